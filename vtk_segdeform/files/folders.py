"""Folders of the current user for caches and unsaved work, where the system has them.

Other settings, such as the list of recent files, are stored by Qt, and compiled kernels by numba.
"""

from __future__ import annotations

import os
from pathlib import Path

from ..importing import imported

_OURS = "segdeform"


def cache_folder() -> Path | None:
    """Return the folder for bindings; None if caching is disabled.

    The environment variable ``SEGDEFORM_CACHE`` names another folder; 0 disables caching.  Nothing
    is cached without platformdirs: the Python of a ParaView needs numpy and scipy only.
    """
    chosen = os.environ.get("SEGDEFORM_CACHE", "")
    if chosen:
        return None if chosen == "0" else Path(chosen)
    try:
        imported("platformdirs")
        from platformdirs import user_cache_path
    except ModuleNotFoundError:
        return None
    return user_cache_path(_OURS, appauthor=False) / "bindings"


def autosave_folder() -> Path:
    """Return the folder for unsaved work."""
    imported("platformdirs")
    from platformdirs import user_data_path

    return user_data_path(_OURS, appauthor=False) / "unsaved"
