"""How much is measured: in a minute or two, in a quarter of an hour, or all that was promised."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Scale:
    """Sizes of the experiments; `QUICK`, `USUAL` and `FULL` are those of the command."""

    name: str
    paper_size: int = 5430  # vertices of the cactus, as in the paper
    n_cage_vertices: int = 155
    drag_sizes: tuple[int, ...] = (5430, 50_000)
    frames: int = 5  # of a drag
    repeats: int = 5  # of what is timed
    regions: tuple[int, ...] = (1, 2, 3, 4, 6, 8, 12, 16, 24)
    study_vertices: int = 288  # of all cages, where their total is the same
    study_each: int = 40  # of each cage, where that is the same
    peer_sizes: tuple[int, ...] = (5430,)
    most_iterations: int = 200  # of a peer
    cage_sizes: tuple[int, ...] = (5430,)
    own_process: bool = True  # for each size and each peer


QUICK = Scale("quick", frames=3, repeats=3, regions=(1, 3, 6, 12, 24), most_iterations=100)
USUAL = Scale("usual", drag_sizes=(5430, 50_000, 500_000), peer_sizes=(5430, 50_000))
FULL = Scale(
    "full",
    frames=12,
    drag_sizes=(5430, 50_000, 500_000, 1_000_000),
    peer_sizes=(5430, 50_000, 500_000, 1_000_000),
    cage_sizes=(5430, 50_000),
)
