"""Files that another file refers to, restricted to the folder of that file and below."""

from __future__ import annotations

from pathlib import Path


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
