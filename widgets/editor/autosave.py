"""Autosaved work on disk: slots, their locks, and recovery after a crash.

    folder/8f31.../lock                 locked while the program that owns the slot runs
                   about.json           the document
                   surface.segdeform    the given surface, written once: a session without edits
                   session.segdeform    the work, without the surface; each is written atomically

Each document has a slot from its first change until it is saved or discarded.  A slot without a
lock is abandoned: its program has crashed or was killed.  `Autosaves.abandoned` locks the slots
that it returns, so that only one of several programs offers to recover them.

A folder is a slot only if its name has 16 hexadecimal digits and it has a lock.  Only these four
files and their drafts (`files.replacing`) are ever deleted in it, and the folder itself once it is
empty.  Symbolic links are not followed.
"""

from __future__ import annotations

import json
import os
import re
import secrets
import stat
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from vtk_segdeform.errors import SessionError
from vtk_segdeform.files import (
    autosave_folder,
    fault_of,
    hold,
    is_draft,
    is_ours,
    open_regular,
    replacing,
)
from vtk_segdeform.mesh import Mesh
from vtk_segdeform.progress import Progress
from vtk_segdeform.session import Session, load_session, save_session

if TYPE_CHECKING:
    from vtk_segdeform.io import Surface

_LOCK, _ABOUT, _SESSION = "lock", "about.json", "session.segdeform"
_SURFACE = "surface.segdeform"
_NAME = re.compile(r"[0-9a-f]{16}")
_LONGEST_ABOUT = 1 << 20  # bytes
_ATTEMPTS = 5


@dataclass(frozen=True)
class About:
    """The document of some unsaved work."""

    name: str = "a mesh"
    """Its name for users: "horse.ply"."""
    session: str = ""
    """Its session file, if any."""
    mesh: str = ""
    """The mesh file it was created from, if any."""


class Slot:
    """The autosave of one document, locked by this program until it is released.

    Parameters
    ----------
    folder : Path
        The folder of the slot.
    handle : int
        File descriptor of the lock.
    about : About
        The document.
    """

    def __init__(self, folder: Path, handle: int, about: About) -> None:
        self.about = about
        self.path = folder / _SESSION
        self._folder = folder
        self._surface: Surface | None = None  # the one in the slot
        self._handle: int | None = handle

    @property
    def when(self) -> datetime:
        """Local time of the last autosave."""
        return datetime.fromtimestamp(self.path.stat().st_mtime)

    def write(self, session: Session, view: Mapping[str, Any] | None = None) -> None:
        """Write the current state of *session*, and the *view* of its editor; in any thread.

        Raises
        ------
        SessionError
            If it cannot be written; the previous autosave is then unchanged.
        """
        given = self._folder / _SURFACE
        for path in (given, self.path):
            if path.is_symlink():
                raise SessionError(f"{path}: is a symbolic link; remove it to enable autosave")
        if session.surface is not None and session.surface is not self._surface:
            save_session(given, Session(session.surface))
            self._surface = session.surface
        save_session(self.path, session, surface=False, view=view)

    def read(self, progress: Progress) -> Session:
        """Return the autosaved session, bound if it has a pose.

        It has its surface, unless the file of that is damaged.
        """
        session, given = load_session(self.path), None
        if _is_file(self._folder / _SURFACE):
            with suppress(SessionError):
                given = load_session(self._folder / _SURFACE).surface
        if session.surface is None and given is not None and _same(given.mesh, session.mesh):
            session, self._surface = Session(given, state=session.state), given
        if session.state.pose is not None:
            session.bind(progress)
        return session

    def release(self) -> None:
        """Unlock the slot, so that any program may recover it."""
        if self._handle is not None:
            os.close(self._handle)
            self._handle = None

    def remove(self) -> None:
        """Delete the slot, the work first, so that an interrupted deletion leaves no slot."""
        if _is_file(self.path):
            self.path.unlink(missing_ok=True)
        self.release()  # some systems cannot delete open files
        with suppress(OSError):  # another process may have deleted it, or it is not empty
            for path in list(self._folder.iterdir()):
                if (path.name in (_LOCK, _ABOUT, _SURFACE) or is_draft(path.name)) and _is_file(
                    path
                ):
                    path.unlink(missing_ok=True)
            self._folder.rmdir()


