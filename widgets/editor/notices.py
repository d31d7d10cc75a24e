"""Notices: how the mesh that is deformed differs from what was given, and where.

    12 holes: volume kept under lids; welded 242 seam points    [Show] [x]

The line is drawn at the lower left of a view, above the status line.  A click on Show marks the
places on the model, a second one removes the marks; x closes the line.  It also disappears with the
first edit, and returns by `Notices.toggle`, the action of a key.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from vtk_segdeform.arrays import IntArray
from vtk_segdeform.mesh import Kind
from vtk_segdeform.session import Change, Session

from ..scene import Highlights, View
from .notice_line import NoticeLine

_ABOVE_WIDGETS = 1.5  # priority: our widgets have 1
_SHOW, _HIDE, _CLOSE = "Show", "Hide", "×"
_EDITS = Change.REGIONS | Change.CAGES | Change.CONSTRAINTS | Change.POSE


@dataclass(frozen=True, eq=False)
class Notice:
    """A sentence about the mesh of a session, and where it applies."""

    text: str
    loops: tuple[IntArray, ...] = ()
    """Closed loops of vertices, (k,) int each."""
    dots: IntArray | None = None
    """Single vertices, (d,) int."""


def notices_of(session: Session) -> tuple[Notice, ...]:
    """Return the notices about the mesh of *session*: its borders, then each workaround."""
    borders, surface = session.mesh.borders, session.surface
    of_borders = [Notice(session.volume_summary, tuple(borders))] if len(borders) else []
    of_workarounds = [
        Notice(each.text, dots=surface.vertices_at(each.points))
        for each in (surface.workarounds if surface else ())
        if surface and each.kind is not Kind.HOLE  # see the borders
    ]
    return *of_borders, *of_workarounds


class Notices:
    """The notices of one session at a time, in a view.

    Parameters
    ----------
    view : View
        Where they are drawn.
    foot : callable
        Returns the height, in pixels, of whatever is drawn below them.
    """

    def __init__(self, view: View, foot: Callable[[], float]) -> None:
        self.view = view
        self._session: Session | None = None
        self._notices: tuple[Notice, ...] = ()
        self._offers: dict[str, tuple[Callable[[], object], Callable[[Session], bool]]] = {}
        self._marks = Highlights(view)
        self._line = NoticeLine(view, foot)
        self._is_open = self._is_enabled = False
        self._was_edited = False
        self._stop = view.observe("LeftButtonPressEvent", self._press, _ABOVE_WIDGETS)

    @property
    def text(self) -> str:
        """All notices in one line; "" if there are none."""
        text = "; ".join(notice.text for notice in self._notices)
        return text[:1].upper() + text[1:]

    @property
    def offers(self) -> tuple[str, ...]:
        """The buttons that only some sessions have, this one among them."""
        session = self._session
        offers = self._offers.items()
        return tuple(label for label, (_, suits) in offers if session and suits(session))

    @property
    def is_open(self) -> bool:
        """Whether the line is shown."""
        return self._is_open and self._is_enabled

    @property
    def are_marked(self) -> bool:
        """Whether the places are marked on the model."""
        return self._marks.is_shown

    def follow(self, session: Session) -> None:
        """Show the notices about another session, if there are any."""
        self._marks.hide()
        self._session, self._notices = session, notices_of(session)
        self._is_open, self._was_edited = bool(self._notices), False
        self._draw()

    def changed(self, change: Change) -> None:
        """Follow a change of the session: the first edit closes the line."""
        if self._session is None:
            return
        if change & Change.OPTIONS:  # lids or no lids
            self._notices = notices_of(self._session)
            if self.are_marked:
                self._mark()
            self._draw()
        # Preparing sets regions and cages, too, but not as a step.
        if change & _EDITS and self._session.history.can_undo and not self._was_edited:
            self._was_edited = True
            self.close()
        elif change & Change.POSE and self.are_marked:
            self._marks.move(self._session.vertices)

    def offer(
        self, label: str, act: Callable[[], object], suits: Callable[[Session], bool]
    ) -> None:
        """Add a button that calls *act*, to this line and later ones, of sessions that it suits."""
        self._offers[label] = act, suits
        self._draw()

    def enable(self, enabled: bool) -> None:
        """Show the line and the marks if they are open, or hide them for the time being."""
        if enabled == self._is_enabled:
            return
        self._is_enabled = enabled
        if not enabled:
            self._marks.hide()
        self._draw()

    def toggle(self) -> bool:
        """Open the line and mark the places, or close both; False if there are no notices."""
        if not self._notices:
            return False
        if self.are_marked:
            self.close()
        else:
            self._is_open = True
            self._mark()
            self._draw()
        return True

    def close(self) -> None:
        """Close the line and remove the marks."""
        self._is_open = False
        self._marks.hide()
        self._draw()

    def remove(self) -> None:
        """Remove everything from the view, permanently."""
        self._stop()
        self._marks.hide()
        self._line.remove()

    def _mark(self) -> None:
        if self._session is not None:
            none = np.empty(0, dtype=np.int64)
            dots = [none if each.dots is None else each.dots for each in self._notices]
            loops = [loop for each in self._notices for loop in each.loops]
            self._marks.show(self._session.vertices, loops, np.unique(np.concatenate(dots)))

    def _draw(self) -> None:
        if self.is_open and self._notices:
            show = _HIDE if self.are_marked else _SHOW
            self._line.show(self.text, (show, *self.offers, _CLOSE))
        else:
            self._line.show("", ())

    def _press(self) -> bool:
        origin = self.view.renderer.GetOrigin()
        pointer = np.subtract(self.view.interactor.GetEventPosition(), origin)
        button = self._line.button_at(pointer)
        if button == _CLOSE:
            self.close()
        elif button in (_SHOW, _HIDE):
            if self.are_marked:
                self._marks.hide()
            else:
                self._mark()
            self._draw()
        elif button:
            act, _ = self._offers[button]
            act()
        return button is not None
