"""Landmarks in files: names, points and how uncertain they are.

    .csv                    name,x,y,z and perhaps uncertainty; with a header, columns in any order;
                            of three columns, x,y,z.  Also with tabs or semicolons
    .mrk.json, .fcsv        markups of 3D Slicer: point lists, and the control points of curves
    .pp                     picked points of MeshLab
    any file of a surface   its points, such as of a PLY without faces

Points without names are named by their numbers, from 1.  Slicer's coordinates are given in LPS,
as it writes meshes, whichever of LPS and RAS the file has.
"""

from __future__ import annotations

import csv
import io
import json
import os
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree

import numpy as np

from ..arrays import FloatArray
from ..checks import as_path, require
from ..errors import ArgumentError, MeshError
from ..files import open_regular, replacing
from ..importing import imported

_TO_LPS = np.array([-1.0, -1.0, 1.0])  # from RAS
_LARGEST = 1 << 28  # bytes of a text
_NAMES = ("name", "label", "id")  # of the column of names, the first that is there


@dataclass(frozen=True, eq=False)
class Landmarks:
    """Named points; made by `read_landmarks`."""

    names: tuple[str, ...]
    """Of k landmarks, all different."""
    points: FloatArray
    """(k, 3) float."""
    uncertainty: FloatArray
    """(k,) float: the standard deviation of each coordinate; NaN where none is given."""


class Pairs(NamedTuple):
    """The landmarks that two sets have in common."""

    names: tuple[str, ...]
    source: FloatArray  # (k, 3)
    target: FloatArray  # (k, 3)
    uncertainty: FloatArray  # (k,), of both together; NaN where neither is given


def paired(source: Landmarks, target: Landmarks) -> Pairs:
    """Return the landmarks of the same names in *source* and *target*, in the order of *source*.

    >>> one = Landmarks(("a", "b"), np.zeros((2, 3)), np.array([3.0, np.nan]))
    >>> other = Landmarks(("c", "a"), np.ones((2, 3)), np.array([1.0, 4.0]))
    >>> paired(one, other).names, paired(one, other).uncertainty
    (('a',), array([5.]))
    """
    place = {name: k for k, name in enumerate(target.names)}
    own = [k for k, name in enumerate(source.names) if name in place]
    other = [place[source.names[k]] for k in own]
    sigmas = np.stack([source.uncertainty[own], target.uncertainty[other]])
    total = np.sqrt(np.nansum(sigmas**2, axis=0))
    total[np.isnan(sigmas).all(axis=0)] = np.nan
    names = tuple(source.names[k] for k in own)
    return Pairs(names, source.points[own], target.points[other], total)


def read_landmarks(path: str | os.PathLike[str]) -> Landmarks:
    """Return the landmarks in a file; see `landmarks.files`.

    Parameters
    ----------
    path : path
        .csv, .mrk.json, .json, .fcsv, .pp, or a file of a surface, whose points they are.

    Raises
    ------
    MeshError
        If it cannot be read, has no landmarks, or two of the same name.
    """
    path = as_path(path)
    suffix = path.suffix.lower()
    if suffix not in _READERS:
        imported("vtk_segdeform.io")  # imports pyvista
        from ..io import read_points

        rows = [(f"{k}", *q, "") for k, q in enumerate(read_points(path).points.tolist(), 1)]
        return _checked(path, rows)
    try:
        with open_regular(path) as file:
            data = file.read(_LARGEST + 1)
        if len(data) > _LARGEST:
            raise ValueError("too large for landmarks")
        rows = list(_READERS[suffix](data.decode("utf-8-sig")))
    except OSError as fault:
        raise MeshError(f"{path}: {fault.strerror or fault}") from None
    except (ValueError, KeyError, TypeError, ElementTree.ParseError, csv.Error) as fault:
        raise MeshError(f"{path}: is no file of landmarks ({fault})") from None
    return _checked(path, rows)


def write_landmarks(path: str | os.PathLike[str], landmarks: Landmarks) -> None:
    """Write *landmarks* to a .csv file, in full precision.

    Raises
    ------
    ArgumentError
        If *path* has another ending.
    MeshError
        If it cannot be written.
    """
    path = as_path(path)
    require(landmarks, Landmarks, "landmarks")
    if path.suffix.lower() != ".csv":
        raise ArgumentError(f"path must end in .csv for landmarks; got {path.name}")
    has_sigma = not np.isnan(landmarks.uncertainty).all()
    rows: list[Sequence[object]] = [("name", "x", "y", "z", *["uncertainty"] * has_sigma)]
    each = zip(landmarks.names, landmarks.points.tolist(), landmarks.uncertainty, strict=True)
    for name, point, sigma in each:
        rows.append((name, *point, *["" if np.isnan(sigma) else float(sigma)] * has_sigma))
    write_rows(path, rows)


