"""The gizmo by which something is moved and turned: arrows, squares, rings and a ball.

It is as large on the screen wherever it is, and hidden by nothing.  Of the rings only the half
towards the viewer is there, and neither an arrow that points at the viewer nor a square seen
from its side.  The part under the pointer is found among the very lines that are drawn.
"""

from __future__ import annotations

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkPlane

from vtk_segdeform.arrays import FloatArray
from vtk_segdeform.pictures import COLOURS, INK, PAPER

from ..scene import Pointer, View
from .gizmo_label import Label
from .gizmo_shapes import (
    BALL,
    PARTS,
    Part,
    Way,
    distance_to_origin,
    line_of,
    surrounds_origin,
    towards_corner,
)
from .gizmo_solids import Solid

AXIS_COLOURS = COLOURS[6], COLOURS[2], COLOURS[5]  # vermilion, green, blue
_POINTED_AT = COLOURS[4]  # yellow, within a dark outline
_REACH = 6.0  # pixels
_RING_HANDICAP = 3.0  # pixels that a ring has to be nearer than what it crosses
_END_ON = 0.2  # sine of the angle at which arrows and squares vanish
_DESIGNED_FOR = 600  # pixels of height; in a higher window it is a little larger


class Gizmo:
    """What to grab, at one place in a view; hidden until it is placed.

    Parameters
    ----------
    view : View
        Where it is drawn.

    Attributes
    ----------
    size : float
        Pixels from the centre to a ring, in a window 600 pixels high.
    """

    def __init__(self, view: View) -> None:
        self.view = view
        self.size = 90.0
        self._centre: FloatArray | None = None
        self._axes = np.eye(3)
        self._pointed_at: Part | None = None
        self._only: Part | None = None
        self._words = ""
        self._lines = {part: line_of(part) for part in PARTS}
        self._half = vtkPlane()
        self._solids = {part: Solid(view.front, part) for part in PARTS}
        self._letters = [Label(view.front, colour) for colour in AXIS_COLOURS]
        self._caption = Label(view.front, INK)
        self._stop = view.before_render(self._fit)
        self._dress()
        self._cut()

    @property
    def centre(self) -> FloatArray | None:
        """(3,) float: where it is; None if it is hidden."""
        return self._centre

    @property
    def axes(self) -> FloatArray:
        """(3, 3) float: its x, y and z, as rows."""
        return self._axes

    @property
    def radius(self) -> float:
        """How large it is now in the mesh's unit: from the centre to a ring; 0 while hidden."""
        if self._centre is None:
            return 0.0
        return self._radius_in_pixels * self.view.pixel_at(self._centre)

    @property
    def _radius_in_pixels(self) -> float:
        higher = np.sqrt(self.view.renderer.GetSize()[1] / _DESIGNED_FOR)
        return float(self.size * np.clip(higher, 0.8, 1.6))

    def place(self, centre: FloatArray | None, axes: FloatArray | None = None) -> None:
        """Be at *centre* (3,), turned as *axes* (3, 3), those of the world by default; or hide."""
        self._centre = centre
        self._axes = np.eye(3) if axes is None else axes
        self.view.touch()

    def point_at(self, part: Part | None) -> None:
        """Show *part* as the one that a press would take, or none."""
        if part != self._pointed_at:
            self._pointed_at = part
            self._dress()
            self.view.touch()

    def show_only(self, part: Part | None) -> None:
        """Show no other part than this, all of it; or, with None, all again."""
        if part != self._only:
            self._only = part
            self._cut()
            self.view.touch()

    def say(self, words: str) -> None:
        """Have a few *words* beside it, or "" for none."""
        if words != self._words:
            self._words = words
            self.view.touch()

    def line(self, part: Part) -> FloatArray:
        """Return where a part is seen: (k, 3) display coordinates, NaN where it is hidden."""
        if self._centre is None:
            return np.full((1, 3), np.nan)
        points = self._centre + self.radius * self._lines[part] @ self._frame(part)
        seen = self.view.to_display(points)
        if part.way is Way.ABOUT and part.axis is not None:
            seen[(points - self._centre) @ self._to_viewer() < 0.0] = np.nan
        return seen

    def under(self, pointer: Pointer) -> Part | None:
        """Return the part under *pointer*, or None."""
        if self._centre is None or self._only is not None:
            return None
        middle = self.view.to_display(self._centre[None])[0, :2]
        if not np.linalg.norm(middle - pointer.position) < 1.5 * self._radius_in_pixels:
            return None  # as mostly
        nearest, found = _REACH, None
        for part in filter(self._is_to_be_seen, PARTS):
            away = self._away(part, pointer.position)
            if away < nearest:
                nearest, found = away, part
        return found

    def remove(self) -> None:
        """Go out of the view, for good."""
        self._stop()
        for solid in self._solids.values():
            solid.remove()
        for label in (*self._letters, self._caption):
            label.remove()

    def _away(self, part: Part, position: FloatArray) -> float:
        """Return how many pixels a part is from *position*; rings count as a little farther."""
        line = self.line(part)[:, :2] - position
        if part.way is Way.FREE:
            return max(0.0, float(np.linalg.norm(line)) - BALL * self._radius_in_pixels)
        if part.way is Way.WITHIN and surrounds_origin(line):
            return 0.0
        return distance_to_origin(line) + (_RING_HANDICAP if part.way is Way.ABOUT else 0.0)

    def _frame(self, part: Part) -> FloatArray:
        """Return the x, y and z of a part, as rows (3, 3)."""
        to_viewer = self._to_viewer()
        if part == Part(Way.ABOUT):
            aside = np.cross(to_viewer, np.eye(3)[np.argmin(np.abs(to_viewer))])
            aside = aside / np.linalg.norm(aside)
            return np.stack([aside, np.cross(to_viewer, aside), to_viewer])
        if part.way is Way.WITHIN and part.axis is not None:  # where none is behind another
            return towards_corner(self._axes, part.axis, self._axes @ to_viewer >= 0.0)
        return self._axes

    def _is_to_be_seen(self, part: Part) -> bool:
        if self._centre is None or self._only not in (None, part):
            return False
        if self._only == part or part.axis is None or part.way is Way.ABOUT:
            return True
        cosine = abs(float(self._axes[part.axis] @ self._to_viewer()))
        if part.way is Way.ALONG:
            return cosine * cosine < 1.0 - _END_ON**2
        return cosine > _END_ON

    def _to_viewer(self) -> FloatArray:
        """Return the direction from the centre to the eye, (3,) of length 1."""
        if self._centre is None or self.view.camera.GetParallelProjection():
            return -self.view.towards_scene
        away = np.asarray(self.view.camera.GetPosition() - self._centre)
        length = float(np.linalg.norm(away))
        return away / length if length else -self.view.towards_scene

    # Drawing.

    def _dress(self) -> None:
        """Give every part its colour."""
        for part, solid in self._solids.items():
            own = INK if part.axis is None else AXIS_COLOURS[part.axis]
            solid.draw(*((_POINTED_AT, INK) if part == self._pointed_at else (own, PAPER)))

    def _cut(self) -> None:
        """Let the far half of rings vanish, but for one that is shown alone."""
        for axis in range(3):
            ring = Part(Way.ABOUT, axis)
            self._solids[ring].cut(None if ring == self._only else self._half)

    def _fit(self) -> None:
        """Be as large as it should be, and show what is to be seen from here."""
        if self._centre is not None:
            self._half.SetOrigin(*self._centre)
            self._half.SetNormal(*self._to_viewer())
        for part, solid in self._solids.items():
            solid.show(self._is_to_be_seen(part))
            if self._centre is not None:
                solid.place(self._centre, self.radius * self._frame(part))
        self._write()

    def _write(self) -> None:
        """Put the letters to their arrows, and what is said below."""
        size = 0.18 * self._radius_in_pixels
        for axis, letter in enumerate(self._letters):
            arrow = Part(Way.ALONG, axis)
            if self._is_to_be_seen(arrow):
                start, tip = self.line(arrow)[[0, -1], :2]
                length = float(np.linalg.norm(tip - start))
                onward = (tip - start) / length if length > 1.0 else np.array([0.0, 1.0])
                x, y = tip + 0.65 * size * onward
                letter.say("xyz"[axis], size, x, y)
            else:
                letter.hide()
        if self._words and self._centre is not None:
            x, y, _ = self.view.to_display(self._centre[None])[0]
            self._caption.say(self._words, size, x, y - 1.3 * self._radius_in_pixels)
        else:
            self._caption.hide()
