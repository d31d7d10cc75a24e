"""Plots for the page on the mathematics, computed when they are drawn."""

from __future__ import annotations

from typing import Any

import matplotlib.pyplot as plt
import numpy as np

import vtk_segdeform as sd
from making.made import FIGURES as FOLDER
from making.scene import bar, cactus, deformer_of, rotated
from vtk_segdeform.deformer import PaperDeformer
from vtk_segdeform.geometry import signed_volume, volume_along
from vtk_segdeform.io import polydata_of
from vtk_segdeform.pictures import COLOURS, INK

OURS, THEIRS = COLOURS[5], COLOURS[6]
_MOST = 300  # steps after which both have converged
BESIDE = {"textcoords": "offset points", "color": INK}


def volume_along_a_step() -> None:
    """Draw the volume as a cubic of the step length, with its root and its tangent."""
    parts, free, _ = bar()
    faces, x = parts["mesh"].faces, free.vertices
    surface = polydata_of(x, np.full(len(faces), 3), faces.ravel())
    surface = surface.compute_normals(
        cell_normals=False, split_vertices=False, consistent_normals=False
    )
    outward = np.asarray(surface.point_data["Normals"], dtype=float)
    at_rest = signed_volume(parts["mesh"].vertices, faces)
    cubic = np.polynomial.Polynomial(100.0 * volume_along(x, outward, faces) / at_rest)
    slope = cubic.deriv()(0.0)
    guess = (100.0 - cubic(0.0)) / slope
    root = min(r.real for r in (cubic - 100.0).roots() if abs(r.imag) < 1e-9 and r.real > 0.0)
    t = np.linspace(0.0, 1.5 * guess, 200)

    figure, axes = new_figure()
    axes.axhline(100.0, color=INK, lw=1, ls=":")
    axes.plot(t, cubic(0.0) + slope * t, color=THEIRS, ls="--")
    axes.plot(t, cubic(t), color=OURS)
    axes.plot([guess, guess], [100.0, cubic(guess)], color=THEIRS, marker="o")
    axes.plot([root], [100.0], color=OURS, marker="o")
    words = f"tangent: {cubic(guess):.1f} %"
    axes.annotate(words, (guess, cubic(guess)), (-8, 6), ha="right", **BESIDE)
    axes.annotate("cubic: 100 %", (root, 100.0), (10, -34), **BESIDE)
    axes.annotate("at rest", (0.0, 100.0), (0, -14), **BESIDE)
    axes.set(xlabel="step length $t$", ylabel="volume [%]")
    axes.locator_params(axis="x", nbins=5)
    figure.savefig(FOLDER / "volume_along.png", dpi=150)


def convergence() -> None:
    """Draw how the paper's iteration and ours approach their converged poses."""
    parts = cactus(1500)
    ours, printed = deformer_of(parts), _printed(parts, diagonal=100.0)
    targets = rotated(parts["mesh"], parts["handle"], 30)
    scaled = targets * (printed.mesh.diagonal / parts["mesh"].diagonal)
    runs = {
        "the paper, eq. (21)": (THEIRS, *_approach(printed, scaled, steps=60)),
        "vtk_segdeform": (OURS, *_approach(ours, targets, steps=12)),
    }

    figure, (left, right) = new_figure(2)
    for name, (colour, distances, changes) in runs.items():
        style = {"color": colour, "label": name, "marker": "o", "ms": 3}
        left.semilogy(range(1, len(distances) + 1), np.maximum(distances, 1e-10), **style)
        right.semilogy(range(1, len(changes) + 1), np.maximum(changes, 1e-17), **style)
    left.set(xlabel="steps", ylabel="distance from the end / diagonal")
    right.set(xlabel="steps", ylabel=r"$|V - V_0|\,/\,V_0$", ylim=(3e-18, 1))
    for axes in (left, right):
        axes.legend(frameon=False)
    figure.savefig(FOLDER / "convergence.png", dpi=150)


def _printed(parts: dict[str, Any], diagonal: float) -> PaperDeformer:
    """Return the paper as printed on the same parts, in another unit of length."""
    factor = diagonal / parts["mesh"].diagonal
    mesh, *cages = (sd.Mesh(factor * s.vertices, s.faces) for s in (parts["mesh"], *parts["cages"]))
    regions = sd.Regions(mesh, parts["regions"].membership)
    ends = {name: parts[name] for name in ("fixed", "handle")}
    return sd.Deformer.as_printed(mesh, regions, cages, **ends)


def _approach(
    deformer: sd.Deformer | PaperDeformer, targets: Any, steps: int
) -> tuple[list[float], list[float]]:
    """Return the distance to the converged pose, in diagonals, and |dV| / V, after each step."""
    poses = [deformer.solve(targets, max_steps=1) for _ in range(steps)]
    for _ in range(_MOST):
        end = deformer.solve(targets, max_steps=1).vertices
    away = [np.linalg.norm(pose.vertices - end, axis=1).max() for pose in poses]
    return [each / deformer.mesh.diagonal for each in away], [abs(p.volume_change) for p in poses]


def new_figure(columns: int = 1) -> Any:
    """Return a new Matplotlib figure and its axes."""
    plt.rcParams.update({"font.size": 11, "axes.spines.top": False, "axes.spines.right": False})
    plt.rcParams.update({"axes.edgecolor": INK, "axes.labelcolor": INK, "text.color": INK})
    return plt.subplots(1, columns, figsize=(5.2 * columns, 3.6), constrained_layout=True)
