"""Mend triangles into a closed, outward oriented two-manifold, step by step and said aloud.

Each step does only what is needed, in an order where the next can stand on the one before: first
what is no triangle goes, then borders that coincide are welded, then every vertex gets one fan,
every shell one orientation, every small hole a lid, and at last every closed shell faces outward.
Turning comes after filling, because an open shell has no inside.
"""

from __future__ import annotations

from dataclasses import dataclass

from numpy.typing import ArrayLike
from scipy import sparse

from ..arrays import BoolArray, FloatArray, IntArray, is_number, is_whole
from ..checks import shown
from ..errors import ArgumentError, MeshError
from ..freezing import Frozen
from ..mesh import HOPELESS, MeshReport, as_soup, find_faults
from . import repair_steps as steps


@dataclass(frozen=True)
class Repair(Frozen):
    """A mended mesh and how it came about; *report* says what could not be mended.

    What is kept keeps its order; what is created comes after.

    Attributes
    ----------
    vertices, faces : (n, 3) float, (m, 3) int
        The result.  A `Mesh` takes it if ``report.ok``.
    steps : tuple of str
        What was done, one sentence each; empty if nothing was wrong.
    vertex_map, face_map : (n,) int, (m,) int
        The original index of each vertex and face; -1 if it fills a hole or is part of a face
        that was split to close a crack.
    report : MeshReport
        What `find_faults` says of the result.
    vertex_weights : (n, o) sparse
        Weights of the o original vertices at each vertex; rows sum to 1.  A kept vertex has one
        weight, a new one interpolates the border around it: ``vertex_weights @ array`` transfers an
        array of the original vertices to the repaired mesh.
    face_turned : (m,) bool
        Which faces were flipped, so that their corners are in the opposite order.
    open_holes : tuple of int
        Number of edges of each hole that is larger than *largest_hole*.
    """

    vertices: FloatArray
    faces: IntArray
    steps: tuple[str, ...]
    vertex_map: IntArray
    face_map: IntArray
    report: MeshReport
    vertex_weights: sparse.csr_array
    face_turned: BoolArray
    open_holes: tuple[int, ...]

    @property
    def advice(self) -> str:
        """A sentence on how to close the remaining holes; "" if there are none."""
        if not self.open_holes:
            return ""
        few, many = min(self.open_holes), max(self.open_holes)
        holes = (
            "1 hole remains"
            if len(self.open_holes) == 1
            else f"{len(self.open_holes)} holes remain"
        )
        edges = str(few) if few == many else f"{few} to {many}"
        return (
            f"{holes} open, of {edges} edges; to fill up to that size, repair with "
            f"largest_hole={many} (--largest-hole {many} on the command line)"
        )


def repair(
    vertices: ArrayLike,
    faces: ArrayLike,
    *,
    weld_distance: float = 0.0,
    largest_hole: int = 100,
) -> Repair:
    """Return the triangles mended as far as that needs no guessing.

    Parameters
    ----------
    vertices : (n, 3) float
        NaN and infinite coordinates are dropped with their faces.
    faces : (m, 3) int
        Triangles in any state, but with valid indices.
    weld_distance : float
        How far apart two vertices may lie and still count as one, in the unit of *vertices*.
        Only vertices whose welding closes open edges are welded at all.
    largest_hole : int
        Holes with more edges than this are not filled; ``open_holes`` has their sizes.

    Raises
    ------
    MeshError
        If there are no faces, none worth keeping, faces with bad indices, or coordinates beyond all
        computing.
    ValueError
        If an array has the wrong shape or type.

    Examples
    --------
    >>> corners = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
    >>> mended = repair(corners, [[0, 2, 1], [0, 1, 3], [0, 3, 2]])
    >>> mended.steps
    ('fill 1 hole of 3 edges with 1 triangle',)
    >>> mended.face_map, mended.report.ok
    (array([ 0,  1,  2, -1]), True)
    """
    if not is_number(weld_distance, 0.0):
        raise ArgumentError(
            f"weld_distance must be a length, 0 or more; got {shown(weld_distance)}"
        )
    if not is_whole(largest_hole, 0):
        raise ArgumentError(
            f"largest_hole must be a whole number of edges; got {shown(largest_hole)}"
        )
    points, triangles = as_soup(vertices, faces)
    report = find_faults(points, triangles)
    hopeless = [
        f"{fault}; {fault.kind.advice}" for fault in report.faults if fault.kind in HOPELESS
    ]
    if hopeless:
        raise MeshError(f"nothing to repair: {'; '.join(hopeless)}")
    draft = steps.Draft.of(points, triangles)
    done: list[str] = []
    if not report.ok:
        for step in (
            steps.drop_non_finite,
            steps.drop_degenerate,
            lambda draft: steps.weld(draft, weld_distance),
            lambda draft: steps.weld_corners(draft, weld_distance),
            steps.drop_duplicates,
            steps.drop_unreferenced,
            steps.split,
            steps.orient,
            lambda draft: steps.fill(draft, largest_hole),
            steps.close_flat,
            steps.split,
            steps.turn_outward,
        ):
            draft, sentence = step(draft)
            done += sentence.splitlines()
            if not len(draft.faces):
                raise MeshError(
                    f"nothing is left of the mesh after: {'; '.join(done)}; "
                    "look at where it comes from"
                )
        report = find_faults(draft.vertices, draft.faces)
    left = steps.holes_beyond(draft, largest_hole) if not report.ok else ()
    found = Repair(
        draft.vertices, draft.faces, tuple(done), draft.vertex_map, draft.face_map, report,
        draft.mix, draft.turned, left,
    )  # fmt: skip
    found.__setstate__(found.__getstate__())  # makes its arrays read-only
    return found
