"""The messages between the view of a page and its `Stream`, over trame's own connection."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from wslink import register
from wslink.websocket import LinkProtocol

from vtk_segdeform.arrays import is_number, is_whole
from vtk_segdeform.checks import shown
from vtk_segdeform.errors import ArgumentError

from .answers import answer_in_sentences
from .page_drawing import PageDrawing, Surface, Update
from .pictures import Picture
from .stream import Stream

_SMALLEST_SIDE, _LARGEST_SIDE = 16, 8192  # pixels, width or height of a view
_MOST_PIXELS = 8_000_000
_MOST_EVENTS = 200  # of one message


class ViewProtocol(LinkProtocol):
    """Receives the input of a page, and publishes pictures to it.

    Parameters
    ----------
    stream : Stream
        The view.
    drawing : PageDrawing
        What the page draws itself, while there is only one.
    sized : callable
        Called after each change of its size.
    """

    def __init__(self, stream: Stream, drawing: PageDrawing, sized: Callable[[], object]) -> None:
        super().__init__()
        self._stream, self._drawing, self._sized = stream, drawing, sized
        self._draws = False  # the page that connected last
        self._pages: set[str] = set()

    def init(self, publish: Any, *others: Any) -> None:
        """Receive the functions of wslink; `publish` is a method of the handler of connections."""
        super().init(publish, *others)
        answer_in_sentences(publish.__self__)

    def onConnect(self, request: Any, client_id: str) -> None:  # noqa: N802 - wslink's name
        """Count a page; whether it draws is not known yet."""
        del request
        self._pages.add(client_id)
        self._set_draws(False)

    def onClose(self, client_id: str) -> None:  # noqa: N802
        """Stop drawing when the last page has gone."""
        self._pages.discard(client_id)
        if not self._pages:
            self._stream.close()
        self._set_draws(self._draws)

    def _set_draws(self, draws: bool) -> None:
        self._draws = draws
        self._drawing.want(draws and len(self._pages) == 1)
        self._stream.wake()

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
            if not is_number(value) or not 0 < value <= _LARGEST_SIDE:
                raise ArgumentError(f"width, height and ratio must be numbers; got {shown(value)}")
        columns, rows = width * ratio, height * ratio
        scale = min(1.0, (_MOST_PIXELS / (columns * rows)) ** 0.5)
        size = [
            min(_LARGEST_SIDE, max(_SMALLEST_SIDE, round(scale * each))) for each in (columns, rows)
        ]
        self._stream.open(size[0], size[1])
        self._sized()

    @register("segdeform.draws")
    def draws(self, draws: object) -> None:
        """Let the page draw from now on, which has nothing yet; or let the server draw."""
        self._set_draws(draws is True)

    @register("segdeform.surface")
    def surface(self, version: Any, start: Any) -> bytes:
        """Return the bytes of a surface from *start* on; see `PageDrawing.piece`."""
        for value in (version, start):
            if not is_whole(value, 0):
                raise ArgumentError(f"version and start must be integers; got {shown(value)}")
        return self._drawing.piece(int(version), int(start))

    @register("segdeform.holds")
    def holds(self, version: Any) -> None:
        """Let the page draw surface *version*, which it has received."""
        if not is_whole(version, 0):
            raise ArgumentError(f"version must be an integer; got {shown(version)}")
        self._drawing.hold(int(version))

    @register("segdeform.shown")
    def shown(self, number: Any) -> None:
        """Continue: the page has shown picture *number*."""
        if not is_whole(number, 0):
            raise ArgumentError(f"number must be an integer; got {shown(number)}")
        self._stream.shown(int(number))

    def send(self, picture: Picture | Update | Surface, number: int) -> None:
        """Publish a picture, or what the page needs to draw."""
        names = {"data": "content"}
        message = {names.get(name, name): value for name, value in vars(picture).items()}
        self.publish("segdeform.picture", {"number": number, **message})
