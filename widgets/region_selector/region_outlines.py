"""The outlines of the regions as thin lines on the surface, and their numbers, from 1.

An outline crosses the edges between two regions at their middle.  The number of a region is at a
visible place near the centre of the region, and has its colour as background.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import vtkmodules.vtkRenderingFreeType  # noqa: F401 - required to draw text
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkRenderingCore import vtkTextActor

from vtk_segdeform.arrays import FloatArray, IntArray
from vtk_segdeform.pictures import INK, ink_on, of_region, rgb
from vtk_segdeform.session import Change

from ..picking import Picker
from ..scene import Phase, Pointer, Stop, SurfaceDisplay, Wireframe

_LINE_WIDTH, _LETTERS = 1.6, 14  # pixels
_PLACES = 24  # per region, where its number may be
_SAMPLE = 300  # vertices of a region from which they are chosen
_HIDDEN = 0.01  # diagonals between a place and the surface in front of it
_FACING = -0.4  # cosine of the angle between normal and view
_NO_POINTS = np.empty(0, dtype=np.int64)


class RegionOutlines:
    """Outlines and numbers of the regions of a session; hidden until `show`."""

    def __init__(self, surface: SurfaceDisplay) -> None:
        self._surface, self._view = surface, surface.view
        self._session = surface.session
        self._picker = Picker(surface)
        self._lines = self._numbers = False
        self._outline: Wireframe | None = None
        self._ends: IntArray = np.empty((0, 2), dtype=np.int64)
        self._labels: list[tuple[Any, IntArray]] = []  # text, and the vertices where it may be
        self._stops: list[Stop] = [
            self._session.on_change(self._changed),
            self._view.before_render(self._lay_out),
        ]

    @property
    def n_numbers(self) -> int:
        """How many numbers the last picture shows."""
        return sum(bool(text.GetVisibility()) for text, _ in self._labels)

    def show(self, *, lines: bool, numbers: bool) -> None:
        """Show or hide the outlines and the numbers."""
        if (lines, numbers) != (self._lines, self._numbers):
            self._lines, self._numbers = lines, numbers
            self._rebuild()

    def remove(self) -> None:
        """Remove everything from the view, permanently."""
        for stop in self._stops:
            stop()
        self.show(lines=False, numbers=False)

    def _changed(self, change: Change) -> None:
        if change & Change.REGIONS:
            self._rebuild()
        elif change & Change.POSE and self._outline is not None:
            self._outline.move(self._surface.points[self._ends].mean(axis=1))

    def _rebuild(self) -> None:
        renderer, regions = self._view.renderer, self._session.regions
        if self._outline is not None:
            renderer.RemoveActor(self._outline.actor)
            self._outline = None
        for text, _ in self._labels:
            renderer.RemoveViewProp(text)
        self._labels = []
        if regions is not None and self._lines:
            self._ends, edges = _borders(regions.labels, self._session.mesh.faces)
            points = self._surface.points[self._ends].mean(axis=1)
            self._outline = Wireframe(points, edges, _NO_POINTS)
            self._outline.actor.GetProperty().LightingOff()
            renderer.AddActor(self._outline.actor)
        if regions is not None and self._numbers:
            for region, members in enumerate(regions.membership):
                own = np.flatnonzero(members & (regions.membership.sum(axis=0) == 1))
                ids = own if len(own) else np.flatnonzero(members)
                text = _number(region)
                renderer.AddViewProp(text)
                self._labels.append((text, _spread(self._session.mesh.vertices, ids)))
        self._view.request_render()

    def _lay_out(self) -> None:
        """Scale lines and numbers with the window, and place the numbers where they are seen."""
        if not (self._outline or self._labels):
            return
        scale = self._view.scale
        if self._outline is not None:
            self._outline.set_style(rgb(INK), line_width=scale * _LINE_WIDTH, sphere_size=1.0)
        dots = self._view.renderer.GetRenderWindow().GetDPI() or 72
        size = max(6, round(scale * _LETTERS * 72 / dots))
        for text, vertices in self._labels:
            text.GetTextProperty().SetFontSize(size)
            self._place(text, vertices, max(1, round(scale)))

    def _place(self, text: Any, vertices: IntArray, frame: int) -> None:
        display = self._view.to_display(self._surface.points[vertices])
        in_front = np.isfinite(display).all(axis=1)  # of the camera
        vertices, display = vertices[in_front], display[in_front]
        points = self._surface.points[vertices]
        normals = vtk_to_numpy(self._surface.polydata.GetPointData().GetNormals())[vertices]
        turned_away = normals @ self._view.view_direction > _FACING  # last choice: at a silhouette
        middle = display[:, :2].mean(axis=0) if len(display) else np.zeros(2)
        away = np.linalg.norm(display[:, :2] - middle, axis=1)
        order = np.lexsort((away, turned_away))
        place = next((display[k] for k in order if self._sees(display[k], points[k])), None)
        text.SetVisibility(place is not None)
        if place is not None:
            x, y = place[:2] - self._view.renderer.GetOrigin()
            text.GetTextProperty().SetFrameWidth(frame)
            text.SetPosition(float(x), float(y))

    def _sees(self, at: FloatArray, point: FloatArray) -> bool:
        """Return whether nothing is in front of *point* (3,), displayed at *at*."""
        pointer = Pointer(Phase.HOVER, float(at[0]), float(at[1]))
        if not self._view.contains(pointer):
            return False
        if self._session.is_dragging:  # a search structure for each frame would be too slow
            return True
        return self._picker.sees(point, within=_HIDDEN * self._session.mesh.diagonal)


def _borders(labels: IntArray, faces: IntArray) -> tuple[IntArray, IntArray]:
    """Return the points of the outline, each in the middle of two vertices (p, 2), and its edges.

    In a triangle with two *labels* the outline joins the middles of two sides, in one with three
    labels the middles of all sides.
    """
    a, b, c = (labels[corner] for corner in faces.T)
    mixed = faces[(a != b) | (b != c)]
    sides = np.sort(np.stack([mixed, mixed[:, [1, 2, 0]]], axis=2), axis=2)  # (m, 3, 2)
    crossed = labels[sides[:, :, 0]] != labels[sides[:, :, 1]]
    middles, number = np.unique(sides[crossed], axis=0, return_inverse=True)
    at = np.full(crossed.shape, -1)
    at[crossed] = number.ravel()
    edges = np.concatenate([at[:, [0, 1]], at[:, [1, 2]], at[:, [2, 0]]])
    return middles, edges[(edges >= 0).all(axis=1)]


def _spread(vertices: FloatArray, ids: IntArray) -> IntArray:
    """Return some of the vertices *ids*, far from each other."""
    ids = ids[:: max(1, len(ids) // _SAMPLE)]
    points = vertices[ids]
    chosen = [int(np.linalg.norm(points - points.mean(axis=0), axis=1).argmin())]
    nearest = np.linalg.norm(points - points[chosen[0]], axis=1)
    for _ in range(min(_PLACES, len(ids)) - 1):
        chosen.append(int(nearest.argmax()))
        nearest = np.minimum(nearest, np.linalg.norm(points - points[chosen[-1]], axis=1))
    return np.asarray(ids[chosen])


def _number(region: int) -> Any:
    text, colour = vtkTextActor(), of_region(region)
    text.SetInput(f" {region + 1} ")
    text.SetTextScaleModeToNone()
    text.PickableOff()
    style = text.GetTextProperty()
    style.BoldOn()
    style.SetColor(*(rgb(ink_on(colour)) / 255.0))
    style.SetBackgroundColor(*(colour / 255.0))
    style.SetBackgroundOpacity(1.0)
    style.FrameOn()
    style.SetFrameColor(*(rgb(INK) / 255.0))
    style.SetJustificationToCentered()
    style.SetVerticalJustificationToCentered()
    return text
