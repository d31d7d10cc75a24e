"""Bodies fitted to landmarks, beside a thin-plate spline through the same landmarks.

The truth is a map of space: smooth growth, a bend whose middle line keeps its length, or both.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from ..arrays import FloatArray
from ..landmarks import Spline, fit_landmarks
from ..mesh import Mesh
from ..models import bar, random_limbs
from ..progress import Progress, tell
from .measuring import in_own_process, timed
from .results import Cell, Scale, Section, Table
from .tasks import warm_up

_COLUMNS = (
    "body", "truth", "landmarks", "spline, %", "fit, %", "fit / spline", "left out, spline, %",
    "left out, fit, %", "stiffness", "fit, s",
)  # fmt: skip
_TEXT = """\
A body is moved by a known map of space, and fitted to that of a few of its vertices, drawn at \
random. Errors are those of all its vertices, root mean square, and of the landmarks that are left \
out, their mean, in per cent of the diagonal. *Grows*: 40 % longer at one end than at the other, \
and of other widths; *bends*: to an arc of 120 degrees. All times are of the processor."""
_ANGLE = np.deg2rad(120.0)
_FEW, _MANY = (12, 24, 48), (10, 5_000)


def run(scale: Scale, progress: Progress | None = None) -> Section:
    """Return a table with the errors, and one with the times for 10 and 5,000 landmarks."""
    tell(progress, 0.0, "bodies fitted to landmarks")
    errors = in_own_process(fits)
    tell(progress, 0.6, "many landmarks")
    times = in_own_process(times_of, max(scale.drag_sizes[0], _MANY[1]))
    return Section(
        "Landmarks",
        _TEXT,
        [
            Table(_COLUMNS, errors, "errors"),
            Table(("vertices", "landmarks", "fit, s"), times, "many landmarks"),
        ],
    )


def grown(x: FloatArray) -> FloatArray:
    """Return points (n, 3) of a body of height 1 after growth."""
    t = x[:, 2:]
    return np.asarray(x * [1.3, 0.9, 1.2] + t * x * [0.2, 0.2, 0.4])


def bent(x: FloatArray) -> FloatArray:
    """Return points (n, 3) of a body of height 1 bent to an arc."""
    t, inward = _ANGLE * x[:, 2], 1.0 / _ANGLE - x[:, 0]
    across = 1.0 / _ANGLE - inward * np.cos(t)
    return np.stack([across, x[:, 1], inward * np.sin(t)], axis=1)


TRUTHS: dict[str, Callable[[FloatArray], FloatArray]] = {
    "grows": grown,
    "bends": bent,
    "grows and bends": lambda x: bent(x * np.array([1.2, 1.2, 1.0])),
}


def bodies() -> dict[str, Mesh]:
    """Return bodies of height 1 that stand on z = 0."""
    beam = bar(size=(0.2, 0.15, 1.0), divisions=(6, 5, 30))
    return {"bar": standing(beam), "random limbs": standing(random_limbs(3_000, seed=5))}


def standing(mesh: Mesh) -> Mesh:
    """Return *mesh* with its middle on the z axis, its height 1."""
    x = mesh.vertices - mesh.vertices.min(axis=0)
    x = x / x[:, 2].max()
    return mesh.with_vertices(x - np.append(0.5 * x[:, :2].max(axis=0), 0.0))


def fits() -> list[tuple[Cell, ...]]:
    """Return a row of errors for each body, truth and number of landmarks."""
    warm_up()
    rows: list[tuple[Cell, ...]] = []
    for body, mesh in bodies().items():
        x, percent = mesh.vertices, 100.0 / mesh.diagonal
        order = np.random.default_rng(0).permutation(len(x))
        for truth, move in TRUTHS.items():
            y = move(x)
            for count in _FEW:
                ids = order[:count]
                fit, seconds = timed(partial(fit_landmarks, mesh, x[ids], y[ids]))
                spline = Spline(x[ids], np.zeros(count)).at(x, y[ids])
                own, other = (percent * _rms(each - y) for each in (fit.vertices, spline))
                left = (
                    percent * float(each.mean()) for each in (fit.left_out_spline, fit.left_out)
                )
                rows.append(
                    (body, truth, count, other, own, own / other, *left, fit.stiffness, seconds)
                )
    return rows


def times_of(size: int) -> list[tuple[Cell, ...]]:
    """Return rows with the times of few and many landmarks of a body of *size* vertices."""
    warm_up()
    mesh = standing(random_limbs(size, seed=5))
    x, y = mesh.vertices, grown(mesh.vertices)
    order = np.random.default_rng(0).permutation(len(x))
    rows: list[tuple[Cell, ...]] = []
    for count in _MANY:
        ids = order[:count]
        _, seconds = timed(partial(fit_landmarks, mesh, x[ids], y[ids]))
        rows.append((size, count, seconds))
    return rows


def _rms(away: FloatArray) -> float:
    return float(np.sqrt((away**2).sum(axis=1).mean()))
