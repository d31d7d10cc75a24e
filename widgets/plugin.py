"""The extension of pyvista's plotters and meshes, and `edit`.

    plotter.segdeform.edit(mesh)                     the editor, in an existing plotter
    plotter.segdeform.add_volume_overlay(session)    the local volume change, in colours
    mesh.segdeform(fixed, handle, targets)    a deformed copy with all arrays
    mesh.segdeform.regions(3)                        a copy with arrays of its regions
    mesh.segdeform.check()                           the faults that prevent deforming it
    mesh.segdeform.repair()                          a repaired copy, with its arrays

pyvista finds this module by its entry points when ``segdeform`` is first used.  pyvistaqt hides
those of plotters: there, and if the package is not installed, ``import vtk_segdeform`` after
pyvista or ``import vtk_segdeform.widgets.plugin``.
"""

from __future__ import annotations

import logging
import os
from typing import TYPE_CHECKING, Any, overload

import numpy as np
import pyvista as pv
from numpy.typing import ArrayLike

from vtk_segdeform import io
from vtk_segdeform.checks import as_path, as_text, require, shown
from vtk_segdeform.deformer import deform
from vtk_segdeform.errors import ArgumentError
from vtk_segdeform.io import repair_surface, triangles_of
from vtk_segdeform.mesh import Mesh, MeshReport, find_faults
from vtk_segdeform.pictures import require_screen
from vtk_segdeform.progress import Progress
from vtk_segdeform.regions import segment
from vtk_segdeform.session import Session

if TYPE_CHECKING:
    from .editor import DeformEditor
    from .volume_overlay import VolumeOverlay

_Path = str | os.PathLike[str] | None
_log = logging.getLogger(__name__)

_HANDLE_MET = 1e-3  # of the diagonal


@overload
def edit(mesh: Mesh, *, path: _Path = None, title: str = ...) -> Mesh: ...
@overload
def edit(mesh: Session, *, path: _Path = None, title: str = ...) -> Session: ...
@overload
def edit(mesh: pv.PolyData, *, path: _Path = None, title: str = ...) -> pv.PolyData: ...
def edit(mesh: Any, *, path: _Path = None, title: str = "segdeform") -> Any:
    """Open a window to deform *mesh*; return the deformed mesh when the window closes.

    Parameters
    ----------
    mesh : Mesh, pyvista.PolyData or Session
        A closed surface, or a session to continue.
    path : path, optional
        The file that the editor's keys save and open.
    title : str
        Title of the window.

    Returns
    -------
    deformed : of the type of *mesh*
        A deformed copy; a PolyData with all its arrays.  A session is returned itself, unless
        another one was opened in the editor.  With pyvista's OFF_SCREEN the window closes at
        once.

    Raises
    ------
    MeshError
        If *mesh* is a PolyData but not a closed, outward oriented two-manifold.
    MissingDependencyError
        If there is no screen.
    """
    session = session_of(mesh)
    path = None if path is None else as_path(path)
    as_text(title, "title")
    if not pv.OFF_SCREEN:
        require_screen()
    plotter = pv.Plotter(title=title, notebook=False)
    try:
        editor = plotter.segdeform.edit(session, path=path)
        plotter.show()
    finally:
        plotter.close()
    if isinstance(mesh, Session):
        return editor.session
    if isinstance(mesh, Mesh):
        return editor.session.mesh.with_vertices(editor.session.vertices)
    return deformed(mesh, editor.session)


def deformed(surface: pv.PolyData, session: Session) -> pv.PolyData:
    """Return a deformed copy of *surface*, or the session's mesh if that is another one."""
    require(surface, pv.PolyData, "surface")
    require(session, Session, "session")
    if surface.n_points == session.mesh.n_vertices:
        return io.with_vertices(surface, session.vertices)
    return io.to_polydata(session.mesh.with_vertices(session.vertices))


