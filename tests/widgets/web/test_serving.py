"""``segdeform serve``: what is refused, and what stays private.

The client process is a small stand-in.  The server and its visitors share one event loop.
"""

from __future__ import annotations

import asyncio
import os
from pathlib import Path

import pytest

pytest.importorskip("aiohttp")

from visitors import LIMITS, serving


@pytest.fixture(scope="module")
def server(do, tmp_path_factory):
    """Return a server that all tests share, and a function that returns new visitors."""
    context = serving(tmp_path_factory.mktemp("run"))
    server, visitor = do(context.__aenter__())
    yield server, visitor
    do(context.__aexit__(None, None, None))


@pytest.fixture(scope="module")
def guest(server, do):
    guest = server[1]()
    do(guest.enter())
    return guest


def test_without_the_token_nothing_is_answered_and_no_process_is_started(do, tmp_path):
    async def story():
        async with serving(tmp_path) as (server, visitor):
            stranger, token = visitor(), server.access.token
            for path in ("/", "/?token=", f"/?token={token[:-1]}", f"/?token={token}x",
                         "/?token=%C3%A9", "/?Token=" + token, f"/?token={token}&token=x",
                         "/s/unknown/"):  # fmt: skip
                status, text, headers = await stranger.get(path)
                assert status == 403, path
                assert "segdeform serve printed" in text
                assert token not in text
                assert "Set-Cookie" not in headers
            assert server.clients.is_empty

    do(story())


def test_a_token_for_a_command_line_works_once(server, do):
    server, visitor = server
    stranger, once = visitor(), server.access.token_for_once()
    assert do(stranger.get(f"/?token={once}"))[0] == 303
    assert do(stranger.get(f"/?token={once}"))[0] == 403


def test_the_page_has_a_cookie_of_its_own_and_no_token(server, do):
    server, visitor = server
    status, _, headers = do(visitor().get(f"/?token={server.access.token}"))
    assert status == 303
    assert headers["Location"].startswith("/s/")
    assert "token" not in headers["Location"]
    cookie = headers["Set-Cookie"]
    assert cookie.startswith(f"segdeform-{server.port}=")
    assert "Max-Age=" in cookie  # a browser that was killed continues
    for attribute in ("HttpOnly", "SameSite=Strict", f"Path={headers['Location']}"):
        assert attribute in cookie
    assert headers["Referrer-Policy"] == "no-referrer"
    assert headers["X-Content-Type-Options"] == "nosniff"
    assert headers["X-Frame-Options"] == "DENY"
    assert "frame-ancestors 'none'" in headers["Content-Security-Policy"]


@pytest.mark.parametrize(
    "host", ["evil.example:{}", "127.0.0.1.evil.example:{}", "127.0.0.1 evil.example", "", "[::2]"]
)
def test_another_host_name_is_refused_even_with_the_token(server, do, host):
    server, visitor = server
    host = host.format(server.port)
    path = f"/?token={server.access.token}"
    answer = do(visitor().raw(f"GET {path} HTTP/1.1\nHost: {host}\nConnection: close\n\n"))
    assert answer.startswith(("HTTP/1.1 403", "HTTP/1.0 400", "HTTP/1.1 400"))
    assert "Location" not in answer


def test_loopback_names_and_forwarded_ports_are_accepted(guest, do):
    for host in ("localhost:9000", "LOCALHOST", "127.0.0.1", "[::1]:8765"):
        request = f"GET {guest.path}index.html HTTP/1.1\nHost: {host}\nCookie: {guest.cookie}\n\n"
        assert do(guest.raw(request)).startswith("HTTP/1.1 200"), host


@pytest.mark.parametrize("origin", ["http://evil.example", "http://localhost:1", "null", None])
def test_another_origin_opens_no_socket_and_posts_nothing(guest, do, origin):
    lines = [
        f"Host: 127.0.0.1:{guest.server.port}", f"Cookie: {guest.cookie}", "Connection: close",
        *([f"Origin: {origin}"] if origin else []),
    ]  # fmt: skip
    socket = ["Upgrade: websocket", "Connection: Upgrade", "Sec-WebSocket-Version: 13",
              "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ=="]  # fmt: skip
    for first, more in (("GET {}ws", socket), ("POST {}upload", ["Content-Length: 0"])):
        head = "\n".join([f"{first.format(guest.path)} HTTP/1.1", *lines, *more, "", ""])
        answer = do(guest.raw(head))
        assert answer.startswith("HTTP/1.1 403")
        assert answer.endswith("Requests from pages of other sites are refused.\n")


def test_the_client_process_answers_nobody_else(guest, do):
    client = guest.server.clients.get(guest.path.split("/")[2])

    async def status(**headers):
        url = f"http://127.0.0.1:{client.port}/index.html"
        async with guest.session.get(url, headers=headers) as answer:
            return answer.status

    assert do(status()) == 403
    assert do(status(**{"X-Segdeform-Secret": "é"})) == 403
    assert do(status(**{"X-Segdeform-Secret": client.secret})) == 200


