"""Benchmarks: what a person feels, the paper's tables, and a comparison with libigl.

The files, in reading order:

    report        run the experiments and write the report
    results       problem sizes, tables and sections
    measuring     processor time, child processes and the conditions of a run
    tasks         meshes, handles and targets; a hand on a limb of any body
    drags         drags as a hand makes them, frame by frame
    felt          what drags feel like, for 5 to 500 thousand vertices
    constrained   the same drag with rigid parts, slides, symmetry, volumes and followers
    opening       from opening a file to a surface that follows the pointer
    atlas         bodies fitted to landmarks, beside a thin-plate spline
    mechanisms    what each mechanism of the solver buys
    batching      batches by one process and by two
    paper         tables 1 and 2 of the paper
    peers         the same poses by libigl
    solids        volume meshes, beside radial basis functions and linear elasticity
"""

from .measuring import in_own_process
from .report import EXPERIMENTS, NAME, write_report
from .results import FULL, QUICK, USUAL

__all__ = ["EXPERIMENTS", "FULL", "NAME", "QUICK", "USUAL", "in_own_process", "write_report"]
