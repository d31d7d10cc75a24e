"""Named groups of cells, as OBJ, STL and glTF have them.

The cell array "Group" has indices into the field array "GroupNames"; "Object" and "Material"
likewise.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
import pyvista as pv

from ..arrays import IntArray
from .array_names import get_names, set_names

GROUP, OBJECT, MATERIAL = "Group", "Object", "Material"


def names_key(key: str) -> str:
    """Return the name of the field array with the names of the groups *key*."""
    return f"{key}Names"


def set_groups(surface: pv.PolyData, key: str, numbers: Any, names: Iterable[str]) -> None:
    """Store the group (m,) of each cell, an index into *names*."""
    surface.cell_data[key] = numbers
    set_names(surface, names_key(key), names)


def groups_of(surface: pv.PolyData, key: str) -> tuple[IntArray, list[str]] | None:
    """Return the group (m,) of each cell and the names; None if not every cell has a name."""
    names = get_names(surface, names_key(key))
    numbers = whole_numbers(surface.cell_data.get(key), len(names))
    return None if numbers is None else (numbers, names)


def whole_numbers(values: Any, end: int) -> IntArray | None:
    """Return *values* as integers in 0..*end* - 1, (m,); None if they are anything else."""
    array = np.asarray(values)
    if array.ndim != 1 or array.dtype.kind not in "biuf" or not len(array):
        return None
    if not ((array >= 0) & (array < end) & (array == np.rint(array))).all():
        return None
    return array.astype(np.int64)
