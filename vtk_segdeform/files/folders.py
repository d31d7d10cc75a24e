"""Folders of the current user for caches and unsaved work.

                     bindings                             unsaved work
    Linux            $XDG_CACHE_HOME or ~/.cache          $XDG_DATA_HOME or ~/.local/share
    macOS            ~/Library/Caches                     ~/Library/Application Support
    Windows          %LOCALAPPDATA%                       %LOCALAPPDATA%

Both are subfolders of ``segdeform`` there.  Other settings, such as the list of recent files, are
stored by Qt, and compiled kernels by numba.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path


def cache_folder() -> Path | None:
    """Return the folder for bindings; None if caching is disabled.

    The environment variable ``SEGDEFORM_CACHE`` names another folder; 0 disables caching.
    """
    chosen = os.environ.get("SEGDEFORM_CACHE", "")
    if chosen:
        return None if chosen == "0" else Path(chosen)
    return _base("XDG_CACHE_HOME", ".cache", "Caches") / "segdeform" / "bindings"


def autosave_folder() -> Path:
    """Return the folder for unsaved work."""
    base = _base("XDG_DATA_HOME", os.path.join(".local", "share"), "Application Support")
    return base / "segdeform" / "unsaved"


def _base(variable: str, default: str, in_library: str) -> Path:
    """Return the folder that the system provides for files of one kind.

    On Linux, an environment variable with a default under the home folder; on macOS, a folder in
    the user's library.
    """
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local")
    if sys.platform == "darwin":
        return Path.home() / "Library" / in_library
    return Path(os.environ.get(variable) or Path.home() / default)
