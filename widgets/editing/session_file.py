"""The file that the editor saves to and opens from, and whether it is up to date."""

from __future__ import annotations

import os
from pathlib import Path

from vtk_segdeform.progress import Progress
from vtk_segdeform.session import Session
from vtk_segdeform.store import load_session, save_session

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
    """

    def __init__(self, path: Path, session: Session) -> None:
        self.path = path
        self._ours: Path | None = None
        self._kept = session.state

    @property
    def is_ours(self) -> bool:
        """Whether nothing of others is lost by writing: it was written or read before."""
        return self._ours == self.path or not os.path.isfile(self.path)

    def is_behind(self, session: Session) -> bool:
        """Tell whether something would be lost if *session* were given up now."""
        return bool(self._kept.changes(session.state))

    def took(self, path: Path, session: Session) -> None:
        """Go on beside *path*, from which *session* was read; over a mesh nothing is written."""
        if is_mesh(path):
            self.path, self._ours, self._kept = path.with_suffix(_SUFFIX), None, session.state
        else:
            self.path = path
            self.keeps(session)

    def write(self, session: Session) -> None:
        """Save *session*; see `save_session`."""
        save_session(self.path, session)
        self.keeps(session)

    def keeps(self, session: Session) -> None:
        """Remember that *session* is what the file holds."""
        self._ours, self._kept = self.path, session.state


def is_mesh(path: Path) -> bool:
    """Tell whether a file is by its name a mesh, not a session."""
    from vtk_segdeform.convert import is_mesh_file  # which imports pyvista

    return is_mesh_file(path)


def read_bound(path: Path, progress: Progress) -> Session:
    """Return the session in a file, or one over the mesh in it.

    It is bound if it is in a pose, which cannot be drawn without.
    """
    if is_mesh(path):
        from vtk_segdeform.convert import read_mesh

        progress(0.0, "")
        return Session(read_mesh(path))
    session = load_session(path)
    if session.state.pose is not None:
        session.bind(progress)
    return session
