"""Which messages a page still needs to draw the body of a session.

    surface    once for a mesh and its cages; large, and made by `SurfaceStream.encode`
    colours    when they change
    look       when camera, light or material change
    offsets    of a finished pose, when they change
    cages      when the pose changes: 12 bytes for each cage vertex
    marks      when they change

A pose that was finished on the mesh, or dragged on from one that was, differs from W~ p; its
offsets are x - W~ p.  While such a pose is dragged they change by far less than they are, only to
keep the volume, and are sent again only when a vertex would be misplaced visibly.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vtk_segdeform.arrays import FloatArray
from vtk_segdeform.checks import require
from vtk_segdeform.deformer import Deformer
from vtk_segdeform.geometry import VertexNormals
from vtk_segdeform.session import Session

from .encoding import EncodedSurface, encode_surface, is_drawable
from .look import Look
from .marks import Mark, MarkStream

_VISIBLE = 1e-4  # diagonals


class SurfaceStream:
    """The messages for one page; after `reset`, for a page that knows nothing."""

    def __init__(self, session: Session) -> None:
        self.session = require(session, Session, "session")
        self._serial = 0
        self._number = 0
        self._surface: EncodedSurface | None = None
        self._deformer: Deformer | None = None  # of `_surface`
        self._marks = MarkStream()
        self.reset()

    @property
    def is_possible(self) -> bool:
        """Whether the page can draw the body: its cages are bound, and it is not too large."""
        session = self.session
        return session.is_bound and is_drawable(session.mesh, session.deformer.subspace)

    @property
    def surface(self) -> EncodedSurface | None:
        """The mesh as it was encoded last, or None."""
        return self._surface

    @property
    def is_encoded(self) -> bool:
        """Whether the current mesh and cages are encoded, so that `due` returns messages."""
        is_bound = self._deformer is not None and self.session.is_bound
        return is_bound and self.session.deformer is self._deformer

    def reset(self) -> None:
        """Send everything again: to a new page, or to one that lost its graphics memory."""
        self._sends_surface = True
        self._colours: NDArray[np.uint8] | None = None
        self._look = b""
        self._marks.reset()
        self._cages: tuple[FloatArray, ...] = ()
        self._offsets: FloatArray | None = None

    def encode(self) -> None:
        """Encode the mesh and its cages, if `is_possible`; 0.1 s for 50,000 vertices.

        Raises
        ------
        CageError
            If there are no cages.
        """
        session = self.session
        deformer = session.deformer
        turned = VertexNormals(session.mesh).turned
        self._surface = encode_surface(session.mesh, deformer.subspace, session.cages, turned)
        self._deformer = deformer
        self._serial += 1
        self.reset()

    def due(
        self,
        look: Look,
        *,
        colours: NDArray[np.uint8] | None = None,
        marks: Collection[Mark] = (),
    ) -> list[bytes]:
        """Return the messages that the page still needs, in order; none unless `is_encoded`.

        Parameters
        ----------
        look : Look
            The current camera, light and material.
        colours : (n, 3) uint8, optional
            The current colours of the vertices; by default that of the body.
        marks : collection of Mark
            What is drawn over the body.
        """
        surface, session = self._surface, self.session
        if surface is None or not self.is_encoded:
            return []
        result = []
        if self._sends_surface:
            result.append(surface.message(self._serial))
            self._sends_surface = False
        if colours is not self._colours:
            result.append(surface.colour_message(self._serial, colours))
            self._colours = colours
        seen = look.message(self._serial, surface)
        if seen != self._look:
            result.append(seen)
            self._look = seen
        if session.cage_vertices is not self._cages and not _same(
            session.cage_vertices, self._cages
        ):
            result += self._pose_messages(surface)
        elif self._is_finished or self._offsets is not None:
            result += self._offset_messages(surface)
        return result + self._marks.due(self._serial, surface, marks)

    @property
    def _is_finished(self) -> bool:
        state = self.session.state
        if state.pose is None:
            return False
        return state.pose.finished is not None or state.pose.on(state.stiffness) is not state.pose

    def _pose_messages(self, surface: EncodedSurface) -> list[bytes]:
        self._number += 1
        self._cages = self.session.cage_vertices
        pose = surface.cage_message(self._serial, self._number, self._cages)
        return [*self._offset_messages(surface), pose]

    def _offset_messages(self, surface: EncodedSurface) -> list[bytes]:
        offsets = None
        if self._is_finished:
            assert self._deformer is not None
            x = self._deformer.surface(self._cages)
            offsets = self.session.vertices - x
        before = self._offsets
        if before is None and offsets is None:
            return []
        if before is not None and offsets is not None:
            is_visible = np.abs(offsets - before).max() > _VISIBLE * surface.scale
            if not is_visible:
                return []
        self._offsets = offsets
        return [surface.offset_message(self._serial, offsets)]


def _same(a: Sequence[Any], b: Sequence[Any]) -> bool:
    """Return whether both have the same arrays."""
    return len(a) == len(b) and all(x is y for x, y in zip(a, b, strict=True))
