"""Validation of arguments of public functions, and short texts for values; for arrays see `arrays`.

A checking function returns the valid value or raises an `ArgumentError` that names the argument,
says what it must be, and shows the value in short form.
"""

from __future__ import annotations

import html
import math
import os
import reprlib
from abc import abstractmethod
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from .errors import ArgumentError

_T = TypeVar("_T")
_Callable = TypeVar("_Callable", bound=Callable[..., Any])
_LONGEST = 60  # characters of a value in a message
_LONGEST_PATH = 4096  # characters, as on Linux
_LARGEST = 10**20  # larger integers are described by their number of bits


class _Brief(reprlib.Repr):
    """Short text for any value; if its ``__repr__`` fails, the name of its type."""

    def __init__(self) -> None:
        super().__init__()
        self.maxstring = self.maxother = _LONGEST
        self.maxlevel, self.maxlist, self.maxtuple = 2, 4, 4

    def repr_int(self, x: int, level: int) -> str:  # noqa: ARG002 - reprlib's signature
        return repr(x) if abs(x) < _LARGEST else f"an integer of {x.bit_length()} bits"

    def repr_bytes(self, x: bytes, level: int) -> str:  # noqa: ARG002
        return repr(x) if len(x) < _LONGEST else f"{x[: _LONGEST // 2]!r}..."

    def repr_ndarray(self, x: Any, level: int) -> str:  # noqa: ARG002
        return f"an array of {x.dtype} and shape {x.shape}"


_BRIEF = _Brief()


def shown(value: object) -> str:
    """Return a short text for *value*, of any size and with any ``__repr__``.

    >>> shown([1] * 1000), len(shown("a" * 1000)), shown(10**5000)
    ('[1, 1, 1, 1, ...]', 60, 'an integer of 16610 bits')
    """
    return " ".join(_BRIEF.repr(value).split())


class Described:
    """An object described by its numbers: in one line, and as a table in a notebook."""

    @abstractmethod
    def facts(self) -> dict[str, str]:
        """Return its numbers as texts, by what they are."""

    def __repr__(self) -> str:
        return f"<{type(self).__name__} {'; '.join(map(': '.join, self.facts().items()))}>"

    def _repr_html_(self) -> str:
        cells = ((html.escape(name), html.escape(text)) for name, text in self.facts().items())
        rows = "".join(f"<tr><th>{name}</th><td>{text}</td></tr>" for name, text in cells)
        return f"<table><caption>{type(self).__name__}</caption>{rows}</table>"


def require(value: object, kind: type[_T] | tuple[type[_T], ...], name: str) -> _T:
    """Return *value* if it is an instance of *kind*, one class or several.

    >>> require(3, str, "name")
    Traceback (most recent call last):
    ...
    vtk_segdeform.errors.ArgumentError: name must be a str; got 3
    """
    if isinstance(value, kind):
        return value
    kinds = kind if isinstance(kind, tuple) else (kind,)
    expected = " or ".join(f"a {each.__name__}" for each in kinds)
    raise ArgumentError(f"{name} must be {expected}; got {shown(value)}")


def require_sequence(values: object, name: str) -> None:
    """Raise unless *values* is a list, a tuple, an array or another sequence except text."""
    known = isinstance(values, Sequence) or (isinstance(values, np.ndarray) and values.ndim > 0)
    if not known or isinstance(values, str | bytes | bytearray | memoryview):
        raise ArgumentError(f"{name} must be a sequence; got {shown(values)}")


def all_of(values: Sequence[_T], kind: type[_T], name: str) -> tuple[_T, ...]:
    """Return *values*, a sequence of instances of *kind*, as a tuple."""
    require_sequence(values, name)
    return tuple(require(value, kind, f"{name}[{k}]") for k, value in enumerate(values))


def as_flag(value: object, name: str) -> bool:
    """Return *value* as a bool; numpy's booleans are accepted, numbers are not."""
    if isinstance(value, bool | np.bool_):
        return bool(value)
    raise ArgumentError(f"{name} must be True or False; got {shown(value)}")


def as_switch(value: object, name: str) -> bool:
    """Return *value* as a bool; as in VTK, 1 and 0 are accepted."""
    if isinstance(value, bool | np.bool_ | int | np.integer) and value in (0, 1):
        return bool(value)
    raise ArgumentError(f"{name} must be True or False; got {shown(value)}")


def as_text(value: object, name: str, most: float = math.inf) -> str:
    """Return *value* if it is a str of at most *most* characters, encodable, without null."""
    text = require(value, str, name)
    if len(text) > most:
        raise ArgumentError(f"{name} has {len(text)} characters; at most {most} are allowed")
    if "\0" in text:
        raise ArgumentError(f"{name} must not contain a null character; got {shown(text)}")
    try:
        text.encode()
    except UnicodeEncodeError:
        raise ArgumentError(f"{name} cannot be encoded; got {shown(text)}") from None
    return text


def as_callable(value: _Callable, name: str) -> _Callable:
    """Return *value* if it is callable."""
    if callable(value):
        return value
    raise ArgumentError(f"{name} must be callable; got {shown(value)}")


def as_path(path: str | os.PathLike[str], name: str = "path") -> Path:
    """Return *path* as a Path; file descriptors, bytes and invalid names are rejected."""
    if not isinstance(path, str | os.PathLike):
        raise ArgumentError(f"{name} must be a str or a Path; got {shown(path)}")
    text = os.fspath(path)
    if not isinstance(text, str):
        raise ArgumentError(f"{name} must be a str or a Path; got {shown(text)}")
    if "\0" in text:
        raise ArgumentError(f"{name} must not contain a null character; got {shown(text)}")
    if len(text) > _LONGEST_PATH:
        raise ArgumentError(
            f"{name} has {len(text)} characters; at most {_LONGEST_PATH} are allowed"
        )
    try:
        os.fsencode(text)
    except UnicodeEncodeError:
        raise ArgumentError(f"{name} cannot be encoded as a file name; got {shown(text)}") from None
    return Path(text)
