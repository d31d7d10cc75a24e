"""Kinds of mesh faults, and the report that counts them.

A fault prevents triangles from being a `Mesh`; a note, such as a border, does not.  `find_faults`
finds both; `repair` repairs both.
"""

from __future__ import annotations

import enum
from dataclasses import dataclass

Id = int | tuple[int, ...]  # a vertex or face by its number, an edge by its two vertices


class Kind(enum.Enum):
    """A kind of fault, or of note (those with False): its name, its location and what to do.

    Those of the whole mesh, which occur once, have no plural.
    """

    EMPTY = "empty mesh", "", "", "give at least one face"
    NON_FINITE = (
        "vertex with NaN or infinite coordinates",
        "vertices with NaN or infinite coordinates",
        "vertex ",
        "`repair` removes such vertices and their faces",
    )
    BAD_INDEX = (
        "face with a vertex index out of range",
        "faces with a vertex index out of range",
        "face ",
        "number vertices from 0, and pass all of them",
    )
    TOO_LARGE = (
        "vertex too far from the origin to compute volumes",
        "vertices too far from the origin to compute volumes",
        "vertex ",
        "scale the mesh down; coordinates must not exceed 1e70",
    )
    TOO_SMALL = (
        "mesh too small to compute volumes",
        "",
        "",
        "scale the mesh up; its extent must be at least 1e-70",
    )
    OUTLYING = (
        "vertex too far from all others",
        "vertices too far from all others",
        "vertex ",
        "move or delete it; such a distance leaves no digits for the rest of the mesh",
    )
    FLAT = (
        "all faces are flat",
        "",
        "",
        "give at least one whose three corners are not on a line",
    )
    UNREFERENCED = (
        "unreferenced vertex",
        "unreferenced vertices",
        "vertex ",
        "`repair` removes vertices that are in no face",
    )
    DEGENERATE = (
        "degenerate face",
        "degenerate faces",
        "face ",
        "`repair` removes faces that contain a vertex twice",
    )
    DUPLICATE_FACE = "duplicate face", "duplicate faces", "face ", "`repair` keeps one of each"
    OPEN_EDGE = (
        "open edge",
        "open edges",
        "",
        "allowed; `repair` welds coincident vertices along them, then fills holes",
        False,
    )
    HOLE = (
        "hole",
        "holes",
        "at vertex ",
        "allowed; `repair` fills holes of up to `largest_hole` edges",
        False,
    )
    NON_MANIFOLD_EDGE = (
        "non-manifold edge",
        "non-manifold edges",
        "",
        "allowed; three or more faces meet there; `repair` separates closed bodies that touch",
        False,
    )
    NON_MANIFOLD_VERTEX = (
        "non-manifold vertex",
        "non-manifold vertices",
        "vertex ",
        "allowed; surfaces touch there at a point; `repair` separates them",
        False,
    )
    TURNED_EDGE = (
        "inconsistently oriented edge",
        "inconsistently oriented edges",
        "",
        "the two faces there have opposite orientation; `repair` flips the minority",
    )
    ONE_SIDED = (
        "one-sided component",
        "one-sided components",
        "at vertex ",
        "allowed; it has no outside, like a Moebius strip",
        False,
    )
    INWARD = (
        "inside-out component",
        "inside-out components",
        "at vertex ",
        "`repair` flips such components",
    )
    NO_VOLUME = (
        "component that encloses no volume",
        "components that enclose no volume",
        "at vertex ",
        "allowed; if it is a body far from the origin, move it there",
        False,
    )
    ZERO_AREA = "face without area", "faces without area", "face ", "allowed", False
    COINCIDENT = (
        "vertex at the same position as another",
        "vertices at the same position as another",
        "vertex ",
        "allowed if the surface is closed without welding them",
        False,
    )
    COMPONENTS = "component", "components", "", "allowed", False

    def __init__(self, one: str, many: str, place: str, advice: str, fatal: bool = True) -> None:
        self.one, self.many, self.place, self.advice, self.fatal = one, many, place, advice, fatal


_OPEN = (
    Kind.OPEN_EDGE,
    Kind.NON_MANIFOLD_EDGE,
    Kind.NON_MANIFOLD_VERTEX,
    Kind.ONE_SIDED,
)  # notes on surfaces that are not closed two-manifolds


@dataclass(frozen=True)
class Fault:
    """One kind of fault: its count, and examples of vertices, edges or faces."""

    kind: Kind
    count: int
    examples: tuple[Id, ...] = ()

    def __str__(self) -> str:
        if not self.kind.many:
            return self.kind.one
        text = f"{self.count} {self.kind.one if self.count == 1 else self.kind.many}"
        if not self.examples:
            return text
        ids = ("-".join(map(str, i)) if isinstance(i, tuple) else str(i) for i in self.examples)
        more = ", ..." if self.count > len(self.examples) else ""
        return f"{text} ({self.kind.place}{', '.join(ids)}{more})"


@dataclass(frozen=True)
class MeshReport:
    """The result of `find_faults`; ``str(report)`` is readable text."""

    n_vertices: int
    n_faces: int
    n_components: int
    faults: tuple[Fault, ...]
    notes: tuple[Fault, ...]

    @property
    def ok(self) -> bool:
        """Whether the triangles can be a `Mesh`; notes do not matter."""
        return not self.faults

    @property
    def is_closed(self) -> bool:
        """Whether the triangles are a closed, outward oriented two-manifold with a volume."""
        return self.is_two_manifold and not self.count(Kind.NO_VOLUME)

    @property
    def is_two_manifold(self) -> bool:
        """Whether the triangles are a closed, oriented two-manifold."""
        return self.ok and not any(note.kind in _OPEN for note in self.notes)

    def count(self, kind: Kind) -> int:
        """Return the number of occurrences of *kind*."""
        return sum(f.count for f in self.faults + self.notes if f.kind is kind)

    def __str__(self) -> str:
        parts = "component" if self.n_components == 1 else "components"
        size = f"{self.n_vertices} vertices, {self.n_faces} faces, {self.n_components} {parts}"
        verdict = "a closed, outward oriented two-manifold"
        if not self.is_closed:
            verdict = "can be deformed" if self.ok else "has faults"
        lines = [f"{size}: {verdict}"]
        lines += [f"  fault: {fault}; {fault.kind.advice}" for fault in self.faults]
        lines += [f"  note: {note}; {note.kind.advice}" for note in self.notes]
        return "\n".join(lines)


def counted(number: int, one: str, many: str) -> str:
    """Return "1 edge is" or "2 edges are": *number* with its singular or plural."""
    return f"{number} {one if number == 1 else many}"
