"""Files of motions: poses of a surface that follow each other.

    .glb, .gltf   the surface with morph targets: some of the poses, between which viewers blend
                  linearly.  They are as few as keep every other pose within the tolerance.
    .pvd          all poses, for ParaView: a list of the files of a folder beside it

Points that turn do not move on straight lines, so a blend shrinks what turns, and changes its
volume: along a straight line it is a cubic of time, whose extremes are told.
"""

from __future__ import annotations

import itertools
import math
import os
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from .arrays import FloatArray, as_points, is_number
from .checks import as_path, require_sequence, shown
from .errors import ArgumentError, MeshError
from .files import replacing, require_place
from .geometry import volume_along_path
from .io import Surface, surface_of, write_gltf_motion, write_mesh
from .solver import VolumeConstraint, total_volume

_PVD = (
    '<?xml version="1.0"?>\n<VTKFile type="Collection" version="0.1">\n<Collection>\n'
    "{}\n</Collection>\n</VTKFile>\n"
)
_FRAME = '<DataSet timestep="{:.9g}" part="0" file="{}/{:04d}.vtp"/>'


class Motion(NamedTuple):
    """What `write_motion` has written."""

    kept: tuple[int, ...]
    """The numbers of the poses that were written, from 0; morph targets, or all."""
    deviation: float
    """Largest distance of a point of a pose from the blend at its time, in diagonals."""
    volume_change: float
    """Largest |V - V0| / V0 at any time of the blend, from that at rest; 0 without a volume."""


def write_motion(
    path: str | os.PathLike[str],
    surface: Any,
    poses: Sequence[ArrayLike],
    *,
    seconds: Sequence[float] | None = None,
    tolerance: float = 0.002,
) -> Motion:
    """Write the motion of a surface from rest through *poses*, one after the other.

    Parameters
    ----------
    path : path
        A .glb or .gltf file, which is replaced; or a .pvd, with a new folder of its name beside it.
    surface : Surface, Mesh, pyvista.PolyData, path or another surface
        At rest, which is where the motion begins.
    poses : sequence of (n, 3) float or Solution
        The vertices of each pose.  The more there are, the nearer is a blend to the motion itself.
    seconds : sequence of float, optional
        The time of each pose after the beginning, rising; by default they are 1 / 24 apart.
    tolerance : float
        By how much a blend may differ from a pose, in diagonals of the surface at rest.

    Returns
    -------
    Motion
        Which poses were written, and how much a blend of them differs.

    Raises
    ------
    ArgumentError
        If there are no poses, or times that do not rise.
    MeshError
        If the file cannot be written, or its folder exists already.
    """
    path, given = as_path(path), surface_of(surface)
    mesh = given.mesh
    require_sequence(poses, "poses")
    xs = [as_points(getattr(each, "vertices", each), "poses", mesh.n_vertices) for each in poses]
    if not xs:
        raise ArgumentError("poses must be at least one pose")
    if not (is_number(tolerance, 0.0) and math.isfinite(tolerance)):
        raise ArgumentError(f"tolerance must be 0 or a positive number; got {shown(tolerance)}")
    times = _times(seconds, len(xs))
    if path.suffix.lower() not in (".glb", ".gltf", ".pvd"):
        raise MeshError(f"{path}: motions are written to .glb, .gltf or .pvd")
    is_series = path.suffix.lower() == ".pvd"
    kept = list(range(len(xs)))
    if not is_series:
        kept = _kept(mesh.vertices, xs, times, tolerance * mesh.diagonal)
    keys = [mesh.vertices, *(xs[k] for k in kept)]
    deviation = _deviation(keys, [0.0, *(times[k] for k in kept)], xs, times) / mesh.diagonal
    volume = total_volume(mesh)
    changes = [abs(volume.relative(x)) for x in keys] if is_series else _blended(volume, keys)
    try:
        if is_series:
            _write_series(path, given, [mesh.vertices, *xs], [0.0, *times])
        else:
            targets = [(times[k], given.moved(xs[k])) for k in kept]
            with replacing(path) as draft:
                write_gltf_motion(draft, given.given, targets)
    except OSError as fault:
        raise MeshError(f"{path}: cannot be written ({fault.strerror or fault})") from fault
    return Motion(tuple(kept), deviation, max(changes, default=0.0))


def _times(seconds: object, count: int) -> list[float]:
    if seconds is None:
        return [k / 24.0 for k in range(1, count + 1)]
    require_sequence(seconds, "seconds")
    times = [float(each) if is_number(each) else math.nan for each in seconds]  # type: ignore[attr-defined]
    if len(times) != count or not all(a < b for a, b in zip([0.0, *times], times, strict=False)):
        raise ArgumentError(
            f"seconds must be {count} rising numbers over 0, one for each pose; got "
            f"{shown(seconds)}"
        )
    return times


def _kept(
    rest: FloatArray, xs: Sequence[FloatArray], times: Sequence[float], most: float
) -> list[int]:
    """Return the poses to blend between: each is the last one up to which a blend is near."""
    kept, start, begin = [], rest, 0.0
    first = 0
    while first < len(xs):
        last = first
        while last + 1 < len(xs):
            ends, spans = [start, xs[last + 1]], [begin, times[last + 1]]
            between = slice(first, last + 1)
            if _deviation(ends, spans, xs[between], times[between]) > most:
                break
            last += 1
        kept.append(last)
        start, begin, first = xs[last], times[last], last + 1
    return kept


def _deviation(
    keys: Sequence[FloatArray],
    at: Sequence[float],
    xs: Sequence[FloatArray],
    times: Sequence[float],
) -> float:
    """Return the largest distance of a point of *xs* from the blend of *keys* at its time."""
    farthest = 0.0
    for x, time in zip(xs, times, strict=True):
        k = int(np.searchsorted(at, time, side="left"))
        share = (time - at[k - 1]) / (at[k] - at[k - 1])
        away = x - (1.0 - share) * keys[k - 1] - share * keys[k]
        farthest = max(farthest, float(np.linalg.norm(away, axis=1).max()))
    return farthest


def _blended(volume: VolumeConstraint, keys: Sequence[FloatArray]) -> Iterator[float]:
    """Yield the largest relative change of *volume* on each straight line between *keys*."""
    for one, other in itertools.pairwise(keys) if volume.has_volume else ():
        c = volume_along_path(volume.extended(np.hstack([one, other - one])), volume.parts)
        turns = np.roots([3.0 * c[3], 2.0 * c[2], c[1]])
        inner = turns.real[(np.abs(turns.imag) < 1e-9) & (turns.real > 0.0) & (turns.real < 1.0)]
        values = np.polyval(c[::-1], np.array([0.0, 1.0, *inner]))
        yield float(np.abs(values / volume.target - 1.0).max())


def _write_series(
    path: Path, surface: Surface, xs: Sequence[FloatArray], times: Sequence[float]
) -> None:
    folder = path.with_suffix("")
    require_place(path)
    try:
        folder.mkdir()
    except FileExistsError:
        raise MeshError(f"{folder}: exists already; remove it or choose another name") from None
    for k, x in enumerate(xs):
        write_mesh(folder / f"{k:04d}.vtp", surface.moved(x))
    lines = [_FRAME.format(time, folder.name, k) for k, time in enumerate(times)]
    with replacing(path) as draft:
        draft.write_text(_PVD.format("\n".join(lines)), encoding="utf-8")
