"""
Fit an atlas to a patient
=========================

Twenty landmarks of an atlas are known in a patient, who is larger, of other proportions and bent.
The atlas grows and bends to them, beside it the thin-plate spline through the same landmarks.

    python examples/fit_an_atlas.py FOLDER

writes a picture of the landmarks, and of the atlas fitted to them.
"""

import sys
from pathlib import Path

import numpy as np

import vtk_segdeform as sd
from vtk_segdeform.landmarks import Spline
from vtk_segdeform.pictures import picture_landmarks

atlas = sd.models.dinosaur(4000)
x = atlas.vertices


def in_patient(points):
    """Return where points of the atlas are in the patient: grown, and bent to the side."""
    grown = points * [1.15, 1.0, 1.3]
    angle = grown[:, 0]
    inward = 1.0 - grown[:, 1]
    across, along = 1.0 - inward * np.cos(angle), inward * np.sin(angle)
    return np.stack([along, across, grown[:, 2]], axis=1)


truth = in_patient(x)
landmarks = np.random.default_rng(4).permutation(len(x))[:20]
fit = sd.fit_landmarks(atlas, x[landmarks], truth[landmarks])


def off(vertices):
    """Return the distance from the patient, root mean square, in per cent of the diagonal."""
    return 100 * np.sqrt(((vertices - truth) ** 2).sum(axis=1).mean()) / atlas.diagonal


by_spline = Spline(x[landmarks], np.zeros(20)).at(x, truth[landmarks])
errors = {"fitted": off(fit.vertices), "spline": off(by_spline)}
print(f"fitted: off by {errors['fitted']:.2f} % of the diagonal, stiffness {fit.stiffness:g}")
print(f"by a thin-plate spline alone: off by {errors['spline']:.2f} %")
print(f"left out, landmarks are off by {fit.left_out.mean():.3f}")
print(f"and by the spline by {fit.left_out_spline.mean():.3f}")
if len(sys.argv) > 1:
    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    ends = {"source": x[landmarks], "target": truth[landmarks], "residuals": fit.residuals}
    picture_landmarks(folder / "landmarks.png", atlas, fit.vertices, **ends)
