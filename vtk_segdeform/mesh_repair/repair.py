"""Repair triangles to a closed, outward oriented two-manifold, one step at a time, each reported.

Each step changes only what is faulty, and the next one relies on it: invalid faces are removed,
coincident borders welded, vertices split until each has one fan, faces oriented consistently,
small holes filled, and closed shells oriented outward.  Orientation outward comes after filling,
because an open shell has no inside.
"""

from __future__ import annotations

from dataclasses import dataclass

from numpy.typing import ArrayLike
from scipy import sparse

from ..arrays import BoolArray, FloatArray, IntArray, is_number, is_whole
from ..checks import shown
from ..errors import ArgumentError, MeshError
from ..freezing import Frozen
from ..mesh import UNREPAIRABLE, MeshReport, as_soup, find_faults
from ..progress import Progress, part, tell
from . import repair_steps as steps


@dataclass(frozen=True, repr=False)
class Repair(Frozen):
    """A repaired mesh and the steps that led to it; *report* lists what remains.

    Vertices and faces that are kept keep their order; new ones come after them.

    Attributes
    ----------
    vertices, faces : (n, 3) float, (m, 3) int
        The result.  It is closed, oriented outward and a two-manifold if ``report.is_closed``, and
        can be a `Mesh`, with borders or not, if ``report.ok``.
    steps : tuple of str
        The steps taken, one sentence each; empty if the mesh was closed already.
    vertex_map, face_map : (n,) int, (m,) int
        The original index of each vertex and face; -1 if it fills a hole or is part of a face
        that was split to close a crack.
    report : MeshReport
        The result of `find_faults` for the repaired mesh.
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
            f"{holes} open, of {edges} edges; to fill holes up to that size, repair with "
            f"largest_hole={many} (--largest-hole {many} on the command line)"
        )


def repair(
    vertices: ArrayLike,
    faces: ArrayLike,
    *,
    weld_distance: float = 0.0,
    largest_hole: int = 100,
    progress: Progress | None = None,
) -> Repair:
    """Repair triangles as far as possible without guessing.

    Parameters
    ----------
    vertices : (n, 3) float
        Vertices with NaN or infinite coordinates are removed with their faces.
    faces : (m, 3) int
        Any triangles with valid indices.
    weld_distance : float
        Largest distance of two vertices that are welded, in the unit of *vertices*.  Vertices
        are only welded where that closes open edges.
    largest_hole : int
        Holes with more edges than this are not filled; ``open_holes`` has their sizes.
    progress : callable, optional
        Called with the fraction done and a text; may raise to cancel.

    Raises
    ------
    MeshError
        If there are no faces, none are left after a step, indices are out of range, or coordinates
        are too large or too small to compute with.
    ValueError
        If an array has the wrong shape or type.

    Examples
    --------
    >>> corners = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
    >>> fixed = repair(corners, [[0, 2, 1], [0, 1, 3], [0, 3, 2]])
    >>> fixed.steps
    ('fill 1 hole of 3 edges with 1 triangle',)
    >>> fixed.face_map, fixed.report.is_closed
    (array([ 0,  1,  2, -1]), True)
    """
    if not is_number(weld_distance, 0.0):
        raise ArgumentError(
            f"weld_distance must be a length, 0 or more; got {shown(weld_distance)}"
        )
    if not is_whole(largest_hole, 0):
        raise ArgumentError(
            f"largest_hole must be a number of edges, 0 or more; got {shown(largest_hole)}"
        )
    points, triangles = as_soup(vertices, faces)
    tell(progress, 0.0, "Searching for faults")
    report = find_faults(points, triangles)
    unrepairable = [
        f"{fault}; {fault.kind.advice}" for fault in report.faults if fault.kind in UNREPAIRABLE
    ]
    if unrepairable:
        raise MeshError(f"the mesh cannot be repaired: {'; '.join(unrepairable)}")
    draft = steps.Draft.of(points, triangles)
    done: list[str] = []
    if not report.is_closed:
        filling = part(progress, 0.3, 0.8)
        for fraction, message, step in (
            (0.05, "Removing invalid faces", steps.remove_non_finite),
            (0.05, "Removing invalid faces", steps.remove_degenerate),
            (0.1, "Welding vertices", lambda draft: steps.weld(draft, weld_distance)),
            (0.1, "Welding vertices", lambda draft: steps.weld_corners(draft, weld_distance)),
            (0.15, "Removing duplicate faces", steps.remove_duplicates),
            (0.15, "Removing duplicate faces", steps.remove_unreferenced),
            (0.2, "Splitting vertices where surfaces touch", steps.split),
            (0.25, "Orienting faces", steps.orient),
            (0.3, "Filling holes", lambda draft: steps.fill(draft, largest_hole, filling)),
            (0.8, "Closing cracks", steps.close_flat),
            (0.8, "Splitting vertices where surfaces touch", steps.split),
            (0.85, "Orienting components outward", steps.orient_outward),
        ):
            tell(progress, fraction, message)
            draft, sentence = step(draft)
            done += sentence.splitlines()
            if not len(draft.faces):
                raise MeshError(
                    f"no faces are left after these repairs: {'; '.join(done)}; "
                    "check how the mesh was made"
                )
        tell(progress, 0.9, "Checking the result")
        report = find_faults(draft.vertices, draft.faces)
    left = steps.remaining_holes(draft, largest_hole) if not report.is_closed else ()
    found = Repair(
        draft.vertices, draft.faces, tuple(done), draft.vertex_map, draft.face_map, report,
        draft.weights, draft.flipped, left,
    )  # fmt: skip
    found.__setstate__(found.__getstate__())  # makes the arrays read-only
    tell(progress, 1.0, "Repaired")
    return found
