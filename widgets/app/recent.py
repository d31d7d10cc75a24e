"""The files that were open last, kept in the user's settings."""

from __future__ import annotations

from pathlib import Path
from typing import Any

_KEY = "recent files"
_MOST = 8


class Recent:
    """A short list of files, the last one first.

    Parameters
    ----------
    settings : QSettings
        Where it is kept; another program that runs meanwhile writes there too.
    """

    def __init__(self, settings: Any) -> None:
        self._settings = settings

    @property
    def paths(self) -> list[Path]:
        """The files; some may be gone."""
        self._settings.sync()
        kept = self._settings.value(_KEY) or []
        names = kept if isinstance(kept, list) else [kept]
        return [Path(name) for name in names if isinstance(name, str) and name]

    def add(self, path: Path) -> None:
        """Put a file first, unless its name is not valid Unicode, which settings cannot store."""
        path = path.absolute()
        if not _is_text(str(path)):
            return
        self._keep([path, *(each for each in self.paths if each != path)][:_MOST])

    def drop(self, path: Path) -> None:
        """Take a file out."""
        self._keep([each for each in self.paths if each != path.absolute()])

    def clear(self) -> None:
        """Take all out."""
        self._keep([])

    def _keep(self, paths: list[Path]) -> None:
        self._settings.setValue(_KEY, [str(path) for path in paths])
        self._settings.sync()


def _is_text(name: str) -> bool:
    try:
        name.encode()
    except UnicodeEncodeError:
        return False
    return True
