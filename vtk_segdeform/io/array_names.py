"""Arrays, names, texts and digits that a file format cannot store: replacements and warnings.

Every format stores text in UTF-8 without null characters, which end a text in most programs; so
`with_storable_texts` gives a surface only such text before any writer sees it.  An array that a
format cannot store is left out; a name that is invalid or reserved in its syntax is replaced by
another one; coordinates are rounded.  All of it is logged as warnings, which the command line
prints.  The file is valid in any case.

Single precision has 7 digits of the distance from the origin: near it these are enough, but a body
of 2 m at 5,400 km is stored in steps of 0.5 m.
"""

from __future__ import annotations

import codecs
import logging
from collections.abc import Callable, Container, Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import pyvista as pv
from vtkmodules.vtkCommonCore import vtkStringArray

from ..arrays import FloatArray, IntArray, bounds_of
from ..errors import MeshError
from ..geometry import signed_volume

HEADER = "Header"  # a field array with the title of a file, in formats that have one
COMMENTS = "Comments"  # a field array with the comments of a file, likewise
IS_ROUNDING = "segdeform_rounding"  # an attribute of the log records of rounded coordinates
_log = logging.getLogger(__name__)
# Of the size, and of the volume: the command line tells errors to 0.001 % of the size.
_VISIBLE = 1e-5
_ROUNDING = 1e-9  # of areas and volumes, in sizes
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
    if b"\0" in data:
        raise MeshError("is UTF-16 text, or not text at all; save it as UTF-8 or ASCII text")
    return data.removeprefix(codecs.BOM_UTF8)


def storable(text: str | bytes | None) -> str:
    r"""Return *text* as every format can store it: valid in UTF-8, without null characters.

    >>> storable("a\0b"), storable(b"Gr\xf6\xdfe"), storable(None)
    ('a_b', 'Größe', '')
    """
    given = decoded(text) if isinstance(text, bytes) else text or ""
    return given.replace("\0", "_").encode("utf-8", "replace").decode()


def cut(text: str, size: int) -> bytes:
    """Return at most *size* bytes of *text* in UTF-8, whole characters only."""
    return text.encode()[:size].decode("utf-8", "ignore").encode()


def with_storable_texts(surface: pv.PolyData) -> pv.PolyData:
    """Return a surface whose names and texts are `storable`: *surface* itself, or a shallow copy.

    Arrays without a name get one, with a warning.
    """
    result = surface
    for sort in ("Point", "Cell", "Field"):
        attributes = getattr(surface, f"Get{sort}Data")()
        arrays = [attributes.GetAbstractArray(k) for k in range(attributes.GetNumberOfArrays())]
        names: list[str] = []
        for array in arrays:
            name = storable(array.GetName()) or "unnamed"
            while name in names:
                name += "_"
            names.append(name)
        pairs = list(zip(arrays, names, strict=True))
        if all(array.GetName() == name and not _has_other_texts(array) for array, name in pairs):
            continue
        warn_renamed(f"{sort.lower()} array", {storable(a.GetName()): name for a, name in pairs})
        result = surface.copy(deep=False) if result is surface else result
        replace_arrays(
            getattr(result, f"Get{sort}Data")(), [_storable_array(*pair) for pair in pairs]
        )
    return result


def component_names(array: Any) -> list[str]:
    """Return the names of the components of an array; "" for unnamed ones."""
    if not array.HasAComponentName():
        return []
    return [storable(array.GetComponentName(k)) for k in range(array.GetNumberOfComponents())]


def replace_arrays(attributes: Any, arrays: Sequence[Any]) -> None:
    """Replace all arrays of *attributes* by *arrays*, which remain the active normals, scalars."""
    parts = [
        attributes.IsArrayAnAttribute(k) if hasattr(attributes, "IsArrayAnAttribute") else -1
        for k in range(len(arrays))
    ]
    attributes.Initialize()
    for array, part in zip(arrays, parts, strict=True):
        place = attributes.AddArray(array)
        if part >= 0:
            attributes.SetActiveAttribute(place, part)


def _texts_of(array: Any) -> list[str | bytes]:
    """Return the values of an array of text; none of an array of numbers."""
    if not array.IsA("vtkStringArray"):
        return []
    return [array.GetValue(k) for k in range(array.GetNumberOfValues())]


