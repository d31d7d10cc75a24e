"""The file that the editor saves to and opens from, and whether it is up to date."""

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
    """A place for sessions.

    Parameters
    ----------
    path : Path
        Where to write to; need not be there yet.
    session : Session
        What would be no loss if it were given up now.

    Attributes
    ----------
    path : Path
        May be changed.
    surface : pyvista.PolyData or None
        All that came with the mesh, arrays, colours, polygons, for `deformed`; may be changed.
    """

    def __init__(self, path: Path, session: Session) -> None:
        self.path = path
        self._ours: Path | None = None
        self._kept = session.state
        self.surface: Any = None

    @property
    def is_ours(self) -> bool:
        """Whether nothing of others is lost by writing: it was written or read before."""
        return self.may_replace(self.path)

    def may_replace(self, place: Path) -> bool:
        """Return whether writing to *place* overwrites no file of another origin."""
        return self._ours == place or not os.path.isfile(place)

    def is_behind(self, session: Session) -> bool:
        """Tell whether something would be lost if *session* were given up now."""
        return bool(self._kept.changes(session.state))

    def took(self, path: Path, session: Session, surface: Any = None) -> None:
        """Go on beside *path*, from which *session* was read; over a mesh nothing is written.

        A session without a *surface* goes on with the one that is there, if it has the same mesh.
        """
        self.surface = self.surface if surface is None else surface
        if is_mesh(path):
            self.path, self._ours, self._kept = path.with_suffix(_SUFFIX), None, session.state
        else:
            self.path = path
            self.keeps(session)

    def deformed(self, session: Session) -> Any:
        """Return the mesh of *session* in its pose, a pyvista.PolyData, with all it came with.

        Normals are made anew, as `convert.with_vertices` does.
        """
        from vtk_segdeform.io import to_polydata, with_vertices  # which import pyvista

        rest, vertices = session.mesh.vertices, session.vertices
        if self.surface is None or not np.array_equal(self.surface.points, rest):
            return to_polydata(session.mesh.with_vertices(vertices))
        return with_vertices(self.surface, vertices)

    def write(self, session: Session, place: Path) -> None:
        """Save *session* to *place*, which differs from `path` in a replay; see `save_session`."""
        save_session(place, session)
        self._ours, self._kept = place, session.state

    def keeps(self, session: Session) -> None:
        """Remember that *session* is what the file holds."""
        self._ours, self._kept = self.path, session.state


def is_mesh(path: Path) -> bool:
    """Tell whether a file is by its name a mesh, not a session."""
    from vtk_segdeform.io import is_mesh_file  # which imports pyvista

    return is_mesh_file(path)


def read_all(path: Path, progress: Progress) -> tuple[Session, Any]:
    """Return the session in a file, or one over the mesh in it, and that file's surface or None.

    The session is bound if it is in a pose, which cannot be drawn without.
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
    """Return the session in a file, or one over the mesh in it; see `read_all`."""
    if is_mesh(path):
        return read_all(path, progress)[0]
    session = load_session(path)
    if session.state.pose is not None:
        session.bind(progress)
    return session
