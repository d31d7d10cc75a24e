"""``segdeform demo``: bend the trunk of the sample cactus by 60 degrees.

The bottom is fixed and the tip of the trunk is the handle.  The axis of rotation is horizontal and
passes through the trunk below the arm on the inner side, so that this arm swings out of the way.
"""

from __future__ import annotations

import math
import time
from argparse import Namespace

import numpy as np

from .. import io
from ..cages import fit_cages
from ..deformer import Deformer, finished
from ..errors import ConstraintError, MissingDependencyError
from ..geometry import local_volume_change, rotation, transform
from ..mesh import Mesh, parse_selection
from ..models import cactus
from ..pictures import (
    picture_before_after,
    picture_regions_and_cages,
    picture_volume_change,
)
from ..progress import Progress, part
from ..regions import segment
from .outputs import (
    HANDLE_TOLERANCE,
    Say,
    coloured_cages,
    coloured_regions,
    report_cages,
    report_pose,
    report_regions,
    report_solution,
)

_PIVOT_HEIGHT = 0.4  # as a fraction of the height


def demo(options: Namespace, say: Say, progress: Progress) -> bool:
    """Bend the cactus; write meshes and pictures.  Return whether the handle met its targets."""
    folder = options.output
    if folder.exists() and not folder.is_dir():
        raise ConstraintError(f"{folder} is a file; give a folder")
    mesh = cactus(options.size)
    folder.mkdir(parents=True, exist_ok=True)
    say(f"cactus          {mesh.n_vertices} vertices, {mesh.n_faces} triangles")
    start = time.perf_counter()
    regions = segment(mesh, n_regions=3, progress=part(progress, 0.0, 0.2))
    report_regions(regions, say)
    cages = fit_cages(mesh, regions, n_vertices=155, progress=part(progress, 0.2, 0.5))
    report_cages(cages, say)
    fixed, handle = (parse_selection(text, mesh.vertices) for text in ("z<8%", "z>92%"))
    low, high = mesh.bounds
    pivot = 0.5 * (low + high)
    pivot[2] = low[2] + _PIVOT_HEIGHT * (high[2] - low[2])
    targets = transform(mesh.vertices[handle], rotation([0, 1, 0], math.radians(60.0), pivot))
    deformer = Deformer(
        mesh, regions, cages, fixed=fixed, handle=handle, progress=part(progress, 0.5, 0.7)
    )
    say(f"set-up          {time.perf_counter() - start:.1f} s")
    start = time.perf_counter()
    solved = deformer.solve(targets)
    report_solution(solved, time.perf_counter() - start, say)
    start = time.perf_counter()
    solution = finished(deformer, solved, None, progress=part(progress, 0.7, 0.8))
    steps, seconds = solution.steps - solved.steps, time.perf_counter() - start
    say(
        f"finish          {steps} steps on the mesh, {1e3 * seconds:.0f} ms, "
        f"handle error {100 * solution.handle_error:.3f} %, volume {solution.volume_change:+.1e}"
    )
    report_pose(solution, mesh, say)
    change = local_volume_change(mesh, solution.vertices)
    usual = math.ceil(100 * np.percentile(np.abs(change), 99.0))  # as in the legend of the picture
    say(
        f"local volume    {100 * change.min():+.0f} % to {100 * change.max():+.0f} %, "
        f"at 99 % of the vertices within {usual} %"
    )

    after = mesh.with_vertices(solution.vertices)
    bent = coloured_regions(io.Surface(io.to_polydata(after)), regions)
    bent.point_data["local_volume_change"] = change
    io.write_mesh(folder / "cactus-bent.vtp", bent)
    io.write_mesh(folder / "cages-bent.vtp", coloured_cages(cages, solution.cage_vertices))
    say(f"written         {folder / 'cactus-bent.vtp'}, {folder / 'cages-bent.vtp'}")
    if not options.no_pictures:
        progress(0.8, "drawing pictures")
        names = ("regions-and-cages.png", "before-after.png", "cages-bent.png", "volume-change.png")
        at_rest, before_after, cages_bent, volume = (folder / name for name in names)
        moved = [Mesh(p, cage.faces) for p, cage in zip(solution.cage_vertices, cages, strict=True)]
        try:
            picture_regions_and_cages(at_rest, mesh, regions.membership, cages)
            picture_before_after(before_after, mesh, after.vertices, fixed=fixed, handle=handle)
            picture_regions_and_cages(cages_bent, after, regions.membership, moved)
            picture_volume_change(volume, mesh, after.vertices, change)
            say(f"written         {', '.join(names)}")
        except MissingDependencyError as missing:
            say(f"no pictures     {missing}")
    return solution.handle_error <= HANDLE_TOLERANCE
