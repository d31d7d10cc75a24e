"""The document in the window, and readers for meshes, sessions and autosaves.

Readers run in any thread; this file does not use Qt.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from vtk_segdeform import models
from vtk_segdeform.errors import MeshError, SegDeformError
from vtk_segdeform.io import from_polydata, read_polydata
from vtk_segdeform.mesh import Mesh
from vtk_segdeform.progress import Progress
from vtk_segdeform.session import Session

from ..editor import SessionFile, error_text, is_mesh, read_bound
from .autosave import About, Slot

SUFFIX = ".segdeform"


@dataclass(frozen=True)
class Document:
    """The files of a session."""

    name: str
    """Name in the title of the window."""
    session_path: Path | None = None
    """The file to save the session to; None to ask for one."""
    mesh_path: Path | None = None
    """The file to save the mesh to; None to ask, because the original is never overwritten."""
    source: Path | None = None
    """The original mesh file, if it is known."""
    surface: Any = None
    """The content of that file, a pyvista.PolyData, with all its arrays."""

    @property
    def proposal(self) -> Path:
        """A proposed path for its files, apart from the suffix."""
        path = self.session_path or self.source
        return Path.cwd() / self.name if path is None else path

    @property
    def about(self) -> About:
        """The description stored with autosaved work."""
        return About(self.name, _text(self.session_path), _text(self.source))

    def file(self, session: Session, *, is_unsaved: bool = False) -> SessionFile:
        """Return the editor's file for *session*, which is modified at first if *is_unsaved*."""
        saved = Session(session.mesh) if is_unsaved else session
        file = SessionFile(self.proposal.with_suffix(SUFFIX), saved)
        if self.session_path is not None:
            file.path = self.session_path
            file.mark_saved(saved)
        file.surface = self.surface
        return file


Opened = tuple[Document, Session]
Reader = Callable[[Progress], Opened]


def from_file(path: Path) -> Reader:
    """Return the reader of a mesh file, with all its arrays, or of a session file."""

    def read(progress: Progress) -> Opened:
        if not is_mesh(path):
            return Document(path.name, session_path=path), read_bound(path, progress)
        progress(0.0, "Reading mesh")
        surface = read_polydata(path)
        progress(0.0, "Checking mesh")
        return Document(path.name, source=path, surface=surface), Session(_mesh_of(path, surface))

    return read


def from_slot(slot: Slot) -> Reader:
    """Return the reader of an autosave."""

    def read(progress: Progress) -> Opened:
        session, about = slot.read(progress), slot.about
        source = Path(about.mesh) if about.mesh else None
        path = Path(about.session) if about.session else None
        surface = None if source is None else _surface_of(source, session.mesh)
        return Document(about.name, path, source=source, surface=surface), session

    return read


def sample_model(progress: Progress) -> Opened:
    """Return the sample model, a cactus."""
    progress(0.0, "Building mesh")
    return Document("cactus"), Session(models.cactus())


def opening_error(error: BaseException) -> str:
    """Return the message of an error raised by a reader."""
    if isinstance(error, OSError) and error.filename is not None:
        return f"{error.filename}: {error.strerror}"
    return error_text(error)


def _mesh_of(path: Path, surface: Any) -> Mesh:
    try:
        return from_polydata(surface)
    except MeshError as fault:
        raise MeshError(
            f"{path.name} cannot be deformed: {fault}.\n\n"
            f"'segdeform check {path.name} --repair -o repaired{path.suffix}' may repair it."
        ) from None


def _surface_of(source: Path, mesh: Mesh) -> Any:
    """Return the surface in the file, or None if it no longer exists or has another mesh."""
    try:
        surface = read_polydata(source)
    except SegDeformError:
        return None
    is_same = np.array_equal(np.asarray(surface.points, dtype=float), mesh.vertices)
    return surface if is_same else None


def _text(path: Path | None) -> str:
    return "" if path is None else str(path.absolute())
