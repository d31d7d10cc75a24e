"""The Python end of a notebook's channel, with a page and a server that only take notes."""

from __future__ import annotations

import asyncio
import gzip
from collections.abc import Callable, Coroutine
from types import SimpleNamespace
from typing import Any

import pytest

pytest.importorskip("trame")
from aiohttp import web

from vtk_segdeform.widgets.web import tunnel as tunnel_module
from vtk_segdeform.widgets.web.tunnel import Tunnel

Story = Callable[["Channel"], Coroutine[Any, Any, None]]


class Endpoint:
    """Instead of the handler of wslink: it notes what each connection receives."""

    def __init__(self) -> None:
        self.connections: dict[str, Any] = {}
        self.authentified_client_ids: set[str] = set()
        self.frames: list[tuple[bool, Any]] = []
        self.closed: list[str] = []

    async def onConnect(self, _: object, client: str) -> None:  # noqa: N802 - wslink's name
        assert client in self.connections

    async def onMessage(self, is_binary: bool, message: Any, _: str) -> None:  # noqa: N802
        await asyncio.sleep(0)  # others could get in between
        self.frames.append((is_binary, message.data))

    async def onClose(self, client: str) -> None:  # noqa: N802
        self.closed.append(client)


class Channel:
    """A tunnel, and all that it has sent."""

    def __init__(self) -> None:
        self.endpoint, self.sent, self.uploads = Endpoint(), [], []  # type: ignore[var-annotated]
        editor: Any = SimpleNamespace(endpoint=self.endpoint, transfer=self, server="a server")
        self.tunnel = Tunnel(editor, lambda content, buffers: self.sent.append((content, buffers)))

    async def say(self, kind: str, page: str = "a", data: bytes | None = None, **more: Any) -> None:
        buffers = [] if data is None else [memoryview(data)]
        self.tunnel.receive({"kind": kind, "page": page, **more}, buffers)
        for _ in range(8):
            await asyncio.sleep(0)

    def heard(self, page: str = "a") -> list[str]:
        return [content["kind"] for content, _ in self.sent if content["page"] == page]

    async def take(self, query: Any, size: int, read: Any) -> web.Response:
        parts = []
        while part := await read():
            parts.append(part)
        self.uploads.append((query, size, b"".join(parts)))
        return web.Response(text="taken")

    async def give(self, suffix: str, query: Any) -> web.Response:
        return web.Response(body=f"{suffix} {query}".encode())


def told(story: Story) -> None:
    async def tell() -> None:
        await asyncio.wait_for(story(Channel()), 20.0)

    asyncio.run(tell())


def test_frames_keep_their_kind_and_their_order_in_both_directions() -> None:
    async def story(channel: Channel) -> None:
        await channel.say("connect")
        for k in range(3):
            channel.tunnel.receive({"kind": "frame", "page": "a"}, [memoryview(b"%d" % k)])
            channel.tunnel.receive({"kind": "frame", "page": "a", "text": str(k)})
        channel.tunnel.receive({"kind": "frame", "page": "a"}, [b""])
        while len(channel.endpoint.frames) < 7:
            await asyncio.sleep(0)
        sent = [(True, b"0"), (False, "0"), (True, b"1"), (False, "1"), (True, b"2"), (False, "2")]
        assert channel.endpoint.frames == [*sent, (True, b"")]
        (connection,) = channel.endpoint.connections.values()
        for k in range(3):
            await connection.send_bytes(b"%d" % k)
        assert channel.heard() == ["connected", "frame", "frame", "frame"]
        assert [buffers for _, buffers in channel.sent[1:]] == [[b"0"], [b"1"], [b"2"]]

    told(story)


