"""Printed lines and written surfaces of the commands.

What is told of a result is told of the file as it is read again: formats round coordinates, and
some of them to single precision.
"""

from __future__ import annotations

import logging
from argparse import Namespace
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pyvista as pv

from ..arrays import FloatArray, IntArray
from ..cages import Cage
from ..deformer import OTHER_MEASURE, is_centroid
from ..errors import MeshError
from ..inside import VolumeMesh, VolumePose, require_volume_writable, volume_of
from ..io import (
    Surface,
    polydata_of,
    require_writable,
    stored_vertices,
    to_polydata,
    volume_change,
)
from ..mesh import Kind, Mesh
from ..pictures import COLOURS, rgb
from ..regions import Regions
from ..session import Session
from ..solver import Solution, Status

Say = Callable[[str], None]
"""Prints one line."""

HANDLE_TOLERANCE = 1e-3  # handle error, in mesh diagonals, above which a command fails
_VOLUME_TOLERANCE = 1e-9  # the same of a volume with a goal, relative
_ADVICE = "move less, or add cage vertices"
_PALETTE = np.array([rgb(colour) for colour in COLOURS])


def report_surface(surface: Surface, say: Say, *, is_volume: bool = False) -> None:
    """Print how the mesh of *surface* differs from it."""
    for workaround in surface.workarounds:
        is_inside = is_volume and workaround.kind is Kind.UNREFERENCED
        if workaround.kind is not Kind.HOLE and not is_inside:  # the line of the volume counts them
            say(f"input           {workaround}")


def report_regions(regions: Regions, say: Say) -> None:
    """Print the number of vertices of each region, and how many are in several regions."""
    shared = int(np.count_nonzero(regions.membership.sum(axis=0) > 1))
    sizes = " + ".join(str(size) for size in regions.membership.sum(axis=1))
    say(f"regions         {regions.n_regions}: {sizes} vertices, {shared} in overlaps")


def report_cages(cages: Sequence[Cage], say: Say) -> None:
    """Print the number of vertices of each cage."""
    counts = [cage.n_vertices for cage in cages]
    say(f"cages           {' + '.join(map(str, counts))} = {sum(counts)} vertices")


def report_solution(
    solution: Solution, seconds: float, say: Say, *, has_handle: bool = True
) -> None:
    """Print the volume change, the error of a handle, if there is one, and the time."""
    each = 1e3 * seconds / max(solution.steps, 1)
    report_volume(solution.volume_change, say)
    if has_handle:
        say(f"handle error    {100 * solution.handle_error:.3f} % of model size")
    say(f"solve           {solution.steps} steps, {1e3 * seconds:.0f} ms, {each:.1f} ms per step")


def report_goals(solution: Solution, surface: Surface, path: Path, say: Say) -> None:
    """Print the volumes, areas and centroids with goals, and their changes, by name and label.

    Of the formats of *path*, glTF alone tells its unit, the metre.
    """
    labels = {volume: k for k, volumes in surface.labels().items() for volume in volumes}
    is_in_metres = path.suffix.lower() in (".glb", ".gltf")
    for name, change in solution.volume_changes.items():
        value = solution.volumes[name]
        if is_centroid(name):
            say(f"{name:15} {value:.6g}, moved by {100 * change:+.4g} % of model size")
            continue
        is_area = OTHER_MEASURE.fullmatch(name) is not None
        unit = f" m^3 ({1e6 * value:.6g} ml)" if is_in_metres and not is_area else ""
        label = f"label {labels[name]}, " if name in labels else ""
        text = name if is_area else f"volume          {label}{name}:"
        say(f"{text:15} {value:.6g}{unit}, {100 * change:+.4g} % of the original")


def report_pose(
    solution: Solution,
    mesh: Mesh,
    say: Say,
    *,
    avoids_contact: bool = False,
    inside: VolumePose | None = None,
) -> None:
    """Print how near a pose is to its minimum and what is wrong with its surface.

    The latter are faces that cross others or are turned over, unlike at rest, and parts that
    nothing moves, if there are any.
    """
    status = str(solution.status)
    if solution.is_finished and solution.status is Status.STEP_LIMIT:
        remaining = f"{100 * solution.remaining:.1g} % of model size"
        status = f"not fully converged: to finish it again would move it by {remaining} or more"
    say(f"status          {status}")
    advice = _ADVICE if avoids_contact else f"{_ADVICE}, or use --avoid-contact"
    crossings, folds = len(solution.crossings()), len(solution.folds())
    crossing = f"{crossings:,} faces cross that did not at rest: {advice}" if crossings else "none"
    plural = "s" if folds > 1 else ""
    folded = f"{folds:,} turned-over face{plural}: {_ADVICE}" if folds else "none"
    say(f"crossings       {crossing}")
    say(f"folds           {folded}")
    if inside is not None:
        say(f"inside          {inside.summary()}")
    if len(solution.unmoved):
        say(f"parts           {solution.unmoved_summary(mesh)}")


