"""The view of one page: its input in, pictures out, in one order.

    input that waits  ->  the editor, which asks for a picture  ->  one picture  ->  the page

All drawing happens here.  `View.render` only says that a picture is wanted, so many changes make
one picture; none is drawn while the page is behind or has gone.  Once the view rests, the last
picture is sent again in full quality.

A page that can draw the surface is sent updates instead of pictures from a press until the view
rests; see `PageDrawing`.  Pictures and updates share one sequence of numbers, in the order of what
they show, so the page never goes back.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace

from ..scene import View
from .inputs import Inputs
from .page_drawing import PageDrawing, Surface, Update
from .pictures import Encode, Picture, Pictures
from .timers import Timers

_AHEAD = 2  # pictures that the page has not shown yet
_LOST = 2.0  # seconds after which such a picture is no longer waited for
_REST = 0.25  # seconds without another picture, after which the view rests
_RECEIVING = 0.01  # seconds to read waiting messages before a timer may fire
_EXCHANGE = 0.03  # seconds to wait, at most, for a picture that is being encoded
_TURNS = 3  # of the event loop, that sending or reading a message takes
_PERIOD = 0.04  # seconds between two checks whether a view that the page draws rests

Send = Callable[[Picture | Update | Surface, int], None]
"""``send(picture, number)`` sends a picture to the page, or what it needs to draw."""


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
    drawing : PageDrawing
        What the page draws itself.
    """

    def __init__(
        self,
        view: View,
        timers: Timers,
        send: Send,
        handled: Callable[[], object],
        drawing: PageDrawing,
    ) -> None:
        self.view, self.inputs = view, Inputs(view)
        self._timers, self._handled = timers, handled
        self._pictures, self._send = Pictures(view), send
        self._drawing = drawing
        self._is_live = False  # the page draws
        self._has_updates = False  # since the last picture
        self._awake = asyncio.Event()
        self._task: asyncio.Task[None] | None = None
        self._encoding: asyncio.Task[None] | None = None
        self._rest: asyncio.TimerHandle | None = None
        self._is_wanted = self._is_drawing = self._is_open = False
        self._sent = self._shown = 0  # numbers of pictures and updates
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

    def wake(self) -> None:
        """Look for something to do: the editor has changed."""
        self._awake.set()

    def put(self, messages: list[object]) -> None:
        """Queue the events of a page; see `Inputs.put`."""
        self._timers.postpone()
        try:
            for message in messages:
                self.inputs.put(message)
        finally:
            self._awake.set()

    def open(self, width: int, height: int) -> None:
        """Show the view in a page, at this size in pixels; again whenever the size changes."""
        self._is_open, self._shown, self._is_live = True, self._sent, False
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
            await self._wait()
            await self._exchange()
            self._awake.clear()
            if self.inputs:
                for _ in range(len(self.inputs)):
                    await self._handle_input()
                self._timers.postpone()
                self._handled()
            self._end_live()
            if self._is_wanted and self._is_open:
                if self._is_ahead:
                    await self._wait_for_page()
                await self._show()
            self._announce()

    async def _wait(self) -> None:
        """Wait until there is something to do; while the page draws, not for long."""
        with suppress(asyncio.TimeoutError):
            await asyncio.wait_for(self._awake.wait(), _PERIOD if self._is_live else None)

    async def _exchange(self) -> None:
        """Send the last picture, and read what the page has sent since.

        Events and drawing block the event loop.  Without this pause, a picture would be sent only
        once the next one is drawn, and stale mouse moves would be solved for.
        """
        if self._encoding is not None:
            await asyncio.wait([self._encoding], timeout=_EXCHANGE)
        for _ in range(_TURNS):
            await asyncio.sleep(0)

    async def _handle_input(self) -> None:
        """Send the oldest event to the view; if it begins a drag, let the page draw."""
        drawing = self._drawing
        was_dragging = drawing.is_dragging
        self.inputs.send_next()
        if was_dragging or self._is_live or not self._is_open:
            return
        if drawing.is_dragging and drawing.is_possible:
            if not drawing.is_current:
                await self._deliver(self._draw())
            if self._encoding is not None:
                await asyncio.wait([self._encoding])
            self._cancel_rest()
            self._is_live = True
            self._update(drawing.update(is_first=True))

    def _end_live(self) -> None:
        """Let the server draw again, once the view rests or the page cannot draw any more."""
        drawing = self._drawing
        if self._is_live and not (drawing.is_moving and drawing.is_possible):
            self._is_live = False
            self._is_wanted = self._is_wanted or self._has_updates

    async def _show(self) -> None:
        """Show the view in the page: by an update or by a picture."""
        if self._is_live:
            self._is_wanted, self._has_updates = False, True
            self._update(self._drawing.update())
            return
        encode, replaces_updates = self._draw(), self._has_updates
        self._has_updates = False
        still = self._pictures.still() if replaces_updates else None
        await self._deliver(still or encode)

    def _update(self, update: Update) -> None:
        self._sent += 1
        self._send(replace(update, time=self.inputs.time), self._sent)

    def _announce(self) -> None:
        """Let the page fetch the surface, if it lacks it."""
        if self._is_open and not self._is_live:
            surface = self._drawing.announce()
            if surface is not None:
                self._send(surface, self._sent)

    @property
    def _is_ahead(self) -> bool:
        """Whether the page has yet to show enough of what was sent."""
        is_encoding = self._encoding is not None and not self._encoding.done()
        return self._sent - is_encoding - self._shown >= _AHEAD

    async def _wait_for_page(self) -> None:
        """Wait until the page has shown a picture, or too long; handle no event meanwhile."""
        while self._is_ahead:
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
            self._timers.postpone(_RECEIVING)  # input that has arrived meanwhile comes first
            self._drawing.note_picture()

    def _drawn(self, *_: object) -> None:
        """Send what somebody else has drawn, too."""
        if not self._is_drawing:
            self.want()

    async def _deliver(self, encode: Encode) -> None:
        """Encode a picture in another thread and send it, after the one before."""
        if self._encoding is not None:
            await asyncio.wait([self._encoding])
        self._sent += 1
        task = self._encode(encode, self._sent, self.inputs.time)
        self._encoding = asyncio.get_running_loop().create_task(task)

    async def _encode(self, encode: Encode, number: int, time: float) -> None:
        loop = asyncio.get_running_loop()
        picture = await loop.run_in_executor(None, encode)
        if self._is_open:
            self._send(replace(picture, time=time), number)
        self._cancel_rest()
        if not picture.is_still:
            self._rest = loop.call_later(_REST, self._rested)

    def _cancel_rest(self) -> None:
        if self._rest is not None:
            self._rest.cancel()
            self._rest = None

    def _rested(self) -> None:
        still = self._pictures.still()
        if still is not None and not (self._is_wanted or self._is_live) and self._is_open:
            task = self._encode(still, self._sent, self.inputs.time)
            self._encoding = asyncio.get_running_loop().create_task(task)