def _has_other_texts(array: Any) -> bool:
    given: list[Any] = _texts_of(array)
    if array.HasAComponentName():
        given += [array.GetComponentName(k) or "" for k in range(array.GetNumberOfComponents())]
    return any(text != storable(text) for text in given)


def _storable_array(array: Any, name: str) -> Any:
    """Return a copy of an array with another *name*, and storable texts."""
    copy = array.NewInstance()
    copy.DeepCopy(array)
    copy.SetName(name)
    for k, part in enumerate(component_names(array)):
        copy.SetComponentName(k, part)
    for k, text in enumerate(_texts_of(array)):
        copy.SetValue(k, storable(text))
    return copy


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
    silent = (COMMENTS,) if get_names(surface, COMMENTS) else ()
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


def warn_of_rounding(what: str, faces: IntArray, meant: FloatArray, stored: FloatArray) -> None:
    """Log a warning if a file stores vertices visibly elsewhere, with the size of the loss.

    Parameters
    ----------
    what : str
        What the format does: "STL stores single precision".
    faces : (m, 3) int
        The triangles; vertices in none of them do not count.
    meant, stored : (n, 3) float
        The vertices: as they should be, and as a reader finds them in the file.
    """
    finite = np.asarray((np.isfinite(meant) & np.isfinite(stored)).all(axis=1))
    faces = faces if finite.all() else faces[finite[faces].all(axis=1)]
    used = np.zeros(len(meant), dtype=bool)
    used[faces] = True
    if not used.any():
        return
    faces = (np.cumsum(used) - 1)[faces]
    before = np.asarray(meant, dtype=np.float64)[used]
    low, high = bounds_of(before)
    size, middle = float(np.linalg.norm(high - low)), 0.5 * low + 0.5 * high
    before, after = before - middle, np.asarray(stored, dtype=np.float64)[used] - middle
    away = after - before
    moved = float(np.sqrt(np.einsum("ij,ij->i", away, away).max()))
    change = _volume_change(faces, before, after, size)
    if text := rounding_text(moved, size, change):
        _log.warning("%s: %s", what, text, extra={IS_ROUNDING: True})


def rounding_text(moved: float, size: float, change: float) -> str:
    """Return what a file loses by rounding, and what keeps it; "" if nothing visible is lost.

    Parameters
    ----------
    moved : float
        The largest displacement of a vertex.
    size : float
        The diagonal of the model.
    change : float
        The relative change of its volume.
    """
    if not (moved > _VISIBLE * size or abs(change) > _VISIBLE):
        return ""
    volume = f", the volume changed by {100.0 * change:+.3g} %" if change else ""
    share = f" ({100.0 * moved / size:.2g} % of model size)" if size else ""
    return (
        f"vertices moved by up to {moved:.2g}{share}{volume}; .ply and .vtp keep all digits, "
        "or move the model to the origin"
    )


def _volume_change(faces: IntArray, before: FloatArray, after: FloatArray, size: float) -> float:
    """Return the relative change of the volume of a body of a *size*; 0 if it is not closed."""
    a, b, c = (before[faces[:, k]] for k in range(3))
    products = (b - a).T @ (c - a)  # twice the area vector, which vanishes for a closed surface
    volume = signed_volume(before, faces)
    if np.abs(products - products.T).max() > _ROUNDING * size**2:
        return 0.0
    if abs(volume) <= _ROUNDING * size**3:
        return 0.0
    return (signed_volume(after, faces) - volume) / volume


def set_names(surface: pv.PolyData, key: str, names: Iterable[str]) -> None:
    """Store *names* as field array *key*; pyvista accepts ASCII text only."""
    array = vtkStringArray()
    array.SetName(key)
    for name in names:
        array.InsertNextValue(storable(name))
    surface.GetFieldData().AddArray(array)


def get_names(surface: pv.PolyData, key: str) -> list[str]:
    """Return the texts of field array *key*; empty if it does not exist or is not text."""
    array = surface.GetFieldData().GetAbstractArray(key)
    return [] if array is None else [storable(text) for text in _texts_of(array)]
