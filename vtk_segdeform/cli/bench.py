"""``segdeform bench``: run experiments, write a report, and print its tables."""

from __future__ import annotations

from argparse import Namespace
from dataclasses import replace

from ..benchmarks import FULL, NAME, QUICK, USUAL, write_report
from ..kernels import wait_until_compiled
from ..progress import Progress
from .outputs import Say


def bench(options: Namespace, say: Say, progress: Progress) -> bool:
    """Run experiments, write a report, and print its tables."""
    wait_until_compiled()
    scale = QUICK if options.quick else FULL if options.full else USUAL
    scale = replace(scale, n_cage_vertices=options.cage_vertices)
    if options.size is not None:
        one = (options.size,)
        scale = replace(scale, paper_size=options.size, drag_sizes=one, peer_sizes=one)
    for section in write_report(options.output, scale, options.only, progress):
        for line in section.markdown().splitlines():
            say(line)
    say(f"written         {options.output / NAME}")
    return True
