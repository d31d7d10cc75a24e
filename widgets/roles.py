"""What a stroke makes of vertices: part of a region, fixed, or a handle.

A vertex is either fixed, or of one handle, or neither: painting leaves out what has the other
role already, and says so where nothing would be left.
"""

from __future__ import annotations

import enum
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vtk_segdeform.arrays import BoolArray
from vtk_segdeform.errors import ConstraintError, RegionError
from vtk_segdeform.palette import FIXED, HANDLE, of_region, rgb
from vtk_segdeform.session import Session


class Paint(enum.Enum):
    """What vertices become."""

    REGION = enum.auto()
    FIXED = enum.auto()
    HANDLE = enum.auto()


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
            if regions is None:  # the first stroke begins from one region that holds everything
                return np.full(session.mesh.n_vertices, self.region == 0)
            if self.region < regions.n_regions:
                return np.array(regions.membership[self.region], dtype=bool)
            return np.zeros(session.mesh.n_vertices, dtype=bool)
        ids = session.fixed if self.paint is Paint.FIXED else session.handles.get(self.handle or "")
        return self._mask([] if ids is None else ids)

    def give(self, vertices: BoolArray) -> str | None:
        """Give the role to *vertices*, a mask (n,); return the handle's name, if it is one.

        Raises
        ------
        ConstraintError
            If every one of them has the other role.
        RegionError
            If there is no such region.
        """
        if self.paint is Paint.REGION:
            self.session.paint_region(self.region, vertices)
            return self.handle
        taken = self._mask([] if self.paint is Paint.FIXED else self.session.fixed)
        for name, ids in self.session.handles.items():
            if self.paint is Paint.FIXED or name != self.handle:
                taken |= self._mask(ids)
        if not (vertices & ~taken).any():
            raise ConstraintError(
                "all of these vertices are fixed or of another handle; take them out there first"
            )
        after = self.members() | (vertices & ~taken)
        if self.paint is Paint.FIXED:
            self.session.set_fixed(after)
            return self.handle
        return self.session.add_handle(after, self.handle)

    def take(self, vertices: BoolArray) -> str | None:
        """Take the role from *vertices*; return the handle's name, None once it has none left.

        Raises
        ------
        RegionError
            If a region would be empty, or a vertex in no region.
        """
        if self.paint is Paint.REGION:
            if not (self.members() & vertices).any():
                raise RegionError(f"none of these vertices is in region {self.region}")
            self.session.paint_region(self.region, vertices, subtract=True)
            return self.handle
        after = self.members() & ~vertices
        if self.paint is Paint.FIXED:
            self.session.set_fixed(after)
            return self.handle
        if self.handle is None or self.handle not in self.session.handles:
            return self.handle
        if not after.any():
            self.session.remove_handle(self.handle)
            return None
        return self.session.add_handle(after, self.handle)

    def _mask(self, ids: object) -> BoolArray:
        mask = np.zeros(self.session.mesh.n_vertices, dtype=bool)
        mask[np.asarray(ids, dtype=np.int64)] = True
        return mask
