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
        return [Path(name) for name in ([kept] if isinstance(kept, str) else kept)]

    def add(self, path: Path) -> None:
        """Put a file first."""
        path = path.absolute()
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
