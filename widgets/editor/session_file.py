"""The file that the editor saves to and opens from, and whether the session has changed since.

Also the meshes that it writes, which are read again: the person is told what a format has lost.
"""

from __future__ import annotations

import logging
import os
import re
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any
from zipfile import is_zipfile

from vtk_segdeform.arrays import FloatArray
from vtk_segdeform.errors import MeshError, SegDeformError, SessionError
from vtk_segdeform.geometry import VertexNormals
from vtk_segdeform.importing import imported
from vtk_segdeform.kernels import load_early
from vtk_segdeform.mesh import Mesh
from vtk_segdeform.progress import Progress
from vtk_segdeform.session import Session, load_session, save_session

from ..scene import drawn_triangles

if TYPE_CHECKING:
    from vtk_segdeform.io import Surface

_SUFFIX = ".segdeform"
_LARGE = 8 << 20  # bytes of a file for whose mesh compiled kernels pay before the first picture
_READ = 0.3  # share of reading in the progress of opening a mesh; the rest is checking it


class SessionFile:
    """The file of a session.

    Parameters
    ----------
    path : Path
        Where to write; need not exist yet.
    session : Session
        A session without unsaved changes.

    Attributes
    ----------
    path : Path
        The path; may be changed.
    is_new : bool
        Whether the session was made or recovered by the program, and has yet to be saved.
    """

    def __init__(self, path: Path, session: Session) -> None:
        self.path = path
        self.is_new = False
        self._written: Path | None = None
        self._saved = session.state
        self._carried: set[Path] = set()  # that were written

    @property
    def may_overwrite(self) -> bool:
        """Whether writing to `path` replaces nothing but this session's own file."""
        return self._written == self.path or not os.path.isfile(self.path)

    def is_modified(self, session: Session) -> bool:
        """Return whether *session* has unsaved changes."""
        return self.is_new or bool(self._saved.changes(session.state))

    def prepared(self, session: Session, *, was_modified: bool) -> None:
        """Continue after *session* was prepared for pulls, which is no change to be saved."""
        if not was_modified:
            self._saved = session.state

    def opened(self, path: Path, session: Session) -> None:
        """Continue with *path*, from which *session* was read; a mesh file is never overwritten."""
        if is_mesh(path):
            self.path, self._written = path.with_suffix(_SUFFIX), None
            self._saved, self.is_new = session.state, False
        else:
            self.path = path
            self.mark_saved(session)

    def write(self, session: Session, view: Mapping[str, Any] | None = None) -> None:
        """Save *session* to `path`; see `save_session`."""
        save_session(self.path, session, view=view)
        self.mark_saved(session)

    def write_carried(self, session: Session, folder: Path) -> tuple[str, ...]:
        """Write what *session* carries along to a *folder*; return what to say, in sentences.

        No file is replaced but those that were written so before.
        """
        written, failed = session.carried.write_all(folder, ours=self._carried)
        self._carried |= {*written.values()}
        beside = ", ".join(path.name for path in written.values())
        said = [f"Beside it: {beside}"] if written else []
        return *said, *(f"{name} was not saved: {why}" for name, why in failed.items())

    def mark_saved(self, session: Session) -> None:
        """Record that the file contains *session*."""
        self._written, self._saved, self.is_new = self.path, session.state, False


@dataclass(frozen=True, eq=False)
class WrittenMesh:
    """A surface in a pose that was written to a file; later changes of the session change nothing.

    Attributes
    ----------
    mesh : Mesh
        The mesh at rest.
    surface : Surface or None
        The surface that it was made of.
    vertices : (n, 3) float
        The pose.
    path : Path
        The file.
    lids : bool or None
        The option of the session.
    remarks : tuple of str
        What the format cannot store, except digits, in sentences.
    """

    mesh: Mesh
    surface: Surface | None
    vertices: FloatArray
    path: Path
    lids: bool | None
    remarks: tuple[str, ...]

    def loss(self) -> str:
        """Read the file again, in any thread; return what it has lost, in a sentence, or "".

        Raises
        ------
        SessionError
            If it cannot be read again.
        """
        imported("vtk_segdeform.io")
        from vtk_segdeform.io import Surface, loss_of, to_polydata

        surface = self.surface or Surface(to_polydata(self.mesh))
        try:
            loss = loss_of(surface, self.vertices, self.path, self.lids)
        except SegDeformError as error:
            advice = "save the mesh again, in another format or folder"
            raise SessionError(f"The file cannot be read again: {advice} ({error})") from error
        return loss and f"In the file, {loss}"


