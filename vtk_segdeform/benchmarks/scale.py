"""Problem sizes of a run: a few minutes, a quarter of an hour, or an hour."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Scale:
    """Sizes and repetitions of the experiments."""

    name: str
    paper_size: int = 5430  # vertices of the cactus, as in the paper
    n_cage_vertices: int = 155
    drag_sizes: tuple[int, ...] = (5430, 50_000)
    frames: int = 5  # of a drag
    repeats: int = 5  # of each measurement
    regions: tuple[int, ...] = (1, 2, 3, 4, 6, 8, 12, 16, 24)
    study_vertices: int = 288  # total cage vertices, for a constant total
    study_each: int = 40  # vertices of each cage, for a constant number per cage
    peer_sizes: tuple[int, ...] = (5430,)
    most_iterations: int = 200  # of a peer
    cage_sizes: tuple[int, ...] = (5430,)
    own_process: bool = True  # run each size and each peer in a process of its own


QUICK = Scale("quick", frames=3, repeats=3, regions=(1, 3, 6, 12, 24), most_iterations=100)
USUAL = Scale("usual", drag_sizes=(5430, 50_000, 500_000), peer_sizes=(5430, 50_000))
FULL = Scale(
    "full",
    frames=12,
    drag_sizes=(5430, 50_000, 500_000, 1_000_000),
    peer_sizes=(5430, 50_000, 500_000, 1_000_000),
    cage_sizes=(5430, 50_000),
)
