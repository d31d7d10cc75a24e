"""The document in the window, requests to open one, and readers of files and autosaves.

Readers run in any thread; this file does not use Qt.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from vtk_segdeform import models
from vtk_segdeform.errors import MeshError
from vtk_segdeform.io import read_polydata, triangles_of
from vtk_segdeform.mesh import Mesh, mesh_of
from vtk_segdeform.progress import Progress
from vtk_segdeform.session import Session

from ..editor import About, SessionFile, Slot, error_text, is_mesh, read_session

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

    @property
    def proposal(self) -> Path:
        """A proposed path for its files, apart from the suffix."""
        path = self.session_path or self.source
        return Path.cwd() / self.name if path is None else path

    @property
    def about(self) -> About:
        """The description stored with autosaved work."""
        return About(self.name, _text(self.session_path), _text(self.source))

    def file(self, session: Session, *, is_new: bool = False) -> SessionFile:
        """Return the editor's file for *session*, which has yet to be saved if it *is_new*."""
        file = SessionFile(self.proposal.with_suffix(SUFFIX), session)
        if self.session_path is not None:
            file.path = self.session_path
            file.mark_saved(session)
        file.is_new = is_new
        return file


Opened = tuple[Document, Session]
Reader = Callable[[Progress], Opened]


@dataclass(frozen=True)
class Request:
    """A document to open."""

    name: str
    """Its name for users."""
    reader: Reader
    """``reader(progress)`` reads it, in another thread."""
    path: Path | None = None
    """The file, if the user chose one."""
    slot: Slot | None = None
    """Where it was autosaved, if it is recovered work."""
    is_new: bool = False
    """Whether it has been made or recovered by the program, and is to be saved."""


def from_file(path: Path) -> Reader:
    """Return the reader of a mesh file, with all its arrays, or of a session file."""

    def read(progress: Progress) -> Opened:
        try:
            session = read_session(path, progress)
        except MeshError as error:
            if is_mesh(path):
                _require_unrepairable(path, error)
            raise
        if is_mesh(path):
            return Document(path.name, source=path), session
        return Document(path.name, session_path=path), session

    return read


class Unopenable(MeshError):
    """A surface cannot be deformed as it is, but it can be repaired.

    Attributes
    ----------
    given : pyvista.PolyData
        The surface.
    valid : Mesh
        The mesh of its faces with finite coordinates.
    """

    def __init__(self, text: str, given: Any, valid: Mesh) -> None:
        super().__init__(text)
        self.given, self.valid = given, valid


def _require_unrepairable(path: Path, error: MeshError) -> None:
    """Raise `Unopenable` if the file has valid faces beside invalid ones."""
    given = read_polydata(path)
    points = np.array(given.points, dtype=np.float64)
    is_valid = np.asarray(np.isfinite(points).all(axis=1))
    points[~is_valid] = 0.0
    triangles = triangles_of(given)
    try:
        valid = mesh_of(points, triangles[is_valid[triangles].all(axis=1)]).mesh
    except MeshError:
        return
    raise Unopenable(str(error), given, valid) from None


def from_slot(slot: Slot) -> Reader:
    """Return the reader of an autosave."""

    def read(progress: Progress) -> Opened:
        session, about = slot.read(progress), slot.about
        source = Path(about.mesh) if about.mesh else None
        path = Path(about.session) if about.session else None
        return Document(about.name, path, source=source), session

    return read


def sample_model(progress: Progress) -> Opened:
    """Return the sample model, a cactus."""
    progress(0.0, "Building mesh")
    return Document("cactus"), Session(models.cactus())


def opening_error(error: BaseException) -> str:
    """Return the message of an error raised by a reader."""
    if isinstance(error, OSError) and error.filename is not None:
        return f"{error.filename}: {error.strerror}"
    return error_text(error).replace("`", "")  # of names of functions


def _text(path: Path | None) -> str:
    return "" if path is None else str(path.absolute())
