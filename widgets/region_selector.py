"""Paint regions, what stays fixed and what is dragged, onto the mesh.

    brush       press on the mesh and move; the wheel over it, or ``[`` and ``]``, change its size
    lasso       draw around vertices
    rectangle   from corner to corner
    component   click on what hangs together

Plain adds, Control takes away; Shift leaves the mouse to the camera, and so does a brush beside
the mesh.  A stroke is shown while it is made and is one step of the session's history when the
button comes up; Escape or the right button ends it with nothing changed.
"""

from __future__ import annotations

import enum
from collections.abc import Iterator
from typing import Any

import numpy as np

from vtk_segdeform.arrays import BoolArray, FloatArray
from vtk_segdeform.palette import PAPER, rgb
from vtk_segdeform.session import Session

from .brush_ring import BrushRing
from .gestures import Gesture, Phase, Pointer
from .outline import Outline
from .picking import Hit, Picker
from .region_colours import RegionColours
from .roles import Paint, Role
from .surface_display import SurfaceDisplay
from .widget import Widget

__all__ = ["Paint", "RegionSelector", "Tool"]

_RADIUS = 0.05  # of the mesh's diagonal, to begin with
_LARGER = 1.25  # by a click of the wheel, or a key
_SMALLEST, _LARGEST = 0.002, 0.5  # of the diagonal
_STEP = 0.5  # of the radius: between two dabs of a fast stroke
_MOST_DABS = 50  # between two moves of the mouse
_LEAST = 3.0  # pixels: a narrower lasso or rectangle is a slip of the hand


class Tool(enum.Enum):
    """How vertices are taken."""

    BRUSH = enum.auto()
    LASSO = enum.auto()
    RECTANGLE = enum.auto()
    COMPONENT = enum.auto()


