"""The files that a session carries along: translucent, before the body and faintly through it.

Of a surface the faces are drawn, of a grid those of its surface, of curves the lines, and points
that have neither as dots.  Where there are many points, a regular grid divides them, and one of
each grid cell stands for all of it: the frames of a drag then cost the same for any file.  While
something moves in a view that is drawn in software, nothing of it is drawn until the release.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from vtkmodules.util.numpy_support import numpy_to_vtk
from vtkmodules.vtkCommonDataModel import vtkPolyData
from vtkmodules.vtkRenderingCore import vtkActor, vtkPolyDataMapper

from vtk_segdeform.arrays import FloatArray, IntArray
from vtk_segdeform.errors import SegDeformError
from vtk_segdeform.pictures import rgb
from vtk_segdeform.session import Change, Session

from .draft import Draft, observe_drafts
from .view import View
from .wireframe import cells_of, points_of

CARRIED_COLOUR = "#3E6472"  # slate: of no region, handle or landmark
_BEFORE, _THROUGH = 0.35, 0.15  # opacities
_LINE, _DOT = 2.0, 5.0  # pixels
_MOST = 2_500  # points that are drawn of a file
_FAST = 0.010  # seconds for a picture by a graphics card; in software these layers double a frame
_COARSER = 1.2  # factor of the grid until they are not more


class _Drawn(NamedTuple):
    """A file in the view."""

    points: FloatArray  # (k, 3), at rest
    data: vtkPolyData
    actors: tuple[vtkActor, vtkActor]  # before the body, and through it


class CarriedDisplay:
    """Shows what a session carries along; no widget: it cannot be picked.

    Parameters
    ----------
    view : View
        Where it is drawn.
    session : Session
        The session.

    Attributes
    ----------
    follows_drags : bool
        Whether it moves in the frames of a drag, and not only at the release.
    """

    def __init__(self, view: View, session: Session) -> None:
        self._view, self._session = view, session
        self.follows_drags = True
        self._drawn: dict[object, _Drawn | None] = {}  # None: it cannot be read
        self._hidden, self._is_shown = set[str](), True
        self._is_left_out = False  # of pictures in motion, which are slow
        self._stops = [
            session.on_change(self._changed),
            view.before_render(self._set_sizes),
            observe_drafts(view.interactor, self._leave_out),
        ]
        self._show_all()

    def is_hidden(self, name: str) -> bool:
        """Return whether a file is hidden."""
        return name in self._hidden

    def hide(self, name: str, hidden: bool) -> None:
        """Hide a file, or show it again."""
        (self._hidden.add if hidden else self._hidden.discard)(name)
        self._show_all()

    @property
    def is_shown(self) -> bool:
        """Whether all are shown that are not hidden."""
        return self._is_shown

    @is_shown.setter
    def is_shown(self, shown: bool) -> None:
        if shown != self._is_shown:
            self._is_shown = shown
            self._show_all()

    def has_fault(self, name: str) -> bool:
        """Return whether a file cannot be read."""
        return self._drawn.get(self._session.carried[name]) is None

    def copy_settings(self, before: CarriedDisplay) -> None:
        """Hide what *before* hides, and follow drags as it does."""
        self._hidden, self.follows_drags = set(before._hidden), before.follows_drags
        self._show_all()

    def remove(self) -> None:
        """Remove all from the view, permanently."""
        for stop in self._stops:
            stop()
        for file in list(self._drawn):
            self._take_away(file)

    def _leave_out(self, begins: bool) -> None:
        begins &= Draft.of(self._view).seconds > _FAST
        if begins != self._is_left_out:
            self._is_left_out = begins
            self._show_all()

    def _changed(self, change: Change) -> None:
        if change & Change.CARRIED:
            self._show_all()
        elif self.follows_drags or not self._session.is_dragging:
            self._move()

    def _show_all(self) -> None:
        carried = self._session.carried
        for file in [file for file in self._drawn if file not in carried.values()]:
            self._take_away(file)
        for name, file in carried.items():
            if file not in self._drawn:
                try:
                    self._drawn[file] = self._made(*_thinned(*file.follower.drawn))
                except SegDeformError:
                    self._drawn[file] = None
            if (drawn := self._drawn[file]) is not None:
                for actor in drawn.actors:
                    actor.SetVisibility(self._is_visible(name))
        self._move()

    def _is_visible(self, name: str) -> bool:
        return self._is_shown and not self._is_left_out and name not in self._hidden

    def _made(self, points: FloatArray, *cells: IntArray) -> _Drawn:
        data = vtkPolyData()
        data.SetPoints(points_of(points))
        for put, corners in zip((data.SetPolys, data.SetLines, data.SetVerts), cells, strict=True):
            put(cells_of(corners))
        mapper = vtkPolyDataMapper()
        mapper.SetInputData(data)
        actors = vtkActor(), vtkActor()
        for renderer, actor, opacity in zip(
            self._renderers, actors, (_BEFORE, _THROUGH), strict=True
        ):
            actor.SetMapper(mapper)
            actor.PickableOff()
            actor.GetProperty().SetColor(*(rgb(CARRIED_COLOUR) / 255.0))
            # Lines and dots are thin enough.
            actor.GetProperty().SetOpacity(opacity if len(cells[0]) else min(1.0, 2.0 * opacity))
            renderer.AddActor(actor)
        return _Drawn(points, data, actors)

    @property
    def _renderers(self) -> tuple[Any, Any]:
        return self._view.renderer, self._view.foreground

    def _take_away(self, file: object) -> None:
        drawn = self._drawn.pop(file)
        if drawn is not None:
            for renderer, actor in zip(self._renderers, drawn.actors, strict=True):
                renderer.RemoveActor(actor)
        self._view.request_render()

    def _move(self) -> None:
        """Move all that is shown to where the pose takes it."""
        session = self._session
        for name, file in session.carried.items():
            drawn = self._drawn.get(file)
            if drawn is not None and self._is_visible(name):
                live = session.is_dragging
                places = session.poses.carry_often(session.state, drawn.points, live=live)
                drawn.data.GetPoints().SetData(numpy_to_vtk(places, deep=True))
        if self._drawn:
            self._view.request_render()

    def _set_sizes(self) -> None:
        """Scale lines and dots with the window."""
        for drawn in filter(None, self._drawn.values()):
            for actor in drawn.actors:
                actor.GetProperty().SetLineWidth(_LINE * self._view.scale)
                actor.GetProperty().SetPointSize(_DOT * self._view.scale)


def _thinned(
    points: FloatArray, triangles: IntArray, edges: IntArray
) -> tuple[FloatArray, IntArray, IntArray, IntArray]:
    """Return at most `_MOST` of *points*, the cells between them, and those in none as dots."""
    low, size = points.min(axis=0), float(np.ptp(points, axis=0).max())
    kept = stands_for = np.arange(len(points))
    spacing = size / np.sqrt(_MOST)
    while len(kept) > _MOST:
        cells = np.floor((points - low) / spacing).astype(np.int64)
        number = cells @ (1 << np.array([42, 21, 0]))
        _, kept, stands_for = np.unique(number, return_index=True, return_inverse=True)
        spacing *= _COARSER
    dots = np.setdiff1d(np.arange(len(points)), np.append(triangles, edges))
    triangles, edges = (stands_for[each] for each in (triangles, edges))
    ends = np.sort(triangles, axis=1)
    triangles = triangles[(np.diff(ends, axis=1) > 0).all(axis=1)]
    edges = np.unique(edges[edges[:, 0] != edges[:, 1]], axis=0)
    return points[kept], triangles, edges, np.unique(stands_for[dots])[:, None]
