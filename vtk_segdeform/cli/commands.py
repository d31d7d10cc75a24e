"""The commands ``deform``, ``edit``, ``regions`` and ``cages``.

A command takes its parsed options, a function `say` that prints one line of its report, and a
progress callback.  It returns True, or False if it found faults; errors are raised.  `main` sets
the exit code.
"""

from __future__ import annotations

import math
import time
from argparse import Namespace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .. import io
from ..arrays import FloatArray, IntArray
from ..cages import fit_cages, suggested_size
from ..deformer import (
    Deformer,
    Slide,
    changing_components,
    checked_goals,
    clamped,
    finished,
    solved_along,
)
from ..errors import ArgumentError, ConstraintError, MeshError
from ..geometry import checked_attach, lids_of, moved_handles, parse_rotation, total_legs
from ..inside import VolumeMesh
from ..io import Surface
from ..mesh import Role, parse_selection
from ..pictures import picture_before_after, require_picture, require_screen
from ..progress import Progress, part
from ..regions import Regions, segment
from ..session import Session, load_session
from .main import AS_IN_PYTHON
from .outputs import (
    LIDS,
    Say,
    coloured_cages,
    coloured_regions,
    report_approximate,
    report_cages,
    report_goals,
    report_pose,
    report_regions,
    report_session,
    report_solution,
    report_surface,
    require_met,
    surface_and_volume,
    written,
)
from .turns import turns_off

SESSION = ".segdeform"  # suffix of session files


def deform(options: Namespace, say: Say, progress: Progress) -> bool:
    """Move the handles of a surface and write it as it was given, apart from coordinates."""
    if options.picture is not None:
        require_picture(options.picture)
    surface, volume = surface_and_volume(options)
    mesh = surface.mesh
    report_surface(surface, say, is_volume=volume is not None)
    if not mesh.is_closed:
        enclosed = lids_of(mesh, LIDS[options.lids])
        say(f"volume          {enclosed.summary(preserved=not options.no_volume)}")
    fixed = np.zeros(0, dtype=np.int64)
    if options.fixed is not None:
        fixed = _selected(options.fixed, surface, "fixed")
    constraints = constraints_of(options, surface, volume)
    has_goals = bool(options.volume)
    handle, path = _handles(options.handles, surface, fixed, has_goals=has_goals)
    held = np.union1d(fixed, handle)
    goals = checked_goals(constraints["volumes"])
    apart = changing_components(mesh, LIDS[options.lids], goals)
    found = _regions(options, surface, part(progress, 0.0, 0.18), held, apart=apart)
    size = _size(options, found)
    is_fixed = np.zeros(mesh.n_vertices, dtype=bool)
    is_fixed[fixed] = True
    regions, _ = clamped(
        found, fixed=is_fixed, handle=handle, targets=path[-1], n_cage_vertices=size
    )
    cages = fit_cages(mesh, regions, size, progress=part(progress, 0.18, 0.6))
    report_regions(regions, say)
    report_cages(cages, say)
    deformer = Deformer(
        mesh, regions, cages, fixed=fixed, handle=handle, progress=part(progress, 0.6, 0.9),
        preserve_volume=not options.no_volume, **constraints,
    )  # fmt: skip
    progress(0.9, "solving")
    start = time.perf_counter()
    solution = solved_along(deformer, path, progress=part(progress, 0.9, 0.95))
    solution = finished(deformer, solution, options.refine, progress=part(progress, 0.95, 1.0))
    seconds = time.perf_counter() - start
    stored, inside = written(surface, solution, options, volume=volume)
    report_solution(stored, seconds, say, has_handle=len(handle) > 0)
    report_goals(stored, surface, options.input, say)
    report_pose(stored, mesh, say, avoids_contact=options.avoid_contact, inside=inside)
    report_approximate(stored, options, say)
    say(f"written         {options.output}")
    if options.picture is not None:
        picture_before_after(options.picture, mesh, solution.vertices, fixed=fixed, handle=handle)
        say(f"written         {options.picture}")
    require_met(solution, options.output, "a handle", inside=inside)
    _require_turns(options, surface, fixed, solution.vertices)
    return True