def pose_remark(session: Session) -> str:
    """Return what to say about a saved pose; "" if it has settled."""
    return ". The pose had not settled" if session.is_unsettled else ""


def write_posed(session: Session, path: Path, *, displacement: str | None = None) -> WrittenMesh:
    """Write the surface of *session* in its pose; see `Session.write_deformed`."""
    with _warnings() as warnings:
        session.write_deformed(path, displacement=displacement)
    remarks = tuple(map(_shortened, warnings))
    lids = session.options.lids
    return WrittenMesh(session.mesh, session.surface, session.vertices, path, lids, remarks)


@contextmanager
def _warnings() -> Iterator[list[str]]:
    """Collect what writing a file in this thread logs inside a ``with`` block, except rounding."""
    imported("vtk_segdeform.io")
    from vtk_segdeform.io import IS_ROUNDING

    found: list[str] = []
    handler, logger = logging.Handler(logging.WARNING), logging.getLogger("vtk_segdeform.io")
    thread = threading.get_ident()

    def collect(record: logging.LogRecord) -> None:
        if record.thread == thread and not hasattr(record, IS_ROUNDING):
            found.append(record.getMessage())

    handler.emit = collect  # type: ignore[method-assign]
    logger.addHandler(handler)
    try:
        yield found
    finally:
        logger.removeHandler(handler)


def _shortened(warning: str) -> str:
    """Return a *warning* about arrays for the status line: their names only."""
    text = re.sub(r"\b(point|cell|field) array ", "", warning)
    return text[:1].upper() + text[1:]


def file_types(*, sessions: bool) -> str:
    """Return the types of files in a dialog: meshes, and with *sessions* these and all others."""
    imported("vtk_segdeform.io")  # imports pyvista
    from vtk_segdeform.io import writable_suffixes

    meshes = " ".join(f"*{suffix}" for suffix in writable_suffixes())
    if not sessions:
        return f"Meshes ({meshes})"
    return f"Meshes and sessions (*{_SUFFIX} {meshes});;All files (*)"


def is_mesh(path: Path) -> bool:
    """Return whether the name of a file is that of a mesh, not of a session."""
    imported("vtk_segdeform.io")  # imports pyvista
    from vtk_segdeform.io import is_mesh_file

    return is_mesh_file(path)


def read_session(path: Path, progress: Progress) -> Session:
    """Return the session in a file, or a new one of the surface in it.

    A session with a pose is bound, because the pose cannot be drawn otherwise.
    """
    if os.path.isfile(path) and os.path.getsize(path) > _LARGE:
        load_early()
    may_be_session = path.suffix.lower() == _SUFFIX or not os.path.isfile(path)
    if is_mesh(path) or not (may_be_session or is_zipfile(path)):
        imported("vtk_segdeform.io")  # imports pyvista
        from vtk_segdeform.io import Surface, read_polydata

        progress(0.0, "Reading mesh")
        polydata = read_polydata(path)
        progress(_READ, f"Checking mesh of {polydata.n_points:,} points")
        try:
            surface = Surface(polydata)
        except MeshError as fault:
            raise MeshError(f"{path}: {fault}") from None
        session = Session(surface)
        # They are kept with the mesh or the session.  The window does not wait for them here.
        VertexNormals(session.mesh).of(session.vertices)
        drawn_triangles(session.mesh)
        _ = session.mesh.bounds, session.has_volume
        progress(1.0, "Drawing mesh")
        return session
    session = load_session(path)
    if session.state.pose is not None:
        session.bind(progress)
    return session
