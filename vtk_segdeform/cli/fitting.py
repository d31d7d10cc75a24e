"""The command ``landmarks``: a mesh is grown and bent to where its landmarks are to be."""

from __future__ import annotations

import time
from argparse import Namespace
from collections.abc import Sequence
from fnmatch import fnmatchcase
from pathlib import Path

import numpy as np

from .. import io
from ..arrays import FloatArray
from ..deformer import SurfaceTrack
from ..errors import ArgumentError, ConstraintError, MeshError
from ..io import Surface, stored_vertices, volume_change
from ..landmarks import (
    LANDMARK_SUFFIXES,
    LEAST_PAIRS,
    Follower,
    LandmarkFit,
    Landmarks,
    Pairs,
    fit_landmarks,
    paired,
    read_landmarks,
    write_rows,
)
from ..mesh import Mesh
from ..pictures import picture_landmarks, require_picture
from ..progress import Progress
from .outputs import Say, report_surface, report_volume

_LISTED = 3  # names in a line
_FAR = 0.05  # diagonals from the mesh: landmarks that are picked on it are much nearer


def landmarks(options: Namespace, say: Say, progress: Progress) -> bool:
    """Fit a surface to landmarks, and write it as it was given, apart from coordinates."""
    io.require_writable(options.output)
    if options.picture is not None:
        require_picture(options.picture)
    for _, path in options.carry:
        if _is_of_landmarks(path) and path.suffix.lower() != ".csv":
            raise ConstraintError(f"--carry writes landmarks to .csv; got {path.name}")
    for path, _ in options.carry:
        if not path.is_file():
            raise MeshError(f"{path}: there is no such file")
    for path in filter(None, (options.residuals, *(other for _, other in options.carry))):
        if not path.parent.is_dir():
            raise MeshError(f"{path}: there is no folder {path.parent}")
    source, target = read_landmarks(options.source), read_landmarks(options.target)
    sliding = [_sliding(names, path, source) for names, path in options.slide]
    target = _with_unknown(target, [name for names, _ in sliding for name in names])
    pairs = paired(source, target)
    for path, found in ((options.source, source), (options.target, target)):
        if alone := [name for name in found.names if name not in set(pairs.names)]:
            say(f"unpaired        in {path.name}: {_listed(alone)}")
    if len(pairs.names) < LEAST_PAIRS:
        raise ConstraintError(
            f"--source and --target must have {LEAST_PAIRS} landmarks of the same names or more; "
            f"they have {len(pairs.names)}"
        )
    surface = Surface.read(options.input)
    report_surface(surface, say)
    _report_far(surface.mesh, pairs, say)
    given = pairs.uncertainty
    start = time.perf_counter()
    try:
        fit = fit_landmarks(
            surface.mesh,
            pairs.source,
            pairs.target,
            uncertainty=np.where(np.isnan(given), options.uncertainty, given),
            slides=[([pairs.names.index(name) for name in own], on) for own, on in sliding],
            volume=options.volume,
            avoid_contact=options.avoid_contact,
            n_regions=options.regions,
            n_cage_vertices=options.cage_vertices,
            progress=progress,
        )
    except ArgumentError as error:
        raise ConstraintError(f"--{error}") from None
    seconds = time.perf_counter() - start
    surface.write(options.output, fit.vertices)
    x = stored_vertices(surface, fit.vertices, options.output)
    report_volume(volume_change(surface.mesh, x, None), say)
    _report(fit, pairs, say)
    say(f"fit             {seconds:.1f} s including regions and cages")
    say(f"written         {options.output}")
    for one, other in options.carry:
        follower = Follower.read(one)
        follower.write(other, fit.moved(follower.points))
        say(f"written         {other}")
    if options.residuals is not None:
        _write_residuals(options.residuals, fit, pairs)
        say(f"written         {options.residuals}")
    if options.picture is not None:
        picture_landmarks(
            options.picture,
            surface.mesh,
            fit.vertices,
            source=pairs.source,
            target=fit.targets,
            residuals=fit.residuals,
        )
        say(f"written         {options.picture}")
    return True


def _sliding(names: str, path: Path, source: Landmarks) -> tuple[list[str], Mesh | FloatArray]:
    """Return the landmarks whose names fit, and the curve or the surface that they slide along."""
    own = [name for name in source.names if fnmatchcase(name, names)]
    if not own:
        raise ConstraintError(f"--slide: no landmark of --source has a name like {names}")
    return own, read_landmarks(path).points if _is_of_landmarks(path) else Surface.read(path).mesh


def _with_unknown(target: Landmarks, names: Sequence[str]) -> Landmarks:
    """Return *target* with those of *names* that it lacks, at NaN."""
    more = tuple(name for name in names if name not in target.names)
    return Landmarks(
        (*target.names, *more),
        np.concatenate([target.points, np.full((len(more), 3), np.nan)]),
        np.concatenate([target.uncertainty, np.full(len(more), np.nan)]),
    )


def _report_far(mesh: Mesh, pairs: Pairs, say: Say) -> None:
    """Print how far a landmark is from *mesh*, if that is far: its coordinates may be others."""
    away = np.linalg.norm(SurfaceTrack(mesh)(pairs.source)[0] - pairs.source, axis=1)
    worst = int(away.argmax())
    if away[worst] > _FAR * mesh.diagonal:
        share = 100.0 * away[worst] / mesh.diagonal
        say(
            f"far away        {pairs.names[worst][:40]} is {share:.3g} % of the diagonal from the "
            "mesh: are the landmarks in other coordinates or units?"
        )


def _report(fit: LandmarkFit, pairs: Pairs, say: Say) -> None:
    """Print how far landmarks are from their targets, also if they are left out."""
    away = np.linalg.norm(fit.residuals, axis=1)
    worst = int(away.argmax())
    say(
        f"landmarks       {len(away)}, off by {_rms(away):.3g} root mean square, at most "
        f"{away[worst]:.3g}: {pairs.names[worst]}"
    )
    text = "grown, not bent" if not fit.stiffness else f"bent, stiffness {fit.stiffness:g}"
    one, other = _rms(fit.left_out), _rms(fit.left_out_spline)
    say(f"left out        off by {one:.3g} ({text}); by a thin-plate spline {other:.3g}")
    if crossings := len(fit.crossings()):
        say(f"crossings       {crossings:,} faces cross that did not at rest")


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.nanmean(values**2)))


def _is_of_landmarks(path: Path) -> bool:
    return path.suffix.lower() in LANDMARK_SUFFIXES


def _write_residuals(path: Path, fit: LandmarkFit, pairs: Pairs) -> None:
    rows: list[Sequence[object]] = [
        ("name", "x", "y", "z", "residual", "left out", "left out, spline")
    ]
    columns = zip(
        pairs.names,
        (pairs.target - fit.residuals).tolist(),
        np.linalg.norm(fit.residuals, axis=1).tolist(),
        fit.left_out.tolist(),
        fit.left_out_spline.tolist(),
        strict=True,
    )
    rows += [(name, *point, *errors) for name, point, *errors in columns]
    write_rows(path, rows)


def _listed(names: Sequence[str]) -> str:
    """Return the first of *names*, and how many there are besides."""
    more = f" and {len(names) - _LISTED} more" if len(names) > _LISTED else ""
    return ", ".join(name[:40] for name in names[:_LISTED]) + more
