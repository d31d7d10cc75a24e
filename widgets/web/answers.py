"""Answers to calls that are malformed or fail: one sentence; the log has the details.

wslink would also send the traceback, with paths of the server, and end the connection if it cannot
parse a message.
"""

from __future__ import annotations

import logging
from typing import Any

from wslink.protocol import EXCEPTION_ERROR

_log = logging.getLogger(__name__)
_MALFORMED = -32600  # an invalid request, of JSON-RPC
_SENTENCES = {
    EXCEPTION_ERROR: "The call failed. See the log of the server for details.",
    _MALFORMED: "The message is not a valid call.",
}


def answer_in_sentences(handler: Any) -> None:
    """Let *handler*, of the connections of a wslink server, answer with sentences only."""
    send, handle, complete = handler.sendWrappedError, handler.onMessage, handler.onCompleteMessage

    async def send_error(
        call: Any, code: int, message: str, data: object = None, client_id: str | None = None
    ) -> None:
        del data  # the traceback, which wslink has logged
        await send(call, code, _SENTENCES.get(code, message), client_id=client_id)

    async def on_message(is_binary: bool, message: Any, client_id: str) -> None:
        try:
            if not is_binary:
                raise ValueError("a text message")
            await handle(is_binary, message, client_id)
        except (ValueError, TypeError, RecursionError) as error:  # of parsing
            _log.debug("a malformed message", exc_info=error)
            await send(None, _MALFORMED, _SENTENCES[_MALFORMED], client_id=client_id)

    async def on_call(call: Any, client_id: str) -> None:
        if not _is_call(call):
            raise ValueError("not a call")
        await complete(call, client_id)

    handler.sendWrappedError = send_error
    handler.onMessage = on_message
    handler.onCompleteMessage = on_call


def _is_call(call: object) -> bool:
    """Return whether wslink understands a message."""
    return (
        isinstance(call, dict)
        and isinstance(call.get("id"), str)
        and isinstance(call.get("method"), str)
        and isinstance(call.get("args", []), list)
    )
