"""Files that another file names: read only from its own folder and below."""

from __future__ import annotations

from pathlib import Path


def file_inside(folder: Path, name: str) -> Path | None:
    """Return the file *name* in *folder* or below, links resolved; None if there is none.

    Also None for a path that leads outside, whether absolute, by ``..`` or through a link.
    """
    folder = folder.resolve()
    try:
        file = (folder / name).resolve()
        inside = bool(name) and file.is_relative_to(folder) and file.is_file()
    except (OSError, ValueError, RuntimeError):  # too long, or circular links
        return None
    return file if inside else None