@pv.register_plotter_component("segdeform")
class PlotterTools:
    """Deformation in a plotter, including those of pyvistaqt; ``plotter.segdeform``.

    Everything in `added` is removed before the plotter closes.

    Parameters
    ----------
    plotter : pyvista.BasePlotter
        The plotter to extend.
    """

    def __init__(self, plotter: pv.BasePlotter) -> None:
        self._plotter = plotter
        self.added: list[DeformEditor | VolumeOverlay] = []

    def edit(self, mesh: Mesh | pv.PolyData | Session, *, path: _Path = None) -> DeformEditor:
        """Add the editor to the current subplot of the plotter, and switch it on.

        Actors of *mesh* in the plotter are hidden, because the editor draws the mesh itself.

        Parameters
        ----------
        mesh : Mesh, pyvista.PolyData or Session
            What to edit.  A mesh is not changed; the editor's session has the deformed vertices,
            in the same order.
        path : path, optional
            The file that the editor's keys save and open.
        """
        from .editor import DeformEditor

        session = session_of(mesh)
        path = None if path is None else as_path(path)
        if isinstance(mesh, pv.PolyData):
            for actor in self._plotter.renderer.actors.values():
                if getattr(getattr(actor, "mapper", None), "dataset", None) is mesh:
                    actor.visibility = False
        editor = DeformEditor(self._plotter, session)
        editor.controller.file.surface = surface_of(mesh)
        self.added.append(editor)
        if path is not None:
            editor.path = path
        if not self._plotter.camera_set:
            self._plotter.reset_camera()  # as `add_mesh` does
        editor.On()
        return editor

    def add_volume_overlay(self, session: Session) -> VolumeOverlay:
        """Show the mesh of *session*, coloured by its local volume change, with a colour scale."""
        from .volume_overlay import VolumeOverlay

        if not isinstance(session, Session):
            raise ArgumentError(f"session must be a Session; got {shown(session)}")
        overlay = VolumeOverlay(self._plotter, session)
        self.added.append(overlay)
        overlay.show()
        return overlay

    def __plotter_close__(self) -> None:
        while self.added:
            self.added.pop().remove()


@pv.register_dataset_accessor("segdeform", pv.PolyData)
class PolyDataTools:
    """Deformation of a surface; ``mesh.segdeform``.  The surface itself is not changed.

    Parameters
    ----------
    surface : pyvista.PolyData
        The surface.
    """

    def __init__(self, surface: pv.PolyData) -> None:
        self._surface = surface

    def deform(
        self,
        fixed: ArrayLike,
        handle: ArrayLike,
        targets: ArrayLike,
        *,
        n_regions: int | None = 3,
        n_cage_vertices: int = 155,
        preserve_volume: bool = True,
        progress: Progress | None = None,
    ) -> pv.PolyData:
        """Return a deformed copy with the handle points at *targets* and all arrays.

        Normals are recomputed.  Parameters and exceptions are those of `vtk_segdeform.deform`,
        which also returns the solver's status; here a missed target is only logged.
        """
        solution = deform(
            io.from_polydata(self._surface), fixed, handle, targets,
            n_regions=n_regions, n_cage_vertices=n_cage_vertices,
            preserve_volume=preserve_volume, progress=progress,
        )  # fmt: skip
        if solution.handle_error > _HANDLE_MET:
            error = 100.0 * solution.handle_error
            _log.warning("handle error %.2g %% of model size: %s", error, solution.status)
        return io.with_vertices(self._surface, solution.vertices)

    def regions(self, n_regions: int | None = 3, progress: Progress | None = None) -> pv.PolyData:
        """Return a copy with the regions used by a deformation, as point arrays.

        ``region`` (n,) int is the region with the largest weight, ``regions_here`` (n,) int the
        number of regions at a point, ``region_weights`` (n, r) float their weights, which sum to 1.

        Parameters
        ----------
        n_regions : int or None
            Number of regions; None lets `vtk_segdeform.segment` choose.
        progress : Progress, optional
            Progress callback; may cancel.
        """
        found = segment(io.from_polydata(self._surface), n_regions, progress=progress)
        copy = self._surface.copy()
        copy.point_data["regions_here"] = found.membership.sum(axis=0)
        copy.point_data["region_weights"] = np.ascontiguousarray(found.weights.T)
        copy.point_data["region"] = found.labels
        return copy

    def check(self) -> MeshReport:
        """Return the faults that prevent deforming the surface: ``.ok``, ``.faults``."""
        points = np.asarray(self._surface.points, dtype=np.float64)
        return find_faults(points, triangles_of(self._surface))

    def repair(self, *, weld_distance: float = 0.0, largest_hole: int = 100) -> pv.PolyData:
        """Return a repaired copy with the polygons and arrays of all remaining faces.

        Each repair, loss and remaining hole is logged on a line of its own.  The parameters are
        those of `vtk_segdeform.repair`.
        """
        closed, done = repair_surface(
            self._surface, weld_distance=weld_distance, largest_hole=largest_hole
        )
        for step in done.steps:
            _log.info("repair: %s", step)
        if done.advice:
            _log.warning("repair: %s", done.advice)
        return closed


def surface_of(mesh: object) -> pv.PolyData | None:
    """Return a shallow copy of *mesh* if it is a PolyData, to save its arrays with the pose."""
    return mesh.copy(deep=False) if isinstance(mesh, pv.PolyData) else None


def session_of(mesh: Mesh | pv.PolyData | Session) -> Session:
    """Return a session over *mesh*; a session is returned itself."""
    if isinstance(mesh, Session | Mesh):
        return mesh if isinstance(mesh, Session) else Session(mesh)
    if isinstance(mesh, pv.PolyData):
        return Session(io.from_polydata(mesh))
    raise ArgumentError(f"mesh must be a Mesh, a PolyData or a Session; got {shown(mesh)}")
