"""The extension of pyvista's plotters and meshes, and `edit`.

    plotter.segdeform.edit(mesh)                     the editor, in an existing plotter
    plotter.segdeform.add_volume_overlay(session)    the local volume change, in colours
    mesh.segdeform.deform(fixed, handle, targets)    a deformed copy with all arrays
    mesh.segdeform.pull(vertex, to)                  the same, by one point
    mesh.segdeform.regions(3)                        a copy with arrays of its regions
    mesh.segdeform.check()                           its faults and borders
    mesh.segdeform.repair()                          a closed copy, with its arrays

pyvista finds this module by its entry points when ``segdeform`` is first used.  pyvistaqt hides
those of plotters: there, and if the package is not installed, ``import vtk_segdeform`` after
pyvista or ``import vtk_segdeform.widgets.plugin``.

Long because every option of `edit` and of the tools is in their signatures and docstrings.
"""

from __future__ import annotations

import logging
import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, TypeVar, overload

import numpy as np
import pyvista as pv
from numpy.typing import ArrayLike

from vtk_segdeform.any_mesh import (
    AnyMesh,
    AsPolyData,
    Deformed,
    LikeMeshio,
    LikeTrimesh,
    Pair,
    deform,
    pull,
    segment,
)
from vtk_segdeform.arrays import FloatArray, IntArray, plain
from vtk_segdeform.checks import as_callable, as_path, as_text, shown
from vtk_segdeform.errors import ArgumentError, Cancelled, SegDeformError
from vtk_segdeform.importing import imported
from vtk_segdeform.io import Surface, as_polydata, repair_surface, triangles_of
from vtk_segdeform.mesh import Mesh, MeshReport, find_faults
from vtk_segdeform.pictures import require_screen
from vtk_segdeform.progress import Progress
from vtk_segdeform.session import Session

from .hosting import add_editor, call_with_poses, edited, require_no_editor, session_of
from .web import add_to_notebook, edit_in_notebook, shows_in_notebook

if TYPE_CHECKING:
    from .editor import DeformEditor, KeyChoice
    from .volume_overlay import VolumeOverlay


class Removable(Protocol):
    """Whatever has to end before a plotter closes."""

    def remove(self) -> None:
        """Remove everything from the plotter."""


_Path = str | os.PathLike[str] | None
_SameType = TypeVar("_SameType", bound=Mesh | pv.PolyData | LikeTrimesh | LikeMeshio | Session)
_log = logging.getLogger(__name__)

_HANDLE_MET = 1e-3  # of the diagonal


@overload
def edit(
    mesh: AsPolyData,
    *,
    path: _Path = None,
    title: str = ...,
    keys: KeyChoice = ...,
    progress: Progress | None = ...,
) -> pv.PolyData: ...
@overload
def edit(
    mesh: Pair,
    *,
    path: _Path = None,
    title: str = ...,
    keys: KeyChoice = ...,
    progress: Progress | None = ...,
) -> tuple[FloatArray, IntArray]: ...
@overload
def edit(
    mesh: _SameType,
    *,
    path: _Path = None,
    title: str = ...,
    keys: KeyChoice = ...,
    progress: Progress | None = ...,
) -> _SameType: ...
def edit(
    mesh: Any,
    *,
    path: _Path = None,
    title: str = "segdeform",
    keys: KeyChoice = "pyvista",
    progress: Progress | None = None,
) -> Any:
    """Open a window to deform *mesh*; return the deformed mesh when the window closes.

    A pose that was still settling, or was not finished yet, is completed first, which may take
    seconds.  Ctrl+C stops that, and the pose is returned as far as it is.

    In a notebook the editor is in the output of the cell instead, and a `NotebookEditor` is
    returned at once: its ``session`` and ``mesh`` follow what is done by hand.

    Parameters
    ----------
    mesh : PolyData, Mesh, trimesh.Trimesh, meshio.Mesh, pair of arrays, path, Surface or Session
        Any surface, as in `vtk_segdeform.deform`, or a session to continue.  The surfaces of a
        MultiBlock are edited as one.
    path : path, optional
        The file that the editor's keys save and open.  In a notebook only its name is shown: the
        page downloads.
    title : str
        Title of the window, if there is one.
    keys : str or mapping of str to str or sequence of str
        "pyvista", "Blender" or the keys of some actions, as in ``{"undo": "Ctrl+Z"}``.
    progress : Progress, optional
        Called while a pose is completed; raising `Cancelled` is like Ctrl+C.

    Returns
    -------
    deformed : of the type of *mesh*, or NotebookEditor
        A deformed copy: what was given, apart from coordinates and normals.  It is one PolyData if
        a path, a Surface, a MultiBlock or a grid was given.  A session is returned itself, unless
        another one was opened in the editor.  With pyvista's OFF_SCREEN the window closes at once.

    Raises
    ------
    MeshError
        If no mesh can be made of a PolyData: it has no faces, flat ones only, or NaN.
    MissingDependencyError
        If there is no screen, or in a notebook no trame.
    """
    imported("vtk_segdeform.widgets.scene")
    from .scene import set_background, set_lights

    session = session_of(mesh)
    path = None if path is None else as_path(path)
    as_text(title, "title")
    if shows_in_notebook(pv.global_theme):
        return edit_in_notebook(mesh, session, name=_name_of(path), keys=keys)
    if not pv.OFF_SCREEN:
        require_screen()
    plotter = pv.Plotter(title=title, notebook=False)
    is_dark = sum(pv.global_theme.background.float_rgb) < 1.5
    set_background(plotter.renderer, dark=is_dark)
    set_lights(plotter.renderer)
    try:
        editor = plotter.segdeform.edit(session, path=path, keys=keys)
        plotter.show()
    finally:
        plotter.close()
    _complete(editor, progress)
    return edited(mesh, editor.session)


