"""Reading a recording: the whole file is checked before the first event is replayed."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator

from vtk_segdeform.checks import as_path, require, require_sequence
from vtk_segdeform.errors import SessionError
from vtk_segdeform.files import open_regular

from .limits import LARGEST_FILE, ReplayLimits
from .transcript import TITLE, Entry, Steps, Ticks, Window, read_entry

Moment = tuple[float, Entry, tuple[int, ...]]
"""A time in seconds, an entry, and the number of solver steps of each solve it caused."""


def read_recording(
    source: str | os.PathLike[str] | Iterable[str], limits: ReplayLimits | None = None
) -> list[Moment]:
    """Return the entries of a recording; empty lines and comments are skipped.

    Parameters
    ----------
    source : path or iterable of str
        The file, or its lines.
    limits : ReplayLimits, optional
        Limits on the events and the window size.

    Raises
    ------
    SessionError
        If the file cannot be read, or a line is invalid or exceeds the limits; the message has
        the number of the line.
    """
    limits = limits or ReplayLimits()
    name = "recording"
    lines: Iterable[str]
    if isinstance(source, str | os.PathLike):
        source = as_path(source, "source")
        name = str(source)
        lines = _lines(source)
    else:
        if not isinstance(source, Iterator):
            require_sequence(source, "source")
        lines = source
    entries: list[tuple[float, Entry]] = []
    began = False
    events = 0
    for number, line in enumerate(lines, start=1):
        try:
            text = require(line, str, "a line").strip()
            if not began:
                began = _is_title(text)
                continue
            events += 1  # comments too: an iterable may be endless
            if text and not text.startswith("#"):
                entries.append(read_entry(text))
                events += _size(entries[-1][1], limits.pixels) - 1
            if events > limits.events:
                raise ValueError(
                    f"the limit of {limits.events:,} events and timer ticks is exceeded; raise it "
                    "to replay this recording"
                )
        except ValueError as fault:
            raise SessionError(f"{name}, line {number}: {fault}") from None
    if not began:
        raise SessionError(f"{name}: is empty; a recording begins with {TITLE!r}")
    return _with_steps(entries)


def _lines(path: str | os.PathLike[str]) -> list[str]:
    try:
        with open_regular(path) as file:
            content = file.read(LARGEST_FILE + 1)
    except OSError as fault:
        name = os.fsdecode(path)
        raise SessionError(f"{name}: cannot be read ({fault.strerror or fault})") from fault
    if len(content) > LARGEST_FILE:
        raise SessionError(f"{os.fsdecode(path)}: exceeds the limit of {LARGEST_FILE:,} bytes")
    return content.decode(errors="replace").splitlines()


def _size(entry: Entry, pixels: int) -> int:
    """Return the number of events an entry counts as; ValueError if it is too large a window."""
    if isinstance(entry, Window) and entry.width * entry.height > pixels:
        raise ValueError(
            f"a window of {entry.width} x {entry.height} exceeds the limit of {pixels:,} pixels"
        )
    return entry.times if isinstance(entry, Ticks) else 1


def _is_title(text: str) -> bool:
    if text != TITLE:
        raise ValueError(f"a recording begins with {TITLE!r}; got {text[:60]!r}")
    return True


def _with_steps(entries: list[tuple[float, Entry]]) -> list[Moment]:
    """Return *entries*, each with the numbers of steps recorded after it."""
    found: list[Moment] = []
    for moment, entry in entries:
        if not isinstance(entry, Steps):
            found.append((moment, entry, ()))
        elif found:
            before, what, steps = found[-1]
            found[-1] = before, what, (*steps, entry.number)
    return found
