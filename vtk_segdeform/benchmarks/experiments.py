"""Figures 7, 8 and 9 of the paper, with measured distortion.

    7   with and without volume preservation     the cactus, bent by 60 degrees
    8   another model                            the dinosaur, its head turned back
    9   one cage and three cages                 the cactus

The paper calls a local change of shape, such as a bulge or a dent, distortion.  Besides its mean
over the surface, the tables therefore list its 99th percentile.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pyvista as pv

from ..arrays import FloatArray
from ..geometry import distortion, triangle_distortion
from ..io import polydata_of
from ..mesh import Mesh
from ..pictures import INK, add_surface, view_of, write_panels
from ..progress import Progress
from ..solver import Solution
from .scale import Scale
from .sections import Cell, Figure, Section, Table
from .tasks import Task, bent_cactus, prepare, raised_neck

COLUMNS = (
    "case", "volume change", "distortion", "99th percentile", "handle error", "steps",
)  # fmt: skip
_BAR = 0.17  # height of a colour bar, as a fraction of the figure


Cases = dict[str, tuple[int, dict[str, Any]]]  # number of regions and options of the deformer


def figures_of(scale: Scale) -> dict[str, tuple[Task, Cases]]:
    """Return the task and the cases of each figure."""
    cactus, dinosaur = bent_cactus(scale.paper_size), raised_neck(max(scale.paper_size, 1000))
    return {
        "figure 7": (cactus, {
            "volume preserved": (3, {}), "not preserved": (3, {"preserve_volume": False}),
            "not preserved, detail only": (3, {"preserve_volume": False, "stretch": 0.0}),
        }),
        "figure 8": (dinosaur, {"one cage": (1, {}), "five regions": (5, {})}),
        "figure 9": (cactus, {
            "one cage": (1, {}), "three regions": (3, {}),
            "three regions, detail only": (3, {"stretch": 0.0}),
        }),
    }  # fmt: skip


def run(scale: Scale, progress: Progress | None = None) -> Section:
    """Return a table and a picture for each of the three figures."""
    n, figures = scale.n_cage_vertices, figures_of(scale)
    section = Section("Figures 7, 8 and 9")
    for k, (name, (task, cases)) in enumerate(figures.items()):
        poses: dict[str, FloatArray] = {}
        rows = []
        for case, (n_regions, options) in cases.items():
            if progress:
                progress(k / len(figures), f"{name}, {case}")
            solution = prepare(task, n_regions, n, **options).deformer.solve(task.targets)
            poses[case] = solution.vertices
            rows.append(row_of(case, task.mesh, solution))
        section.tables.append(Table(COLUMNS, rows, f"{name}: {task.name}"))
        caption = f"{name.capitalize()}: {'; '.join(poses)}. Coloured by distortion."
        draw = partial(_draw, mesh=task.mesh, poses=poses)
        section.figures.append(Figure(f"{name.replace(' ', '-')}.png", caption, draw))
    return section


def row_of(case: str, mesh: Mesh, solution: Solution) -> tuple[Cell, ...]:
    """Return a row of `COLUMNS`."""
    return (
        case,
        solution.volume_change,
        distortion(mesh, solution.vertices),
        distortion_percentile(mesh, solution.vertices),
        solution.handle_error,
        solution.steps,
    )


def distortion_percentile(mesh: Mesh, vertices: FloatArray) -> float:
    """Return the distortion that is exceeded on one percent of the surface."""
    each = triangle_distortion(mesh, vertices)
    order = np.argsort(each)
    share = np.cumsum(mesh.face_areas[order]) / mesh.face_areas.sum()
    return float(each[order[np.searchsorted(share, 0.99)]])


def _draw(path: Path, *, mesh: Mesh, poses: dict[str, FloatArray]) -> None:
    """Draw the poses side by side, coloured by distortion with a common range."""
    most = max(distortion_percentile(mesh, pose) for pose in poses.values())

    def draw(plotter: pv.Plotter, pose: FloatArray) -> None:
        surface = polydata_of(pose, np.full(mesh.n_faces, 3), mesh.faces.ravel())
        surface.cell_data["distortion"] = triangle_distortion(mesh, pose)
        add_surface(plotter, surface, scalars="distortion", cmap="cividis", clim=(0.0, most))
        plotter.add_scalar_bar(
            " ", n_labels=3, fmt="%.2g", color=INK, label_font_size=36,
            width=0.7, height=0.1, position_x=0.15, position_y=0.02,
        )  # fmt: skip

    panels = [(name, partial(draw, pose=pose)) for name, pose in poses.items()]
    everything = np.concatenate(list(poses.values()))
    write_panels(
        path, panels, everything, view_of(mesh.vertices, everything[: mesh.n_vertices]), foot=_BAR
    )
