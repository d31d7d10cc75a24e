"""Files of a batch that are elsewhere, by URLs such as ``s3://...``, through fsspec.

Meshes are read one at a time.  SQLite needs a file of this machine: so the poses are written in a
temporary folder here, which is filled from the URL at the beginning.  From there they are copied
back at the end, however it comes, and every minute: after a kill, what is older is there.
"""

from __future__ import annotations

import json
import shutil
import time
import weakref
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path, PurePosixPath
from tempfile import TemporaryDirectory, mkdtemp
from typing import Any

from ..errors import ArgumentError, MissingDependencyError
from ..importing import imported

_PERIOD, _TIMES = 60.0, 10.0  # seconds, and times what a copy takes, between copies at least


def is_url(path: object) -> bool:
    """Return whether *path* is the URL of a file elsewhere."""
    return isinstance(path, str) and "://" in path


def found(url: str) -> list[str]:
    """Return the URLs of the files that a URL with or without a pattern names, sorted."""
    with _named(url):
        system, path = _system(url)
        return sorted(map(system.unstrip_protocol, system.glob(path)))


def read_json(url: str) -> Any:
    """Return the content of a JSON file."""
    with _named(url):
        system, path = _system(url)
        return json.loads(system.cat_file(path))


@contextmanager
def copied(url: str) -> Iterator[Path]:
    """Copy a file to this machine, under its name, for as long as the context is open."""
    with TemporaryDirectory() as folder:
        place = Path(folder) / PurePosixPath(url).name
        with _named(url):
            system, path = _system(url)
            system.get_file(path, str(place))
        yield place


class RemoteFolder:
    """A folder of this machine with files of a URL; it is deleted with this object."""

    def __init__(self, url: str, *names: str) -> None:
        self.url = url.rstrip("/")
        self.path = Path(mkdtemp(prefix="segdeform-"))
        weakref.finalize(self, shutil.rmtree, self.path, ignore_errors=True)
        self._next = time.monotonic() + _PERIOD
        for name in names:
            with _named(url):
                system, path = _system(f"{self.url}/{name}")
                if system.exists(path):
                    system.get_file(path, str(self.path / name))

    def __fspath__(self) -> str:
        return str(self.path)

    def send(self, name: str, file: Path | None = None) -> None:
        """Copy a *file*, by default that of this name in this folder, to the URL as *name*."""
        with _named(self.url):
            system, path = _system(f"{self.url}/{name}")
            system.makedirs(str(PurePosixPath(path).parent), exist_ok=True)
            system.put_file(str(file or self.path / name), path)

    def checkpoint(self, name: str, write: Callable[[Path], None]) -> None:
        """Let *write* write a file, and send it as *name*, unless that was done a moment ago."""
        began = time.monotonic()
        if began >= self._next:
            write(copy := self.path / f"copy-of-{name}")
            self.send(name, copy)
            now = time.monotonic()
            self._next = now + max(_PERIOD, _TIMES * (now - began))


def _system(url: str) -> tuple[Any, str]:
    """Return the file system of a URL, and the path there."""
    try:
        imported("fsspec")
    except ImportError:
        raise MissingDependencyError(
            f"{url} is a URL, which requires fsspec; pip install 'vtk-segdeform[remote]'"
        ) from None
    from fsspec.core import url_to_fs

    system, path = url_to_fs(url)
    return system, str(path)


@contextmanager
def _named(url: str) -> Iterator[None]:
    """Raise errors of fsspec, and of the libraries that it uses, as an ArgumentError."""
    try:
        yield
    except (ArgumentError, MissingDependencyError):
        raise
    except ImportError as fault:  # such as s3fs
        raise MissingDependencyError(f"{url} cannot be opened: {fault}") from None
    except Exception as fault:  # noqa: BLE001 - whatever fsspec, or a library that it uses, raises
        raise ArgumentError(f"{url} cannot be read or written: {fault!r}") from None
