"""A recording read whole, and checked, before anything of it is done."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator

from vtk_segdeform.checks import as_path, require, require_sequence
from vtk_segdeform.errors import SessionError

from .transcript import TITLE, Entry, Steps, read_entry

Moment = tuple[float, Entry, tuple[int, ...]]
"""When, in seconds; what; and how many steps each solve was given at it."""


def read_recording(source: str | os.PathLike[str] | Iterable[str]) -> list[Moment]:
    """Return what happened, line by line, for those that say something.

    Parameters
    ----------
    source : path or iterable of str
        The file, or its lines.

    Raises
    ------
    SessionError
        If there is no such file, or a line makes no sense: the text has its number.
    """
    name = "recording"
    lines: Iterable[str]
    if isinstance(source, str | os.PathLike):
        source = as_path(source, "source")
        name = str(source)
        if not os.path.isfile(source):  # a device would be read for ever
            raise SessionError(f"{name}: cannot be read; it is no file, or not there")
        try:
            lines = source.read_bytes().decode(errors="replace").splitlines()
        except OSError as fault:
            raise SessionError(f"{name}: cannot be read ({fault.strerror or fault})") from fault
    else:
        if not isinstance(source, Iterator):
            require_sequence(source, "source")
        lines = source
    entries: list[tuple[float, Entry]] = []
    began = False
    for number, line in enumerate(lines, start=1):
        try:
            text = require(line, str, "a line").strip()
            if not began:
                began = _is_title(text)
            elif text and not text.startswith("#"):
                entries.append(read_entry(text))
        except ValueError as fault:
            raise SessionError(f"{name}, line {number}: {fault}") from None
    if not began:
        raise SessionError(f"{name}: is empty; a recording begins with {TITLE!r}")
    return _with_steps(entries)


def _is_title(text: str) -> bool:
    if text != TITLE:
        raise ValueError(f"a recording begins with {TITLE!r}; got {text[:60]!r}")
    return True


def _with_steps(entries: list[tuple[float, Entry]]) -> list[Moment]:
    """Return *entries*, each with the steps that are told after it."""
    found: list[Moment] = []
    for moment, entry in entries:
        if not isinstance(entry, Steps):
            found.append((moment, entry, ()))
        elif found:
            before, what, steps = found[-1]
            found[-1] = before, what, (*steps, entry.number)
    return found
