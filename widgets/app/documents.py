"""What can be open in the window, and how it gets there.

Reading happens in any thread: nothing here knows of Qt.
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

from ..editor import SessionFile, is_mesh, read_bound, words_of
from .autosave import About, Slot

SUFFIX = ".segdeform"


@dataclass(frozen=True)
class Document:
    """Where a session came from, and where it goes."""

    name: str
    """What the title of the window says."""
    session_path: Path | None = None
    """The file to save the session to; None: ask."""
    mesh_path: Path | None = None
    """The file to save the mesh to; None: ask, for what was read is not to be written over."""
    source: Path | None = None
    """The mesh file it began with, if it is known."""
    surface: Any = None
    """All that was in that file, a pyvista.PolyData, so that it can be written again."""

    @property
    def proposal(self) -> Path:
        """A path for its files, but for the suffix."""
        path = self.session_path or self.source
        return Path.cwd() / self.name.removeprefix("the ") if path is None else path

    @property
    def about(self) -> About:
        """What to tell of it beside unsaved work."""
        return About(self.name, _text(self.session_path), _text(self.source))

    def file(self, session: Session, *, is_unsaved: bool = False) -> SessionFile:
        """Return the editor's file for *session*; behind it from the start if *is_unsaved*."""
        kept = Session(session.mesh) if is_unsaved else session
        file = SessionFile(self.proposal.with_suffix(SUFFIX), kept)
        if self.session_path is not None:
            file.path = self.session_path
            file.keeps(kept)
        file.surface = self.surface
        return file


Opened = tuple[Document, Session]
Reader = Callable[[Progress], Opened]


def from_file(path: Path) -> Reader:
    """Return the reader of a mesh, with all its arrays, or of a session."""

    def read(progress: Progress) -> Opened:
        if not is_mesh(path):
            return Document(path.name, session_path=path), read_bound(path, progress)
        progress(0.0, "reading")
        surface = read_polydata(path)
        progress(0.0, "checking")
        return Document(path.name, source=path, surface=surface), Session(_mesh_of(path, surface))

    return read


def from_slot(slot: Slot) -> Reader:
    """Return the reader of unsaved work."""

    def read(progress: Progress) -> Opened:
        session, about = slot.read(progress), slot.about
        source = Path(about.mesh) if about.mesh else None
        path = Path(about.session) if about.session else None
        surface = None if source is None else _surface_again(source, session.mesh)
        return Document(about.name, path, source=source, surface=surface), session

    return read


def the_cactus(progress: Progress) -> Opened:
    """Return something to try things on."""
    progress(0.0, "growing")
    return Document("the cactus"), Session(models.cactus())


def words(error: BaseException) -> str:
    """Return what went wrong; our own errors are in words already."""
    if isinstance(error, OSError) and error.filename is not None:
        return f"{error.filename}: {error.strerror}"
    return words_of(error)


def _mesh_of(path: Path, surface: Any) -> Mesh:
    try:
        return from_polydata(surface)
    except MeshError as fault:
        raise MeshError(
            f"{path.name} cannot be deformed: {fault}.\n\n"
            f"'segdeform check {path.name} --repair -o mended{path.suffix}' may mend it."
        ) from None


def _surface_again(source: Path, mesh: Mesh) -> Any:
    """Return what is in the file, if it is still there and still has this mesh; else None."""
    try:
        surface = read_polydata(source)
    except SegDeformError:
        return None
    is_same = np.array_equal(np.asarray(surface.points, dtype=float), mesh.vertices)
    return surface if is_same else None


def _text(path: Path | None) -> str:
    return "" if path is None else str(path.absolute())