class Autosaves:
    """The autosaves in a folder.

    Parameters
    ----------
    folder : Path, optional
        By default `autosave_folder`; created when needed.

    Examples
    --------
    >>> import tempfile
    >>> from vtk_segdeform import models
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     crashed, next_one = Autosaves(Path(folder)), Autosaves(Path(folder))
    ...     slot = crashed.new(About("ball.ply"))
    ...     slot.write(Session(models.sphere(300)))
    ...     print([each.about.name for each in next_one.abandoned()])
    ...     slot.release()  # as the operating system does when the program ends
    ...     print([each.about.name for each in next_one.abandoned()])
    []
    ['ball.ply']
    """

    def __init__(self, folder: Path | None = None) -> None:
        self.folder = autosave_folder() if folder is None else folder

    def new(self, about: About) -> Slot:
        """Return a new slot, locked by this program.

        Raises
        ------
        SessionError
            If nothing can be written or locked there.
        """
        try:
            for _ in range(_ATTEMPTS):
                folder = self.folder / secrets.token_hex(8)
                folder.mkdir(parents=True, mode=0o700)
                with suppress(FileNotFoundError):  # another program has just deleted it as empty
                    handle = hold(folder / _LOCK)
                    if handle is not None:
                        with replacing(folder / _ABOUT) as draft:
                            draft.write_text(json.dumps(asdict(about)), encoding="utf-8")
                        return Slot(folder, handle, about)
        except OSError as fault:
            raise SessionError(f"{self.folder}: {fault.strerror or fault}") from fault
        raise SessionError(f"{self.folder}: files there cannot be locked")

    def abandoned(self) -> list[Slot]:
        """Return the slots of programs that have ended, the latest first, and lock them."""
        return sorted(self._lock_abandoned(), key=lambda slot: slot.when, reverse=True)

    @property
    def has_abandoned(self) -> bool:
        """Whether there are abandoned slots; none is locked afterwards."""
        slots = self.abandoned()
        for slot in slots:
            slot.release()
        return bool(slots)

    def _lock_abandoned(self) -> Iterator[Slot]:
        folders = sorted(self.folder.iterdir()) if self.folder.is_dir() else []
        for folder in folders:
            handle = None
            with suppress(OSError):  # deleted meanwhile, or not readable by this user
                handle = _hold(folder)
            if handle is None:
                continue
            slot = Slot(folder, handle, _read_about(folder))
            if _is_file(slot.path):
                yield slot
            elif slot.path.exists() or slot.path.is_symlink():
                slot.release()  # not a file that this program wrote
            else:
                slot.remove()  # its program ended before the first autosave


def _hold(folder: Path) -> int | None:
    """Lock a folder if it is a slot; otherwise leave it untouched."""
    status = os.lstat(folder)
    named = _NAME.fullmatch(folder.name) and stat.S_ISDIR(status.st_mode) and is_ours(status)
    return hold(folder / _LOCK) if named and _is_file(folder / _LOCK) else None


def _same(one: Mesh, other: Mesh) -> bool:
    vertices = np.array_equal(one.vertices, other.vertices)
    return vertices and np.array_equal(one.faces, other.faces)


def _is_file(path: Path) -> bool:
    """Return whether *path* is a regular file of this user, not a symbolic link."""
    try:
        return not fault_of(os.lstat(path), own=True)
    except OSError:
        return False


def _read_about(folder: Path) -> About:
    """Return the document of a slot; a default one if the file is missing or damaged."""
    try:
        with open_regular(folder / _ABOUT, own=True) as file:
            fields = json.loads(file.read(_LONGEST_ABOUT))
        return About(str(fields["name"]), str(fields["session"]), str(fields["mesh"]))
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return About()
