"""Which borders of a session's mesh are holes in a volume, and which bound a sheet."""

from __future__ import annotations

from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np

from vtk_segdeform.arrays import IntArray
from vtk_segdeform.geometry import lids_of
from vtk_segdeform.mesh import Mesh
from vtk_segdeform.session import Session

NO_VOLUME = "No volume to preserve"


@dataclass(frozen=True, eq=False)
class Enclosure:
    """The volume of a mesh with or without borders.

    Attributes
    ----------
    has_volume : bool
        Whether the mesh encloses a volume, if need be under lids.
    holes, sheets : tuple of (k,) int
        The border loops of components that enclose a volume, and of those that do not.
    n_sheets : int
        Number of open components that enclose no volume.
    """

    has_volume: bool
    holes: tuple[IntArray, ...] = ()
    sheets: tuple[IntArray, ...] = ()
    n_sheets: int = 0


_CLOSED = Enclosure(has_volume=True)
_known: WeakKeyDictionary[Mesh, dict[bool | None, Enclosure]] = WeakKeyDictionary()


def enclosure_of(session: Session) -> Enclosure:
    """Return the enclosure of the mesh of *session*, computed once for each of its options."""
    mesh, wanted = session.mesh, session.options.lids
    if mesh.is_closed:
        return _CLOSED
    known = _known.setdefault(mesh, {})
    if wanted not in known:
        known[wanted] = _enclosure(mesh, wanted)
    return known[wanted]


def _enclosure(mesh: Mesh, wanted: bool | None) -> Enclosure:
    lids = lids_of(mesh, wanted)
    pairs = list(zip(mesh.borders, lids.used.tolist(), strict=True))
    return Enclosure(
        lids.has_volume,
        tuple(loop for loop, is_hole in pairs if is_hole),
        tuple(loop for loop, is_hole in pairs if not is_hole),
        len(np.unique(lids.component[~lids.used])),
    )
