"""Lock files: held by one process, visible to all others, released when that process ends.

The operating system manages the lock, so that it does not outlive a crash or a ``kill -9``, and a
new process with a reused id is not mistaken for the old one.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path

if sys.platform == "win32":
    import msvcrt

    def _lock(handle: int) -> None:
        msvcrt.locking(handle, msvcrt.LK_NBLCK, 1)

else:
    import fcntl

    def _lock(handle: int) -> None:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)


def hold(path: Path) -> int | None:
    """Lock a file, which is created if it does not exist.

    Returns
    -------
    handle : int or None
        An open file, locked until it is closed; None if it is locked already, even by this
        process, if it was deleted meanwhile, or where files cannot be locked.

    Raises
    ------
    OSError
        If the file cannot be opened.
    """
    handle = os.open(path, os.O_RDWR | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0), 0o600)
    try:
        _lock(handle)
        if os.path.samestat(os.fstat(handle), os.lstat(path)):
            return handle
    except OSError:  # locked by another
        pass
    except BaseException:
        os.close(handle)
        raise
    os.close(handle)
    return None
