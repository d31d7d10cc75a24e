"""Measurements: the experiments of the paper, and other programs, each in one file.

report    runs them and writes the report
"""

from .report import EXPERIMENTS, NAME, write_report
from .scale import FULL, QUICK, USUAL

__all__ = ["EXPERIMENTS", "FULL", "NAME", "QUICK", "USUAL", "write_report"]
