"""What every host of the editor does: sessions from surfaces, editors in plotters."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pyvista as pv

from vtk_segdeform.importing import imported
from vtk_segdeform.io import of_its_kind, surface_of
from vtk_segdeform.mesh import Mesh
from vtk_segdeform.session import Session

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
