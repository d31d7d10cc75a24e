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
    repeats: int = 5  # of each measurement
    regions: tuple[int, ...] = (1, 2, 3, 4, 6, 8, 12, 16, 24)  # of the paper's table 2
    peer_sizes: tuple[int, ...] = (5430,)
    most_iterations: int = 5000  # of a peer
    own_process: bool = True  # run each size and each peer in a process of its own


QUICK = Scale("quick", repeats=3, regions=(1, 3, 6, 12, 24))
USUAL = Scale("usual", peer_sizes=(5430, 50_000))
FULL = Scale("full", drag_sizes=(5430, 50_000, 500_000), peer_sizes=(5430, 50_000, 500_000))
