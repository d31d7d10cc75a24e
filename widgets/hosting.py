"""What every host of the editor does: sessions from surfaces, editors in plotters."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pyvista as pv

from vtk_segdeform.importing import imported
from vtk_segdeform.io import Surface, as_polydata
from vtk_segdeform.mesh import Mesh
from vtk_segdeform.session import Session

if TYPE_CHECKING:
    from .editor import DeformEditor, KeyChoice


def session_of(
    mesh: pv.PolyData | pv.UnstructuredGrid | pv.MultiBlock | Surface | Mesh | Session,
) -> Session:
    """Return a session over *mesh*; a session is returned itself.

    The blocks of a MultiBlock, as `pyvista.read` returns of a glTF file, become one surface, and
    so do the cells of an UnstructuredGrid.
    """
    if isinstance(mesh, Session):
        return mesh
    if isinstance(mesh, Mesh | Surface):
        return Session(mesh)
    expected = "a PolyData, a MultiBlock of PolyData, a Surface, a Mesh or a Session"
    return Session(Surface(as_polydata(mesh, "mesh", expected)))


def edited(mesh: Any, session: Session) -> Any:
    """Return what *session* made of *mesh*, of the same type."""
    if isinstance(mesh, Session):
        return session
    if isinstance(mesh, Mesh):
        return session.mesh.with_vertices(session.vertices)
    return session.deformed


def add_editor(plotter: pv.BasePlotter, session: Session, *, keys: KeyChoice) -> DeformEditor:
    """Add an editor to the current subplot of *plotter*, aim the camera, and switch it on."""
    imported("vtk_segdeform.widgets.editor")
    from .editor import DeformEditor

    editor = DeformEditor(plotter, session, keys=keys)
    plotter.segdeform.added.append(editor)
    if not plotter.camera_set:
        editor.controller.camera.begin(is_aimed=False)
        plotter.camera_set = True  # otherwise `show` would aim it again
    editor.On()
    return editor
