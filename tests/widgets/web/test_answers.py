"""Calls of a page that are malformed or fail, sent by a real WebSocket."""

from __future__ import annotations

import asyncio
import logging

import pytest

pytest.importorskip("trame")
import msgpack
from solids import OCTAHEDRON
from web_hands import Served, call, connected

from vtk_segdeform import Mesh

MALFORMED = "The message is not a valid call."
FAILED = "The call failed. See the log of the server for details."


def nested(depth):
    """Return a packed call with lists in lists."""
    return msgpack.packb(call("segdeform.input", 0))[:-1] + b"\x91" * depth + b"\x90"


MESSAGES = [
    (call("no.such"), "Unregistered method called"),
    (call("segdeform.size", 1), FAILED),
    (call("segdeform.input", 5), FAILED),
    (call("segdeform.surface", -1, 0), FAILED),
    (call("segdeform.shown", kwargs={"no": 1}), FAILED),
    (call("trame.trigger", 1), FAILED),
    (call("wslink.hello", id="system:c0:1"), "Authentication failed"),
    (call("no.such", id="system:c0:1"), "Unknown system method called"),
    ("not a call", MALFORMED),
    (b"", MALFORMED),
    (b"not msgpack", MALFORMED),
    (b"\xc1", MALFORMED),
    (b"\x91" * 3000 + b"\x90", MALFORMED),
    ([1, 2], MALFORMED),
    (5, MALFORMED),
    ({"method": "segdeform.size", "args": []}, MALFORMED),
    ({"id": "rpc:c0:1"}, MALFORMED),
    ({"id": 7, "method": "segdeform.size"}, MALFORMED),
    (call(["segdeform.size"]), MALFORMED),
    ({**call("segdeform.size"), "args": 5}, MALFORMED),
    (nested(400), FAILED),
    (nested(1000), MALFORMED),
]


@pytest.fixture(scope="module")
def served():
    with Served(Mesh(*OCTAHEDRON)) as served:
        yield served


def tell(served, message, **keywords):
    """Return the answers to one message."""

    async def story():
        async with connected(f"http://127.0.0.1:{served.port}/ws", **keywords) as (send, answers):
            await send(message)
            return await answers()

    return asyncio.run(asyncio.wait_for(story(), 60))


@pytest.mark.parametrize(("message", "text"), MESSAGES, ids=range(len(MESSAGES)))
def test_the_answer_is_one_sentence_and_the_connection_lives_on(served, message, text):
    (answer,) = tell(served, message)
    assert answer["error"]["message"] == text
    assert set(answer["error"]) == {"code", "message"}
    for word in ("Traceback", ".py", "Error", "/"):
        assert word not in str(answer["error"])


def test_the_log_has_the_details(served, caplog):
    tell(served, call("segdeform.size", 1))
    assert "Traceback" in caplog.text
    assert "missing 2 required positional arguments" in caplog.text
    caplog.clear()
    caplog.set_level(logging.DEBUG, "vtk_segdeform.widgets.web.answers")
    tell(served, "not a call")
    assert "Traceback" in caplog.text


def test_a_page_that_has_not_entered_is_answered_in_sentences_too(served):
    for message, text in (
        ("text", MALFORMED),
        ([1, 2], MALFORMED),
        (call("segdeform.size", 1), "Unauthorized: Skip message processing"),
    ):
        (answer,) = tell(served, message, enters=False)
        assert answer["error"]["message"] == text
        assert set(answer["error"]) == {"code", "message"}