def edit(options: Namespace, say: Say, progress: Progress) -> bool:
    """Edit a mesh or a saved session in a window; write the deformed mesh."""
    from ..widgets import plugin  # loads pyvista's plotters, which other commands do not need

    is_told = False

    def completing(fraction: float, text: str) -> None:
        nonlocal is_told
        if not is_told:
            is_told = True
            say("pose            finishing after the window was closed; Ctrl+C to stop")
        progress(fraction, text)

    if options.output is not None:
        io.require_writable(options.output)
    session = opened(options.input)
    if attach := checked_attach(dict(options.attach), int(session.mesh.components.max()) + 1):
        session.change_options(attach=attach)
    require_screen()
    session = plugin.edit(
        session,
        path=options.input.with_suffix(SESSION),
        title=f"segdeform {options.input.name}",
        progress=completing,
    )
    report_session(session, options.output, say)
    return True


def regions(options: Namespace, say: Say, progress: Progress) -> bool:
    """Divide a mesh into regions; print their sizes and write them as a point array "region"."""
    if options.output is not None:
        io.require_writable(options.output, arrays=True)
    surface = Surface.read(options.input)
    report_surface(surface, say)
    found = _regions(options, surface, progress)
    report_regions(found, say)
    if options.output is not None:
        io.write_mesh(options.output, coloured_regions(surface, found))
        say(f"written         {options.output}")
    return True


def cages(options: Namespace, say: Say, progress: Progress) -> bool:
    """Fit cages to a mesh; print their sizes and write them as one coloured surface."""
    if options.output is not None:
        io.require_writable(options.output, arrays=True)
    surface = Surface.read(options.input)
    report_surface(surface, say)
    found = _regions(options, surface, part(progress, 0.0, 0.3))
    made = fit_cages(surface.mesh, found, _size(options, found), progress=part(progress, 0.3, 1.0))
    report_regions(found, say)
    report_cages(made, say)
    if options.output is not None:
        io.write_mesh(options.output, coloured_cages(made))
        say(f"written         {options.output}")
    return True


def opened(path: Path) -> Session:
    """Return the session in a file, or a new one of the surface in it."""
    return load_session(path) if path.suffix == SESSION else Session(Surface.read(path))


def _regions(
    options: Namespace,
    surface: Surface,
    progress: Progress | None,
    held: ArrayLike = (),
    *,
    apart: ArrayLike = (),
) -> Regions:
    wanted, arrays = options.regions, surface.given.point_data
    if options.attach and (wanted in arrays or wanted == "1"):
        raise ConstraintError("--attach is for automatic regions only; leave it or --regions out")
    if wanted in arrays:
        labels = surface.at_vertices(np.asarray(arrays[wanted]))
        rings = {} if options.overlap is None else {"overlap": options.overlap}
        return Regions.from_labels(surface.mesh, labels, **rings)
    if options.overlap is not None:
        raise ConstraintError("--overlap is for regions of a point array only; leave it out")
    if wanted == "1":
        return Regions.single(surface.mesh)
    if wanted != "auto" and not (wanted.isdecimal() and int(wanted) > 0):
        raise ConstraintError(
            f"--regions must be a number from 1, 'auto' or a point array of the mesh "
            f"({', '.join(arrays.keys()) or 'it has none'}); got {wanted!r}"
        )
    number = None if wanted == "auto" else int(wanted)
    attach = dict(options.attach)
    return segment(surface.mesh, number, attach=attach, held=held, apart=apart, progress=progress)


def _size(options: Namespace, found: Regions) -> int:
    """Return the total number of cage vertices."""
    number: int | None = options.cage_vertices
    return suggested_size(found) if number is None else number


def _selected(text: str, surface: Surface, role: Role) -> IntArray:
    """Return the vertices (k,) of the mesh that the selected points are."""
    points = surface.at_points(surface.mesh.vertices)
    ids = parse_selection(text, points, point_arrays=surface.given.point_data, role=role)
    vertices = surface.vertices_at(ids)
    if len(ids) and not len(vertices):
        raise ConstraintError(
            f"no point that {text!r} selects is in a face; such points only follow the surface"
        )
    return vertices


