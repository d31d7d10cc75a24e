"""Plots for the page on the mathematics, computed when they are drawn."""

from __future__ import annotations

from typing import Any

import matplotlib.pyplot as plt
import numpy as np

from making.made import FIGURES as FOLDER
from making.scene import bar, cactus, deformer_of, rotated
from vtk_segdeform.geometry import signed_volume, volume_along
from vtk_segdeform.io import polydata_of
from vtk_segdeform.pictures import COLOURS, INK

OURS, THEIRS = COLOURS[5], COLOURS[6]
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
    """Draw the convergence of the paper's iteration and of ours to the same pose."""
    parts = cactus(1500)
    targets = rotated(parts["mesh"], parts["handle"], 30)
    ours = deformer_of(parts).solve(targets)
    paper = {"acceleration": 0, "exact_hessian": False}
    printed = deformer_of(parts, **paper).solve(targets)
    linear = deformer_of(parts, exact_volume=False, **paper)
    linearised = [abs(linear.solve(targets, max_steps=1).volume_change) for _ in range(60)]
    exact = deformer_of(parts)
    errors = [abs(exact.solve(targets, max_steps=1).volume_change) for _ in range(ours.steps)]
    least = min(ours.merits[-1], printed.merits[-1])

    figure, (left, right) = new_figure(2)
    for name, merits, colour in (
        ("eq. (21) as printed", printed.merits, THEIRS),
        ("with exact Hessian and acceleration", ours.merits, OURS),
    ):
        left.semilogy(np.array(merits) / least - 1.0 + 1e-12, color=colour, label=name)
    left.set(xlabel="steps", ylabel="objective / its minimum $-$ 1", ylim=(1e-10, None))
    left.set_xlim(0, min(len(printed.merits), 400))
    right.semilogy(range(1, 61), linearised, color=THEIRS, label="linearised, eq. (21)")
    dots = {"ls": "none", "marker": "o", "ms": 4, "color": OURS}
    right.semilogy(range(1, len(errors) + 1), np.maximum(errors, 1e-17), **dots, label="exact")
    right.set(xlabel="steps", ylabel=r"$|V - V_0|\,/\,V_0$", ylim=(3e-18, 1))
    for axes in (left, right):
        axes.legend(frameon=False)
    figure.savefig(FOLDER / "convergence.png", dpi=150)


def new_figure(columns: int = 1) -> Any:
    """Return a new Matplotlib figure and its axes."""
    plt.rcParams.update({"font.size": 11, "axes.spines.top": False, "axes.spines.right": False})
    plt.rcParams.update({"axes.edgecolor": INK, "axes.labelcolor": INK, "text.color": INK})
    return plt.subplots(1, columns, figsize=(5.2 * columns, 3.6), constrained_layout=True)
