"""The extension of pyvista's plotters, and `edit`.

    plotter.segdeform.edit(mesh)                     the editor, in an existing plotter
    plotter.segdeform.add_volume_overlay(session)    the local volume change, in colours

pyvista finds this module by its entry point when ``segdeform`` is first used.  pyvistaqt hides it:
there, and if the package is not installed, ``import vtk_segdeform`` after pyvista or ``import
vtk_segdeform.widgets.plugin``.
"""

from __future__ import annotations

import logging
import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, TypeVar, overload

import pyvista as pv
from numpy.typing import ArrayLike

from vtk_segdeform.any_mesh import (
    AnyMesh,
    AsPolyData,
    LikeMeshio,
    LikeTrimesh,
    Pair,
)
from vtk_segdeform.arrays import FloatArray, IntArray, plain
from vtk_segdeform.checks import as_callable, as_path, as_text, shown
from vtk_segdeform.errors import ArgumentError, Cancelled, SegDeformError
from vtk_segdeform.importing import imported
from vtk_segdeform.io import as_polydata
from vtk_segdeform.mesh import Mesh
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
