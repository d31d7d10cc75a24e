"""The view of one page: its input in, pictures out, in one order.

    input that waits  ->  the editor, which asks for a picture  ->  one picture  ->  the page

All drawing happens here.  `View.render` only says that a picture is wanted, so many changes make
one picture; none is drawn while the page is behind or has gone.  Once the view rests, the last
picture is sent again in full quality.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable

from ..scene import View
from .inputs import Inputs
from .pictures import Encode, Picture, Pictures
from .timers import Timers

_AHEAD = 2  # pictures that the page has not shown yet
_LOST = 2.0  # seconds after which such a picture is no longer waited for
_REST = 0.25  # seconds without another picture, after which the view rests

Send = Callable[[Picture, int], None]
"""``send(picture, number)`` sends a picture to the page."""


class Stream:
    """Input and pictures of one view.

    Parameters
    ----------
    view : View
        The view; it must have been drawn once.
    timers : Timers
        The timers of its interactor.
    send : callable
        Sends a picture; see `Send`.
    handled : callable
        Called after input was handled.
    """

    def __init__(
        self, view: View, timers: Timers, send: Send, handled: Callable[[], object]
    ) -> None:
        self.view, self.inputs = view, Inputs(view)
        self._timers, self._handled = timers, handled
        self._pictures, self._send = Pictures(view), send
        self._awake = asyncio.Event()
        self._task: asyncio.Task[None] | None = None
        self._encoding: asyncio.Task[None] | None = None
        self._rest: asyncio.TimerHandle | None = None
        self._is_wanted = self._is_drawing = self._is_open = False
        self._sent = self._shown = 0  # numbers of pictures
        view.host = self.want
        self._tag = view.window.AddObserver("EndEvent", self._drawn)

    def start(self, loop: asyncio.AbstractEventLoop) -> None:
        """Begin, in *loop*."""
        self._timers.start(loop)
        self._task = loop.create_task(self._run())

    async def stop(self) -> None:
        """End, and leave the view to others."""
        self._timers.stop()
        self.view.host = None
        if self.view.window is not None:
            self.view.window.RemoveObserver(self._tag)
        if self._rest is not None:
            self._rest.cancel()
        for task in filter(None, (self._task, self._encoding)):
            task.cancel()
            await asyncio.wait([task])

    def want(self) -> None:
        """Draw and send a picture soon."""
        self._is_wanted = True
        self._awake.set()

    def put(self, messages: list[object]) -> None:
        """Queue the events of a page; see `Inputs.put`."""
        try:
            for message in messages:
                self.inputs.put(message)
        finally:
            self._awake.set()

    def open(self, width: int, height: int) -> None:
        """Show the view in a page, at this size in pixels; again whenever the size changes."""
        self._is_open, self._shown = True, self._sent
        window, interactor = self.view.window, self.view.interactor
        if tuple(window.GetSize()) != (width, height):
            window.SetSize(width, height)
            interactor.UpdateSize(width, height)
            interactor.InvokeEvent("WindowResizeEvent")
        self.want()

    def close(self) -> None:
        """Draw no longer, because the page has gone; a drag ends as if the button was released."""
        self._is_open = False
        self.inputs.release_all()

    def shown(self, number: int) -> None:
        """Continue: the page has shown picture *number*."""
        self._shown = max(self._shown, min(number, self._sent))
        self._awake.set()

    async def _run(self) -> None:
        while True:
            await self._awake.wait()
            await asyncio.sleep(0)  # whatever has arrived meanwhile replaces stale moves
            self._awake.clear()
            if self.inputs:
                for _ in range(len(self.inputs)):
                    self.inputs.send_next()
                self._handled()
            if self._is_wanted and self._is_open:
                if self._sent - self._shown >= _AHEAD:
                    await self._wait_for_page()
                await self._deliver(self._draw())

    async def _wait_for_page(self) -> None:
        """Wait until the page has shown a picture, or too long; handle no event meanwhile."""
        while self._sent - self._shown >= _AHEAD:
            try:
                await asyncio.wait_for(self._awake.wait(), _LOST)
            except asyncio.TimeoutError:
                self._shown = self._sent
            self._awake.clear()
        if self.inputs:
            self._awake.set()

    def _draw(self) -> Encode:
        self._is_wanted, self._is_drawing = False, True
        try:
            return self._pictures.draw()
        finally:
            self._is_drawing = False

    def _drawn(self, *_: object) -> None:
        """Send what somebody else has drawn, too."""
        if not self._is_drawing:
            self.want()

    async def _deliver(self, encode: Encode) -> None:
        """Encode a picture in another thread and send it, after the one before."""
        if self._encoding is not None:
            await asyncio.wait([self._encoding])
        loop = asyncio.get_running_loop()
        self._encoding = loop.create_task(self._encode(encode))

    async def _encode(self, encode: Encode) -> None:
        loop = asyncio.get_running_loop()
        picture = await loop.run_in_executor(None, encode)
        if self._is_open:
            self._sent += 1
            self._send(picture, self._sent)
        if self._rest is not None:
            self._rest.cancel()
            self._rest = None
        if not picture.is_still:
            self._rest = loop.call_later(_REST, self._rested)

    def _rested(self) -> None:
        still = self._pictures.still()
        if still is not None and not self._is_wanted and self._is_open:
            self._encoding = asyncio.get_running_loop().create_task(self._encode(still))
