"""Landmarks as dots of constant size, each joined by a line to its target, a ring.

A press on a target drags it in the view plane.  While landmarks are added, a press on the surface
places one there, and a drag from there leads to its target; without a drag it stays where it is.  A
landmark of which only the target is known gets that place first.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from vtk_segdeform.arrays import FloatArray
from vtk_segdeform.pictures import COLOURS, PAPER, rgb
from vtk_segdeform.session import Session, SurfacePoint

from ..picking import Picker
from ..scene import Gesture, Phase, Pointer, SurfaceDisplay, Widget, Wireframe
from .markers import THROUGH, Dots, RimmedDots, nearest_seen

BLUE = COLOURS[5]
_HIGHLIGHT = COLOURS[4]
_SIZE, _LINE = 9.0, 2.0  # pixels: dots without their rims, and lines
_CLICK_TOLERANCE = 3.0  # pixels; a press that moves less places a landmark that stays


class LandmarkMarks(Widget):
    """Shows the landmarks of a session, and drags their targets; invisible until it is on.

    Parameters
    ----------
    view : View, pyvista.Plotter or (vtkRenderer, vtkRenderWindowInteractor)
        The view to work in.  Call `remove` before its window closes.
    session : Session
        The session to show and edit.
    surface : SurfaceDisplay
        The displayed mesh of the session.
    """

    def __init__(self, view: Any, session: Session, surface: SurfaceDisplay) -> None:
        super().__init__(view, session)
        self._picker = Picker(surface)
        self._adds, self._is_hidden = False, False
        self._chosen = self._hovered = ""
        self._sources, self._targets = RimmedDots(self.view), RimmedDots(self.view)
        self._bright = Dots(self.view.renderer)
        self._lines: tuple[Wireframe, ...] = ()
        self._n_ends = 0  # of the lines
        self._stops_showing = [
            session.on_change(lambda _: self.view.request_render()),
            self.view.before_render(self._lay_out),
        ]

    @property
    def adds(self) -> bool:
        """Whether a press on the surface adds a landmark."""
        return self._adds

    @adds.setter
    def adds(self, adds: bool) -> None:
        self._adds = adds
        self._invoke("ModifiedEvent")

    @property
    def is_hidden(self) -> bool:
        """Whether they are not shown, and not dragged, although the widget is on."""
        return self._is_hidden

    @is_hidden.setter
    def is_hidden(self, hidden: bool) -> None:
        self._is_hidden = hidden
        self.view.request_render()

    @property
    def chosen(self) -> str:
        """The name of the selected landmark; "" if there is none."""
        return self._chosen if self._chosen in self.session.landmarks else ""

    @chosen.setter
    def chosen(self, name: str) -> None:
        self._chosen = name
        self.view.request_render()

    def Off(self) -> None:  # noqa: N802 - VTK's word
        """Stop handling events and showing landmarks; finish an ongoing gesture."""
        super().Off()
        self.view.request_render()

    def On(self) -> None:  # noqa: N802
        """Start handling events and showing landmarks."""
        super().On()
        self.view.request_render()

    def remove(self) -> None:
        """Remove the widget from the view permanently."""
        self.Off()
        for stop in self._stops_showing:
            stop()
        for dots in (self._sources, self._targets, self._bright):
            dots.remove()
        self._draw_lines(np.empty((0, 3)))

    # Events.
    def on_press(self, press: Pointer) -> Gesture | None:
        """Drag the target under the pointer, or add a landmark; otherwise pass on the press."""
        name = self._target_at(press)
        marks = self.session.landmarks
        if name:
            return self._drag(name, press, marks[name][1])
        hit = self._picker.hit(press) if self.adds else None
        if hit is None:
            return None
        waiting = [name for name, (source, _) in marks.items() if np.isnan(source).any()]
        if waiting:  # of which only the target is known
            name = self.chosen if self.chosen in waiting else waiting[0]
            return self._drag(name, press, marks[name][1], place=hit.place)
        return self._drag(marks.new_name, press, hit.point, place=hit.place)

    def on_hover(self, pointer: Pointer) -> None:
        """Highlight the target under the pointer."""
        self._highlight(self._target_at(pointer) if self.view.contains(pointer) else "")

    def leave(self) -> None:
        """Remove the highlight."""
        self._highlight("")

    def _highlight(self, name: str) -> None:
        if name != self._hovered:
            self._hovered = name
            self.view.request_render()

    def _target_at(self, pointer: Pointer) -> str:
        """Return the landmark whose visible target is nearest to *pointer*, and near it; or ""."""
        marks = self.session.state.landmarks
        if self._is_hidden or not marks.names:
            return ""
        nearest = nearest_seen(self.view, self._picker, pointer, marks.target)
        return "" if nearest is None else marks.names[nearest]

    def _drag(
        self, name: str, press: Pointer, target: FloatArray, *, place: SurfacePoint | None = None
    ) -> Gesture:
        """Move the *target* (3,) of a landmark, put at a *place* before, as one step.

        The target of a landmark that gets its place later stays.
        """
        session, view = self.session, self.view
        session.commit()  # keeps an unfinished drag from elsewhere out of our undo step
        moves = place is None or name not in session.landmarks
        label = f"move target of {name}" if place is None else f"set {name}"
        display = view.to_display(target[None])[0]
        offset, committed, has_moved = display[:2] - press.position, False, False
        self.chosen = name
        try:
            if place is not None:
                session.landmarks.move(name, target, point=place)
            while (pointer := (yield)).phase is Phase.MOVE:
                distance = float(np.linalg.norm(pointer.position - press.position))
                has_moved |= distance > _CLICK_TOLERANCE
                if moves and has_moved:
                    to = view.to_world(np.array([[*(pointer.position + offset), display[2]]]))
                    session.landmarks.move(name, to[0])
            if pointer.phase is Phase.RELEASE:
                session.commit(label)
                committed = True
                self._invoke("ModifiedEvent")
        finally:
            if not committed:
                session.revert()

    # Display.
    def _lay_out(self) -> None:
        """Place the dots in front of the surface, as seen from the camera."""
        is_shown, nothing = self.GetEnabled() and not self._is_hidden, np.empty((0, 3))
        names = tuple(self.session.landmarks) if is_shown else ()
        source = self.session.landmarks.places if names else nothing
        target = self.session.state.landmarks.target if names else nothing
        sources, targets = (each[np.isfinite(each).all(axis=1)] for each in (source, target))
        self._sources.draw(sources, _SIZE, rim=PAPER, fill=BLUE, through=BLUE)
        self._targets.draw(targets, _SIZE, rim=BLUE, fill=PAPER, through=BLUE)
        complete = np.isfinite(source + target).all(axis=1)
        self._draw_lines(np.stack([source, target], axis=1)[complete].reshape(-1, 3))
        name = self._hovered or self._chosen
        bright = target[[names.index(name)]] if name in names else nothing
        bright = bright[np.isfinite(bright).all(axis=1)]
        scale = self.view.scale
        lifted = self.view.lifted(bright, 2.0 * scale * _SIZE) if len(bright) else bright
        self._bright.draw(lifted, _HIGHLIGHT, scale * _SIZE)

    def _draw_lines(self, ends: FloatArray) -> None:
        """Draw lines between each two of *ends* (2 k, 3): before the body, and faintly through."""
        layers = self.view.renderer, self.view.foreground
        if len(ends) != self._n_ends:
            for renderer, line in zip(layers, self._lines, strict=False):
                renderer.RemoveActor(line.actor)
            self._lines, self._n_ends = (), len(ends)
        if len(ends) and not self._lines:
            edges = np.arange(len(ends)).reshape(-1, 2)
            self._lines = tuple(Wireframe(ends, edges, edges[:0, 0]) for _ in layers)
            for renderer, line in zip(layers, self._lines, strict=True):
                renderer.AddActor(line.actor)
        for line, opacity in zip(self._lines, (1.0, THROUGH), strict=False):
            line.move(ends)
            line.set_style(rgb(BLUE), line_width=_LINE * self.view.scale, sphere_size=1.0)
            line.actor.GetProperty().SetOpacity(opacity)
            line.actor.GetProperty().LightingOff()
