"""``segdeform serve``: what is refused, and what stays private.

The client process is a small stand-in.  The server and its visitors share one event loop.
"""

from __future__ import annotations

import asyncio
import os
from dataclasses import replace
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


def test_another_host_in_the_address_of_a_request_is_refused(guest, do):
    head = f"HTTP/1.1\nHost: localhost\nCookie: {guest.cookie}\nConnection: close\n\n"
    for host, status in (("localhost:9000", 200), ("evil.example", 403)):
        answer = do(guest.raw(f"GET http://{host}{guest.path}index.html {head}"))
        assert answer.startswith(f"HTTP/1.1 {status}")


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


class Slow:
    """A body that arrives in two parts, the second one when it is let."""

    def __init__(self, size):
        self._half, self.begun, self.rest = bytes(size // 2), asyncio.Event(), asyncio.Event()

    async def parts(self):
        yield self._half
        self.begun.set()
        await self.rest.wait()
        yield self._half


def test_two_clients_upload_at_once_and_one_client_one_after_the_other(do, tmp_path):
    async def story():
        async with serving(tmp_path) as (_, visitor):  # without a page that was left
            await at_once(visitor(), visitor())

    async def at_once(guest, other):
        await guest.enter()
        await other.enter()
        bodies = Slow(60_000), Slow(40_000)
        both = [
            asyncio.create_task(each.post("upload", body.parts()))
            for each, body in zip((guest, other), bodies, strict=True)
        ]
        for body in bodies:
            await body.begun.wait()
        refused = await guest.post("upload", b"abc")
        for body in bodies:
            body.rest.set()
        assert [await each for each in both] == [(200, "60000"), (200, "40000")]
        assert refused[0] == 409
        assert "Another upload is in progress" in refused[1]
        assert await guest.post("upload", b"abc") == (200, "3")

    do(story())


def test_an_upload_that_stops_is_ended(guest, do):
    async def story():
        body = Slow(1000)
        sending = asyncio.create_task(guest.post("upload", body.parts()))
        await body.begun.wait()
        await pass_by(1.1 * LIMITS.patience)
        assert await sending == (408, "The upload stopped. Try it again.\n")
        assert await guest.post("upload", b"abc") == (200, "3")

    do(story())


async def pass_by(seconds):
    """Let *seconds* pass on the server's clock, and everything happen that they bring."""
    for ahead in (0.0, seconds, 0.0):
        await asyncio.sleep(0.02)
        asyncio.get_running_loop().put_forward(ahead)


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


def head_of_socket(guest, **changes):
    """Return the request for a WebSocket of *guest*, with other headers, or without those None."""
    headers = {
        "Host": f"127.0.0.1:{guest.server.port}", "Origin": guest.base, "Cookie": guest.cookie,
        "Upgrade": "websocket", "Connection": "Upgrade", "Sec-WebSocket-Version": "13",
        "Sec-WebSocket-Key": "dGhlIHNhbXBsZSBub25jZQ==",
        **{name.replace("_", "-"): value for name, value in changes.items()},
    }  # fmt: skip
    lines = [f"{name}: {value}" for name, value in headers.items() if value is not None]
    return "\r\n".join([f"GET {guest.path}ws HTTP/1.1", *lines, "", ""]).encode("latin-1")


async def connected(port, data, host="127.0.0.1"):
    """Connect from *host* and send *data*; return the reader and the writer."""
    reader, writer = await asyncio.open_connection("127.0.0.1", port, local_addr=(host, 0))
    writer.write(data)
    return reader, writer


async def is_open(reader):
    """Return whether the server has not closed a connection on which it has sent nothing."""
    try:
        await asyncio.wait_for(reader.read(1), 0.1)
    except asyncio.TimeoutError:
        return True
    except ConnectionError:
        pass
    return False


def test_half_sent_requests_of_one_visitor_keep_out_nobody(do, tmp_path):
    async def story():
        async with serving(tmp_path, replace(LIMITS, waiting=10)) as (server, visitor):
            guest = visitor()
            await guest.enter()
            async with guest.socket() as socket:
                other = await connected(server.port, b"GET /", "127.0.0.2")
                half = b"GET / HTTP/1.1\r\nHost: local"
                crowd = [await connected(server.port, half) for _ in range(60)]
                assert (await guest.get(f"{guest.path}index.html"))[0] == 200
                kept = await asyncio.gather(*[is_open(reader) for reader, _ in crowd])
                assert sum(kept) <= 10
                assert await is_open(other[0])
                await socket.send_str("get")
                assert (await socket.receive(300)).data == ""
            for _, writer in (other, *crowd):
                writer.transport.abort()

    do(story())


def test_who_sends_no_whole_request_in_time_is_left(server, guest, do):
    async def story():
        async with guest.socket() as socket:
            slow = await connected(server[0].port, b"GET / HTTP/1.1\r\n")
            for _ in range(8):  # headers that never end
                slow[1].write(b"X: a\r\n")
                await pass_by(0.13 * LIMITS.patience)
            assert not await is_open(slow[0])
            slow[1].close()
            await socket.send_str("count")
            await socket.receive(300)

    do(story())


async def end_of(reader):
    """Return the code and the sentence with which the server closes a WebSocket."""
    assert b" 101 " in await reader.readuntil(b"\r\n\r\n")
    data = await asyncio.wait_for(reader.readuntil(b"\x88"), 300)
    await pass_by(1.1)  # more than the server waits for an answer to its closing
    data += await asyncio.wait_for(reader.read(), 300)
    _, found, frame = data.partition(b"\x88")
    assert found, data
    return int.from_bytes(frame[1:3], "big"), frame[3:].decode()


def test_a_page_that_may_not_connect_is_told_why(guest, do):
    async def story():
        other = head_of_socket(guest, Cookie=guest.cookie[:-1])
        reader, writer = await connected(guest.server.port, other)
        code, sentence = await end_of(reader)
        assert code == 1008
        assert sentence.startswith("This client has ended, or belongs to another browser.")
        writer.close()

    do(story())


def test_a_page_that_does_not_answer_is_told_so(guest, do):
    async def story():
        reader, writer = await connected(guest.server.port, head_of_socket(guest))
        for _ in range(2):
            await pass_by(0.6 * LIMITS.patience)
        assert await end_of(reader) == (1001, "The page did not answer for some time.")
        writer.close()

    do(story())


def test_a_page_that_does_not_read_is_left(guest, do):
    client = guest.server.clients.get(guest.path.split("/")[2])

    async def story():
        reader, writer = await connected(guest.server.port, head_of_socket(guest))
        await reader.readuntil(b"\r\n\r\n")
        writer.transport.pause_reading()
        size = 60_000
        frame = b"\x82\xfe" + size.to_bytes(2, "big") + bytes(4 + size)
        for _ in range(400):  # whose echoes fill all buffers
            writer.write(frame)
        await asyncio.sleep(0.3)
        assert client.visits == 1
        for _ in range(3):
            await pass_by(1.1 * LIMITS.patience)
        writer.transport.abort()
        assert client.visits == 0

    do(story())


def test_too_many_requests_of_one_client_are_refused(do, tmp_path):
    async def story():
        async with serving(tmp_path, replace(LIMITS, requests=3)) as (_, visitor):
            guest = visitor()
            await guest.enter()
            others = [await guest.socket() for _ in range(3)]
            async with guest.socket() as socket:
                closed = await socket.receive(300)
            assert (closed.data, closed.extra[:28]) == (1013, "There are too many requests ")
            status, text, _ = await guest.get(f"{guest.path}index.html")
            assert (status, text[:28]) == (429, "There are too many requests ")
            await others.pop().close()
            while (await guest.get(f"{guest.path}index.html"))[0] != 200:
                await asyncio.sleep(0.01)

    do(story())


def test_pages_are_told_that_the_server_ends(do, tmp_path):
    async def story():
        async with serving(tmp_path) as (server, visitor):
            guest = visitor()
            await guest.enter()
            async with guest.socket() as socket:
                await server.end()
                closed = await socket.receive(300)
                assert (closed.data, closed.extra) == (1001, "The server has ended.")

    do(story())


def test_a_long_reason_is_cut_between_letters(do, tmp_path):
    async def story():
        async with serving(tmp_path) as (server, visitor):
            guest = visitor()
            _, _, headers = await guest.get(f"/?token={server.access.token}")
            guest.path, guest.cookie = headers["Location"], headers["Set-Cookie"].split(";")[0]
            server.clients.get(guest.path.split("/")[2]).failure = "x" + "é" * 100
            async with guest.socket() as socket:
                closed = await socket.receive(300)
            assert (closed.data, closed.extra) == (4000, "x" + "é" * 61)

    do(story())


ODD = [
    "GET {path}%00", "GET {path}a%00b", "GET {path}%", "GET {path}%zz", "GET {path}%ff%fe",
    "GET {path}%1b[31m", "GET {path}" + 300 * "x", "GET {path}" + 3000 * "a/", "GET /" + 9000 * "x",
    "GET {path}\xff", "GET {path}\x1b[31m", "GET {path}a b", "GET {path}ws", "HEAD {path}ws",
    "HEAD {path}%77s", "GET {path}ws?x=%zz", "GET http://evil.example{path}index.html",
    "GET http://127.0.0.1:99999999/", "GET http://[::1/", "GET //[/", "GET *", "OPTIONS *",
    "CONNECT 127.0.0.1:22", "GET foo", "GET ", "PUT {path}", "\x1bGET /", "FOO /",
]  # fmt: skip
ODD_HEADERS = [
    "X: " + 9000 * "a", "\n".join(f"X{k}: a" for k in range(500)), "Content-Length: -5", "X",
    "Transfer-Encoding: foo", "Expect: \x1b[31m", "Range: bytes=9-1", "Cookie: \xff=\xe9; \"",
    "Upgrade: websocket", "Upgrade: h2c\nConnection: Upgrade", "Host: two",
    "If-None-Match: \"\xff", "If-Modified-Since: Mon, 99 Foo 99999 99:99:99 GMT",
]  # fmt: skip


def test_no_request_is_answered_by_500_or_by_a_traceback(guest, do, caplog):
    host = f"Host: 127.0.0.1:{guest.server.port}\nConnection: close\nCookie: {guest.cookie}"
    heads = [f"{line.format(path=guest.path)} HTTP/1.1\n{host}\n\n" for line in ODD]
    heads += [f"GET {guest.path}index.html HTTP/1.1\n{host}\n{more}\n\n" for more in ODD_HEADERS]
    requests = [head.replace("\n", "\r\n").encode("latin-1") for head in heads]
    requests += [b"\x16\x03\x01\x02\0", b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n", b"\0\xff" * 100]
    key = "Sec_WebSocket_Key"
    requests += [head_of_socket(guest, **{key: odd}) for odd in ("\xff\xfe", "a", "", None)]
    upload = f"POST {guest.path}upload HTTP/1.1\n{host}\nOrigin: {guest.base}\n"
    for more in (
        "Content-Encoding: gzip\nContent-Length: 5\n\nabcde",
        "Transfer-Encoding: chunked\n\nzz\nabc\n",
        "Transfer-Encoding: chunked\n\n3\nabcdef\n",
    ):
        requests.append((upload + more).replace("\n", "\r\n").encode())

    async def story():
        for data in requests:
            reader, writer = await connected(guest.server.port, data)
            line = await asyncio.wait_for(reader.readline(), 300)
            rest = await reader.read(4096)
            assert line.startswith((b"HTTP/1.1 ", b"HTTP/1.0 ")), data
            assert line[9:10] in b"234", (data, line)
            assert b"Traceback" not in rest
            writer.close()
        assert (await guest.load())[0]

    do(story())
    assert caplog.records == []
