"""Requests and WebSockets of a page, passed to its client process and back, with limits.

Both directions are streams: nothing is read from one side before the other side took what came
before.  A process that is busy takes no messages, so the page is slowed down: after every half of
`Limits.unread` messages the process is pinged, and it answers a ping only when it has handled all
messages before it.  A page that sends more than `Limits.rate` messages per second, beyond a burst,
is closed.  The page is told why its WebSocket is closed:

    1008    too many messages
    1009    a message is too large
    4000    the client process has ended; the reason says why
"""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator

from aiohttp import (
    ClientError,
    ClientSession,
    ClientTimeout,
    ClientWebSocketResponse,
    StreamReader,
    WSMsgType,
    hdrs,
    web,
)
from yarl import URL

from .access import refuse
from .client import Client
from .limits import Limits
from .secret import HEADER

_ENDED = 4000  # close codes from 4000 are free for applications
_TOO_MANY, _TOO_LARGE = 1008, 1009
# A message is read up to this many times the limit: one that is left unread resets the connection,
# and the page would not learn the reason.
_READ = 16
_LONGEST = 123  # bytes of a reason, by the protocol
_HEARTBEAT = 30.0  # seconds; a page that does not answer within half of it is gone
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


class _Body:
    """The body of an upload, up to a limit."""

    def __init__(self, content: StreamReader, limit: int) -> None:
        self._content, self._left = content, limit
        self.is_too_large = False

    async def parts(self) -> AsyncIterator[bytes]:
        async for part in self._content.iter_any():
            self._left -= len(part)
            if self._left < 0:
                self.is_too_large = True
                raise ValueError
            yield part


async def pass_request(
    session: ClientSession, client: Client, request: web.Request, tail: str, limits: Limits
) -> web.StreamResponse:
    """Answer a request for the path *tail* by that of the client process."""
    large = f"The file is larger than {limits.upload / 1e6:.4g} MB, the limit of this server."
    body = None
    if request.method == hdrs.METH_POST:
        if (request.content_length or 0) > limits.upload:
            raise web.HTTPRequestEntityTooLarge(limits.upload, text=f"{large}\n")
        body = _Body(request.content, limits.upload)
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
                await response.write(part)
    except (ClientError, ConnectionError, ValueError):
        if body and body.is_too_large:
            raise web.HTTPRequestEntityTooLarge(limits.upload, text=f"{large}\n") from None
        if not response.prepared:
            refuse(502, await client.reason())
        if request.transport is not None:
            request.transport.abort()  # an end in the normal way would look like a complete answer
        return response
    await response.write_eof()
    return response


async def pass_socket(
    session: ClientSession, client: Client, request: web.Request, limits: Limits
) -> web.WebSocketResponse:
    """Connect the WebSocket of a page with the client process, until either of them ends."""
    page = web.WebSocketResponse(
        max_msg_size=_READ * limits.message, heartbeat=_HEARTBEAT, compress=False, timeout=1.0
    )
    await page.prepare(request)
    try:
        if client.port is not None:
            async with session.ws_connect(
                _url(client, request, "ws"), headers={HEADER: client.secret},
                max_msg_size=0, autoping=False,
            ) as process:  # fmt: skip
                await _connect(page, process, limits)
    except (ClientError, ConnectionError):
        pass  # either side has gone
    if not page.closed:
        await page.close(code=_ENDED, message=(await client.reason()).encode()[:_LONGEST])
    return page


async def _connect(
    page: web.WebSocketResponse, process: ClientWebSocketResponse, limits: Limits
) -> None:
    handled = asyncio.Event()
    handled.set()
    both = [
        asyncio.create_task(_to_process(page, process, handled, limits)),
        asyncio.create_task(_to_page(process, page, handled)),
    ]
    try:
        await asyncio.wait(both, return_when=asyncio.FIRST_COMPLETED)
    finally:
        for task in both:
            task.cancel()
        for ended in await asyncio.gather(*both, return_exceptions=True):
            if isinstance(ended, Exception) and not isinstance(ended, ClientError | OSError):
                raise ended


async def _to_process(
    page: web.WebSocketResponse,
    process: ClientWebSocketResponse,
    handled: asyncio.Event,
    limits: Limits,
) -> None:
    time = asyncio.get_running_loop().time
    allowed, before, half = float(limits.burst), time(), max(limits.unread // 2, 1)
    sent = 0
    async for message in page:
        now = time()
        allowed = min(allowed + limits.rate * (now - before), limits.burst) - 1.0
        before = now
        if allowed < 0.0:
            await page.close(code=_TOO_MANY, message=b"too many messages")
            return
        if isinstance(message.data, bytes | str) and len(message.data) > limits.message:
            await page.close(code=_TOO_LARGE, message=b"message too large")
            return
        if message.type == WSMsgType.BINARY:
            await process.send_bytes(message.data)
        elif message.type == WSMsgType.TEXT:
            await process.send_str(message.data)
        else:  # an error; the page has been closed with its code
            return
        sent += 1
        if sent % half == 0:
            await handled.wait()
            handled.clear()
            await process.ping()


async def _to_page(
    process: ClientWebSocketResponse, page: web.WebSocketResponse, handled: asyncio.Event
) -> None:
    async for message in process:
        if message.type == WSMsgType.BINARY:
            await page.send_bytes(message.data)
        elif message.type == WSMsgType.TEXT:
            await page.send_str(message.data)
        elif message.type == WSMsgType.PING:
            await process.pong(message.data)
        elif message.type == WSMsgType.PONG:
            handled.set()
