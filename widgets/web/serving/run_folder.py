"""The private folder of one run of the server.

    TEMPORARY/segdeform-serve-8f31.../lock      locked while the server runs
                                      CLIENT/   uploads and autosave of one client

Only this user can enter the folder (mode 0700).  It is deleted when the server ends.  A server that
is killed leaves it behind, and the next one deletes it: a folder is abandoned if it belongs to this
user, its name has 16 hexadecimal digits, and its lock contains the mark of this program and can be
locked.  Nothing else is ever deleted.
"""

from __future__ import annotations

import os
import re
import secrets
import shutil
import stat
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from vtk_segdeform.files import fault_of, hold, is_ours

_PREFIX = "segdeform-serve-"
_NAME = re.compile(_PREFIX + "[0-9a-f]{16}")
_LOCK = "lock"
_MARK = b"vtk_segdeform: private folder of segdeform serve\n"


@contextmanager
def run_folder(parent: Path | None = None) -> Iterator[Path]:
    """Yield a new private folder, which is deleted afterwards.

    Parameters
    ----------
    parent : Path, optional
        Where to create it; by default, the system's folder for temporary files.

    Raises
    ------
    OSError
        If the folder cannot be created.
    """
    parent = Path(tempfile.gettempdir()) if parent is None else parent
    _delete_abandoned(parent)
    folder = parent / f"{_PREFIX}{secrets.token_hex(8)}"
    folder.mkdir(mode=0o700)
    handle = hold(folder / _LOCK)
    try:
        if handle is not None:  # some file systems have no locks; nobody deletes the folder then
            os.write(handle, _MARK)
        yield folder
    finally:
        _delete(folder)
        if handle is not None:
            os.close(handle)


def _delete_abandoned(parent: Path) -> None:
    with suppress(OSError):  # the folder may not be readable
        for folder in [each for each in parent.iterdir() if _NAME.fullmatch(each.name)]:
            with suppress(OSError):  # another server deletes it at the same time
                _delete_one(folder)


def _delete_one(folder: Path) -> None:
    status = os.lstat(folder)
    lock = folder / _LOCK
    if (
        not stat.S_ISDIR(status.st_mode)
        or not is_ours(status)
        or fault_of(os.lstat(lock), own=True)
    ):
        return
    handle = hold(lock)
    if handle is None:
        return
    try:
        if os.read(handle, len(_MARK) + 1) == _MARK:
            _delete(folder)
    finally:
        os.close(handle)


def _delete(folder: Path) -> None:
    """Delete the folders of clients first and the lock last, so that a rest is still marked."""
    for each in folder.iterdir():
        if each.name != _LOCK:
            shutil.rmtree(each, ignore_errors=True)
    with suppress(OSError):  # Windows cannot delete an open file
        (folder / _LOCK).unlink()
        folder.rmdir()
