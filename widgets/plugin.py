"""What pyvista's plotters and meshes can do once this package is there, and `edit`.

    plotter.segdeform.edit(mesh)                     the editor, in a plotter of yours
    plotter.segdeform.add_volume_overlay(session)    how the volume changes, in colours
    mesh.segdeform(fixed, handle, targets)    a deformed copy, arrays and all
    mesh.segdeform.regions(3)                        a copy with arrays of its regions
    mesh.segdeform.check()                           what keeps it from being deformed
    mesh.segdeform.repair()                          a repaired copy, with its arrays

pyvista finds this module by its entry points, when ``segdeform`` is first asked for.  pyvistaqt
hides those of plotters: there, and where the package is not installed, ``import vtk_segdeform``
after pyvista does it, or ``import vtk_segdeform.widgets.plugin``.
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
    """Open a window to deform *mesh* in; return what it is like when the window closes.

    Parameters
    ----------
    mesh : Mesh, pyvista.PolyData or Session
        A closed surface; or a session to go on with.
    path : path, optional
        Where the editor's keys save the session to and open it from.
    title : str
        Of the window.

    Returns
    -------
    deformed : of the type of *mesh*
        A deformed copy; of a PolyData with all its arrays.  A session is the same one, unless
        another was opened in the editor.  Off-screen, with pyvista's OFF_SCREEN, the window
        closes at once.

    Raises
    ------
    MeshError
        If *mesh* is a PolyData that is no closed, outward oriented two-manifold.
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
    """Return a copy of *surface* as *session* has it, or the session's mesh if it is another."""
    require(surface, pv.PolyData, "surface")
    require(session, Session, "session")
    if surface.n_points == session.mesh.n_vertices:
        return io.with_vertices(surface, session.vertices)
    return io.to_polydata(session.mesh.with_vertices(session.vertices))


@pv.register_plotter_component("segdeform")
class PlotterTools:
    """Deformation in a plotter, also in pyvistaqt's; ``plotter.segdeform``.

    What is `added` here is taken out again before the plotter closes.

    Parameters
    ----------
    plotter : pyvista.BasePlotter
        Where.
    """

    def __init__(self, plotter: pv.BasePlotter) -> None:
        self._plotter = plotter
        self.added: list[DeformEditor | VolumeOverlay] = []

    def edit(self, mesh: Mesh | pv.PolyData | Session, *, path: _Path = None) -> DeformEditor:
        """Put the editor into the plotter, in the subplot in hand, and switch it on.

        What the plotter shows of *mesh* already is hidden: the editor draws it itself.

        Parameters
        ----------
        mesh : Mesh, pyvista.PolyData or Session
            What to edit; it is left as it is but for a session.  The editor's session has the
            deformed vertices, in the same order.
        path : path, optional
            Where the editor's keys save the session to and open it from.
        """
        from .editor import DeformEditor

        session = session_of(mesh)
        path = None if path is None else as_path(path)
        if isinstance(mesh, pv.PolyData):
            for actor in self._plotter.renderer.actors.values():
                if getattr(getattr(actor, "mapper", None), "dataset", None) is mesh:
                    actor.visibility = False
        editor = DeformEditor(self._plotter, session)
        editor.desk.file.surface = surface_of(mesh)
        self.added.append(editor)
        if path is not None:
            editor.path = path
        if not self._plotter.camera_set:
            self._plotter.reset_camera()  # as `add_mesh` does
        editor.On()
        return editor

    def add_volume_overlay(self, session: Session) -> VolumeOverlay:
        """Show the mesh of *session*, coloured by its local volume change, with a scale."""
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
    """Deformation of a surface; ``mesh.segdeform``.  The surface is left as it is.

    Parameters
    ----------
    surface : pyvista.PolyData
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
        """Return a deformed copy, handle points at *targets*, all arrays kept, normals anew.

        The parameters, and what is raised, are those of `vtk_segdeform.deform`, which also tells
        how the solver fared; here a handle that misses its target is only logged.
        """
        solution = deform(
            io.from_polydata(self._surface), fixed, handle, targets,
            n_regions=n_regions, n_cage_vertices=n_cage_vertices,
            preserve_volume=preserve_volume, progress=progress,
        )  # fmt: skip
        if solution.handle_error > _HANDLE_MET:
            _log.warning("handle off by %.1e diagonals: %s", solution.handle_error, solution.status)
        return io.with_vertices(self._surface, solution.vertices)

    def regions(self, n_regions: int | None = 3, progress: Progress | None = None) -> pv.PolyData:
        """Return a copy with the regions that a deformation would have, as point arrays.

        ``region`` (n,) int is the region with the most weight, ``regions_here`` (n,) int in how
        many a point is, ``region_weights`` (n, r) float their weights, which sum to 1.

        Parameters
        ----------
        n_regions : int or None
            How many; None lets `vtk_segdeform.segment` choose.
        progress : Progress, optional
            Called meanwhile; may cancel.
        """
        found = segment(io.from_polydata(self._surface), n_regions, progress=progress)
        copy = self._surface.copy()
        copy.point_data["regions_here"] = found.membership.sum(axis=0)
        copy.point_data["region_weights"] = np.ascontiguousarray(found.weights.T)
        copy.point_data["region"] = found.labels
        return copy

    def check(self) -> MeshReport:
        """Return what keeps the surface from being deformed: ``.ok``, ``.faults``, as text."""
        points = np.asarray(self._surface.points, dtype=np.float64)
        return find_faults(points, triangles_of(self._surface))

    def repair(self, *, weld_distance: float = 0.0, largest_hole: int = 100) -> pv.PolyData:
        """Return a repaired copy; polygons and arrays are kept wherever faces are kept.

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
    """Return a PolyData with what else *mesh* has, if it is one, to be written with its pose."""
    return mesh.copy(deep=False) if isinstance(mesh, pv.PolyData) else None


def session_of(mesh: Mesh | pv.PolyData | Session) -> Session:
    """Return a session over *mesh*, or the session that it is."""
    if isinstance(mesh, Session | Mesh):
        return mesh if isinstance(mesh, Session) else Session(mesh)
    if isinstance(mesh, pv.PolyData):
        return Session(io.from_polydata(mesh))
    raise ArgumentError(f"mesh must be a Mesh, a PolyData or a Session; got {shown(mesh)}")