class RegionSelector(Widget):
    """Paint on the mesh; off until `On`.

    Parameters
    ----------
    view : View, pyvista.Plotter or (vtkRenderer, vtkRenderWindowInteractor)
        Where it lives.
    session : Session
        Whose regions, fixed vertices and handles.
    surface, colours : SurfaceDisplay, RegionColours, optional
        The mesh and its colours, if they are shown already.
    """

    def __init__(
        self,
        view: Any,
        session: Session,
        surface: SurfaceDisplay | None = None,
        colours: RegionColours | None = None,
    ) -> None:
        super().__init__(view, session)
        self.tool = Tool.BRUSH
        self.paints = Paint.REGION
        self.region = 0  # the number after the last one's is a new one
        self.handle: str | None = None  # None is a new one, whose name then stands here
        self.through = False  # whether lasso and rectangle reach what the body hides
        self.surface = surface or SurfaceDisplay(self.view, session)
        self.colours = colours or RegionColours(self.surface)
        self._owned: list[Any] = [
            *([] if colours else [self.colours]),
            *([] if surface else [self.surface]),
        ]
        self._picker = Picker(self.surface)
        self._outline = Outline(self.view)
        self._ring = BrushRing(self.view)
        self.radius = _RADIUS * session.mesh.diagonal

    @property
    def radius(self) -> float:
        """Of the brush, along the surface, in the mesh's unit."""
        return self._radius

    @radius.setter
    def radius(self, radius: float) -> None:
        size = self.session.mesh.diagonal
        self._radius = float(np.clip(radius, _SMALLEST * size, _LARGEST * size))

    def region_under_pointer(self) -> int | None:
        """Return the region that the mesh under the pointer belongs to most, or None."""
        hit = self._picker.hit(self.view.pointer(Phase.HOVER))
        regions = self.session.regions
        return None if hit is None or regions is None else int(regions.labels[hit.vertex])

    def grow(self) -> None:
        """Add to what is painted the vertices next to it."""
        self._give(self._next_to(self._role.members()))

    def shrink(self) -> None:
        """Take from what is painted its outermost vertices."""
        members = self._role.members()
        self._take(members & self._next_to(~members))

    def Off(self) -> None:  # noqa: N802 - VTK's word
        """Stop listening; a stroke that is going on is cancelled."""
        super().Off()
        self._ring.hide()

    def remove(self) -> None:
        """Take everything of its own out of the view, for good."""
        self.Off()
        self._outline.remove()
        self._ring.remove()
        for own in self._owned:
            own.remove()

    # What the mouse does.

    def begins(self, press: Pointer) -> Gesture | None:
        """Begin a stroke, but leave Shift, and a press beside the mesh, to the camera."""
        if press.shift:
            return None
        if self.tool in (Tool.LASSO, Tool.RECTANGLE):
            return self._around(press)
        hit = self._picker.hit(press)
        if hit is None:
            return None
        return self._stroke(press, hit) if self.tool is Tool.BRUSH else self._click(press, hit)

    def hovers(self, pointer: Pointer) -> None:
        """Show how large the brush is."""
        hit = self._picker.hit(pointer) if self.tool is Tool.BRUSH else None
        if hit is None or not self.view.contains(pointer):
            self._ring.hide()
        else:
            self._ring.draw(hit.point, self._normal(hit), self.radius, self._role.colour)

    def wheels(self, pointer: Pointer, clicks: int) -> bool:
        """Change the size of the brush, over the mesh; with Shift or Control zoom as ever."""
        if pointer.shift or pointer.control or self._picker.hit(pointer) is None:
            return False
        return self._resize(pointer, clicks)

    def types(self, key: str, pointer: Pointer) -> bool:
        """Change the size of the brush."""
        clicks = {"bracketleft": -1, "bracketright": +1}.get(key)
        return clicks is not None and self._resize(pointer, clicks)

    def _resize(self, pointer: Pointer, clicks: int) -> bool:
        if self.tool is not Tool.BRUSH:
            return False
        self.radius *= _LARGER**clicks
        self.hovers(pointer)
        return True

    def _stroke(self, press: Pointer, hit: Hit) -> Gesture:
        taken, before = self._picker.around(hit, self.radius), press
        try:
            self._preview(taken, press)
            while (pointer := (yield)).phase is Phase.MOVE:
                for dab in self._dabs(before, pointer):
                    taken |= self._picker.around(dab, self.radius)
                before = pointer
                self._preview(taken, press)
                self.hovers(pointer)
        finally:
            self.colours.preview(None)
        self._finish(pointer, taken, subtract=press.control)

    def _click(self, press: Pointer, hit: Hit) -> Gesture:
        taken = self._picker.component(hit.vertex)
        try:
            self._preview(taken, press)
            while (pointer := (yield)).phase is Phase.MOVE:
                pass
        finally:
            self.colours.preview(None)
        self._finish(pointer, taken, subtract=press.control)

    def _around(self, press: Pointer) -> Gesture:
        way = [press.position]
        outline = np.array(way)
        try:
            while (pointer := (yield)).phase is Phase.MOVE:
                way.append(pointer.position)
                outline = np.array(way) if self.tool is Tool.LASSO else _box(way[0], way[-1])
                self._outline.draw(outline)
        finally:
            self._outline.hide()
        if np.ptp(outline, axis=0).min() >= _LEAST:
            taken = self._picker.inside(outline, through=self.through)
            self._finish(pointer, taken, subtract=press.control)

    def _dabs(self, start: Pointer, end: Pointer) -> Iterator[Hit]:
        """Yield where the brush touches the mesh on the way, close enough to leave no gap."""
        way = end.position - start.position
        pixel = self.view.pixel_at(self.surface.points.mean(axis=0))
        count = np.ceil(np.linalg.norm(way) * pixel / (_STEP * self.radius))
        count = int(np.clip(count, 1, _MOST_DABS))
        for share in np.arange(1, count + 1) / count:
            x, y = start.position + share * way
            dab = self._picker.hit(Pointer(Phase.MOVE, float(x), float(y)))
            if dab is not None:
                yield dab

    # What becomes of it.

    @property
    def _role(self) -> Role:
        return Role(self.session, self.paints, self.region, self.handle)

    def _preview(self, taken: BoolArray, press: Pointer) -> None:
        self.colours.preview(taken, rgb(PAPER) if press.control else self._role.colour)

    def _finish(self, pointer: Pointer, taken: BoolArray, *, subtract: bool) -> None:
        if pointer.phase is Phase.RELEASE and taken.any():
            (self._take if subtract else self._give)(taken)

    def _give(self, vertices: BoolArray) -> None:
        self.handle = self._role.give(vertices)

    def _take(self, vertices: BoolArray) -> None:
        self.handle = self._role.take(vertices)

    def _next_to(self, vertices: BoolArray) -> BoolArray:
        return np.asarray(self.session.mesh.adjacency @ vertices.astype(float) > 0.0)

    def _normal(self, hit: Hit) -> FloatArray:
        a, b, c = self.surface.points[self.session.mesh.faces[hit.face]]
        normal = np.cross(b - a, c - a)
        length = np.linalg.norm(normal)
        return np.asarray(normal / length if length > 0.0 else -self.view.towards_scene)


def _box(corner: FloatArray, opposite: FloatArray) -> FloatArray:
    (x0, y0), (x1, y1) = corner, opposite
    return np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]])
