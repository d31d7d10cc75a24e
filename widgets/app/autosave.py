"""Where unsaved work is kept, whose it is, and which of it a crash has left behind.

    folder/8f31.../lock                 held for as long as the program runs that works on it
                   about.json           what the work is on
                   session.segdeform    the work; written whole, as every session

Each document has a slot of its own from its first change until it is saved or given up.  A slot
that nobody holds belongs to nobody any more: its program has crashed, or was killed.  Who asks
for what is `left` holds it from then on, so that of several programs only one offers it.

A folder is a slot only if its name has 16 hexadecimal digits and its lock contains the mark of this
program.  Only these three files and their drafts (`atomic`) are ever deleted in it, and the folder
itself once it is empty.  Symbolic links are not followed.
"""

from __future__ import annotations

import json
import os
import re
import secrets
import stat
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import asdict, dataclass
from datetime import datetime
from pathlib import Path

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
from vtk_segdeform.progress import Progress
from vtk_segdeform.session import Session, save_session

from ..editor import read_bound

_LOCK, _ABOUT, _SESSION = "lock", "about.json", "session.segdeform"
_NAME = re.compile(r"[0-9a-f]{16}")
_MARK = b"vtk_segdeform: unsaved work, held while the program runs\n"
_LONGEST_ABOUT = 1 << 20  # bytes
_TRIES = 5


@dataclass(frozen=True)
class About:
    """What some work is on."""

    name: str = "a mesh"
    """For people: "horse.ply"."""
    session: str = ""
    """The session file it is saved to, if any."""
    mesh: str = ""
    """The mesh file it began with, if any."""


class Slot:
    """A place for the work on one document; ours as long as it is held.

    Parameters
    ----------
    folder : Path
        Where.
    handle : int
        What holds it.
    about : About
        What the work is on.
    """

    def __init__(self, folder: Path, handle: int, about: About) -> None:
        self.about = about
        self.path = folder / _SESSION
        self._folder = folder
        self._handle: int | None = handle

    @property
    def when(self) -> datetime:
        """When the work was last kept; local time."""
        return datetime.fromtimestamp(self.path.stat().st_mtime)

    def write(self, session: Session) -> None:
        """Keep *session*, as it is at this moment; in any thread.

        Raises
        ------
        SessionError
            If it cannot be written; what was kept before stays.
        """
        if self.path.is_symlink():
            raise SessionError(f"{self.path}: is a link; unsaved work is not written through links")
        save_session(self.path, session)

    def read(self, progress: Progress) -> Session:
        """Return what was kept; bound, if it is in a pose."""
        return read_bound(self.path, progress)

    def release(self) -> None:
        """Leave it to whoever asks for it next."""
        if self._handle is not None:
            os.close(self._handle)
            self._handle = None

    def remove(self) -> None:
        """Delete it, the work first: half of it gone is no work left."""
        if _is_file(self.path):
            self.path.unlink(missing_ok=True)
        self.release()  # where open files cannot be deleted
        with suppress(OSError):  # another process may have deleted it, or it is not empty
            for path in list(self._folder.iterdir()):
                if (path.name in (_LOCK, _ABOUT) or is_draft(path.name)) and _is_file(path):
                    path.unlink(missing_ok=True)
            self._folder.rmdir()


class Autosaves:
    """All slots in a folder.

    Parameters
    ----------
    folder : Path, optional
        `autosave_folder` by default; created when needed.

    Examples
    --------
    >>> import tempfile
    >>> from vtk_segdeform import models
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     crashed, next_one = Autosaves(Path(folder)), Autosaves(Path(folder))
    ...     slot = crashed.new(About("ball.ply"))
    ...     slot.write(Session(models.sphere(300)))
    ...     print([each.about.name for each in next_one.left()])
    ...     slot.release()  # as the operating system does when the program ends
    ...     print([each.about.name for each in next_one.left()])
    []
    ['ball.ply']
    """

    def __init__(self, folder: Path | None = None) -> None:
        self.folder = autosave_folder() if folder is None else folder

    def new(self, about: About) -> Slot:
        """Return a slot that nobody else has.

        Raises
        ------
        SessionError
            If nothing can be written or held there.
        """
        try:
            for _ in range(_TRIES):
                folder = self.folder / secrets.token_hex(8)
                folder.mkdir(parents=True, mode=0o700)
                with suppress(FileNotFoundError):  # one who tidies up found it empty
                    handle = hold(folder / _LOCK)
                    if handle is not None:
                        os.write(handle, _MARK)
                        _write_about(folder, about)
                        return Slot(folder, handle, about)
        except OSError as fault:
            raise SessionError(f"{self.folder}: {fault.strerror or fault}") from fault
        raise SessionError(f"{self.folder}: files there cannot be locked")

    def left(self) -> list[Slot]:
        """Return what programs that are gone have left, the latest first; all of it held now."""
        return sorted(self._left(), key=lambda slot: slot.when, reverse=True)

    @property
    def has_left(self) -> bool:
        """Whether there is any; it stays whoever's it is."""
        left = self.left()
        for slot in left:
            slot.release()
        return bool(left)

    def _left(self) -> Iterator[Slot]:
        folders = sorted(self.folder.iterdir()) if self.folder.is_dir() else []
        for folder in folders:
            handle = None
            with suppress(OSError):  # gone meanwhile, or not ours to open
                handle = _hold(folder)
            if handle is None:
                continue
            slot = Slot(folder, handle, _read_about(folder))
            if _is_file(slot.path):
                yield slot
            elif slot.path.exists() or slot.path.is_symlink():
                slot.release()  # not a file that this program wrote
            else:
                slot.remove()  # it ended before there was anything to keep


def _hold(folder: Path) -> int | None:
    """Lock a folder if its name and mark are those of a slot; otherwise leave it untouched."""
    status = os.lstat(folder)
    named = _NAME.fullmatch(folder.name) and stat.S_ISDIR(status.st_mode) and is_ours(status)
    if not (named and _is_file(folder / _LOCK)):
        return None
    handle = hold(folder / _LOCK)
    if handle is None:
        return None
    mark = os.read(handle, len(_MARK) + 1)
    by_earlier = not mark and (_is_file(folder / _SESSION) or _read_about(folder) != About())
    if mark == _MARK or by_earlier:  # earlier versions left the lock empty
        return handle
    os.close(handle)
    return None


def _is_file(path: Path) -> bool:
    """Return whether *path* is a regular file of this user, not a symbolic link."""
    try:
        return not fault_of(os.lstat(path), own=True)
    except OSError:
        return False


def _write_about(folder: Path, about: About) -> None:
    with replacing(folder / _ABOUT) as draft:
        draft.write_text(json.dumps(asdict(about)), encoding="utf-8")


def _read_about(folder: Path) -> About:
    """Return what is told of the work; without it, or where it is damaged, there is still work."""
    try:
        with open_regular(folder / _ABOUT, own=True) as file:
            told = json.loads(file.read(_LONGEST_ABOUT))
        return About(str(told["name"]), str(told["session"]), str(told["mesh"]))
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return About()
