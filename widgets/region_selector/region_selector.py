"""Painting of regions, fixed vertices and handles on the mesh with the mouse.

A stroke adds vertices; with Control held it erases.  The vertices to change are previewed during
the stroke, the release records one undo step, and Escape cancels.

brush, component, region
                    a press beside the mesh moves the camera; the pointer shows what a press changes
lasso, rectangle    start anywhere in the view
all tools           a press with Alt held moves the camera
``[``  ``]``        smaller, larger brush; with Shift held the wheel over the mesh does the same

With a symmetry, strokes fix or stiffen both sides.  A change of regions resets the pose, as in
`Session`; fixed vertices and handles keep it.
`PaintTarget` says which vertices a stroke skips.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from vtk_segdeform.arrays import BoolArray, FloatArray, is_number
from vtk_segdeform.checks import require, shown
from vtk_segdeform.errors import ArgumentError, RegionError
from vtk_segdeform.pictures import PAPER, rgb
from vtk_segdeform.session import Change, Session

from ..picking import Picker
from ..scene import Gesture, Phase, Pointer, SurfaceDisplay, Widget
from .brush_ring import BrushRing
from .outline import Outline
from .paint_target import Paint, PaintTarget
from .region_colours import RegionColours, stiffness_colours
from .strokes import Brush, Lasso, Rectangle, Stroke, Tool, Whole, shares_of

__all__ = ["Paint", "RegionSelector", "Tool"]

_RADIUS = 0.05  # the initial radius, in diagonals of the mesh
_SMALLEST_RADIUS, _LARGEST_RADIUS = 1e-4, 2.0  # in diagonals
_GROWTH = 1.2  # factor for one click of the wheel or one key press


class RegionSelector(Widget):
    """Paints regions, fixed vertices and handles with a brush, a lasso and other tools.

    Parameters
    ----------
    view : View, pyvista.Plotter or (vtkRenderer, vtkRenderWindowInteractor)
        The view to work in.  Call `remove` before its window closes.
    session : Session
        The session to edit.
    surface : SurfaceDisplay, optional
        The displayed mesh; by default the widget adds its own.
    colours : RegionColours, optional
        The region colours of *surface*, also used for the preview; by default the widget adds its
        own.

    Attributes
    ----------
    paints : Paint
        Whether strokes paint a region, fixed vertices, a handle or the stiffness.
    region : int
        The region to paint; the number of regions stands for a new one.
    handle : str or None
        The handle to paint, which need not exist yet.  With None, the next stroke creates a handle
        and sets its name here.
    stiffness : float
        The stiffness to paint, relative to the rest of the surface; infinite: rigid.
    through : bool
        Whether hidden vertices are painted too (X-ray).
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
        self.stiffness = 10.0
        self.through = False
        self._tool = Tool.BRUSH
        self._radius = _RADIUS * session.mesh.diagonal
        self._hovered: tuple[object, ...] = ()  # what the preview under the pointer depends on
        self._cleanup: list[Callable[[], None]] = []  # called in reverse order by `remove`
        if surface is None:
            surface = SurfaceDisplay(self.view, session)
            self._cleanup.append(surface.remove)
        if colours is None:
            colours = RegionColours(surface)
            self._cleanup.append(colours.remove)
        self.surface, self.colours = surface, colours
        self._picker = Picker(surface)
        self._ring, self._outline = BrushRing(surface), Outline(self.view)
        self._cleanup += [self._ring.remove, self._outline.remove, session.on_change(self._changed)]

    @property
    def tool(self) -> Tool:
        """The tool of the next stroke."""
        return self._tool

    @tool.setter
    def tool(self, tool: Tool) -> None:
        self._tool = require(tool, Tool, "tool")
        self.leave()
        self._invoke("ModifiedEvent")

    @property
    def radius(self) -> float:
        """The radius of the brush along the surface, in the mesh's unit."""
        return self._radius

    @radius.setter
    def radius(self, radius: float) -> None:
        if not (is_number(radius) and radius > 0.0):
            raise ArgumentError(f"radius must be above 0; got {shown(radius)}")
        self._radius = radius
        self._invoke("ModifiedEvent")

    def grow(self) -> None:
        """Add one ring of neighbours to the painted region, fixed vertices or handle."""
        members = self._target.members_to("grow")
        self.handle = self._target.add(self._neighbours(members))

    def shrink(self) -> None:
        """Remove the outermost ring of the painted region, fixed vertices or handle."""
        members = self._target.members_to("shrink")
        self.handle = self._target.erase(members & self._neighbours(~members))

    def select_all(self) -> None:
        """Add all vertices that are free to the painted region, fixed vertices or handle."""
        target = self._target
        everything = np.ones(self.session.mesh.n_vertices, dtype=bool)
        self.remark = target.remark(everything & target.shown, erase=False)
        self.handle = target.select_all()

    def select_none(self) -> None:
        """Remove all vertices from the painted fixed vertices or handle."""
        self.handle = self._target.select_none()

    def invert(self) -> None:
        """Exchange the painted fixed vertices or handle for the free vertices outside."""
        self.handle = self._target.invert()

    def region_under_pointer(self) -> int | None:
        """Return the region of largest blend weight at the pointer, or None beside the mesh."""
        hit = self._picker.hit(self.view.pointer(Phase.HOVER))
        regions = self.session.regions
        return None if hit is None or regions is None else regions.label_at(hit.vertex)

    def remove(self) -> None:
        """Remove the widget from the view permanently."""
        self.Off()
        while self._cleanup:
            self._cleanup.pop()()

    # Events.
    def on_press(self, press: Pointer) -> Gesture | None:
        """Start a stroke; pass the press to the camera beside the mesh."""
        stroke = self._stroke_from(press)
        return None if stroke is None else self._follow(stroke, self._target, press.control)

    def on_hover(self, pointer: Pointer) -> None:
        """Show the ring of the brush, or the part or region under the pointer."""
        if self.tool is Tool.BRUSH:
            self._draw_ring(pointer, self._target, pointer.control)
        elif self.tool in (Tool.COMPONENT, Tool.REGION):
            self._preview_whole(pointer)

    def on_wheel(self, pointer: Pointer, clicks: int) -> bool:
        """Resize the brush over the mesh with Shift held; else pass the wheel to the camera."""
        if self.is_grabbing:
            return True  # camera and radius stay the same during a stroke
        if self.tool is not Tool.BRUSH or not pointer.shift:
            return False
        if self._picker.hit(pointer) is None:
            return False
        self._resize(clicks, pointer)
        return True

    def on_key(self, key: str, pointer: Pointer) -> bool:
        """Resize the brush with the bracket keys."""
        clicks = {"bracketleft": -1, "bracketright": +1}.get(key)
        if clicks is None or self.tool is not Tool.BRUSH:
            return False
        if not self.is_grabbing:
            self._resize(clicks, pointer)
        return True

    # Strokes.

    def _stroke_from(self, press: Pointer) -> Stroke | None:
        picker, through = self._picker, self.through
        if self.tool is Tool.LASSO:
            return Lasso(picker, press, through=through)
        if self.tool is Tool.RECTANGLE:
            return Rectangle(picker, press, through=through)
        hit = picker.hit(press)
        if hit is None:
            return None
        if self.tool is Tool.COMPONENT:
            return Whole(picker.component(hit.vertex))
        if self.tool is Tool.REGION:
            return Whole(self._region_at(hit.vertex))
        return Brush(picker, press, radius=self.radius, through=through)

    def _region_at(self, vertex: int) -> BoolArray:
        """Return the vertices, (n,) bool, of the region of largest blend weight at *vertex*."""
        regions = self.session.regions
        if regions is None:
            raise RegionError("No regions yet: detect or paint them first")
        return np.array(regions.membership[regions.label_at(vertex)], dtype=bool)

    def _follow(self, stroke: Stroke, target: PaintTarget, erase: bool) -> Gesture:
        """Preview the changes of *stroke* until the release, then apply them."""
        self._hovered = ()
        try:
            self._preview(stroke, target, erase)
            while (pointer := (yield)).phase is Phase.MOVE:
                stroke.extend(pointer)
                self._preview(stroke, target, erase)
                if isinstance(stroke, Brush):
                    self._draw_ring(pointer, target, erase)
            if pointer.phase is Phase.RELEASE:
                stroke.extend(pointer)
                self._apply(self._shares(stroke, target), target, erase)
        finally:
            self.colours.preview(None)
            self._outline.hide()

    def _preview(self, stroke: Stroke, target: PaintTarget, erase: bool) -> None:
        shares = self._shares(stroke, target)
        changed = target.changed(shares > 0.0, erase=erase)
        colour = rgb(PAPER) if erase else target.colour
        if target.paint is Paint.STIFFNESS:
            after = target.stiffened(shares, erase=erase)
            colour = stiffness_colours(after[changed])
        self.colours.preview(changed, colour)
        if stroke.outline is not None:
            self._outline.draw(stroke.outline)

    def _preview_whole(self, pointer: Pointer) -> None:
        """Preview what a press at *pointer* would change with the tools for a part or region."""
        hit = self._picker.hit(pointer) if self.view.contains(pointer) else None
        regions = self.session.regions
        if hit is None or (self.tool is Tool.REGION and regions is None):
            self.leave()
            return
        if self.tool is Tool.REGION and regions is not None:
            number = regions.label_at(hit.vertex)
        else:
            number = int(self.session.mesh.components[hit.vertex])
        target = self.paints, self.region, self.handle
        now = self.tool, number, pointer.control, *target, self.session.state
        if now == self._hovered:
            return
        stroke = self._stroke_from(pointer)
        if stroke is not None:
            self._preview(stroke, self._target, pointer.control)
            self._hovered = now

    def leave(self) -> None:
        """Hide the ring and the preview under the pointer."""
        self._ring.hide()
        if self._hovered:
            self._hovered = ()
            self.colours.preview(None)

    def _shares(self, stroke: Stroke, target: PaintTarget) -> FloatArray:
        """Return `shares_of` a stroke, and of its mirror image where that has the same effect.

        Hidden vertices are not selected.

        With a symmetry, fixed vertices and stiffness count on both sides.  A handle on both sides
        could move along the plane only, and their regions are not mirrored.
        """
        shares = shares_of(stroke)
        is_mirrored = target.paint in (Paint.FIXED, Paint.STIFFNESS)
        mirror = self.session.poses.mirror(self.session.state) if is_mirrored else None
        shares = shares if mirror is None else np.maximum(shares, shares[mirror.mates])
        return np.where(target.shown, shares, 0.0)

    def _apply(self, shares: FloatArray, target: PaintTarget, erase: bool) -> None:
        vertices = shares > 0.0
        self.remark = target.remark(vertices, erase=erase)
        if target.paint is Paint.STIFFNESS:
            if vertices.any():
                target.stiffen(shares, erase=erase)
                self.remark = "Stiffness counts from the next move"
        elif vertices.any():
            self.handle = target.erase(vertices) if erase else target.add(vertices)

    @property
    def _target(self) -> PaintTarget:
        target = PaintTarget(self.session, self.paints, self.region, self.handle, self.stiffness)
        only = self.surface.only
        return target if only is None else replace(target, shown=only)

    def _neighbours(self, vertices: BoolArray) -> BoolArray:
        """Return the vertices, (n,) bool, that share an edge with one of *vertices*."""
        return np.asarray(self.session.mesh.adjacency @ vertices.astype(float) > 0.0)

    # The ring.

    def _resize(self, clicks: int, pointer: Pointer) -> None:
        diagonal = self.session.mesh.diagonal
        radius = self.radius * _GROWTH**clicks
        self.radius = float(
            np.clip(radius, _SMALLEST_RADIUS * diagonal, _LARGEST_RADIUS * diagonal)
        )
        self._draw_ring(pointer, self._target, pointer.control)

    def _draw_ring(self, pointer: Pointer, target: PaintTarget, erase: bool) -> None:
        hit = self._picker.hit(pointer) if self.view.contains(pointer) else None
        if hit is None:
            self._ring.hide()
        else:
            segments = self._picker.ring(hit, self.radius)
            self._ring.draw(segments, rgb(PAPER) if erase else target.colour)

    def _changed(self, change: Change) -> None:
        if change & Change.POSE:
            self._ring.hide()  # the surface has moved away from it
        if change & (Change.POSE | Change.REGIONS | Change.CONSTRAINTS) and not self.is_grabbing:
            self.leave()
