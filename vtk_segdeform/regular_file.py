"""Open a file to read only if it is a regular one: a pipe would be waited for, a device never ends.

What has a name may be exchanged at any moment, so the questions are asked of the open file.
"""

from __future__ import annotations

import errno
import os
import stat
from typing import BinaryIO

# Windows lacks all but the first, which no other system has.
_READ = os.O_RDONLY | sum(
    getattr(os, flag, 0) for flag in ("O_BINARY", "O_CLOEXEC", "O_NONBLOCK", "O_NOCTTY")
)


def open_regular(path: str | os.PathLike[str], *, own: bool = False) -> BinaryIO:
    """Return a regular file, open for reading bytes; it never waits.

    Parameters
    ----------
    path : path
        Its name.
    own : bool
        Whether it must be this user's, and no link to somewhere else.

    Raises
    ------
    OSError
        If it cannot be opened or is no such file; ``strerror`` says what it is instead.
    """
    name = name_of(path)
    try:
        handle = os.open(name, _READ | (getattr(os, "O_NOFOLLOW", 0) if own else 0))
    except FileNotFoundError as fault:
        raise FileNotFoundError(fault.errno, "there is no such file", name) from None
    try:
        if what := fault_of(os.fstat(handle), own=own):
            raise OSError(errno.EINVAL, f"is {what}", name)
        return open(handle, "rb")
    except BaseException:
        os.close(handle)
        raise


def name_of(path: str | os.PathLike[str]) -> str:
    """Return a path as text; OSError if it can be nobody's."""
    name = os.fsdecode(path)
    if "\0" in name:
        raise OSError(errno.EINVAL, "no file can have a null character in its name", name)
    return name


def fault_of(status: os.stat_result, *, own: bool = False) -> str:
    """Return what is not a regular file, or with *own* another user's, as words; "" if it is."""
    if stat.S_ISDIR(status.st_mode):
        return "a folder, not a file"
    if stat.S_ISLNK(status.st_mode):
        return "a link, not a file"
    if not stat.S_ISREG(status.st_mode):
        return "a device or a pipe, not a file"
    return "another user's" if own and not is_ours(status) else ""


def is_ours(status: os.stat_result) -> bool:
    """Tell whether this user owns a file, where files have owners."""
    return not hasattr(os, "geteuid") or bool(status.st_uid == os.geteuid())
