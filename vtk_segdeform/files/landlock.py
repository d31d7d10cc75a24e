"""Landlock: a process gives up, for good, its right to open any file but one.

The Linux kernel has it since 5.13, if it is not turned off.  Each of its versions covers more.

Source: <linux/landlock.h> and https://docs.kernel.org/userspace-api/landlock.html
"""

from __future__ import annotations

import ctypes
import os
import sys

# The numbers of its system calls are the same for all processors.
_CREATE, _ADD, _RESTRICT, _VERSION, _BENEATH, _READ_FILE = 444, 445, 446, 1, 1, 1 << 2
_NO_NEW_PRIVILEGES = 38


def version() -> int:
    """Return the version of Landlock of this kernel; 0 if it has none."""
    if sys.platform != "linux":
        return 0
    library = ctypes.CDLL(None, use_errno=True)
    return max(0, int(library.syscall(_CREATE, None, ctypes.c_size_t(0), _VERSION)))


def allow_only(path: str) -> None:
    """Make *path* the only file that this process can open, where the kernel supports it."""
    known = version()
    if not known:
        return
    library = ctypes.CDLL(None, use_errno=True)
    # All rights to files that this version knows, to bind and connect TCP, and to signal others.
    n_rights = 13 + (known >= 2) + (known >= 3) + (known >= 5)
    rules = [(1 << n_rights) - 1, 3, 3][: 1 + (known >= 4) + (known >= 6)]
    attributes = (ctypes.c_uint64 * len(rules))(*rules)
    size = ctypes.c_size_t(ctypes.sizeof(attributes))
    ruleset = library.syscall(_CREATE, attributes, size, 0)
    file = os.open(path, os.O_PATH | os.O_CLOEXEC)
    allowed = _READ_FILE.to_bytes(8, sys.byteorder) + file.to_bytes(4, sys.byteorder)
    failed = (
        ruleset < 0
        or library.syscall(_ADD, ruleset, _BENEATH, allowed, 0)
        or library.prctl(_NO_NEW_PRIVILEGES, 1, 0, 0, 0)
        or library.syscall(_RESTRICT, ruleset, 0)
    )
    if failed:
        raise OSError(f"the process cannot be confined: {os.strerror(ctypes.get_errno())}")
    os.close(file)
    os.close(ruleset)


def advice() -> str:
    """Return a sentence on the files to be careful with if the kernel has no Landlock; or ""."""
    if version():
        return ""
    return (
        "this system cannot keep VTK and PyMeshLab from opening other files than the given one "
        "(Linux 5.13 or newer with Landlock can): open .x3d, .wrl and .dae files only if "
        "you trust them"
    )
