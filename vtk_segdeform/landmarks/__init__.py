"""A body fitted to landmarks, such as an atlas to a patient: grown and bent.

The files, in reading order:

    fit            `fit_landmarks`: what bends and what grows
    semilandmarks  those that slide along curves and surfaces
    spline         thin-plate splines
    files          landmarks in files, by name
    followers      files whose points follow a body
"""

from .files import (
    LANDMARK_SUFFIXES,
    Landmarks,
    Pairs,
    paired,
    read_landmarks,
    write_landmarks,
    write_rows,
)
from .fit import LEAST_PAIRS, LandmarkFit, fit_landmarks
from .followers import Follower
from .spline import Spline

__all__ = [
    "LANDMARK_SUFFIXES",
    "LEAST_PAIRS",
    "Follower",
    "LandmarkFit",
    "Landmarks",
    "Pairs",
    "Spline",
    "fit_landmarks",
    "paired",
    "read_landmarks",
    "write_landmarks",
    "write_rows",
]
