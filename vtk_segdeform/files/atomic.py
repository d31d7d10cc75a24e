"""Atomic replacement of files: write to a temporary file in the same folder, then rename it.

    with replacing(path) as draft, open(draft, "wb") as file:
        file.write(...)

The file at *path* is replaced when the block ends without an error; otherwise it stays unchanged
and the draft is deleted.  A process that is killed leaves its draft behind, a file named
``.segdeform-<16 digits>.part``; a write to the same folder deletes it when it has not changed for a
day.  Nothing else is ever deleted.
"""

from __future__ import annotations

import errno
import os
import re
import secrets
import stat
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from .regular_file import fault_of, is_ours, name_of

_DRAFT = re.compile(r"\.segdeform-[0-9a-f]{16}\.part(\.\w{1,8})?")
_A_DAY = 86_400.0  # seconds


@contextmanager
def replacing(
    path: str | os.PathLike[str],
    *,
    follow: bool = True,
    durable: bool = True,
) -> Iterator[Path]:
    """Yield an empty file to write to; it replaces *path* when the block succeeds.

    Parameters
    ----------
    path : path
        The new file keeps the mode of the old one.  If *path* is a symbolic link, its target is
        replaced.
    follow : bool
        If False, replace a symbolic link itself.
    durable : bool
        Flush the new file to the disk before it replaces the old one.

    Raises
    ------
    OSError
        If the file cannot be written; ``strerror`` gives the reason.
    """
    target = require_place(path, follow=follow)
    _sweep(target.parent)
    mode = _mode_of(target)
    draft = _create_draft(target, 0o666 if mode is None else 0o600)
    try:
        yield draft
        if durable:
            _flush(draft)
        if mode not in (None, _mode_of(draft)):  # some file systems have one mode for all
            os.chmod(draft, mode)
        os.replace(draft, target)
    finally:
        with suppress(OSError):  # do not hide the error that led here
            draft.unlink(missing_ok=True)
    if durable:
        with suppress(OSError):  # folders cannot be flushed on every system
            _flush(target.parent)


def require_place(path: str | os.PathLike[str], *, follow: bool = True) -> Path:
    """Return the file that *path* names, symbolic links resolved, if it can be written.

    Raises
    ------
    OSError
        If its folder does not exist or is not writable, or *path* exists and is not a regular file.
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
    """Return whether *name* is that of a draft."""
    return _DRAFT.fullmatch(name) is not None


def _create_draft(target: Path, mode: int) -> Path:
    suffix = target.suffix if re.fullmatch(r"\.\w{1,8}", target.suffix) else ""
    draft = target.with_name(f".segdeform-{secrets.token_hex(8)}.part{suffix}")
    os.close(os.open(draft, os.O_RDWR | os.O_CREAT | os.O_EXCL, mode))
    return draft


def _sweep(folder: Path) -> None:
    """Delete the abandoned drafts in a folder."""
    # The folder may be writable but not readable, and another process may sweep at the same time.
    with suppress(OSError), os.scandir(folder) as entries:
        for draft in [folder / entry.name for entry in entries if is_draft(entry.name)]:
            with suppress(OSError):
                status = os.lstat(draft)
                is_plain = stat.S_ISREG(status.st_mode)
                if is_ours(status) and is_plain and time.time() - status.st_mtime > _A_DAY:
                    draft.unlink(missing_ok=True)


def _mode_of(target: Path) -> int | None:
    """Return the permissions of a file, or None if there is none."""
    with suppress(FileNotFoundError):
        status = os.lstat(target)
        return status.st_mode & 0o777 if stat.S_ISREG(status.st_mode) else None
    return None


def _flush(path: Path) -> None:
    """Flush a file, or the entries of a folder, to the disk."""
    handle = os.open(path, os.O_RDONLY if path.is_dir() else os.O_RDWR)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
