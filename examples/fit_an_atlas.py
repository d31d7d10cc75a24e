"""
Fit an atlas to a patient
=========================

Twenty-four landmarks of an atlas are known in a patient, who is larger, of other proportions and
holds the tail to the side.  The atlas grows and bends to them; beside it the errors of the
thin-plate spline through the same landmarks.

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
    """Return where points of the atlas are in the patient: grown, the tail turned to the side."""
    grown = points * [1.15, 1.0, 1.2]
    s = np.linspace(-1.5, 1.2, 2701)  # along the body; its middle line keeps its length
    share = np.clip((s + 0.95) / 0.3, 0.0, 1.0)
    angle = 1.8 * (1.0 - share**2 * (3.0 - 2.0 * share))
    line = np.cumsum([np.cos(angle), np.sin(angle)], axis=1) * (s[1] - s[0])
    along, across, angle = (np.interp(grown[:, 0], s, each) for each in (*line, angle))
    side = grown[:, 1]
    x, y = along - side * np.sin(angle), across + side * np.cos(angle)
    return np.stack([x, y, grown[:, 2]], axis=1)


truth = in_patient(x)
landmarks = [int(x[:, 2].argmax())]
while len(landmarks) < 24:  # each as far as possible from those before it
    away = np.linalg.norm(x[:, None] - x[landmarks], axis=2).min(axis=1)
    landmarks.append(int(away.argmax()))
fit = sd.fit_landmarks(atlas, x[landmarks], truth[landmarks])


def off(vertices):
    """Return the distance from the patient, root mean square, in per cent of the diagonal."""
    return 100 * np.sqrt(((vertices - truth) ** 2).sum(axis=1).mean()) / atlas.diagonal


by_spline = Spline(x[landmarks], np.zeros(len(landmarks))).at(x, truth[landmarks])
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