def test_cookies_and_the_secret_stay_on_their_own_side(guest, do):
    forged = {"X-Segdeform-Secret": "forged", "X-Other": "1"}
    _, text, headers = do(guest.get(f"{guest.path}headers", **forged))
    assert "Cookie" not in text
    assert "forged" not in text
    assert "X-Other" not in text
    assert "Set-Cookie" not in headers
    assert "Set-Cookie" not in do(guest.get(f"{guest.path}index.html"))[2]


@pytest.mark.parametrize(
    "tail", ["../../etc/passwd", "..%2f..%2fetc/passwd", "%2e%2e/ws", "..\\x", "a/..%5cb", "%2e%2e"]
)
def test_a_path_cannot_leave_the_client(guest, do, tail):
    head = f"GET {guest.path}{tail} HTTP/1.1\nHost: localhost\nCookie: {guest.cookie}\n\n"
    answer = do(guest.raw(head))
    assert answer.startswith("HTTP/1.1 404")
    assert answer.endswith("There is no such file.\n")


def test_uploads_up_to_the_limit_arrive(guest, do):
    body = os.urandom(LIMITS.upload)
    assert do(guest.post("upload", body)) == (200, str(len(body)))
    assert do(guest.post("upload", chunks(len(body)))) == (200, str(len(body)))
    assert do(guest.post("other", b"x"))[0] == 405


async def chunks(size, part=10_000):
    for _ in range(size // part):
        yield bytes(part)


def test_an_upload_above_the_limit_is_refused_by_its_announced_size(guest, do):
    head = (
        f"POST {guest.path}upload HTTP/1.1\nHost: 127.0.0.1:{guest.server.port}\n"
        f"Origin: {guest.base}\nCookie: {guest.cookie}\nContent-Length: 2000000000\n\n"
    )
    answer = do(guest.raw(head))
    assert answer.startswith("HTTP/1.1 413")
    assert "larger than 0.1 MB" in answer


def test_an_upload_above_the_limit_is_refused_while_it_arrives(guest, do):
    status, text = do(guest.post("upload", chunks(LIMITS.upload + 10_000)))
    assert status == 413
    assert "larger than 0.1 MB" in text
    assert do(guest.post("upload", b"abc")) == (200, "3")


def test_a_huge_message_closes_the_socket_by_name(guest, do):
    async def story(size):
        async with guest.socket() as socket:
            await socket.send_bytes(bytes(size))
            return await socket.receive(300)

    assert len(do(story(LIMITS.message - 1)).data) == LIMITS.message - 1
    for size in (LIMITS.message + 1, 10 * LIMITS.message):
        assert do(story(size)).data == 1009


def test_a_forged_frame_closes_the_socket(guest, do):
    head = "\n".join([
        f"GET {guest.path}ws HTTP/1.1", f"Host: 127.0.0.1:{guest.server.port}",
        f"Origin: {guest.base}", f"Cookie: {guest.cookie}", "Upgrade: websocket",
        "Connection: Upgrade", "Sec-WebSocket-Version: 13",
        "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==", "", "",
    ])  # fmt: skip

    async def story(frame):
        reader, writer = await asyncio.open_connection("127.0.0.1", guest.server.port)
        writer.write(head.replace("\n", "\r\n").encode())
        assert b"101" in await reader.readuntil(b"\r\n\r\n")
        writer.write(frame)
        answer = await asyncio.wait_for(reader.read(), 300)
        writer.close()
        return answer

    before = int(do(guest.ask("count")))
    for frame in (b"\xf2\x80abcd", b"\x8f\x80abcd", b"\x82\xff" + b"\xff" * 12):
        assert do(story(frame))[:1] in (b"\x88", b""), frame  # a close frame, or just the end
    assert int(do(guest.ask("count"))) == before + 1


def test_a_flood_is_closed_by_name(guest, do):
    async def story():
        async with guest.socket() as socket:
            sending = asyncio.create_task(flood(socket))
            async for _ in socket:  # echoes, until the server closes
                pass
            sending.cancel()
        return socket.close_code

    async def flood(socket):
        while True:
            await socket.send_bytes(bytes(4000))

    before = int(do(guest.ask("count")))
    assert do(story()) == 1008
    handled = int(do(guest.ask("count"))) - before
    assert LIMITS.burst - 20 <= handled <= 2 * LIMITS.burst


@pytest.mark.skipif(not Path("/proc/net/tcp").exists(), reason="reads queues from /proc")
def test_a_busy_process_has_few_messages_waiting(guest, do):
    port = guest.server.clients.get(guest.path.split("/")[2]).port
    size = 5000

    async def story():
        async with guest.socket() as socket:
            await socket.send_str("sleep 0.6")
            for _ in range(200):
                await socket.send_bytes(bytes(size))
            await asyncio.sleep(0.3)
            waiting = queued(port)
            for _ in range(201):
                await socket.receive(300)
            return waiting

    assert do(story()) <= LIMITS.unread * (size + 20) + 1000


def queued(port):
    """Return the bytes in the queues of all connections to a port of this machine."""
    total = 0
    for line in Path("/proc/net/tcp").read_text().splitlines()[1:]:
        local, remote, _, queues = line.split()[1:5]
        sent, received = (int(each, 16) for each in queues.split(":"))
        total += sent * remote.endswith(f":{port:04X}") + received * local.endswith(f":{port:04X}")
    return total
