"""Arrays and names that a file format cannot store: replacements and warnings.

An array that a format cannot store is left out; a name that is invalid or reserved in its syntax is
replaced by another one.  Both are logged as warnings, which the command line prints.  The file
is valid in any case.
"""

from __future__ import annotations

import codecs
import logging
from collections.abc import Callable, Container, Iterable, Mapping, Sequence

import numpy as np
import pyvista as pv
from vtkmodules.vtkCommonCore import vtkStringArray

from ..errors import MeshError

HEADER = "Header"  # a field array with the title of a file, in formats that have one
COMMENTS = "Comments"  # a field array with the comments of a file, likewise
CELL_TYPES = "types of the cells of a grid"  # a field array, see `grids`
_log = logging.getLogger(__name__)
_LONGEST = 200  # characters; some readers store names in buffers of fixed size


def decoded(data: bytes) -> str:
    """Return *data* decoded as UTF-8 or, if that fails, as Latin-1, which never fails."""
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("latin-1")


def text_of(data: bytes) -> str:
    """Return the text of a file, `decoded`; MeshError if it is in UTF-16, or not text at all."""
    return decoded(text_bytes(data))


def text_bytes(data: bytes) -> bytes:
    """Return the bytes of `text_of`, without the mark of UTF-8 before them."""
    if b"\0" in data[:1000]:
        raise MeshError("is UTF-16 text, or not text at all; save it as UTF-8 or ASCII text")
    return data.removeprefix(codecs.BOM_UTF8)


def plain_names(
    names: Iterable[str],
    reserved: Container[str] = (),
    *,
    refused: str = "",
    measure: Callable[[str], int] = len,
) -> dict[str, str]:
    """Return a unique valid name to write for each of *names*; valid ones are unchanged.

    Parameters
    ----------
    names : iterable of str
        Any text.
    reserved : container of str
        Names with a special meaning in the format.
    refused : str
        Characters that a name must not contain, besides unprintable ones.
    measure : callable
        Returns the length of a name in the file; names longer than 200 are truncated.
    """
    given = dict.fromkeys(names)
    plain = {name: _plain(name, refused, measure) for name in given}
    result = {name: name for name in given if plain[name] == name and name not in reserved}
    taken = set(result)
    for name in given:
        if name in result:
            continue
        free, number = plain[name], 0
        while free in taken or free in reserved:
            number += 1
            free = f"{plain[name]}_{number}"
        taken.add(free)
        result[name] = free
    return {name: result[name] for name in given}


def _plain(name: str, refused: str, measure: Callable[[str], int]) -> str:
    letters = [c if c.isprintable() and c not in refused else "_" for c in name[:_LONGEST]]
    text = "".join(letters).strip()
    while measure(text) > _LONGEST:
        text = text[:-1]
    if text.endswith("\\"):  # in OBJ it would continue the line
        text = text[:-1] + "_"
    return text or "unnamed"


def warn_renamed(what: str, names: dict[str, str]) -> None:
    """Log a warning for each name that is replaced; *what* says what the name stands for."""
    for name, written in names.items():
        if name != written:
            _log.warning("%s %r is written as %r", what, name, written)


def warn_left_out(
    format_: str, surface: pv.PolyData, kept: Mapping[str, Sequence[str]], *, cells: bool = False
) -> None:
    """Log a warning that lists the arrays and cells of *surface* that the format cannot store.

    Comments are no data, and most files have some, so they are left out without a warning.

    Parameters
    ----------
    format_ : str
        Name of the format.
    surface : pyvista.PolyData
        The surface that is written.
    kept : mapping
        Names of the arrays that are written, for "point", "cell" and "field".
    cells : bool
        Whether vertex and line cells are written.
    """
    silent = (CELL_TYPES, COMMENTS) if get_names(surface, COMMENTS) else (CELL_TYPES,)
    lost = [
        f"{sort} array {name!r}"
        for sort in ("point", "cell", "field")
        for name in list(getattr(surface, f"{sort}_data"))
        if name not in (*kept.get(sort, ()), *(silent if sort == "field" else ()))
    ]
    for count, sort in ((surface.n_verts, "vertex"), (surface.n_lines, "line")):
        if count and not cells:
            lost.append(f"{count} {sort} cell{'s' if count > 1 else ''}")
    if lost:
        _log.warning("%s cannot store %s: left out", format_, ", ".join(lost))


def set_names(surface: pv.PolyData, key: str, names: Iterable[str]) -> None:
    """Store *names* as field array *key*; pyvista accepts ASCII text only."""
    array = vtkStringArray()
    array.SetName(key)
    for name in names:
        array.InsertNextValue(name)
    surface.GetFieldData().AddArray(array)


def get_names(surface: pv.PolyData, key: str) -> list[str]:
    """Return the texts of field array *key*; empty if it does not exist or is not text."""
    values = np.asarray(surface.field_data[key]) if key in surface.field_data else np.empty(0)
    return [str(name) for name in values.ravel()] if values.dtype.kind == "U" else []
