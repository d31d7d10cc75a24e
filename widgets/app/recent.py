"""Recently opened files, stored in the user's settings."""

from __future__ import annotations

from pathlib import Path
from typing import Any

_KEY = "recent files"
_MOST_FILES = 8


class Recent:
    """A short list of files, the latest first.

    Parameters
    ----------
    settings : QSettings
        Where the list is stored; other running programs may write there too.
    """

    def __init__(self, settings: Any) -> None:
        self._settings = settings

    @property
    def paths(self) -> list[Path]:
        """The files; some may no longer exist."""
        self._settings.sync()
        stored = self._settings.value(_KEY) or []
        names = stored if isinstance(stored, list) else [stored]
        return [Path(name) for name in names if isinstance(name, str) and name]

    def add(self, path: Path) -> None:
        """Add a file first, unless its name is invalid Unicode, which settings cannot store."""
        path = path.absolute()
        if not _is_text(str(path)):
            return
        self._store([path, *(each for each in self.paths if each != path)][:_MOST_FILES])

    def drop(self, path: Path) -> None:
        """Remove a file."""
        self._store([each for each in self.paths if each != path.absolute()])

    def clear(self) -> None:
        """Remove all files."""
        self._store([])

    def _store(self, paths: list[Path]) -> None:
        self._settings.setValue(_KEY, [str(path) for path in paths])
        self._settings.sync()


def _is_text(name: str) -> bool:
    try:
        name.encode()
    except UnicodeEncodeError:
        return False
    return True