def require_met(
    solution: Solution, path: Path, what: str, *, inside: VolumePose | None = None
) -> None:
    """Raise a MeshError if *what* is moved misses its target, a volume its goal, or cells invert.

    *solution* is that in memory; the one in the file at *path* may be rounded.
    """
    if inside is not None and len(inside.inverted):
        raise MeshError(f"{path} was written, but {inside.summary()}")
    if solution.handle_error > HANDLE_TOLERANCE:
        raise MeshError(
            f"{path} was written, but {what} misses its target by "
            f"{100 * solution.handle_error:.3f} % of model size: {solution.status}"
        )
    if solution.volumes and solution.volume_error > _VOLUME_TOLERANCE:
        raise MeshError(
            f"{path} was written, but a volume is off by "
            f"{100 * solution.volume_error:.3g} %: {solution.status}"
        )


def report_approximate(solution: Solution, options: Namespace, say: Say) -> None:
    """Print if the pose has constraints that only a finish places exactly, and is not finished."""
    if (options.rigid or options.slide or options.symmetry) and not solution.is_finished:
        say("constraints     rigid parts, slides and symmetry are approximate: pose not finished")


def surface_and_volume(options: Namespace) -> tuple[Surface, VolumeMesh | None]:
    """Return the surface in the file of *options*, and the volume mesh if it has one.

    The output must have a format for it.
    """
    volume = volume_of(options.input)
    if volume is not None:
        require_volume_writable(options.output)
        return volume.surface, volume
    require_writable(options.output)
    return Surface.read(options.input), None


def written(
    surface: Surface, solution: Solution, options: Namespace, *, volume: VolumeMesh | None
) -> tuple[Solution, VolumePose | None]:
    """Write *surface* in a pose, and return the pose as it is in the file of *options*.

    Of a *volume* mesh all of it is written; the second result is the pose of its points.

    Raises
    ------
    MeshError
        If the file cannot be written, or not be read again.
    """
    path, lids = options.output, LIDS[options.lids]
    if volume is not None:
        pose = volume.pose(solution.vertices)
        fields = {name: getattr(options, name) for name in ("turn", "push", "displacement")}
        volume.write(path, pose, **fields)
        return solution, pose
    surface.write(
        path,
        solution.vertices,
        turn=options.turn,
        push=options.push,
        displacement=options.displacement,
    )
    with _without_warnings():
        x = stored_vertices(surface, solution.vertices, path)
    if np.array_equal(x, solution.vertices):
        return solution, None
    change = volume_change(surface.mesh, x, lids)
    return replace(solution, vertices=x, volume=lambda: change), None


@contextmanager
def _without_warnings() -> Iterator[None]:
    """Log no warnings of reading: writing has logged them."""
    logger = logging.getLogger("vtk_segdeform.io")
    level = logger.level
    logger.setLevel(logging.ERROR)
    try:
        yield
    finally:
        logger.setLevel(level)


LIDS = {"auto": None, "on": True, "off": False}
"""The values of ``--lids``."""


def report_volume(change: float, say: Say) -> None:
    """Print the relative change of the volume."""
    say(f"volume change   {change:+.1e} of the original volume")


def report_session(session: Session, path: Path | None, say: Say) -> None:
    """Write the surface of a session in its pose, if to a *path*, and print its volume change."""
    change = session.volume_change
    if path is not None:
        session.write_deformed(path)
        surface = session.surface or Surface(to_polydata(session.mesh))
        with _without_warnings():
            x = stored_vertices(surface, session.vertices, path)
        if not np.array_equal(x, session.vertices):
            change = volume_change(session.mesh, x, session.options.lids)
    report_volume(change, say)
    if path is not None:
        say(f"written         {path}")


def coloured_regions(surface: Surface, regions: Regions) -> pv.PolyData:
    """Return the given surface with point arrays ``region`` (p,), ``regions_here`` and ``RGB``.

    Colours are mixed by the blend weights, so that overlaps are visible.
    """
    coloured = surface.given.copy()
    colours = regions.weights.T @ _colours(np.arange(regions.n_regions)).astype(float)
    for name, values in (
        ("region", regions.labels),
        ("regions_here", regions.membership.sum(axis=0)),
        ("RGB", np.rint(colours).clip(0, 255).astype(np.uint8)),
    ):
        coloured.point_data[name] = surface.at_points(values)
    return coloured


def coloured_cages(cages: Sequence[Cage], poses: Sequence[FloatArray] | None = None) -> pv.PolyData:
    """Return all cages as one surface, with point arrays ``region`` and ``RGB``.

    Parameters
    ----------
    cages : sequence of Cage
        One per region.
    poses : sequence of (m_r, 3) float, optional
        Vertices of the deformed cages; by default, the cages at rest.
    """
    vertices = [cage.vertices for cage in cages] if poses is None else list(poses)
    starts = np.cumsum([0, *(cage.n_vertices for cage in cages)])
    faces = [cage.faces + start for cage, start in zip(cages, starts, strict=False)]
    corners = np.concatenate(faces)
    merged = polydata_of(np.concatenate(vertices), np.full(len(corners), 3), corners.ravel())
    region = np.repeat(np.arange(len(cages)), [cage.n_vertices for cage in cages])
    merged.point_data["region"] = region
    merged.point_data["RGB"] = _colours(region)
    return merged


def _colours(region: IntArray) -> np.ndarray[Any, np.dtype[np.uint8]]:
    return _PALETTE[region % len(_PALETTE)]
