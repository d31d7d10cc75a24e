"""Files that appear whole or not at all: written beside their place under another name, renamed.

    with replacing(path) as draft, open(draft, "wb") as file:
        file.write(...)

Until the block has ended without an error the file at *path* is what it was, and after an error
nothing else is left.  A process that is killed leaves its draft, ``.segdeform-<16 digits>.part``;
the next one that writes to this folder deletes it.  Drafts are locked by those who write them
(`lock`), so that a draft which can be locked is nobody's any more; where files cannot be locked, as
on Windows, one that nobody has touched for a day.  Nothing else is ever deleted.
"""

from __future__ import annotations

import errno
import os
import re
import secrets
import stat
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from .lock import holds
from .regular_file import fault_of, is_ours, name_of

_DRAFT = re.compile(r"\.segdeform-[0-9a-f]{16}\.part(\.\w{1,8})?")
_IN_FOLDER = re.compile(r"\d{4,}\.png")  # all that a folder is ever filled with
_LOCKS = sys.platform != "win32"  # there a locked file keeps out also who writes it
_A_DAY = 86_400.0  # seconds
_TRIES = 5


@contextmanager
def replacing(
    path: str | os.PathLike[str],
    *,
    folder: bool = False,
    follow: bool = True,
    durable: bool = True,
) -> Iterator[Path]:
    """Yield an empty file to write to, which takes the place of *path* if that succeeds.

    Parameters
    ----------
    path : path
        What is replaced keeps its mode; a link stays, and the file it points to is replaced.
    folder : bool
        Whether it is a folder, to be filled with numbered pictures; there must be none yet.
    follow : bool
        False: a link is replaced itself.
    durable : bool
        Whether it is on the disk before the old file goes.

    Raises
    ------
    OSError
        If it cannot be written; ``strerror`` says why.
    """
    target = require_place(path, follow=follow)
    _sweep(target.parent)
    mode = _mode_of(target)
    draft, handle = _begun(target, folder, 0o666 if mode is None else 0o600)
    try:
        yield draft
        if durable and not folder:
            _flush(draft)
        if mode is not None:
            draft.chmod(mode)
        os.replace(draft, target)
    finally:
        with suppress(OSError):  # what went wrong before says more
            _delete(draft)
        if handle is not None:
            os.close(handle)
    if durable:
        with suppress(OSError):  # not every system writes out folders
            _flush(target.parent)


def require_place(path: str | os.PathLike[str], *, follow: bool = True) -> Path:
    """Return the file that *path* names, links followed, if a file can be written there.

    Raises
    ------
    OSError
        If not: no such folder, no permission, or what has that name is no file.
    """
    name = name_of(path)
    target = Path(os.path.realpath(name)) if follow else Path(os.path.abspath(name))
    folder = target.parent
    try:
        fault = fault_of(os.lstat(target))
    except FileNotFoundError:
        fault = ""
    if fault and (follow or not target.is_symlink()):
        raise OSError(errno.EINVAL, f"is {fault}; choose another name", name)
    if not folder.is_dir():
        raise OSError(errno.ENOENT, f"there is no folder {folder}", name)
    if not os.access(folder, os.W_OK | os.X_OK):
        raise OSError(errno.EACCES, f"the folder {folder} may not be written to", name)
    return target


def is_draft(name: str) -> bool:
    """Tell whether a file has the name of a draft."""
    return _DRAFT.fullmatch(name) is not None


def _begun(target: Path, folder: bool, mode: int) -> tuple[Path, int | None]:
    """Return a new draft, and what holds it; None where nothing can."""
    suffix = target.suffix if re.fullmatch(r"\.\w{1,8}", target.suffix) else ""
    for last in (*[False] * (_TRIES - 1), True):
        draft = target.with_name(f".segdeform-{secrets.token_hex(8)}.part{suffix}")
        if folder:
            draft.mkdir()
            handle = _opened(draft, os.O_RDONLY) if _LOCKS else None
        else:
            handle = os.open(draft, os.O_RDWR | os.O_CREAT | os.O_EXCL, mode)
        if handle is not None and _LOCKS and holds(handle, draft):
            return draft, handle
        if handle is not None:
            os.close(handle)
        if last or not _LOCKS:
            return draft, None
        _delete(draft)  # or somebody has, who took it for abandoned before it was held
    raise AssertionError  # the last one is returned


def _sweep(folder: Path) -> None:
    """Delete drafts whose writers are gone."""
    # A folder that cannot be read can still be written to; and of two that sweep, one is late.
    with suppress(OSError), os.scandir(folder) as entries:
        for draft in [folder / entry.name for entry in entries if is_draft(entry.name)]:
            with suppress(OSError):
                _sweep_one(draft)


def _sweep_one(draft: Path) -> None:
    status = os.lstat(draft)
    if not is_ours(status) or not (stat.S_ISREG(status.st_mode) or stat.S_ISDIR(status.st_mode)):
        return
    if not _LOCKS:
        if time.time() - status.st_mtime > _A_DAY:
            _delete(draft)
        return
    handle = _opened(draft, os.O_RDONLY if stat.S_ISDIR(status.st_mode) else os.O_RDWR)
    try:
        if holds(handle, draft):
            _delete(draft)  # while it is held
    finally:
        os.close(handle)


def _opened(draft: Path, how: int) -> int:
    return os.open(draft, how | os.O_NONBLOCK | os.O_NOFOLLOW)


def _delete(draft: Path) -> None:
    """Delete a draft; of a folder the pictures, and then itself if that was all."""
    if not draft.is_dir():
        draft.unlink(missing_ok=True)
        return
    for each in list(draft.iterdir()):
        if _IN_FOLDER.fullmatch(each.name) and not each.is_symlink():
            each.unlink(missing_ok=True)
    with suppress(OSError):
        draft.rmdir()


def _mode_of(target: Path) -> int | None:
    """Return the permissions of a file, or None if there is none."""
    with suppress(FileNotFoundError):
        status = os.lstat(target)
        return status.st_mode & 0o777 if stat.S_ISREG(status.st_mode) else None
    return None


def _flush(path: Path) -> None:
    """Write a file, or the names in a folder, to the disk."""
    handle = os.open(path, os.O_RDONLY if path.is_dir() else os.O_RDWR)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
