"""Benchmarks: the experiments of the paper and comparisons with other programs.

The files, in reading order:

    report                run the experiments and write the report
    sections              text, tables, figures and ratios of an experiment
    scale                 problem sizes: quick, usual and full
    history               record and plot the ratios of many runs
    tasks                 meshes, handles and targets
    bodies                bodies that are no sample meshes, and a hand on one of their limbs
    drags                 drags as a hand makes them, frame by frame
    measuring             time, memory and child processes
    felt                  what drags feel like, for 5 to 500 thousand vertices
    mechanisms            what each mechanism of the solver buys
    paper                 tables 1 and 2 of the paper
    experiments           figures 7, 8 and 9 of the paper
    peers programs        deformation by other programs
    browser               drags in the browser and in process
    chromium              the browser
    charts                plots
"""

from .history import plot_history, read_history, record
from .measuring import in_own_process
from .report import EXPERIMENTS, NAME, write_report
from .scale import FULL, QUICK, USUAL

__all__ = [
    "EXPERIMENTS",
    "FULL",
    "NAME",
    "QUICK",
    "USUAL",
    "in_own_process",
    "plot_history",
    "read_history",
    "record",
    "write_report",
]
