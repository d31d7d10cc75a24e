"""The file that the editor saves to and opens from, and whether the session has changed since."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np

from vtk_segdeform.errors import MeshError
from vtk_segdeform.progress import Progress
from vtk_segdeform.session import Session, load_session, save_session

_SUFFIX = ".segdeform"


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
    surface : pyvista.PolyData or None
        The original surface with its arrays, colours and polygons, for `deformed`; may be
        changed.
    """

    def __init__(self, path: Path, session: Session) -> None:
        self.path = path
        self._written: Path | None = None
        self._saved = session.state
        self.surface: Any = None

    @property
    def may_overwrite(self) -> bool:
        """Whether writing to `path` replaces nothing but this session's own file."""
        return self.may_replace(self.path)

    def may_replace(self, place: Path) -> bool:
        """Return whether *place* is unused, or was written or read before."""
        return self._written == place or not os.path.isfile(place)

    def is_modified(self, session: Session) -> bool:
        """Return whether *session* has unsaved changes."""
        return bool(self._saved.changes(session.state))

    def opened(self, path: Path, session: Session, surface: Any = None) -> None:
        """Continue with *path*, from which *session* was read; a mesh file is never overwritten.

        Without a *surface* the current one is kept; `deformed` uses it if it has the same mesh.
        """
        self.surface = self.surface if surface is None else surface
        if is_mesh(path):
            self.path, self._written = path.with_suffix(_SUFFIX), None
            self._saved = session.state
        else:
            self.path = path
            self.mark_saved(session)

    def deformed(self, session: Session) -> Any:
        """Return the posed mesh of *session* as a pyvista.PolyData, with its original arrays.

        Normals are recomputed, as by `io.with_vertices`.
        """
        from vtk_segdeform.io import to_polydata, with_vertices  # which import pyvista

        rest, vertices = session.mesh.vertices, session.vertices
        if self.surface is None or not np.array_equal(self.surface.points, rest):
            return to_polydata(session.mesh.with_vertices(vertices))
        return with_vertices(self.surface, vertices)

    def write(self, session: Session, place: Path) -> None:
        """Save *session* to *place*, which differs from `path` in a replay; see `save_session`."""
        save_session(place, session)
        self._written, self._saved = place, session.state

    def mark_saved(self, session: Session) -> None:
        """Record that the file contains *session*."""
        self._written, self._saved = self.path, session.state


def is_mesh(path: Path) -> bool:
    """Return whether the name of a file is that of a mesh, not of a session."""
    from vtk_segdeform.io import is_mesh_file  # which imports pyvista

    return is_mesh_file(path)


def read_all(path: Path, progress: Progress) -> tuple[Session, Any]:
    """Return the session in a file, or a new one over the mesh in it, and the surface or None.

    A session with a pose is bound, because the pose cannot be drawn otherwise.
    """
    if not is_mesh(path):
        return read_bound(path, progress), None
    from vtk_segdeform.io import from_polydata, read_polydata

    progress(0.0, "")
    surface = read_polydata(path)
    try:
        return Session(from_polydata(surface)), surface
    except MeshError as fault:
        raise MeshError(f"{path}: {fault}") from None


def read_bound(path: Path, progress: Progress) -> Session:
    """Return the session in a file, or a new one over the mesh in it; see `read_all`."""
    if is_mesh(path):
        return read_all(path, progress)[0]
    session = load_session(path)
    if session.state.pose is not None:
        session.bind(progress)
    return session
