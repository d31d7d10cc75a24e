"""The target of a stroke, to which vertices are added: a region, the fixed vertices or a handle.

Or the stiffness of the surface, which a stroke changes, by factors, the less towards the rim of a
brush.  Rigid is what is rigid by at least a half.

A vertex is fixed, or in one handle, or neither, and it is in at least one region.  Adding therefore
skips vertices that are already fixed or in a handle, and erasing from a region skips vertices of no
other region.  If a stroke would skip all its vertices, an error gives the reason.
"""

from __future__ import annotations

import enum
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vtk_segdeform.arrays import BoolArray, FloatArray
from vtk_segdeform.errors import ConstraintError, RegionError
from vtk_segdeform.pictures import FIXED, of_region, rgb
from vtk_segdeform.session import Session

from ..scene import handle_colour
from .region_colours import stiffness_colours


class Paint(enum.Enum):
    """The kind of a target."""

    REGION = enum.auto()
    FIXED = enum.auto()
    HANDLE = enum.auto()
    STIFFNESS = enum.auto()


@dataclass(frozen=True)
class PaintTarget:
    """One region, the fixed vertices, one handle or a stiffness, of a session with n vertices.

    Only the vertices that are *shown*, (n,), are added or erased; by default all are.
    """

    session: Session
    paint: Paint
    region: int
    handle: str | None
    stiffness: float = 1.0
    shown: BoolArray | np.bool_ = np.True_

    @property
    def colour(self) -> NDArray[np.uint8]:
        """(3,) uint8: red, green and blue."""
        if self.paint is Paint.REGION:
            return of_region(self.region)
        if self.paint is Paint.FIXED:
            return rgb(FIXED)
        if self.paint is Paint.STIFFNESS:
            return np.asarray(stiffness_colours(np.array([self.stiffness]))[0])
        return handle_colour(self.session, self.handle)

    def members(self) -> BoolArray:
        """Return the vertices of the target, (n,) bool."""
        session = self.session
        if self.paint is Paint.REGION:
            regions = session.regions
            if regions is not None and self.region < regions.n_regions:
                return np.array(regions.membership[self.region], dtype=bool)
            return np.zeros(session.mesh.n_vertices, dtype=bool)
        if self.paint is Paint.STIFFNESS:
            return np.asarray(self._stiffness != 1.0)
        ids = session.fixed if self.paint is Paint.FIXED else session.handles.get(self.handle or "")
        return self._mask([] if ids is None else ids)

    def members_to(self, verb: str) -> BoolArray:
        """Return `members`; raise ConstraintError, "Nothing to *verb*", if there are none."""
        members = self.members()
        if not members.any():
            raise ConstraintError(f"Nothing to {verb}: {self._name} has no vertices")
        return members

    def changed(self, vertices: BoolArray, *, erase: bool) -> BoolArray:
        """Return those of *vertices*, a mask (n,), that `add`, or `erase`, would change."""
        if self.paint is Paint.STIFFNESS:
            return vertices
        return vertices & self._candidates(erase) & ~self._protected(erase)

    def remark(self, vertices: BoolArray, *, erase: bool) -> str:
        """Return a message about those of *vertices* that `add`, or `erase`, skips."""
        count = np.count_nonzero(vertices & self._candidates(erase) & self._protected(erase))
        if not count:
            return ""
        reason = "in no other region" if erase else "already fixed or in a handle"
        return f"{count} {'vertices' if count != 1 else 'vertex'} skipped: {reason}"

    def stiffened(self, shares: FloatArray, *, erase: bool) -> FloatArray:
        """Return the stiffness (n,) after a stroke with these *shares* (n,), 0 to 1."""
        before, to = self._stiffness, 1.0 if erase else self.stiffness
        is_core, is_rigid = shares >= 0.5, np.isinf(before)
        if np.isinf(to):
            return np.where(is_core, to, before)
        finite = np.where(is_rigid, 1.0, before) ** (1.0 - shares) * to**shares
        return np.where(is_rigid, np.where(is_core, to, before), finite)

    def stiffen(self, shares: FloatArray, *, erase: bool) -> None:
        """Change the stiffness by a stroke with *shares* (n,), 0 to 1."""
        after = self.stiffened(shares, erase=erase)
        self.session.set_stiffness(None if (after == 1.0).all() else after)

    def add(self, vertices: BoolArray) -> str | None:
        """Add *vertices*, a mask (n,); return the name of the handle, if the target is one.

        Vertices that are already in the target are ignored.

        Raises
        ------
        ConstraintError
            If all others are fixed or in another handle.
        RegionError
            If there is no such region.
        """
        if self.paint is Paint.STIFFNESS:
            self.stiffen(vertices.astype(np.float64), erase=False)
            return self.handle
        vertices = vertices & self.shown
        new = self.changed(vertices, erase=False)
        if not new.any():
            if (vertices & self._candidates(False)).any():
                raise ConstraintError(
                    "all these vertices are already fixed or in a handle; erase them there first"
                )
            return self.handle
        if self.paint is Paint.REGION:
            self.session.painting.paint(self.region, new)
            return self.handle
        return self._assign(self.members() | new)

    def erase(self, vertices: BoolArray) -> str | None:
        """Remove *vertices*, a mask (n,); return the name of the handle, None once it is empty.

        Vertices outside the target are ignored.

        Raises
        ------
        RegionError
            If the region would be empty, or all the vertices are in no other region.
        ConstraintError
            If the target is a handle and none is selected.
        """
        if self.paint is Paint.HANDLE and self.handle is None:
            if not self.session.handles:
                raise ConstraintError("no handle to erase from yet")
            raise ConstraintError("select the handle to erase from")
        if self.paint is Paint.STIFFNESS:
            self.stiffen(vertices.astype(np.float64), erase=True)
            return self.handle
        vertices = vertices & self.shown
        old = vertices & self._candidates(True)
        if not old.any():
            return self.handle
        free = self.changed(vertices, erase=True)
        if self.paint is Paint.REGION:
            # With *old*, the session raises an error that gives the reason.
            self.session.painting.paint(self.region, free if free.any() else old, subtract=True)
            return self.handle
        return self._assign(self.members() & ~old)

    def select_all(self) -> str | None:
        """Add all vertices that are free; return the name of the handle, if the target is one.

        Raises
        ------
        ConstraintError
            If none is free.
        """
        everything = np.ones(self.session.mesh.n_vertices, dtype=bool)
        if not self._candidates(False).any():
            raise ConstraintError(f"All vertices are already in {self._name}")
        return self.add(everything)

    def select_none(self) -> str | None:
        """Remove all vertices; a handle is removed, and None is returned.

        Raises
        ------
        ConstraintError
            If the target is empty.
        RegionError
            If it is a region, which cannot be empty.
        """
        members = self.members_to("deselect")
        if self.paint is Paint.REGION:
            raise RegionError(
                f"{self._name} cannot become empty; merge it with another region instead"
            )
        return self.erase(members)

    def invert(self) -> str | None:
        """Exchange the vertices for all others that are free; return the name of the handle.

        Raises
        ------
        ConstraintError
            If none is free.
        RegionError
            If the target is a region.
        """
        if self.paint in (Paint.REGION, Paint.STIFFNESS):
            raise RegionError("Only fixed vertices and handles can be inverted; paint the region")
        members = self.members()
        if not members.any():
            return self.select_all()
        others = ~members & ~self._protected(False) & self.shown
        if not others.any():
            raise ConstraintError(
                f"Cannot invert {self._name}: all other vertices are fixed or in a handle"
                if not members.all()
                else f"Cannot invert {self._name}: it contains all vertices"
            )
        return self._assign(others | (members & ~self.shown))

    def _assign(self, members: BoolArray) -> str | None:
        """Make *members* the fixed vertices or the handle; return its name, None if it is empty."""
        if self.paint is Paint.FIXED:
            self.session.set_fixed(members)
            return self.handle
        if members.any():
            return self.session.handles.add(members, self.handle)
        self.session.handles.remove(str(self.handle))
        return None

    @property
    def _name(self) -> str:
        """The target in messages."""
        if self.paint is Paint.REGION:
            return self.session.painting.name(self.region)
        if self.paint is Paint.FIXED:
            return "the set of fixed vertices"
        if self.paint is Paint.STIFFNESS:
            return "the stiff or soft part"
        return "the new handle" if self.handle is None else self.handle

    def _candidates(self, erase: bool) -> BoolArray:
        """Return the vertices inside the target if *erase*, else those outside."""
        return self.members() if erase else ~self.members()

    def _protected(self, erase: bool) -> BoolArray:
        """Return the vertices that a stroke skips."""
        session = self.session
        if self.paint is Paint.REGION:
            if erase and session.regions is not None:
                return np.asarray(session.regions.membership.sum(axis=0) < 2)
            return self._mask([])
        if erase or self.paint is Paint.STIFFNESS:
            return self._mask([])
        return self._mask(np.concatenate([session.fixed, *session.handles.values()]))

    @property
    def _stiffness(self) -> FloatArray:
        stiffness = self.session.state.stiffness
        return np.ones(self.session.mesh.n_vertices) if stiffness is None else stiffness

    def _mask(self, ids: object) -> BoolArray:
        mask = np.zeros(self.session.mesh.n_vertices, dtype=bool)
        mask[np.asarray(ids, dtype=np.int64)] = True
        return mask
