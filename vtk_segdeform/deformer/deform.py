"""The whole method in one call: segment, fit cages, bind, solve."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from .. import sizes
from ..arrays import FloatArray, is_whole
from ..cages import fit_cages, require_cage_vertices, suggested_size
from ..checks import as_flag, require_sequence, shown
from ..errors import ArgumentError, Cancelled, ConstraintError, SegDeformError
from ..geometry import Attach
from ..mesh import Mesh, require_mesh
from ..progress import Progress, part, tell
from ..regions import segment
from ..solver import Solution
from .arguments import as_lids, checked_constraints, checked_targets
from .clamping import clamped
from .deformer import Deformer
from .enclosed_volume import changing_components
from .slides import Slide
from .symmetry import Symmetry
from .volume_goals import Goals, checked_goals

_log = logging.getLogger(__name__)

# Of the progress, at the ends of segmentation, fitting, binding, solve and finish: about the mean
# shares of the time for 5,000 to 100,000 vertices.  Of large meshes the finish takes most of it.
_ENDS = 0.06, 0.22, 0.4, 0.6, 1.0
_NO_TARGETS = np.empty((0, 3))


def deform(
    mesh: Mesh,
    fixed: ArrayLike = (),
    handle: ArrayLike = (),
    targets: ArrayLike = _NO_TARGETS,
    *,
    volumes: Goals | None = None,
    parts: Mapping[str, ArrayLike] | None = None,
    stiffness: ArrayLike | None = None,
    slides: Iterable[Slide] = (),
    symmetry: Symmetry = None,
    through: Sequence[ArrayLike] = (),
    n_regions: int | None = None,
    n_cage_vertices: int | None = None,
    preserve_volume: bool = True,
    lids: bool | None = None,
    avoid_contact: bool = False,
    attach: Attach | None = None,
    refine: bool | None = None,
    progress: Progress | None = None,
) -> Solution:
    """Return *mesh* deformed so that its handle vertices are at *targets*, with volumes as given.

    For one pose only.  To drag, or to choose regions and cages, use a `Deformer`.

    Parameters
    ----------
    mesh : Mesh
        n vertices.  ``sd.deform`` takes any surface, with vertices numbered as in what is given: a
        PolyData or another surface of VTK, a ``trimesh.Trimesh``, a ``meshio.Mesh``, a pair
        (vertices, faces) or a path.  It returns a `Deformed`, whose `mesh` is the same, deformed.
        Of a grid of tetrahedra, hexahedra, wedges or pyramids the inside follows; see `VolumeMesh`.
    fixed, handle : (k,) int or (n,) bool
        Vertices that stay in place, and vertices that follow *targets*.
    targets : (len(handle), 3) float
        Positions of the handle vertices, in the order of *handle* (of its true entries, if it is a
        mask).  A handle turns the shorter way to them, or from the last ones of *through*.
    volumes : mapping of str to str or float, optional
        Goals by the names of volumes, as ``{"cavity": "-40%", "whole": "keep"}``; see `Deformer`.
        With some, there need be no handle.
    parts : mapping of str to (k,) int or (n,) bool, optional
        Vertices by the names of parts of the surface, for *volumes*.
    stiffness : (n,) float, optional
        Of each vertex, relative to the others; infinite where the surface is rigid.
    slides : sequence of Slide, optional
        Vertices that move along a plane, a line or the surface at rest only.
    symmetry : str or pair of (3,) float, optional
        The plane about which motions are mirrored: "x", "y", "z", "auto", or a point and a normal.
    through : sequence of (len(handle), 3) float
        Targets on the way, such as those of a quarter and of half a turn before those of
        three quarters; each less than half a turn from the last ones.
    n_regions : int, optional
        Number of regions; by default one for each limb and one for the trunk, see `segment`.  Fixed
        parts and handles that move rigidly become regions of their own.
    n_cage_vertices : int, optional
        Total number of cage vertices; by default it follows the number of regions.
    preserve_volume : bool
        Preserve the enclosed volume exactly.
    lids : bool or None
        Whether an open surface encloses a volume under lids over its borders; None decides it for
        each connected part, as `Deformer` does.
    avoid_contact : bool
        Keep parts of the surface from crossing each other; see `Deformer`.
    attach : mapping of int to int or "free", optional
        For components, numbered as in `Mesh.components`, the one that each follows; ``"free"`` if
        it follows none.  By default a component without fixed or handle vertices follows one that
        it lies against, is around or inside of, such as a sleeve its arm.
    refine : bool or None
        Whether to finish the pose on the mesh itself (`Deformer.finish`), which distorts it less.
        None does so for meshes of at most 100,000 vertices, where it takes less time than all the
        rest; a pose that cannot be finished is returned as it is.
    progress : Progress, optional
        Called with the fraction done, 0 to 1, and a text, while cages are fitted and bound, and
        before every step.  It cancels by raising `Cancelled`.

    Returns
    -------
    Solution

    Raises
    ------
    ConstraintError
        If *fixed*, *handle*, *targets* or *volumes* are invalid, or there is neither a handle nor a
        goal for a volume.
    ArgumentError
        If *attach* is for other components, or they follow each other.
    Cancelled
        If *progress* raised it.
    """
    require_mesh(mesh)
    as_flag(preserve_volume, "preserve_volume")
    as_lids(lids)
    as_flag(avoid_contact, "avoid_contact")
    checked_refine(refine)
    if n_cage_vertices is not None and not is_whole(n_cage_vertices, 4):
        raise ArgumentError(
            f"n_cage_vertices must be a whole number, 4 or more; got {shown(n_cage_vertices)}"
        )
    stays, moves = checked_constraints(mesh, fixed, handle)
    if not len(moves) and not checked_goals(volumes):
        raise ConstraintError(
            "deform requires at least one vertex in handle, or goals for volumes; got none. Select "
            "the vertices to move"
        )
    require_sequence(through, "through")
    path = [checked_targets(each, len(moves), "through") for each in through]
    path.append(checked_targets(targets, len(moves)))
    stages = iter(stages_of(progress, finishes=is_finished(mesh, refine)))
    held = np.union1d(stays, moves)
    apart = changing_components(mesh, lids, checked_goals(volumes))
    regions = segment(mesh, n_regions, attach=attach, held=held, apart=apart, progress=next(stages))
    size = suggested_size(regions) if n_cage_vertices is None else n_cage_vertices
    require_cage_vertices(size, regions.n_regions, "n_cage_vertices")
    is_fixed = np.zeros(mesh.n_vertices, dtype=bool)
    is_fixed[stays] = True
    regions, _ = clamped(
        regions, fixed=is_fixed, handle=moves, targets=path[-1], n_cage_vertices=size
    )
    cages = fit_cages(mesh, regions, size, progress=next(stages))
    deformer = Deformer(
        mesh,
        regions,
        cages,
        fixed=fixed,
        handle=handle,
        preserve_volume=preserve_volume,
        lids=lids,
        volumes=volumes,
        parts=parts,
        stiffness=stiffness,
        slides=slides,
        symmetry=symmetry,
        avoid_contact=avoid_contact,
        progress=next(stages),
    )
    solution = solved_along(deformer, path, progress=next(stages))
    return finished(deformer, solution, refine, progress=next(stages))


def solved_along(
    deformer: Deformer, path: Sequence[FloatArray], *, progress: Progress | None = None
) -> Solution:
    """Return the pose for the last targets (k, 3) of *path*, solved for the others before it."""
    steps = 0
    for number, targets in enumerate(path):
        ends = number / len(path), (number + 1) / len(path)
        solution = deformer.solve(targets, progress=part(progress, *ends))
        steps += solution.steps
    return replace(solution, steps=steps)


def checked_refine(refine: bool | None) -> bool | None:
    """Return *refine*; ArgumentError if it is neither a flag nor None."""
    return None if refine is None else as_flag(refine, "refine")


def stages_of(progress: Progress | None, *, finishes: bool) -> list[Progress | None]:
    """Return the callbacks of segmentation, fitting, binding, solve and finish, if it *finishes*.

    They are five in any case; without a finish the last one spans nothing.
    """
    ends = [min(end / (1.0 if finishes else _ENDS[-2]), 1.0) for end in _ENDS]
    return [part(progress, start, end) for start, end in pairwise([0.0, *ends])]


def is_finished(mesh: Mesh, refine: bool | None) -> bool:
    """Return whether a pose of *mesh* is finished with this option; see `deform`."""
    return mesh.n_vertices <= sizes.FINISHED if refine is None else refine


def finished(
    deformer: Deformer,
    solution: Solution,
    refine: bool | None,
    *,
    progress: Progress | None = None,
) -> Solution:
    """Return the pose of the last solve, finished on the mesh itself if *refine*; see `deform`."""
    if not is_finished(deformer.mesh, refine):
        tell(progress, 1.0, "solved")
        return solution
    try:
        return deformer.finish(solution, progress=progress)
    except Cancelled:
        raise
    except SegDeformError as fault:
        if refine:
            raise
        _log.info("the pose was not finished on the mesh: %s", fault)
        return solution
