"""A gizmo for moving and rotating: arrows, squares, rings and a ball.

It has a constant size on the screen, smaller near a border of the view, and is drawn over
everything else.  Only the front half of each
ring is drawn.  Arrows along the line of sight and squares seen edge-on are hidden.  The part under
the pointer is found with the same lines that are drawn.
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
    Kind,
    Part,
    distance_to_origin,
    facing_axes,
    line_of,
    surrounds_origin,
)
from .gizmo_solids import Solid

AXIS_COLOURS = COLOURS[6], COLOURS[2], COLOURS[5]  # vermilion, green, blue
_HIGHLIGHT = COLOURS[4]  # yellow, with a dark outline
_PICK_RADIUS = 6.0  # pixels
_RING_PENALTY = 3.0  # pixels: other parts win over a ring that crosses them
_END_ON = 0.2  # sine of the angle below which arrows and squares are hidden
_DESIGN_SIZE = 600  # pixels; in a larger view the gizmo is slightly larger
_REACH = 1.4  # radii from the centre to the letters
_SMALLEST = 45.0  # pixels: the radius at a border of the view, at least


class Gizmo:
    """A gizmo at one point of a view; hidden until it is placed.

    Attributes
    ----------
    size : float
        Pixels from the centre to a ring, in a view of 600 pixels.
    """

    def __init__(self, view: View) -> None:
        self.view = view
        self.size = 90.0
        self._centre: FloatArray | None = None
        self._axes = np.eye(3)
        self._highlighted: Part | None = None
        self._only: Part | None = None
        self._caption_text = ""
        self._lines = {part: line_of(part) for part in PARTS}
        self._front_half = vtkPlane()
        self._solids = {part: Solid(view.foreground, part) for part in PARTS}
        self._letters = [Label(view.foreground, colour) for colour in AXIS_COLOURS]
        self._caption = Label(view.foreground, PAPER, dark=True)
        self._stop = view.before_render(self._lay_out)
        self._update_colours()
        self._update_clipping()
        self._lay_out()  # hides it

    @property
    def centre(self) -> FloatArray | None:
        """(3,) float: the centre; None while hidden."""
        return self._centre

    @property
    def axes(self) -> FloatArray:
        """(3, 3) float: the x, y and z axes as rows."""
        return self._axes

    @property
    def radius(self) -> float:
        """The current radius of the rings in the mesh's unit; 0 while hidden."""
        if self._centre is None:
            return 0.0
        return self._radius_in_pixels * self.view.pixel_at(self._centre)

    @property
    def _usual_radius(self) -> float:
        """The radius in pixels away from the borders of the view."""
        scale = np.sqrt(min(self.view.renderer.GetSize()) / _DESIGN_SIZE)
        return float(self.size * np.clip(scale, 0.8, 1.6))

    @property
    def _radius_in_pixels(self) -> float:
        if self._centre is None:
            return self._usual_radius
        size = np.array(self.view.renderer.GetSize())
        place = self.view.to_display(self._centre[None])[0, :2] - self.view.renderer.GetOrigin()
        room = min(place.min(), (size - place).min()) / _REACH  # not a number behind the camera
        return float(np.fmin(self._usual_radius, np.fmax(room, _SMALLEST)))

    def place(self, centre: FloatArray | None, axes: FloatArray | None = None) -> None:
        """Set the *centre* (3,), None to hide, and the *axes* (3, 3), by default the world's."""
        self._centre = centre
        self._axes = np.eye(3) if axes is None else axes
        self.view.request_render()

    def highlight(self, part: Part | None) -> None:
        """Highlight *part*, or none."""
        if part != self._highlighted:
            self._highlighted = part
            self._update_colours()
            self.view.request_render()

    def show_only(self, part: Part | None) -> None:
        """Show only *part*, and all of it, and of a ring its centre; with None, all parts."""
        if part != self._only:
            self._only = part
            self._update_clipping()
            self.view.request_render()

    def set_caption(self, text: str) -> None:
        """Show *text* below the gizmo; "" removes it."""
        if text != self._caption_text:
            self._caption_text = text
            self.view.request_render()

    def line(self, part: Part) -> FloatArray:
        """Return the line of a part in display coordinates (k, 3), NaN where it is hidden."""
        if self._centre is None:
            return np.full((1, 3), np.nan)
        points = self._centre + self.radius * self._lines[part] @ self._frame(part)
        display = self.view.to_display(points)
        if part.kind is Kind.ROTATION and part.axis is not None:
            display[(points - self._centre) @ self._to_viewer() < 0.0] = np.nan
        return display

    def part_at(self, pointer: Pointer) -> Part | None:
        """Return the part under *pointer*, or None."""
        if self._centre is None or self._only is not None:
            return None
        middle = self.view.to_display(self._centre[None])[0, :2]
        if not np.linalg.norm(middle - pointer.position) < 1.5 * self._radius_in_pixels:
            return None  # the usual case, without a test of every part
        nearest, found = _PICK_RADIUS, None
        for part in filter(self._is_visible, PARTS):
            distance = self._distance(part, pointer.position)
            if distance < nearest:
                nearest, found = distance, part
        return found

    def reaches(self, rectangle: tuple[float, float, float, float]) -> bool:
        """Return whether it is drawn in a *rectangle*: left, bottom, right, top in the window."""
        if self._centre is None:
            return False
        place = self.view.to_display(self._centre[None])[0, :2]
        low, high = np.reshape(rectangle, (2, 2))
        away = np.maximum(low - place, place - high).max()
        return bool(away < _REACH * self._radius_in_pixels)

    def remove(self) -> None:
        """Remove the gizmo from the view permanently."""
        self._stop()
        for solid in self._solids.values():
            solid.remove()
        for label in (*self._letters, self._caption):
            label.remove()

    def _distance(self, part: Part, position: FloatArray) -> float:
        """Return the distance in pixels of a part from *position*, with a penalty for rings."""
        line = self.line(part)[:, :2] - position
        if part.kind is Kind.FREE:
            return max(0.0, float(np.linalg.norm(line)) - BALL * self._radius_in_pixels)
        if part.kind is Kind.PLANE and surrounds_origin(line):
            return 0.0
        return distance_to_origin(line) + (_RING_PENALTY if part.kind is Kind.ROTATION else 0.0)

    def _frame(self, part: Part) -> FloatArray:
        """Return the x, y and z axes of a part as rows (3, 3)."""
        to_viewer = self._to_viewer()
        if part == Part(Kind.ROTATION):
            x = np.cross(to_viewer, np.eye(3)[np.argmin(np.abs(to_viewer))])
            x = x / np.linalg.norm(x)
            return np.stack([x, np.cross(to_viewer, x), to_viewer])
        if part.kind is Kind.PLANE and part.axis is not None:  # no square hides another one
            return facing_axes(self._axes, part.axis, self._axes @ to_viewer >= 0.0)
        return self._axes

    def _is_visible(self, part: Part) -> bool:
        if self._centre is None:
            return False
        if self._only not in (None, part):  # only the ball, the centre of a shown ring
            return part.kind is Kind.FREE and self._only.kind is Kind.ROTATION
        if self._only == part or part.axis is None or part.kind is Kind.ROTATION:
            return True
        cosine = abs(float(self._axes[part.axis] @ self._to_viewer()))
        if part.kind is Kind.AXIS:
            return cosine * cosine < 1.0 - _END_ON**2
        return cosine > _END_ON

    def _to_viewer(self) -> FloatArray:
        """Return the direction from the centre to the camera, (3,) of length 1."""
        if self._centre is None or self.view.camera.GetParallelProjection():
            return -self.view.view_direction
        offset = np.asarray(self.view.camera.GetPosition() - self._centre)
        length = float(np.linalg.norm(offset))
        return offset / length if length else -self.view.view_direction

    # Drawing.

    def _update_colours(self) -> None:
        for part, solid in self._solids.items():
            own = INK if part.axis is None else AXIS_COLOURS[part.axis]
            solid.set_colours(*((_HIGHLIGHT, INK) if part == self._highlighted else (own, PAPER)))

    def _update_clipping(self) -> None:
        """Clip the far half of each ring, except of a ring that is shown alone."""
        for axis in range(3):
            ring = Part(Kind.ROTATION, axis)
            self._solids[ring].clip(None if ring == self._only else self._front_half)

    def _lay_out(self) -> None:
        """Update sizes, positions and visibility for the current camera."""
        if self._centre is not None:
            self._front_half.SetOrigin(*self._centre)
            self._front_half.SetNormal(*self._to_viewer())
        radius = self.radius
        for part, solid in self._solids.items():
            is_visible = self._is_visible(part)
            solid.show(is_visible)
            if is_visible and self._centre is not None:
                solid.place(self._centre, radius * self._frame(part))
        self._lay_out_labels()

    def _lay_out_labels(self) -> None:
        """Place the letters at the tips of the arrows, and the caption below the gizmo."""
        size = 0.18 * self._radius_in_pixels
        for axis, letter in enumerate(self._letters):
            arrow = Part(Kind.AXIS, axis)
            if self._is_visible(arrow):
                start, tip = self.line(arrow)[[0, -1], :2]
                length = float(np.linalg.norm(tip - start))
                direction = (tip - start) / length if length > 1.0 else np.array([0.0, 1.0])
                x, y = tip + 0.65 * size * direction
                letter.show("xyz"[axis], size, x, y)
            else:
                letter.hide()
        if self._caption_text and self._centre is not None:
            x, y, _ = self.view.to_display(self._centre[None])[0]
            size = 0.18 * self._usual_radius  # legible near a border, too
            self._caption.show(self._caption_text, size, x, y - 1.3 * self._radius_in_pixels)
        else:
            self._caption.hide()