def test_messages_may_come_from_another_thread() -> None:
    async def story(channel: Channel) -> None:
        asyncio.get_running_loop().set_debug(True)  # raises where that is not safe
        await channel.say("connect")
        message = {"kind": "frame", "page": "a", "text": "x"}
        await asyncio.to_thread(channel.tunnel.receive, message)
        while not channel.endpoint.frames:
            await asyncio.sleep(0)
        assert channel.endpoint.frames == [(False, "x")]

    told(story)


def test_a_connection_ends_when_it_is_closed_or_made_again() -> None:
    async def story(channel: Channel) -> None:
        endpoint = channel.endpoint
        await channel.say("connect")
        (first,) = endpoint.connections
        await channel.say("connect")  # the frame was loaded again
        assert endpoint.closed == [first]
        assert channel.heard() == ["connected", "connected"]
        (second,) = endpoint.connections
        endpoint.authentified_client_ids.add(second)
        await channel.say("close")
        assert endpoint.closed == [first, second]
        assert endpoint.connections == {}
        assert endpoint.authentified_client_ids == set()
        assert channel.heard()[2:] == ["close"]
        await channel.say("frame", data=b"late")
        assert channel.heard()[3:] == ["close"]
        assert channel.sent[-1][0]["reason"] == "The connection to the kernel was lost."
        assert endpoint.frames == []

    told(story)


@pytest.mark.parametrize(
    "message",
    ["text", None, {}, {"kind": "eval", "page": "a"}, {"kind": ["open"], "page": "a"},
     {"kind": "request", "page": "a"}, {"kind": "part", "page": "a", "id": 7}],
)  # fmt: skip
def test_messages_that_are_not_valid_are_refused_in_words(message: Any) -> None:
    async def story(channel: Channel) -> None:
        channel.tunnel.receive(message)
        await asyncio.sleep(0)
        ((answer, _),) = channel.sent
        assert answer["kind"] == "refused"
        assert answer["reason"].startswith("This message is not valid: ")
        await channel.say("connect")  # goes on
        assert channel.heard()[-1] == "connected"

    told(story)


def test_when_a_page_connects_those_that_are_silent_are_dropped(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(tunnel_module, "_TURN", 0.001)

    async def story(channel: Channel) -> None:
        for page in ("gone", "here"):
            await channel.say("connect", page)
        await channel.say("here", "gone")  # to the first question
        await channel.say("connect", "new")
        await channel.say("here", "here")
        while "close" not in channel.heard("gone"):
            await asyncio.sleep(0.001)
        assert channel.heard("here") == ["connected", "ping"]
        assert channel.heard("new") == ["connected"]
        assert len(channel.endpoint.connections) == 2

    told(story)


def test_uploads_arrive_in_parts_and_downloads_whole() -> None:
    async def story(channel: Channel) -> None:
        query = {"name": "a.ply"}
        await channel.say("request", id=1, path="upload", query=query, size=4)
        await channel.say("request", id=2, path="download/ply", query={"field": "f"})
        for part in (b"ab", b"cd", b""):
            await channel.say("part", id=1, data=part)
        await channel.say("request", id=3, path="../passwd", query={})
        assert channel.uploads == [(query, 4, b"abcd")]
        answers = {c["id"]: (c["status"], *b) for c, b in channel.sent if c["kind"] == "answer"}
        assert answers[1] == (200, b"taken")
        assert answers[2] == (200, b"ply {'field': 'f'}")
        assert answers[3][0] == 404
        assert channel.heard().count("more") == 3

    told(story)


def test_all_are_told_when_the_editor_has_ended(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tunnel_module, "whole_page", lambda server: f"the page of {server}")

    async def story(channel: Channel) -> None:
        await channel.say("open")
        ((_, (document,)),) = channel.sent
        assert gzip.decompress(document) == b"the page of a server"
        await channel.say("connect")
        channel.tunnel.close()
        for _ in range(8):
            await asyncio.sleep(0)
        assert channel.heard()[2] == "ended"
        assert channel.endpoint.connections == {}
        await channel.say("open", "later")
        assert channel.heard("later") == ["ended"]

    told(story)
