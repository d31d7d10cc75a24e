"""Open a file for reading only if it is regular: a pipe would block, a device may never end.

A regular file that is larger than `LARGEST_FILE` is refused as well, before it is read.

A file can be replaced at any moment, so the checks are made on the open file, not on its name.
"""

from __future__ import annotations

import errno
import os
import stat
from pathlib import Path
from typing import BinaryIO

LARGEST_FILE = 2 << 30
"""Bytes of a file beyond which it is refused before it is read.

Twenty million vertices as text, of which reading takes some 30 GB of memory.  A file that is larger
by mistake, such as a disk image or one with a hole, would fill the memory first."""

# O_BINARY exists on Windows only, the others everywhere else.
_READ = os.O_RDONLY | sum(
    getattr(os, flag, 0) for flag in ("O_BINARY", "O_CLOEXEC", "O_NONBLOCK", "O_NOCTTY")
)


def open_regular(path: str | os.PathLike[str], *, own: bool = False) -> BinaryIO:
    """Open a regular file for reading bytes, without ever blocking.

    Parameters
    ----------
    path : path
        The file.
    own : bool
        Require that the current user owns it and that *path* is not a symbolic link.

    Raises
    ------
    OSError
        If it cannot be opened, is not a regular file or is too large; ``strerror`` gives the
        reason.
    """
    name = name_of(path)
    try:
        handle = os.open(name, _READ | (getattr(os, "O_NOFOLLOW", 0) if own else 0))
    except FileNotFoundError as fault:
        raise FileNotFoundError(fault.errno, "there is no such file", name) from None
    try:
        status = os.fstat(handle)
        if what := fault_of(status, own=own):
            raise OSError(errno.EINVAL, f"is {what}", name)
        if what := excess_of(status):
            raise OSError(errno.EFBIG, what, name)
        if status.st_size:
            return open(handle, "rb")
    except BaseException:  # Ctrl+C as well: nobody else would close it
        os.close(handle)
        raise
    os.close(handle)
    return open(os.devnull, "rb")  # a file of the kernel, in /proc, may block, or never end


def read_regular(path: str | os.PathLike[str]) -> bytes:
    """Return the bytes of a file that `open_regular` opens."""
    with open_regular(path) as file:
        return file.read()


def excess_of(status: os.stat_result) -> str:
    """Return that a file is too large to be read, in words; "" if it is not."""
    if status.st_size <= LARGEST_FILE:
        return ""
    return f"has {status.st_size / 1e9:.3g} GB; the limit is {LARGEST_FILE / 1e9:.3g} GB"


def name_of(path: str | os.PathLike[str]) -> str:
    """Return *path* as text; OSError if it contains a null character."""
    name = os.fsdecode(path)
    if "\0" in name:
        raise OSError(errno.EINVAL, "a file name cannot contain a null character", name)
    return name


def fault_of(status: os.stat_result, *, own: bool = False) -> str:
    """Return why a file is not regular, or with *own* not this user's, in words; "" if it is."""
    if stat.S_ISDIR(status.st_mode):
        return "a folder, not a file"
    if stat.S_ISLNK(status.st_mode):
        return "a link, not a file"
    if not stat.S_ISREG(status.st_mode):
        return "a device or a pipe, not a file"
    return "another user's" if own and not is_ours(status) else ""


def is_ours(status: os.stat_result) -> bool:
    """Return whether the current user owns the file; always True on Windows."""
    return not hasattr(os, "geteuid") or bool(status.st_uid == os.geteuid())


def file_inside(folder: Path, name: str) -> Path | None:
    """Return the file *name* in *folder* or below, with links resolved; None if there is none.

    Also None for paths that lead outside: absolute, by ``..`` or through a link.
    """
    folder = folder.resolve()
    try:
        file = (folder / name).resolve()
        inside = bool(name) and file.is_relative_to(folder) and file.is_file()
    except (OSError, ValueError, RuntimeError):  # too long, or circular links
        return None
    return file if inside else None