def _complete(editor: DeformEditor, progress: Progress | None) -> None:
    """Complete the pose, or log why not: what was done in the window is never lost."""
    try:
        editor.complete(progress)
    except (Cancelled, KeyboardInterrupt):
        _log.warning("interrupted: the pose is not finished")
    except SegDeformError as error:
        _log.warning("the pose is not finished: %s", error)


def _name_of(path: Path | None) -> str:
    return "Untitled" if path is None else path.name


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
        self.added: list[Removable] = []

    def edit(
        self,
        mesh: AnyMesh | Session,
        *,
        path: _Path = None,
        keys: KeyChoice = "pyvista",
        scalars: str | ArrayLike | None = None,
        cmap: str | Sequence[str] | None = None,
        callback: Callable[[Any], object] | None = None,
    ) -> DeformEditor:
        """Add the editor to the current subplot of the plotter, and switch it on.

        Actors of *mesh* in the plotter show the pose, with their colours and textures; not those of
        a MultiBlock, which pyvista draws by its blocks.

        Parameters
        ----------
        mesh : any surface, or Session
            What to edit, as in `edit`; not changed.  ``editor.session.deformed`` is the deformed
            surface.
        path : path, optional
            The file that the editor's keys save and open.
        keys : str or mapping of str to str or sequence of str
            As in `edit`.
        scalars : str or array, optional
            The array of the mesh, or the values (n,), to colour the mesh by, with a scalar bar.
            For other options, or a texture, call ``plotter.add_mesh`` first.
        cmap : str or sequence of str, optional
            The colour map, or its colours, of *scalars*.
        callback : callable, optional
            Called with the deformed mesh, of the type that was given, after each change of the
            pose; not during a drag.

        Raises
        ------
        ArgumentError
            If the subplot has an editor already.

        In a notebook ``plotter.show()`` shows the page of the editor, with pyvista's backends
        "trame", "server" and "client"; with the others a picture.
        """
        session = session_of(mesh)
        path = None if path is None else as_path(path)
        require_no_editor(self._plotter)
        if scalars is not None:
            self._show(session, scalars, cmap)
        if callback is not None:
            call_with_poses(as_callable(callback, "callback"), mesh, session)
        # A QtInteractor has no such attribute.
        is_shown_in_notebook = getattr(self._plotter, "notebook", False)
        if is_shown_in_notebook and shows_in_notebook(self._plotter.theme):
            name = _name_of(path)
            return add_to_notebook(self._plotter, session, path=path, name=name, keys=keys)
        editor = add_editor(self._plotter, session, keys=keys)
        if path is not None:
            editor.path = path
        return editor

    def _show(self, session: Session, scalars: Any, cmap: Any) -> None:
        """Add the surface of *session* to the plotter, coloured by *scalars*."""
        shown = as_polydata(session.mesh if session.surface is None else session.surface.given)
        values = scalars if isinstance(scalars, str) else plain(scalars, "scalars")
        try:
            self._plotter.add_mesh(shown, scalars=values, cmap=cmap, copy_mesh=True)
        except (ValueError, TypeError, LookupError, AttributeError) as fault:
            raise ArgumentError(f"scalars or cmap cannot be shown: {fault!s:.200}") from None

    def add_volume_overlay(self, session: Session) -> VolumeOverlay:
        """Show the mesh of *session*, coloured by its local volume change, with a colour scale."""
        imported("vtk_segdeform.widgets.volume_overlay")
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
    """Deformation of any surface; ``mesh.segdeform``.  The surface itself is not changed.

    Points are numbered as in the surface.  Points at a seam follow one vertex of its mesh.

    Parameters
    ----------
    surface : pyvista.PolyData
        The surface.
    """

    def __init__(self, surface: pv.PolyData) -> None:
        self._given = surface

    def deform(
        self,
        fixed: ArrayLike,
        handle: ArrayLike,
        targets: ArrayLike,
        *,
        n_regions: int | None = None,
        n_cage_vertices: int | None = None,
        preserve_volume: bool = True,
        lids: bool | None = None,
        refine: bool | None = None,
        progress: Progress | None = None,
    ) -> pv.PolyData:
        """Return a copy with the handle points at *targets*: coordinates and normals differ.

        Parameters
        ----------
        fixed : (f,) int or (p,) bool
            Points that do not move.
        handle : (h,) int or (p,) bool
            Points of the handle.
        targets : (h, 3) float
            Where they go.  Points at a seam that are one vertex go to the mean.
        n_regions, n_cage_vertices, preserve_volume, lids, refine, progress
            As in `vtk_segdeform.deform`, which also returns the solver's status; here a missed
            target is only logged.

        Raises
        ------
        MeshError, ConstraintError
            As in `vtk_segdeform.deform`; MeshError if no mesh can be made of the surface.
        """
        return self._moved(
            deform(
                self._given, fixed, handle, targets,
                n_regions=n_regions, n_cage_vertices=n_cage_vertices,
                preserve_volume=preserve_volume, lids=lids, refine=refine, progress=progress,
            )
        )  # fmt: skip

    def pull(
        self,
        vertex: int | ArrayLike,
        to: ArrayLike,
        radius: float | None = None,
        *,
        pins: ArrayLike = (),
        locality: float | None = None,
        lids: bool | None = None,
        progress: Progress | None = None,
    ) -> pv.PolyData:
        """Return a copy with one point pulled to another place.

        Parameters
        ----------
        vertex : int or (3,) float
            The grabbed point, or a position on the surface.
        to : (3,) float
            Where it is pulled to.
        radius, pins, locality, lids, progress
            As in `vtk_segdeform.pull`, which has more options and also returns the solver's status;
            here a missed target is only logged.

        Raises
        ------
        MeshError, ConstraintError
            As in `vtk_segdeform.pull`; MeshError if no mesh can be made of the surface.
        """
        return self._moved(
            pull(
                self._given, vertex, to, radius,
                pins=pins, locality=locality, lids=lids, progress=progress,
            )
        )  # fmt: skip

    @staticmethod
    def _moved(solution: Deformed[pv.PolyData]) -> pv.PolyData:
        if solution.handle_error > _HANDLE_MET:
            error = 100.0 * solution.handle_error
            _log.warning("handle error %.2g %% of model size: %s", error, solution.status)
        return solution.mesh

    def regions(
        self, n_regions: int | None = None, progress: Progress | None = None
    ) -> pv.PolyData:
        """Return a copy with the regions used by a deformation, as point arrays.

        ``region`` (p,) int is the region with the largest weight, ``regions_here`` (p,) int the
        number of regions at a point, ``region_weights`` (p, r) float their weights, which sum to 1.

        Parameters
        ----------
        n_regions : int, optional
            Number of regions; by default one for each limb and one for the trunk.
        progress : Progress, optional
            Called with the fraction done and a text; may raise `Cancelled`.
        """
        surface, copy = Surface(self._given), self._given.copy()
        found = segment(surface.mesh, n_regions, progress=progress)
        for name, values in (
            ("regions_here", found.membership.sum(axis=0)),
            ("region_weights", found.weights.T),
            ("region", found.labels),
        ):
            copy.point_data[name] = surface.at_points(values)
        return copy

    def check(self) -> MeshReport:
        """Return what prevents the surface from being a `Mesh` as it is: ``.ok``, ``.faults``.

        A surface with faults can be deformed as well, see ``Surface(polydata).workarounds``; a
        closed one, ``.is_closed``, preserves its volume without lids.
        """
        points = np.asarray(self._given.points, dtype=np.float64)
        return find_faults(points, triangles_of(self._given))

    def repair(self, *, weld_distance: float = 0.0, largest_hole: int = 100) -> pv.PolyData:
        """Return a repaired copy with the polygons and arrays of all remaining faces.

        Each repair, loss and remaining hole is logged on a line of its own.  The parameters are
        those of `vtk_segdeform.repair`.
        """
        closed, done = repair_surface(
            self._given, weld_distance=weld_distance, largest_hole=largest_hole
        )
        for step in done.steps:
            _log.info("repair: %s", step)
        if done.advice:
            _log.warning("repair: %s", done.advice)
        return closed
