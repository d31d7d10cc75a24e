"""What is wrong with a mesh, in words: kinds of faults, and the report that counts them.

A fault keeps triangles from being a `Mesh`; a note does not.  `find_faults` looks for both.
"""

from __future__ import annotations

import enum
from dataclasses import dataclass

Id = int | tuple[int, ...]  # a vertex or face by its number, an edge by its two vertices


class Kind(enum.Enum):
    """A way to fail or, the last three, a thing worth knowing: in words, where, what to do."""

    EMPTY = "empty mesh", "empty meshes", "", "give at least four triangles"
    NON_FINITE = (
        "vertex with NaN or infinite coordinates",
        "vertices with NaN or infinite coordinates",
        "vertex ",
        "`repair` would drop them and their faces",
    )
    BAD_INDEX = (
        "face naming a vertex that does not exist",
        "faces naming a vertex that does not exist",
        "face ",
        "count vertices from 0, and pass all of them",
    )
    TOO_LARGE = (
        "vertex too far out to compute volumes with",
        "vertices too far out to compute volumes with",
        "vertex ",
        "scale the mesh down: coordinates may be 1e70 at most",
    )
    TOO_SMALL = (
        "mesh too small to compute volumes with",
        "meshes too small to compute volumes with",
        "",
        "scale it up: it must be 1e-70 long at least",
    )
    UNREFERENCED = (
        "unreferenced vertex",
        "unreferenced vertices",
        "vertex ",
        "`repair` would drop what is in no face",
    )
    DEGENERATE = (
        "degenerate face",
        "degenerate faces",
        "face ",
        "`repair` would drop what names a vertex twice",
    )
    DUPLICATE_FACE = "duplicate face", "duplicate faces", "face ", "`repair` would keep one of each"
    OPEN_EDGE = (
        "open edge",
        "open edges",
        "",
        "`repair` would weld vertices that coincide along them, then fill holes",
    )
    HOLE = "hole", "holes", "at vertex ", "`repair` would fill those of up to `largest_hole` edges"
    NON_MANIFOLD_EDGE = (
        "non-manifold edge",
        "non-manifold edges",
        "",
        "three or more faces meet there; `repair` would split where closed bodies touch",
    )
    NON_MANIFOLD_VERTEX = (
        "non-manifold vertex",
        "non-manifold vertices",
        "vertex ",
        "surfaces touch there in a point; `repair` would split them",
    )
    TURNED_EDGE = (
        "inconsistently oriented edge",
        "inconsistently oriented edges",
        "",
        "their two faces face opposite sides; `repair` would turn the fewer faces round",
    )
    INWARD = (
        "inside-out component",
        "inside-out components",
        "at vertex ",
        "`repair` would turn them round",
    )
    NO_VOLUME = (
        "component that encloses no volume",
        "components that enclose no volume",
        "at vertex ",
        "give it thickness, leave it out or, where digits are lost, move it near to the origin",
    )
    ZERO_AREA = "face without area", "faces without area", "face ", "allowed", False
    COINCIDENT = (
        "vertex on the same place as another",
        "vertices on the same place as another",
        "vertex ",
        "allowed where the surface closes without welding them",
        False,
    )
    COMPONENTS = "component", "components", "", "allowed", False

    def __init__(self, one: str, many: str, place: str, advice: str, fatal: bool = True) -> None:
        self.one, self.many, self.place, self.advice, self.fatal = one, many, place, advice, fatal


@dataclass(frozen=True)
class Fault:
    """One kind of fault: how often it occurs, and at which vertices, edges or faces."""

    kind: Kind
    count: int
    examples: tuple[Id, ...] = ()

    def __str__(self) -> str:
        text = f"{self.count} {self.kind.one if self.count == 1 else self.kind.many}"
        if not self.examples:
            return text
        ids = ("-".join(map(str, i)) if isinstance(i, tuple) else str(i) for i in self.examples)
        more = ", ..." if self.count > len(self.examples) else ""
        return f"{text} ({self.kind.place}{', '.join(ids)}{more})"


@dataclass(frozen=True)
class MeshReport:
    """All that `find_faults` found; ``str(report)`` is meant for people."""

    n_vertices: int
    n_faces: int
    n_components: int
    faults: tuple[Fault, ...]
    notes: tuple[Fault, ...]

    @property
    def ok(self) -> bool:
        """Whether a `Mesh` can be made; notes do not stand in the way."""
        return not self.faults

    def count(self, kind: Kind) -> int:
        """Return how often *kind* occurs, 0 if it does not."""
        return sum(f.count for f in self.faults + self.notes if f.kind is kind)

    def __str__(self) -> str:
        parts = "component" if self.n_components == 1 else "components"
        size = f"{self.n_vertices} vertices, {self.n_faces} faces, {self.n_components} {parts}"
        verdict = "a closed, outward oriented two-manifold" if self.ok else "not usable as it is"
        lines = [f"{size}: {verdict}"]
        lines += [f"  fault: {fault}; {fault.kind.advice}" for fault in self.faults]
        lines += [f"  note: {note}; {note.kind.advice}" for note in self.notes]
        return "\n".join(lines)