def write_rows(path: Path, rows: Sequence[Sequence[object]]) -> None:
    """Write a table to a .csv file; a MeshError if that is impossible."""
    try:
        with replacing(path) as draft, draft.open("w", encoding="utf-8", newline="") as file:
            csv.writer(file, lineterminator="\n").writerows(rows)
    except OSError as fault:
        raise MeshError(f"{path}: cannot be written ({fault.strerror or fault})") from fault


_Row = tuple[Any, Any, Any, Any, Any]  # name, x, y, z and uncertainty, as numbers or texts


def _checked(path: Path, rows: Sequence[_Row]) -> Landmarks:
    if not rows:
        raise MeshError(f"{path}: has no landmarks")
    names = tuple(str(row[0]).strip() for row in rows)
    name, count = Counter(names).most_common(1)[0]
    if count > 1:
        raise MeshError(f"{path}: has {count} landmarks called {name[:60]!r}")
    try:
        points = np.array([[float(c) for c in row[1:4]] for row in rows])
        sigma = np.array([float(row[4]) if f"{row[4]}".strip() else np.nan for row in rows])
    except (ValueError, TypeError) as fault:
        raise MeshError(f"{path}: is no file of landmarks ({fault})") from None
    wrong = ~np.isfinite(points).all(axis=1) | (sigma < 0.0) | np.isinf(sigma)
    if wrong.any():
        raise MeshError(
            f"{path}: the coordinates of {names[int(wrong.argmax())][:60]!r} are not finite, or "
            "its uncertainty is negative or infinite"
        )
    return Landmarks(names, points, sigma)


def _from_csv(text: str) -> Iterable[_Row]:
    first = text.partition("\n")[0]
    separator = max(",;\t", key=first.count)
    rows = [row for row in csv.reader(io.StringIO(text), delimiter=separator) if any(row)]
    columns = [cell.strip().lower() for cell in rows[0]] if rows else []
    if {"x", "y", "z"} <= set(columns):
        places = [columns.index(name) for name in "xyz"]
        own = next((columns.index(name) for name in _NAMES if name in columns), None)
        sigma = columns.index("uncertainty") if "uncertainty" in columns else None
        rows = rows[1:]
    else:
        given = len(columns) > 3
        places, own = [given + k for k in range(3)], 0 if given else None
        sigma = 4 if len(columns) > 4 else None
    for number, row in enumerate(rows, 1):
        try:
            x, y, z = (row[k] for k in places)
            name = f"{number}" if own is None else row[own]
            yield name, x, y, z, "" if sigma is None or sigma >= len(row) else row[sigma]
        except IndexError:
            raise ValueError(f"landmark {number} has {len(row)} columns") from None


def _from_fcsv(text: str) -> Iterable[_Row]:
    columns, to_lps = ["id", "x", "y", "z"], _TO_LPS
    for line in text.splitlines():
        key, _, value = line.lstrip("# ").partition("=")
        if line.startswith("#"):
            if key.strip() == "columns":
                columns = [each.strip() for each in value.split(",")]
            elif key.strip() == "CoordinateSystem":
                to_lps = _lps_of({"0": "RAS", "1": "LPS"}.get(value.strip(), value.strip()))
        elif line.strip():
            cells = dict(zip(columns, next(csv.reader([line])), strict=False))
            x = to_lps * [float(cells[name]) for name in "xyz"]
            yield cells.get("label") or cells["id"], *x, ""


def _from_markups(text: str) -> Iterable[_Row]:
    number = 0
    for markup in json.loads(text)["markups"]:
        to_lps = _lps_of(markup.get("coordinateSystem", "LPS"))
        for point in markup["controlPoints"]:
            number += 1
            if point.get("positionStatus", "defined") == "defined":
                yield point.get("label") or f"{number}", *(to_lps * point["position"]), ""


def _lps_of(system: str) -> FloatArray:
    """Return the factors (3,) from coordinates of *system* to LPS."""
    if system not in ("LPS", "RAS"):
        raise ValueError(f"its coordinates are {system[:20]!r}, not LPS or RAS")
    return np.ones(3) if system == "LPS" else _TO_LPS


def _from_picked(text: str) -> Iterable[_Row]:
    if "<!ENTITY" in text.upper():
        raise ValueError("it declares entities")
    for number, point in enumerate(ElementTree.fromstring(text).iter("point"), 1):
        if point.get("active", "1") != "0":
            name = point.get("name") or f"{number}"
            yield name, point.attrib["x"], point.attrib["y"], point.attrib["z"], ""


_READERS = {
    ".csv": _from_csv,
    ".fcsv": _from_fcsv,
    ".json": _from_markups,
    ".pp": _from_picked,
}

LANDMARK_SUFFIXES = frozenset(_READERS)
"""Of files that hold landmarks only."""