def constraints_of(
    options: Namespace, surface: Surface, volume: VolumeMesh | None = None
) -> dict[str, Any]:
    """Return the options of the command line that `Deformer` has, as it takes them."""
    goals, parts = _named("--volume", options.volume), _named("--part", options.part)
    checked_goals(goals)
    names = {name: name if name in parts else _labelled(name, surface) for name in goals}
    if twice := [name for name in goals if list(names.values()).count(names[name]) > 1]:
        raise ConstraintError(f"--volume is given twice for the same volume: {', '.join(twice)}")
    goals = {names[name]: goal for name, goal in goals.items()}
    try:  # before the pose is solved, not when it is written
        if volume is None:
            surface.moved(surface.mesh.vertices, turn=options.turn, push=options.push)
        elif options.turn or options.push:
            volume.moved(volume.at_rest, turn=options.turn, push=options.push)
    except ArgumentError as fault:
        raise ConstraintError(f"--turn or --push: {fault}") from None
    own = {name: getattr(options, name, None) for name in AS_IN_PYTHON}
    return {
        **{name: value for name, value in own.items() if value is not None},
        "lids": LIDS[options.lids],
        "volumes": goals or None,
        "parts": {name: _selected(text, surface, "handle") for name, text in parts.items()},
        "stiffness": _stiffness(options, surface),
        "slides": [_slide(text, surface) for text in options.slide],
    }


def _labelled(name: str, surface: Surface) -> str:
    """Return the name of the volume that is called *name*, which may be a label, as "label 3"."""
    kind, _, number = name.partition(" ")
    if kind != "label":
        return name
    labels = surface.labels()
    volumes = labels.get(int(number), ()) if number.isdecimal() else ()
    if len(volumes) == 1:
        return volumes[0]
    known = "; ".join(f"label {k}: {' and '.join(each)}" for k, each in sorted(labels.items()))
    raise ConstraintError(f"there is no single volume {name!r}; there are {known or 'no labels'}")


def _stiffness(options: Namespace, surface: Surface) -> FloatArray | None:
    """Return the stiffness (n,) of the vertices; None if it is the same everywhere."""
    if not (options.stiffness or options.rigid):
        return None
    stiffness = np.ones(surface.mesh.n_vertices)
    for text in options.stiffness:
        selection, _, times = text.rpartition("=")
        try:
            value = float(times)
        except ValueError:
            value = math.nan
        if not (selection and value > 0.0):
            raise ConstraintError(
                f"--stiffness must be a selection and how many times stiffer it is, as z>80%=5; "
                f"got {text!r}"
            )
        stiffness[_selected(selection, surface, "handle")] = value
    for text in options.rigid:
        stiffness[_selected(text, surface, "handle")] = math.inf
    return stiffness


def _slide(text: str, surface: Surface) -> Slide:
    selection, colon, along = text.rpartition(":")
    if not colon or along not in Slide.KINDS:
        selection, along = text, "plane"
    return Slide(_selected(selection, surface, "handle"), along)


def _named(option: str, texts: list[str]) -> dict[str, str]:
    """Return the values by name of an *option* "name=value" that may be repeated."""
    found: dict[str, str] = {}
    for text in texts:
        name, _, value = (word.strip() for word in text.partition("="))
        if not (name and value):
            example = "whole=+10%" if option == "--volume" else "tip=z>90%"
            raise ConstraintError(
                f"{option} must be a name and a value, as {example}; got {text!r}"
            )
        if name in found:
            raise ConstraintError(f"{option} is given twice for {name!r}; leave one of them out")
        found[name] = value
    return found


def _handles(
    handles: list[dict[str, str]], surface: Surface, fixed: IntArray, *, has_goals: bool
) -> tuple[IntArray, list[FloatArray]]:
    """Return the vertices (k,) of all handles, and their targets (k, 3): on the way, and last."""
    if not (handles or has_goals):
        raise ConstraintError("nothing would move: add --handle SEL with a motion, or --volume")
    return moved_handles(
        handles, lambda text: _selected(text, surface, "handle"), surface.mesh.vertices, fixed
    )


def _require_turns(options: Namespace, surface: Surface, fixed: IntArray, x: FloatArray) -> None:
    """Raise a MeshError if the pose *x* (n, 3) has lost turns of a handle."""
    for handle in options.handles:
        axis, angle = parse_rotation(handle.get("rotate", "z,0"))
        if total_legs([angle]) > 1 and "matrix" not in handle:
            own = _selected(handle["select"], surface, "handle")
            if off := turns_off(surface.mesh, x, axis, angle, fixed=fixed, handle=own):
                asked = math.degrees(angle)
                raise MeshError(
                    f"{options.output} was written, but the body is not wound by {asked:.4g} "
                    f"degrees: it has snapped back to {asked + 360.0 * off:.4g}; turn less, or "
                    f"leave more room between handle and fixed vertices"
                )
