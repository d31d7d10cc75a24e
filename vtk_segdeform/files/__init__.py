"""Files on disk: folders, atomic replacement, locks between processes, and safe opening.

The files, in reading order:

    folders             folders of the current user for caches and unsaved work
    atomic              write a draft, then rename it over the old file
    lock                lock files, released when their process ends
    regular_file        open regular files only: no pipes, no devices
    landlock            a process gives up its right to open other files
"""

from . import landlock
from .atomic import is_draft, replacing, require_place
from .folders import autosave_folder, cache_folder
from .lock import hold
from .regular_file import (
    LARGEST_FILE,
    excess_of,
    fault_of,
    file_inside,
    is_ours,
    open_regular,
    read_regular,
)

__all__ = [
    "LARGEST_FILE",
    "autosave_folder",
    "cache_folder",
    "excess_of",
    "fault_of",
    "file_inside",
    "hold",
    "is_draft",
    "is_ours",
    "landlock",
    "open_regular",
    "read_regular",
    "replacing",
    "require_place",
]
