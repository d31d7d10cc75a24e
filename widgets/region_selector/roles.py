"""What a stroke makes of vertices: part of a region, fixed, or a handle.

A vertex is either fixed, or of one handle, or neither; and it is in some region.  So painting
leaves alone what is fixed or of a handle already, and taking away from a region what no other
region holds.  Where nothing would be left to do for that reason, an error says so.
"""

from __future__ import annotations

import enum
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vtk_segdeform.arrays import BoolArray
from vtk_segdeform.errors import ConstraintError
from vtk_segdeform.pictures import FIXED, HANDLE, of_region, rgb
from vtk_segdeform.regions import Regions
from vtk_segdeform.session import Session


class Paint(enum.Enum):
    """What vertices become."""

    REGION = enum.auto()
    FIXED = enum.auto()
    HANDLE = enum.auto()


def heaviest(regions: Regions, vertex: int) -> int:
    """Return the region that weighs most at *vertex*; one that is there alone needs no weights."""
    own = np.flatnonzero(regions.membership[:, vertex])
    return int(own[0] if len(own) == 1 else regions.labels[vertex])


@dataclass(frozen=True)
class Role:
    """One region, what is fixed, or one handle of a session of n vertices."""

    session: Session
    paint: Paint
    region: int
    handle: str | None

    @property
    def colour(self) -> NDArray[np.uint8]:
        """(3,) of 0 to 255."""
        if self.paint is Paint.REGION:
            return of_region(self.region)
        return rgb(FIXED if self.paint is Paint.FIXED else HANDLE)

    def members(self) -> BoolArray:
        """Return (n,) bool: the vertices that have the role."""
        session = self.session
        if self.paint is Paint.REGION:
            regions = session.regions
            if regions is not None and self.region < regions.n_regions:
                return np.array(regions.membership[self.region], dtype=bool)
            return np.zeros(session.mesh.n_vertices, dtype=bool)
        ids = session.fixed if self.paint is Paint.FIXED else session.handles.get(self.handle or "")
        return self._mask([] if ids is None else ids)

    def changed(self, vertices: BoolArray, *, subtract: bool) -> BoolArray:
        """Return which of *vertices*, a mask (n,), `give` would change, or `take`."""
        return vertices & self._open(subtract) & ~self._barred(subtract)

    def remark(self, vertices: BoolArray, *, subtract: bool) -> str:
        """Return what is to be said of those of *vertices* that `give`, or `take`, leaves alone."""
        count = np.count_nonzero(vertices & self._open(subtract) & self._barred(subtract))
        if not count:
            return ""
        reason = "no other region holds them" if subtract else "fixed or of a handle already"
        return f"{count} vertices left as they were: {reason}"

    def give(self, vertices: BoolArray) -> str | None:
        """Give the role to *vertices*, a mask (n,); return the handle's name, if it is one.

        Nothing happens if all of them have it.

        Raises
        ------
        ConstraintError
            If all that do not are fixed or of another handle.
        RegionError
            If there is no such region.
        """
        new = self.changed(vertices, subtract=False)
        if not new.any():
            if (vertices & self._open(False)).any():
                raise ConstraintError(
                    "all of these vertices are fixed or of a handle already; "
                    "take them out there first"
                )
            return self.handle
        if self.paint is Paint.REGION:
            self.session.paint_region(self.region, new)
        elif self.paint is Paint.FIXED:
            self.session.set_fixed(self.members() | new)
        else:
            return self.session.add_handle(self.members() | new, self.handle)
        return self.handle

    def take(self, vertices: BoolArray) -> str | None:
        """Take the role from *vertices*; return the handle's name, None once it has none left.

        Nothing happens if none of them has it.

        Raises
        ------
        RegionError
            If the region would be empty, or no other holds any of them.
        ConstraintError
            If it is not said which handle.
        """
        if self.paint is Paint.HANDLE and self.handle is None:
            if not self.session.handles:
                raise ConstraintError("there is no handle to take vertices out of yet")
            raise ConstraintError("choose the handle to take vertices out of")
        old = vertices & self._open(True)
        if not old.any():
            return self.handle
        free = self.changed(vertices, subtract=True)
        after = self.members() & ~old
        if self.paint is Paint.REGION:
            # Where none is free, the session says why.
            self.session.paint_region(self.region, free if free.any() else old, subtract=True)
        elif self.paint is Paint.FIXED:
            self.session.set_fixed(after)
        elif after.any():
            return self.session.add_handle(after, self.handle)
        else:
            self.session.remove_handle(str(self.handle))
            return None
        return self.handle

    def _open(self, subtract: bool) -> BoolArray:
        """Tell which vertices are not yet as a stroke would make them."""
        return self.members() if subtract else ~self.members()

    def _barred(self, subtract: bool) -> BoolArray:
        """Tell which vertices a stroke leaves alone."""
        session = self.session
        if self.paint is Paint.REGION:
            if subtract and session.regions is not None:
                return np.asarray(session.regions.membership.sum(axis=0) < 2)
            return self._mask([])
        if subtract:
            return self._mask([])
        return self._mask(np.concatenate([session.fixed, *session.handles.values()]))

    def _mask(self, ids: object) -> BoolArray:
        mask = np.zeros(self.session.mesh.n_vertices, dtype=bool)
        mask[np.asarray(ids, dtype=np.int64)] = True
        return mask
