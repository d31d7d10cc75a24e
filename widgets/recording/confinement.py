"""Replays: their keys read and write files only below a given folder, or not at all.

The recording may come from an untrusted source, and its Ctrl+S must not overwrite any other file.
The keys of its actions are those of the recording, whatever the user's own keys are.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from weakref import WeakKeyDictionary

from vtk_segdeform.errors import SessionError

_folders: WeakKeyDictionary[Any, Path | None] = WeakKeyDictionary()
_keys: WeakKeyDictionary[Any, Mapping[str, Sequence[str]]] = WeakKeyDictionary()


@contextmanager
def confined(interactor: Any, folder: Path | None) -> Iterator[None]:
    """Confine file access of editors on *interactor* to *folder*; None forbids it."""
    was_confined, before = interactor in _folders, _folders.get(interactor)
    keys = _keys.get(interactor, {})
    _folders[interactor], _keys[interactor] = folder, {}
    try:
        yield
    finally:
        if was_confined:
            _folders[interactor], _keys[interactor] = before, keys
        else:
            del _folders[interactor], _keys[interactor]


def recorded_keys(interactor: Any) -> Mapping[str, Sequence[str]] | None:
    """Return the keys of actions in the recording that is replayed; None if none is.

    Actions that are not in the mapping have their default keys.
    """
    return _keys.get(interactor)


def set_recorded_keys(interactor: Any, keys: Mapping[str, Sequence[str]]) -> None:
    """Set the keys of actions in the recording that is replayed."""
    if interactor in _keys:
        _keys[interactor] = keys


def confined_path(interactor: Any, path: Path) -> Path:
    """Return *path* or, during a replay, the path of the same name in the folder of the replay.

    Raises
    ------
    SessionError
        If a replay has no folder, or a symbolic link leads out of it.
    """
    if interactor not in _folders:
        return path
    folder = _folders[interactor]
    if folder is None:
        raise SessionError(
            f"{path.name}: not accessed; a replay reads and writes files only in the folder passed "
            "to it"
        )
    target = folder / path.name
    if not target.resolve().is_relative_to(folder.resolve()):
        raise SessionError(
            f"{target}: is a link that leads out of the folder of the replay; remove it"
        )
    return target
