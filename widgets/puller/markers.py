"""Pins and pulled points as dots of constant size: black with a white rim, pulled points smaller.

Dots that the body hides are drawn faintly through it.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkPolyData
from vtkmodules.vtkRenderingCore import vtkActor, vtkPolyDataMapper

from vtk_segdeform.arrays import FloatArray
from vtk_segdeform.pictures import COLOURS, PAPER, rgb
from vtk_segdeform.session import Session, pulls

from ..picking import Picker
from ..scene import Pointer, SurfaceDisplay, View, cells_of, points_of

_BLACK, _HIGHLIGHT = "#101010", COLOURS[4]
_PIN, _PULLED, RIM = 11.0, 7.0, 4.0  # pixels: the dots, and both sides of the rim together
THROUGH = 0.25  # opacity of dots that the body hides
_REACH = 10.0  # pixels from the pointer


class Markers:
    """Markers of pins and of pulled points; hidden until `show`.

    Parameters
    ----------
    surface : SurfaceDisplay
        The displayed mesh.
    picker : Picker
        Decides which dots are visible.
    is_hidden : callable
        ``is_hidden(name)``: whether a pin or pulled point is not shown.
    """

    def __init__(
        self, surface: SurfaceDisplay, picker: Picker, is_hidden: Callable[[str], bool]
    ) -> None:
        self._surface, self._picker, self._view = surface, picker, surface.view
        self._is_hidden = is_hidden
        self._vertices: dict[str, int] = {}
        self._highlighted: str | None = None
        self._is_shown = False
        self._pins, self._pulled = RimmedDots(self._view), RimmedDots(self._view)
        self._bright = Dots(self._view.renderer)
        self._stop = self._view.before_render(self._lay_out)

    def show(self, shown: bool) -> None:
        """Show the current pins and pulled points, or hide them."""
        self._is_shown = shown
        self._vertices = marked_vertices(self._surface.session) if shown else {}
        if self._highlighted not in self._vertices:
            self._highlighted = None
        self._view.request_render()

    def vertex(self, name: str) -> int:
        """Return the marked vertex of a handle."""
        return self._vertices[name]

    def at(self, pointer: Pointer) -> str | None:
        """Return the visible marker nearest to *pointer* and near it, or None."""
        shown = self._shown
        if not shown:
            return None
        nearest = nearest_seen(
            self._view, self._picker, pointer, self._surface.points[list(shown.values())]
        )
        return None if nearest is None else list(shown)[nearest]

    def reaches(self, rectangle: tuple[float, float, float, float]) -> bool:
        """Return whether a marker is in a *rectangle*: left, bottom, right, top in the window."""
        places = self._view.to_display(self._surface.points[list(self._shown.values())])[:, :2]
        low, high = np.reshape(rectangle, (2, 2))
        away = np.maximum(low - places, places - high).max(axis=1)
        return bool((away < _REACH * self._view.scale).any())

    def highlight(self, name: str | None) -> None:
        """Highlight one marker, or none."""
        if name != self._highlighted:
            self._highlighted = name
            self._view.request_render()

    def remove(self) -> None:
        """Remove the dots from the view permanently."""
        self._stop()
        for dots in (self._pins, self._pulled, self._bright):
            dots.remove()

    @property
    def _shown(self) -> dict[str, int]:
        only = self._surface.only
        return {
            name: vertex
            for name, vertex in self._vertices.items()
            if not self._is_hidden(name) and (only is None or only[vertex])
        }

    def _lay_out(self) -> None:
        """Place the dots in front of the surface, as seen from the camera."""
        scale, pulls, shown = self._view.scale, self._surface.session.state.pulls, self._shown
        for dots, is_pin, size in ((self._pins, True, _PIN), (self._pulled, False, _PULLED)):
            ids = [v for name, v in shown.items() if (name in pulls) is not is_pin]
            places = self._surface.points[np.array(ids, dtype=np.int64)]
            dots.draw(places, size, rim=PAPER, fill=_BLACK, through=_BLACK)
        place, size = np.empty((0, 3)), _PULLED if self._highlighted in pulls else _PIN
        if self._highlighted is not None:
            vertex = self._surface.points[[self._vertices[self._highlighted]]]
            place = self._view.lifted(vertex, 2.0 * scale * size)
        self._bright.draw(place, _HIGHLIGHT, scale * size)


def marked_vertices(session: Session) -> dict[str, int]:
    """Return the vertex of every pin and pulled point of a session by its name."""
    found = {}
    for name, ids in session.handles.items():
        if len(ids) == 1 or name in session.state.pulls:
            found[name] = pulls.middle_vertex(session.mesh, ids)
    return found


def nearest_seen(view: View, picker: Picker, pointer: Pointer, places: FloatArray) -> int | None:
    """Return which of *places* (k, 3) is nearest to *pointer*, near it and visible; or None."""
    away = np.linalg.norm(view.to_display(places)[:, :2] - pointer.position, axis=1)
    away[np.isnan(away)] = np.inf
    for k in np.argsort(away):
        if not away[k] <= _REACH * view.scale:
            break
        if picker.sees(places[k], within=_REACH * view.pixel_at(places[k])):
            return int(k)
    return None


class RimmedDots:
    """Dots with a rim in front of the surface, drawn faintly where the body hides them."""

    def __init__(self, view: View) -> None:
        self._view = view
        self._rim, self._fill = Dots(view.renderer), Dots(view.renderer)
        self._through = Dots(view.foreground)

    def draw(self, places: FloatArray, size: float, *, rim: str, fill: str, through: str) -> None:
        """Show dots of *size* pixels of 96 an inch at *places* (k, 3), in these colours."""
        scale, lifted = self._view.scale, partial(_lifted, self._view, places)
        wide = scale * (size + RIM)
        self._rim.draw(lifted(wide), rim, wide)
        self._fill.draw(lifted(1.2 * wide), fill, scale * size)
        self._through.draw(places, through, scale * size, THROUGH)

    def remove(self) -> None:
        """Remove them from the view permanently."""
        for dots in (self._rim, self._fill, self._through):
            dots.remove()


def _lifted(view: View, places: FloatArray, pixels: float) -> FloatArray:
    return view.lifted(places, pixels) if len(places) else places


class Dots:
    """Points as discs or spheres of constant size on the screen."""

    def __init__(self, renderer: Any) -> None:
        self._renderer = renderer
        self._data = vtkPolyData()
        mapper = vtkPolyDataMapper()
        mapper.SetInputData(self._data)
        self._actor = vtkActor()
        self._actor.SetMapper(mapper)
        self._actor.PickableOff()
        self._actor.UseBoundsOff()  # the mesh has the same bounds
        self._actor.GetProperty().RenderPointsAsSpheresOn()
        self._actor.GetProperty().LightingOff()
        self._actor.VisibilityOff()
        renderer.AddActor(self._actor)

    def draw(self, places: FloatArray, colour: str, size: float, opacity: float = 1.0) -> None:
        """Show discs of *size* pixels at *places* (k, 3); none hides them."""
        self._actor.SetVisibility(len(places) > 0)
        if not len(places):
            return
        if len(places) != self._data.GetNumberOfPoints():
            self._data.SetVerts(cells_of(np.arange(len(places))[:, None]))
        self._data.SetPoints(points_of(places))
        style = self._actor.GetProperty()
        style.SetColor(*(rgb(colour) / 255.0))
        style.SetPointSize(size)
        style.SetOpacity(opacity)

    def remove(self) -> None:
        """Remove them from the renderer permanently."""
        self._renderer.RemoveActor(self._actor)
