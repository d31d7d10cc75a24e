"""Requests and WebSockets of a page, passed to its client process and back, with limits.

Both directions are streams: nothing is read from one side before the other side took what came
before.  A process that is busy takes no messages, so the page is slowed down: after every half of
`Limits.unread` messages the process is pinged, and it answers a ping only when it has handled all
messages before it.  A page that sends more than `Limits.rate` messages per second, beyond a burst,
is closed.  Nobody is waited for longer than `Limits.patience`, except a process.  A WebSocket is
always closed with a code, and a sentence that the page shows:

    1001    the server ends, or the page has not answered
    1008    not the browser of this client, or the client has ended; or too many messages
    1009    a message is too large
    1013    too many requests of this client at the same time
    4000    the client process has ended, or could not be reached
"""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from typing import NamedTuple

from aiohttp import (
    ClientError,
    ClientSession,
    ClientTimeout,
    ClientWebSocketResponse,
    StreamReader,
    WSCloseCode,
    WSMsgType,
    hdrs,
    web,
)
from aiohttp.http import HttpProcessingError
from yarl import URL

from .access import refuse
from .client import Client
from .limits import Limits
from .secret import HEADER

_ENDED = 4000  # close codes from 4000 are free for applications
# A message is read up to this many times the limit: one that is left unread resets the connection,
# and the page would not learn the reason.
_READ = 16
_LONGEST = 123  # bytes of a reason, by the protocol
_CONTENT = (WSMsgType.BINARY, WSMsgType.TEXT, WSMsgType.PING, WSMsgType.PONG)
_FAREWELL = 1.0  # seconds that a page has to confirm the end of its WebSocket
_TO_CLIENT = (
    "X-Segdeform",  # of uploads and downloads; a page of another site cannot send it
    hdrs.ACCEPT, hdrs.ACCEPT_ENCODING, hdrs.CONTENT_LENGTH, hdrs.CONTENT_TYPE,
    hdrs.IF_MODIFIED_SINCE, hdrs.IF_NONE_MATCH, hdrs.RANGE,
)  # fmt: skip
_TO_PAGE = (
    hdrs.ACCEPT_RANGES, hdrs.CACHE_CONTROL, hdrs.CONTENT_DISPOSITION, hdrs.CONTENT_ENCODING,
    hdrs.CONTENT_LENGTH, hdrs.CONTENT_RANGE, hdrs.CONTENT_TYPE, hdrs.ETAG, hdrs.LAST_MODIFIED,
    hdrs.LOCATION,
)  # fmt: skip


def new_session() -> ClientSession:
    """Return the session of all connections to client processes; the caller closes it."""
    return ClientSession(auto_decompress=False, timeout=ClientTimeout(total=None, sock_connect=10))


def _url(client: Client, request: web.Request, tail: str) -> URL:
    query = request.rel_url.raw_query_string
    return URL(f"http://127.0.0.1:{client.port}/{tail}{'?' * bool(query)}{query}", encoded=True)


class End(NamedTuple):
    """Why a WebSocket is closed."""

    code: int
    sentence: str


TOO_LARGE = End(WSCloseCode.MESSAGE_TOO_BIG, "A message of the page was too large.")
TOO_MANY = End(WSCloseCode.POLICY_VIOLATION, "The page sent more events than the server accepts.")
NO_ANSWER = End(WSCloseCode.GOING_AWAY, "The page did not answer for some time.")


class _Body:
    """The body of an upload, up to a limit."""

    def __init__(self, content: StreamReader, limits: Limits) -> None:
        self._content, self._limits, self._left = content, limits, limits.upload
        self.fault: web.HTTPException | None = None
        """Why it cannot be passed on."""

    async def parts(self) -> AsyncIterator[bytes]:
        try:
            while part := await asyncio.wait_for(self._content.readany(), self._limits.patience):
                self._left -= len(part)
                if self._left < 0:
                    self.fault = too_large(self._limits)
                    break
                yield part
        except asyncio.TimeoutError:
            self.fault = web.HTTPRequestTimeout(text="The upload stopped. Try it again.\n")
        except (web.RequestPayloadError, HttpProcessingError):
            self.fault = web.HTTPBadRequest(text="The upload is damaged. Try it again.\n")
        if self.fault is not None:
            raise ValueError  # which ends the request to the process


def too_large(limits: Limits) -> web.HTTPException:
    """Return the answer to an upload over the limit."""
    most = f"{limits.upload / 1e6:.4g} MB, the limit of this server"
    return web.HTTPRequestEntityTooLarge(limits.upload, text=f"The file is larger than {most}.\n")


async def pass_request(
    session: ClientSession, client: Client, request: web.Request, tail: str, limits: Limits
) -> web.StreamResponse:
    """Answer a request for the path *tail* by that of the client process."""
    body = None
    if request.method == hdrs.METH_POST:
        if (request.content_length or 0) > limits.upload:
            raise too_large(limits)
        body = _Body(request.content, limits)
    known = {str(name): request.headers[name] for name in _TO_CLIENT if name in request.headers}
    response = web.StreamResponse()
    try:
        async with session.request(
            request.method, _url(client, request, tail), data=body and body.parts(),
            headers={**known, HEADER: client.secret}, allow_redirects=False,
        ) as answer:  # fmt: skip
            response.set_status(answer.status)
            for name in filter(answer.headers.__contains__, _TO_PAGE):
                response.headers[name] = answer.headers[name]
            await response.prepare(request)
            async for part in answer.content.iter_any():
                await asyncio.wait_for(response.write(part), limits.patience)
    except (ClientError, ConnectionError, ValueError, asyncio.TimeoutError):
        if body and body.fault:
            raise body.fault from None
        if not response.prepared:
            refuse(502, await client.reason())
        if request.transport is not None:
            request.transport.abort()  # an end in the normal way would look like a complete answer
        return response
    await response.write_eof()
    return response


