"""Measurements: the experiments of the paper, and other programs, each in one file.

The files, in reading order:

    report                runs the experiments and writes the report
    sections              text, tables, plots and ratios of an experiment
    scale                 how much is measured: quick, usual or full
    history               ratios of many runs, recorded and plotted
    tasks                 meshes, handles and poses
    drags                 drags, frame by frame
    measuring             clocks, memory and child processes
    drag_profile          drags from 5 thousand to a million vertices
    frame_profile         one drag, part by part
    drawing               drawing time of a frame
    table_one             table 1 of the paper
    experiments           figures 7, 8 and 9 of the paper
    segmentation_study    1 to 24 regions
    full_space            the same energy without cages
    cage_making           cages and coordinates of other programs
    peers programs        deformation by other programs
    charts                plots
"""

from .history import plot_history, read_history, record
from .report import EXPERIMENTS, NAME, write_report
from .scale import FULL, QUICK, USUAL

__all__ = [
    "EXPERIMENTS",
    "FULL",
    "NAME",
    "QUICK",
    "USUAL",
    "plot_history",
    "read_history",
    "record",
    "write_report",
]
