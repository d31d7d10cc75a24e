"""Paint regions, what stays fixed, and handles, on the mesh with the mouse.

A stroke adds to what is painted, with Control held it subtracts; what would change is shown while
it goes on, and the release makes one undo step of it.  Escape ends it with nothing changed.

brush, component    a press beside the mesh is left to the camera
lasso, rectangle    begin anywhere; with Shift held the press is left to the camera, of any tool
``[``  ``]``        smaller, larger brush; so does the wheel over the mesh.  Beside it, and with
                    Shift or Control held, the wheel zooms as ever.

Other regions put the pose to rest, as they do in `Session`; fixed vertices and handles keep it.
What a stroke leaves alone is told in `roles`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from vtk_segdeform.arrays import BoolArray, is_number
from vtk_segdeform.checks import require, shown
from vtk_segdeform.errors import ArgumentError
from vtk_segdeform.pictures import PAPER, rgb
from vtk_segdeform.session import Change, Session

from ..picking import Picker
from ..scene import Gesture, Phase, Pointer, SurfaceDisplay, Widget
from .brush_ring import BrushRing
from .outline import Outline
from .region_colours import RegionColours
from .roles import Paint, Role, heaviest
from .strokes import Brush, Component, Lasso, Rectangle, Stroke, Tool, under

__all__ = ["Paint", "RegionSelector", "Tool"]

_RADIUS = 0.05  # of the mesh's diagonal, at first
_SMALLEST, _LARGEST = 1e-4, 2.0  # of the diagonal
_LARGER = 1.2  # by a click of the wheel or a key


class RegionSelector(Widget):
    """Brush, lasso, rectangle and whole components, for regions, fixed vertices and handles.

    Parameters
    ----------
    view : View, pyvista.Plotter or (vtkRenderer, vtkRenderWindowInteractor)
        Where it lives.  Call `remove` before its window closes.
    session : Session
        What is painted.
    surface : SurfaceDisplay, optional
        The mesh in the view; by default one of its own.
    colours : RegionColours, optional
        What shows the regions on *surface*, and what a stroke would change; by default its own.

    Attributes
    ----------
    paints : Paint
        What is painted.
    region : int
        Which region; one more than there are makes a new one.
    handle : str or None
        Which handle, also one that is still to come; None makes a new one, and is then its name.
    through : bool
        Whether what is hidden is painted too, as if the body were of glass.
    """

    def __init__(
        self,
        view: Any,
        session: Session,
        surface: SurfaceDisplay | None = None,
        colours: RegionColours | None = None,
    ) -> None:
        super().__init__(view, session)
        if surface is not None:
            require(surface, SurfaceDisplay, "surface")
        if colours is not None:
            require(colours, RegionColours, "colours")
        self.paints = Paint.REGION
        self.region = 0
        self.handle: str | None = None
        self.through = False
        self._tool = Tool.BRUSH
        self._radius = _RADIUS * session.mesh.diagonal
        self._own: list[Callable[[], None]] = []  # what was made here goes from here, last first
        if surface is None:
            surface = SurfaceDisplay(self.view, session)
            self._own.append(surface.remove)
        if colours is None:
            colours = RegionColours(surface)
            self._own.append(colours.remove)
        self.surface, self.colours = surface, colours
        self._picker = Picker(surface)
        self._ring, self._outline = BrushRing(surface), Outline(self.view)
        self._own += [self._ring.remove, self._outline.remove, session.on_change(self._changed)]

    @property
    def tool(self) -> Tool:
        """With what is painted; a stroke goes on with what it began with."""
        return self._tool

    @tool.setter
    def tool(self, tool: Tool) -> None:
        self._tool = require(tool, Tool, "tool")
        self._ring.hide()
        self._tell("ModifiedEvent")

    @property
    def radius(self) -> float:
        """How far the brush reaches along the surface, in the mesh's unit."""
        return self._radius

    @radius.setter
    def radius(self, radius: float) -> None:
        if not (is_number(radius) and radius > 0.0):
            raise ArgumentError(f"radius must be above 0; got {shown(radius)}")
        self._radius = radius
        self._tell("ModifiedEvent")

    def grow(self) -> None:
        """Add one ring of neighbours to what is painted."""
        self.handle = self._role.give(self._next_to(self._role.members()))

    def shrink(self) -> None:
        """Take the outermost ring of vertices out of what is painted."""
        members = self._role.members()
        self.handle = self._role.take(members & self._next_to(~members))

    def region_under_pointer(self) -> int | None:
        """Return the region that weighs most where the pointer is; None beside the mesh."""
        hit = self._picker.hit(self.view.pointer(Phase.HOVER))
        regions = self.session.regions
        return None if hit is None or regions is None else heaviest(regions, hit.vertex)

    def remove(self) -> None:
        """Take everything out of the view, for good."""
        self.Off()
        while self._own:
            self._own.pop()()

    # What the hands do.

    def On(self) -> None:  # noqa: N802 - VTK's word
        """Listen to the view."""
        if not self.GetEnabled():
            super().On()
            self._stops.append(self.view.observe("LeaveEvent", self._ring.hide))

    def Off(self) -> None:  # noqa: N802
        """Stop listening; an ongoing stroke is finished."""
        try:
            super().Off()
        finally:
            self._ring.hide()

    def begins(self, press: Pointer) -> Gesture | None:
        """Begin a stroke with the tool; with Shift, or off the mesh, it is the camera's."""
        stroke = None if press.shift else self._begun(press)
        return None if stroke is None else self._follow(stroke, self._role, press.control)

    def hovers(self, pointer: Pointer) -> None:
        """Show how far the brush would reach."""
        if self.tool is Tool.BRUSH:
            self._draw_ring(pointer, self._role, pointer.control)

    def wheels(self, pointer: Pointer, clicks: int) -> bool:
        """Make the brush larger or smaller, over the mesh; with Shift or Control zoom."""
        if self.is_grabbing:
            return True  # a stroke is of one view and one radius
        if self.tool is not Tool.BRUSH or pointer.shift or pointer.control:
            return False
        if self._picker.hit(pointer) is None:
            return False
        self._resize(clicks, pointer)
        return True

    def types(self, key: str, pointer: Pointer) -> bool:
        """Make the brush smaller or larger."""
        clicks = {"bracketleft": -1, "bracketright": +1}.get(key)
        if clicks is None or self.tool is not Tool.BRUSH:
            return False
        if not self.is_grabbing:
            self._resize(clicks, pointer)
        return True

    # Strokes.

    def _begun(self, press: Pointer) -> Stroke | None:
        picker, through = self._picker, self.through
        if self.tool is Tool.LASSO:
            return Lasso(picker, press, through=through)
        if self.tool is Tool.RECTANGLE:
            return Rectangle(picker, press, through=through)
        hit = picker.hit(press)
        if hit is None:
            return None
        if self.tool is Tool.COMPONENT:
            return Component(picker, hit.vertex)
        return Brush(picker, press, radius=self.radius, through=through)

    def _follow(self, stroke: Stroke, role: Role, subtract: bool) -> Gesture:
        """Show what *stroke* would change until the release, then change it."""
        try:
            self._preview(stroke, role, subtract)
            while (pointer := (yield)).phase is Phase.MOVE:
                stroke.extend(pointer)
                self._preview(stroke, role, subtract)
                if isinstance(stroke, Brush):
                    self._draw_ring(pointer, role, subtract)
            if pointer.phase is Phase.RELEASE:
                stroke.extend(pointer)
                self._finish(stroke.mask, role, subtract)
        finally:
            self.colours.preview(None)
            self._outline.hide()

    def _preview(self, stroke: Stroke, role: Role, subtract: bool) -> None:
        changed = role.changed(stroke.mask, subtract=subtract)
        self.colours.preview(changed, rgb(PAPER) if subtract else role.colour)
        if stroke.outline is not None:
            self._outline.draw(stroke.outline)

    def _finish(self, vertices: BoolArray, role: Role, subtract: bool) -> None:
        self.remark = role.remark(vertices, subtract=subtract)
        if vertices.any():
            self.handle = role.take(vertices) if subtract else role.give(vertices)

    @property
    def _role(self) -> Role:
        return Role(self.session, self.paints, self.region, self.handle)

    def _next_to(self, vertices: BoolArray) -> BoolArray:
        return np.asarray(self.session.mesh.adjacency @ vertices.astype(float) > 0.0)

    # The ring.

    def _resize(self, clicks: int, pointer: Pointer) -> None:
        smallest, largest = (share * self.session.mesh.diagonal for share in (_SMALLEST, _LARGEST))
        self.radius = float(np.clip(self.radius * _LARGER**clicks, smallest, largest))
        self._draw_ring(pointer, self._role, pointer.control)

    def _draw_ring(self, pointer: Pointer, role: Role, subtract: bool) -> None:
        hits = under(self._picker, pointer, self.through) if self.view.contains(pointer) else []
        if hits:
            distance = self._picker.distances(hits, self.radius)
            self._ring.draw(distance, self.radius, rgb(PAPER) if subtract else role.colour)
        else:
            self._ring.hide()

    def _changed(self, change: Change) -> None:
        if change & Change.POSE:
            self._ring.hide()  # it lies where the surface was
