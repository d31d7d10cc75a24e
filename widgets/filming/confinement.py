"""Where the keys of a replay write to: below a folder that it is given, or nowhere.

Whoever replays a recording has not typed its Ctrl+S.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from weakref import WeakKeyDictionary

from vtk_segdeform.errors import SessionError

_folders: WeakKeyDictionary[Any, Path | None] = WeakKeyDictionary()


@contextmanager
def confined(interactor: Any, folder: Path | None) -> Iterator[None]:
    """Have all that is done through *interactor* write below *folder*; None: nowhere."""
    was_confined, before = interactor in _folders, _folders.get(interactor)
    _folders[interactor] = folder
    try:
        yield
    finally:
        if was_confined:
            _folders[interactor] = before
        else:
            del _folders[interactor]


def place_of(interactor: Any, path: Path) -> Path:
    """Return where to write what belongs at *path*: there or, in a replay, below its folder.

    Raises
    ------
    SessionError
        In a replay that was given no folder, or where a link leads out of it.
    """
    if interactor not in _folders:
        return path
    folder = _folders[interactor]
    if folder is None:
        raise SessionError(
            f"{path.name}: left alone; a replay reads and writes files only below a folder that "
            "it is given"
        )
    place = folder / path.name
    if not place.resolve().is_relative_to(folder.resolve()):
        raise SessionError(f"{place}: leads out of the folder that the replay was given")
    return place
