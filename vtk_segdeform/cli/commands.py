"""The commands ``deform``, ``edit``, ``check``, ``regions`` and ``cages``.

A command takes its parsed options, a function `say` that prints one line of its report, and a
progress callback.  It returns True, or False if it found faults; errors are raised.  `main` sets
the exit code.
"""

from __future__ import annotations

import time
from argparse import Namespace
from pathlib import Path
from typing import Any

import numpy as np

from .. import io
from ..arrays import FloatArray, IntArray
from ..cages import Cage, fit_cages
from ..deformer import Deformer
from ..errors import ConstraintError, MeshError
from ..io import repair_surface, triangles_of
from ..mesh import Mesh, find_faults
from ..pictures import picture_before_after, require_picture, require_screen
from ..progress import Progress, part
from ..regions import Regions, segment
from ..session import Session, load_session
from ..widgets import plugin
from . import motion
from .outputs import (
    HANDLE_TOLERANCE,
    Say,
    coloured_cages,
    coloured_regions,
    report_cages,
    report_regions,
    report_solution,
    report_volume,
)
from .selection import parse_selection

SESSION = ".segdeform"  # suffix of session files


def deform(options: Namespace, say: Say, progress: Progress) -> bool:
    """Move the handles of a mesh and write it with all its arrays and texture coordinates."""
    io.require_writable(options.output)
    if options.picture is not None:
        require_picture(options.picture)
    surface, mesh = _read(options.input)
    fixed = parse_selection(options.fixed, mesh, point_arrays=surface.point_data, role="fixed")
    handle, targets = _handles(options.handles, surface, mesh, fixed)
    regions, cages = _subspace(options, surface, mesh, part(progress, 0.0, 0.6))
    report_regions(regions, say)
    report_cages(cages, say)
    deformer = Deformer(
        mesh, regions, cages, fixed=fixed, handle=handle, progress=part(progress, 0.6, 0.9),
        **_settings(options),
    )  # fmt: skip
    progress(0.9, "solving")
    start = time.perf_counter()
    solution = deformer.solve(targets, progress=part(progress, 0.9, 1.0))
    report_solution(solution, time.perf_counter() - start, say)
    deformed = io.with_vertices(surface, solution.vertices)
    io.write_mesh(options.output, deformed)
    say(f"written         {options.output}")
    if options.picture is not None:
        picture_before_after(options.picture, mesh, solution.vertices, fixed=fixed, handle=handle)
        say(f"written         {options.picture}")
    if solution.handle_error > HANDLE_TOLERANCE:
        raise MeshError(
            f"{options.output} was written, but a handle misses its target by "
            f"{100 * solution.handle_error:.3f} % of model size: {solution.status}"
        )
    return True


def edit(options: Namespace, say: Say, progress: Progress) -> bool:
    """Edit a mesh or a saved session in a window; write the deformed mesh."""
    del progress  # the window shows progress itself
    if options.output is not None:
        io.require_writable(options.output)
    surface, session = opened(options.input)
    require_screen()
    session = plugin.edit(
        session, path=options.input.with_suffix(SESSION), title=f"segdeform {options.input.name}"
    )
    report_volume(session.volume_change, say)
    if options.output is not None:
        io.write_mesh(options.output, plugin.deformed(surface, session))
        say(f"written         {options.output}")
    return True


def check(options: Namespace, say: Say, progress: Progress) -> bool:
    """Report the faults of a mesh and the steps of a repair; with --repair, write the result."""
    if options.repair != (options.output is not None):
        raise ConstraintError("--repair and -o OUT require each other: -o is the repaired mesh")
    surface = io.read_polydata(options.input)
    vertices, faces = np.asarray(surface.points, dtype=float), triangles_of(surface)
    progress(0.1, "checking mesh")
    report = find_faults(vertices, faces)
    say(f"{options.input}: {report}")
    if report.ok and not options.repair:
        return True
    progress(0.4, "repairing mesh")
    closed, repair = repair_surface(surface, largest_hole=options.largest_hole)
    progress(1.0, "done")
    did, then = ("repaired", "result") if options.repair else ("--repair would", "result")
    for step in repair.steps:
        say(f"{did}: {step}")
    if not repair.steps:
        say("nothing to repair")
    say(f"{then}: {repair.report}")
    if repair.advice:
        say(repair.advice)
    if not options.repair:
        return False
    io.write_mesh(options.output, closed)
    say(f"written: {options.output}")
    return repair.report.is_closed