async def refuse_socket(request: web.Request, end: End) -> web.WebSocketResponse:
    """Accept a WebSocket and close it: a page is not told of any other answer."""
    page = web.WebSocketResponse(timeout=_FAREWELL)
    await _open(page, request)
    await _close(page, request, end)
    return page


async def pass_socket(
    session: ClientSession, client: Client, request: web.Request, limits: Limits
) -> web.WebSocketResponse:
    """Connect the WebSocket of a page with the client process, until either of them ends."""
    page = web.WebSocketResponse(
        max_msg_size=_READ * limits.message, receive_timeout=0.5 * limits.patience,
        autoping=False, compress=False, timeout=_FAREWELL,
    )  # fmt: skip
    await _open(page, request)
    end = None
    try:
        if client.port is not None:
            async with session.ws_connect(
                _url(client, request, "ws"), headers={HEADER: client.secret},
                max_msg_size=0, autoping=False,
            ) as process:  # fmt: skip
                end = await _connect(page, process, limits)
    except (ClientError, ConnectionError):
        pass  # either side has gone
    if not page.closed:
        code = WSCloseCode.GOING_AWAY if client.is_closed else _ENDED
        end = end or End(code, await client.reason())
        await _close(page, request, end)
    return page


async def _open(page: web.WebSocketResponse, request: web.Request) -> None:
    try:
        await page.prepare(request)
    except ValueError:  # a key that is not text
        refuse(400, "This is no request for a WebSocket.")


async def _close(page: web.WebSocketResponse, request: web.Request, end: End) -> None:
    sentence = end.sentence.encode()[:_LONGEST].decode(errors="ignore").encode()
    try:
        await asyncio.wait_for(page.close(code=end.code, message=sentence), 2.0 * _FAREWELL)
    except asyncio.TimeoutError:  # it does not even read
        if request.transport is not None:
            request.transport.abort()


async def _connect(
    page: web.WebSocketResponse, process: ClientWebSocketResponse, limits: Limits
) -> End | None:
    """Pass messages until either side ends; return why the page is to be closed, if it is."""
    handled = asyncio.Event()
    handled.set()
    both = [
        asyncio.create_task(_to_process(page, process, handled, limits)),
        asyncio.create_task(_to_page(process, page, handled, limits)),
    ]
    try:
        await asyncio.wait(both, return_when=asyncio.FIRST_COMPLETED)
    finally:
        while rest := [task for task in both if not task.done()]:
            for task in rest:
                task.cancel()  # which `wait_for` may swallow before Python 3.12
            await asyncio.wait(rest, timeout=0.1)
    for ended in await asyncio.gather(*both, return_exceptions=True):
        if isinstance(ended, End):
            return ended
        if isinstance(ended, asyncio.TimeoutError):
            return NO_ANSWER
        if isinstance(ended, Exception) and not isinstance(ended, ClientError | OSError):
            raise ended
    return None


async def _to_process(
    page: web.WebSocketResponse,
    process: ClientWebSocketResponse,
    handled: asyncio.Event,
    limits: Limits,
) -> End | None:
    time = asyncio.get_running_loop().time
    allowed, before, half = float(limits.burst), time(), max(limits.unread // 2, 1)
    sent, is_asked = 0, False
    while True:
        try:
            message = await page.receive()
        except asyncio.TimeoutError:
            if is_asked:
                return NO_ANSWER
            is_asked = True  # a page answers a ping even if its user does nothing
            await asyncio.wait_for(page.ping(), limits.patience)
            continue
        is_asked = False
        if message.type not in _CONTENT:
            return None  # the page has gone, or has been closed for an error in the protocol
        now = time()
        allowed = min(allowed + limits.rate * (now - before), limits.burst) - 1.0
        before = now
        if allowed < 0.0:
            return TOO_MANY
        if len(message.data) > limits.message:
            return TOO_LARGE
        if message.type == WSMsgType.PING:
            await asyncio.wait_for(page.pong(message.data), limits.patience)
            continue
        if message.type == WSMsgType.PONG:
            continue
        if message.type == WSMsgType.BINARY:
            await process.send_bytes(message.data)
        else:
            await process.send_str(message.data)
        sent += 1
        if sent % half == 0:
            await handled.wait()
            handled.clear()
            await process.ping()


async def _to_page(
    process: ClientWebSocketResponse,
    page: web.WebSocketResponse,
    handled: asyncio.Event,
    limits: Limits,
) -> None:
    async for message in process:
        if message.type == WSMsgType.BINARY:
            await asyncio.wait_for(page.send_bytes(message.data), limits.patience)
        elif message.type == WSMsgType.TEXT:
            await asyncio.wait_for(page.send_str(message.data), limits.patience)
        elif message.type == WSMsgType.PING:
            await process.pong(message.data)
        elif message.type == WSMsgType.PONG:
            handled.set()
