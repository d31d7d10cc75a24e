"""The messages between the view of a page and its `Stream`, over trame's own connection."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from wslink import register
from wslink.websocket import LinkProtocol

from vtk_segdeform.arrays import is_number, is_whole
from vtk_segdeform.checks import shown
from vtk_segdeform.errors import ArgumentError

from .pictures import Picture
from .stream import Stream

_SMALLEST, _LARGEST = 16, 8192  # pixels, width or height of a view
_MOST_PIXELS = 8_000_000
_MOST_EVENTS = 200  # of one message


class ViewProtocol(LinkProtocol):
    """Receives the input of a page, and publishes pictures to it.

    Parameters
    ----------
    stream : Stream
        The view.
    sized : callable
        Called after each change of its size.
    """

    def __init__(self, stream: Stream, sized: Callable[[], object]) -> None:
        super().__init__()
        self._stream, self._sized = stream, sized
        self._pages: set[str] = set()

    def onConnect(self, request: Any, client_id: str) -> None:  # noqa: N802 - wslink's name
        """Count a page."""
        del request
        self._pages.add(client_id)

    def onClose(self, client_id: str) -> None:  # noqa: N802
        """Stop drawing when the last page has gone."""
        self._pages.discard(client_id)
        if not self._pages:
            self._stream.close()

    @register("segdeform.input")
    def input(self, events: object) -> None:
        """Queue events; see `Inputs.put`."""
        if not isinstance(events, list) or len(events) > _MOST_EVENTS:
            raise ArgumentError(f"events must be a list of at most {_MOST_EVENTS}")
        self._stream.put(events)

    @register("segdeform.size")
    def size(self, width: Any, height: Any, ratio: Any) -> None:
        """Show the view at this size, in CSS pixels, with *ratio* device pixels each."""
        for value in (width, height, ratio):
            if not is_number(value) or not 0 < value <= _LARGEST:
                raise ArgumentError(f"width, height and ratio must be numbers; got {shown(value)}")
        columns, rows = width * ratio, height * ratio
        scale = min(1.0, (_MOST_PIXELS / (columns * rows)) ** 0.5)
        size = [min(_LARGEST, max(_SMALLEST, round(scale * each))) for each in (columns, rows)]
        self._stream.open(size[0], size[1])
        self._sized()

    @register("segdeform.shown")
    def shown(self, number: Any) -> None:
        """Continue: the page has shown picture *number*."""
        if not is_whole(number, 0):
            raise ArgumentError(f"number must be an integer; got {shown(number)}")
        self._stream.shown(int(number))

    def send(self, picture: Picture, number: int) -> None:
        """Publish a picture."""
        message = {
            "number": number,
            "width": picture.width,
            "height": picture.height,
            "content": picture.data,
        }
        self.publish("segdeform.picture", message)