def regions(options: Namespace, say: Say, progress: Progress) -> bool:
    """Divide a mesh into regions; print their sizes and write them as a point array "region"."""
    if options.output is not None:
        io.require_writable(options.output, arrays=True)
    surface, mesh = _read(options.input)
    found = _regions(options, surface, mesh, progress)
    report_regions(found, say)
    if options.output is not None:
        io.write_mesh(options.output, coloured_regions(surface, found))
        say(f"written         {options.output}")
    return True


def cages(options: Namespace, say: Say, progress: Progress) -> bool:
    """Fit cages to a mesh; print their sizes and write them as one coloured surface."""
    if options.output is not None:
        io.require_writable(options.output, arrays=True)
    surface, mesh = _read(options.input)
    found, made = _subspace(options, surface, mesh, progress)
    report_regions(found, say)
    report_cages(made, say)
    if options.output is not None:
        io.write_mesh(options.output, coloured_cages(made))
        say(f"written         {options.output}")
    return True


def opened(path: Path) -> tuple[Any, Session]:
    """Return the surface in a file, with all its arrays, and its session, new or saved."""
    if path.suffix == SESSION:
        session = load_session(path)
        return io.to_polydata(session.mesh), session
    surface, mesh = _read(path)
    return surface, Session(mesh)


def _read(path: Path) -> tuple[Any, Mesh]:
    """Return a surface with all its arrays, and the same surface as a closed mesh."""
    surface = io.read_polydata(path)
    try:
        return surface, io.from_polydata(surface)
    except MeshError as fault:
        raise MeshError(f"{path}: {fault}; see 'segdeform check {path}'") from None


def _regions(options: Namespace, surface: Any, mesh: Mesh, progress: Progress | None) -> Regions:
    wanted = options.regions
    if wanted in surface.point_data:
        return Regions.from_labels(mesh, surface.point_data[wanted], overlap=options.overlap)
    if wanted == "1":
        return Regions.single(mesh)
    if wanted != "auto" and not (wanted.isdecimal() and int(wanted) > 0):
        raise ConstraintError(
            f"--regions must be a number from 1, 'auto' or a point array of the mesh "
            f"({', '.join(surface.point_data.keys()) or 'it has none'}); got {wanted!r}"
        )
    number = None if wanted == "auto" else int(wanted)
    return segment(mesh, n_regions=number, progress=progress)


def _subspace(
    options: Namespace, surface: Any, mesh: Mesh, progress: Progress | None
) -> tuple[Regions, tuple[Cage, ...]]:
    found = _regions(options, surface, mesh, part(progress, 0.0, 0.3))
    number = options.cage_vertices
    return found, fit_cages(mesh, found, n_vertices=number, progress=part(progress, 0.3, 1.0))


def _settings(options: Namespace) -> dict[str, Any]:
    """Return the options of `Deformer` that are given on the command line."""
    settings: dict[str, Any] = {"preserve_volume": not options.no_volume}
    if options.stretch is not None:
        settings["stretch"] = options.stretch
    if options.rotation_groups is not None:
        settings["rotation_groups"] = options.rotation_groups or None
    return settings


def _handles(
    handles: list[dict[str, str]], surface: Any, mesh: Mesh, fixed: IntArray
) -> tuple[IntArray, FloatArray]:
    """Return the vertices (k,) of all handles and their targets (k, 3)."""
    ids, targets = [], []
    fixed_centre = mesh.vertices[fixed].mean(axis=0)
    for handle in handles:
        if len(handle) == 1:
            raise ConstraintError(
                f"handle {handle['select']!r} does not move; add --translate, --rotate or --matrix "
                "after it"
            )
        arrays = surface.point_data
        ids.append(parse_selection(handle["select"], mesh, point_arrays=arrays, role="handle"))
        targets.append(_moved(mesh.vertices[ids[-1]], handle, fixed_centre))
    together = np.concatenate(ids)
    if len(np.unique(together)) < len(together):
        raise ConstraintError("two handles share vertices; each vertex can be in only one handle")
    return together, np.concatenate(targets)


def _moved(points: FloatArray, handle: dict[str, str], fixed_centre: FloatArray) -> FloatArray:
    """Apply the matrix, the rotation and the translation of a handle, in this order.

    *fixed_centre* (3,) is the mean of the fixed vertices.
    """
    if "matrix" in handle:
        points = motion.transform(points, motion.read_matrix(handle["matrix"]))
    if "rotate" in handle:
        axis, angle = motion.parse_rotation(handle["rotate"])
        pivot = handle.get("pivot", "handle")
        centres = {"handle": points.mean(axis=0), "fixed": fixed_centre}
        centre = centres[pivot] if pivot in centres else motion.parse_vector(pivot, "pivot")
        points = motion.transform(points, motion.rotation(axis, angle, centre))
    if "translate" in handle:
        points = points + motion.parse_vector(handle["translate"], "translate")
    return points
