"""What every host of the editor does: sessions from surfaces, editors in plotters.

A plotter that already shows the mesh goes on showing it, with its scalars, colour map, texture and
shading: the actors of the host take the pose (`HostActors`), and the editor draws the mesh itself
only where it has colours of its own: those of fixed vertices, handles, regions and volume changes.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
import pyvista as pv
from numpy.typing import NDArray
from vtkmodules.util.numpy_support import vtk_to_numpy

from vtk_segdeform.arrays import FloatArray, IntArray
from vtk_segdeform.errors import ArgumentError
from vtk_segdeform.geometry import VertexNormals
from vtk_segdeform.importing import imported
from vtk_segdeform.io import of_its_kind, surface_of
from vtk_segdeform.mesh import Mesh
from vtk_segdeform.pictures import BODY, rgb
from vtk_segdeform.session import Change, Session

from .scene import Stop, SurfaceDisplay, SurfaceStyle, some_triangles

if TYPE_CHECKING:
    from .editor import DeformEditor, KeyChoice


def session_of(mesh: Any) -> Session:
    """Return a session over a mesh, a path or any surface; a session is returned itself."""
    if isinstance(mesh, Session):
        return mesh
    return Session(mesh if isinstance(mesh, Mesh) else surface_of(mesh))


def edited(mesh: Any, session: Session) -> Any:
    """Return what *session* made of *mesh*, of the same type."""
    if isinstance(mesh, Session):
        return session
    if isinstance(mesh, Mesh):
        return session.mesh.with_vertices(session.vertices)
    return of_its_kind(mesh, session.deformed)


_GAP = 0.01  # of the height of the view, between status line and scalar bars
_ALL = np.zeros((0, 3), dtype=np.uint8)  # instead of colours: all of the mesh is drawn


class _HostActor:
    """An actor of the host that shows a surface, and how its points follow.

    Parameters
    ----------
    actor : pyvista.Actor
        Its mapper gets a copy of its surface.
    ids : (q,) int
        The given point that each of its points is.
    """

    def __init__(self, actor: Any, ids: IntArray) -> None:
        self.actor, self._ids = actor, ids
        self._given = actor.mapper.dataset
        self._rest = np.array(self._given.points, dtype=np.float64)
        self._normals = self._given.point_data.active_normals
        self._shown = self._given.copy()
        self._shown.points = self._rest.copy()
        actor.mapper.dataset = self._shown

    def move(self, shifts: FloatArray, before: FloatArray, after: FloatArray) -> None:
        """Show each given point moved by its row of *shifts* (p, 3).

        Its normal turns as that of its vertex does, from its row of *before* to that of *after*.
        """
        self._shown.points[:] = self._rest + shifts[self._ids]
        self._shown.GetPoints().Modified()
        if self._normals is not None:
            a, b, n = before[self._ids], after[self._ids], self._normals
            middle = a + b
            least = np.finfo(np.float32).eps
            share = _dots(middle, n) / np.maximum(0.5 * _dots(middle, middle), least)
            self._shown.point_data.active_normals[:] = n - share * middle + 2.0 * _dots(a, n) * b
            self._shown.GetPointData().GetNormals().Modified()

    def restore(self) -> None:
        """Show the surface as before."""
        self.actor.mapper.dataset = self._given
        self.actor.visibility = True


def _dots(one: FloatArray, other: FloatArray) -> FloatArray:
    """Return the dot products of rows, as a column."""
    return np.asarray(np.einsum("ij,ij->i", one, other)[:, None])


class HostActors:
    """The actors of a plotter that show the surface of an editor, in its pose; and its scalar bars.

    The bars are kept above the status line of the editor.

    Parameters
    ----------
    plotter : pyvista.BasePlotter
        With the actors.
    editor : DeformEditor
        Whose session they show.
    """

    def __init__(self, plotter: pv.BasePlotter, editor: DeformEditor) -> None:
        self._editor, self._session = editor, editor.session
        self._time = -1
        self._colours: NDArray[np.uint8] | None = _ALL
        self._bars, self._heights = plotter.scalar_bars, dict[str, float]()
        self._stop = editor.view.before_render(self._update)
        rest = VertexNormals(self._session.mesh).of(self._session.mesh.vertices)
        self._normals = rest.astype(np.float64)
        self._actors = _actors_of(plotter, self._session)
        if self._actors:
            mapper = editor.widgets.surface.actor.GetMapper()
            mapper.SetRelativeCoincidentTopologyPolygonOffsetParameters(-1.0, -1.0)

    def _update(self) -> None:
        """Show the pose; called before every picture, until the editor is removed."""
        shown = self._editor.widgets.surface
        if not self._editor.view.renderer.HasViewProp(shown.actor):
            self._stop()
            return
        self._raise_bars()
        is_same = self._editor.session is self._session  # otherwise the editor has opened another
        is_draft = any(draft.GetVisibility() for draft in shown.actors[1:])
        is_seen = is_same and not is_draft and shown.style is SurfaceStyle.SHADED
        is_seen &= shown.only is None
        for each in self._actors:
            each.actor.visibility = is_seen
        if not (is_same and self._actors):
            return
        colours = shown.colours if is_seen else _ALL
        if colours is not self._colours:
            self._colours = colours
            triangles = shown.triangles if colours is _ALL else self._coloured(colours)
            shown.polydata.SetPolys(triangles)
        time = shown.polydata.GetPoints().GetMTime()
        if is_seen and time != self._time:
            self._time = time
            shifts = shown.points - self._session.mesh.vertices
            before, after = self._normals, self._normals_of(shown)
            if (surface := self._session.surface) is not None:
                shifts, before, after = map(surface.at_points, (shifts, before, after))
            for each in self._actors:
                each.move(shifts, before, after)

    def _normals_of(self, shown: SurfaceDisplay) -> FloatArray:
        """Return the shown normals (n, 3) of the vertices."""
        normals = vtk_to_numpy(shown.polydata.GetPointData().GetNormals())
        return np.array(normals[: self._session.mesh.n_vertices], dtype=np.float64)

    def _raise_bars(self) -> None:
        view = self._editor.view
        line = self._editor.controller.messages.height / max(view.renderer.GetSize()[1], 1)
        for name, bar in self._bars.items():
            if not view.renderer.HasViewProp(bar):  # of another subplot
                continue
            x, y = bar.GetPosition()
            y = self._heights.setdefault(name, y)
            bar.SetPosition(x, max(y, line + _GAP) if line else y)

    def _coloured(self, colours: NDArray[np.uint8] | None) -> Any:
        """Return the triangles of which all corners have another colour than the clay."""
        mesh = self._session.mesh
        own = np.zeros(mesh.n_faces, dtype=bool)
        if colours is not None:
            own = (colours != rgb(BODY).astype(np.uint8)).any(axis=1)[mesh.faces].all(axis=1)
        return some_triangles(mesh, own)

    def remove(self) -> None:
        """Show the surface as it was given."""
        self._stop()
        while self._actors:
            self._actors.pop().restore()


def _actors_of(plotter: pv.BasePlotter, session: Session) -> list[_HostActor]:
    """Return the visible actors of the current subplot whose points are those of *session*."""
    surface, found = session.surface, []
    given = session.mesh.vertices if surface is None else np.asarray(surface.given.points)
    for actor in list(plotter.renderer.actors.values()):
        data = getattr(getattr(actor, "mapper", None), "dataset", None)
        if not (isinstance(data, pv.PolyData) and actor.visibility):
            continue
        # pyvista doubles points at sharp edges, if they are shaded so.
        ids = np.asarray(data.point_data.get("vtkOriginalPointIds", np.arange(data.n_points)))
        is_known = len(ids) == data.n_points and ids.max(initial=-1) < len(given)
        if is_known and np.array_equal(data.points, given[ids].astype(data.points.dtype)):
            found.append(_HostActor(actor, ids))
    return found


def call_with_poses(callback: Callable[[Any], object], mesh: Any, session: Session) -> Stop:
    """Call *callback* with each pose of *session* but those of a drag, as `edited` returns it."""
    last = session.vertices

    def changed(_: Change) -> None:
        nonlocal last
        if not session.is_dragging and session.vertices is not last:
            last = session.vertices
            callback(session.deformed if mesh is session else edited(mesh, session))

    return session.on_change(changed)


def require_no_editor(plotter: pv.BasePlotter) -> None:
    """Raise an ArgumentError if the current subplot of *plotter* has an editor."""
    for each in plotter.segdeform.added:
        editor = getattr(each, "widgets", None)
        if editor is not None and plotter.renderer.HasViewProp(editor.surface.actor):
            raise ArgumentError(
                "this subplot has an editor already; remove it, or choose another subplot"
            )


def add_editor(plotter: pv.BasePlotter, session: Session, *, keys: KeyChoice) -> DeformEditor:
    """Add an editor to the current subplot of *plotter*, aim the camera, and switch it on."""
    imported("vtk_segdeform.widgets.editor")
    from .editor import DeformEditor

    editor = DeformEditor(plotter, session, keys=keys)
    plotter.segdeform.added += [editor, HostActors(plotter, editor)]
    if not plotter.camera_set:
        editor.controller.camera.begin(is_aimed=False)
        plotter.camera_set = True  # otherwise `show` would aim it again
    editor.On()
    return editor
