"""The whole method in one call: segment, fit cages, bind, solve."""

from __future__ import annotations

import logging

import numpy as np
from numpy.typing import ArrayLike

from .. import sizes
from ..cages import fit_cages, suggested_size
from ..checks import as_flag
from ..errors import Cancelled, ConstraintError, SegDeformError
from ..mesh import Mesh, require_mesh
from ..progress import Progress, part, tell
from ..regions import segment
from ..solver import Solution
from .arguments import as_lids, checked_constraints, checked_targets
from .clamping import clamped
from .deformer import Deformer

_log = logging.getLogger(__name__)


def deform(
    mesh: Mesh,
    fixed: ArrayLike,
    handle: ArrayLike,
    targets: ArrayLike,
    *,
    n_regions: int | None = None,
    n_cage_vertices: int | None = None,
    preserve_volume: bool = True,
    lids: bool | None = None,
    avoid_folds: bool = False,
    avoid_contact: bool = False,
    refine: bool | None = None,
    progress: Progress | None = None,
) -> Solution:
    """Return *mesh* deformed so that its handle vertices are at *targets*.

    For one pose only.  To drag, or to choose regions and cages, use a `Deformer`.

    Parameters
    ----------
    mesh : Mesh
        n vertices.
    fixed, handle : (k,) int or (n,) bool
        Vertices that stay in place, and vertices that follow *targets*.
    targets : (len(handle), 3) float
        Positions of the handle vertices, in the order of *handle* (of its true entries, if it is a
        mask).
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
    avoid_folds : bool
        Keep the body below the surface from turning inside out; see `Deformer`.
    avoid_contact : bool
        Keep parts of the surface from crossing each other; see `Deformer`.
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
        If *fixed*, *handle* or *targets* are invalid, or *handle* is empty.
    Cancelled
        If *progress* raised it.
    """
    require_mesh(mesh)
    as_flag(preserve_volume, "preserve_volume")
    as_lids(lids)
    as_flag(avoid_folds, "avoid_folds")
    as_flag(avoid_contact, "avoid_contact")
    checked_refine(refine)
    stays, moves = checked_constraints(mesh, fixed, handle)
    if not len(moves):
        raise ConstraintError(
            "deform requires at least one vertex in handle; got none. Select the vertices to move"
        )
    places = checked_targets(targets, len(moves))
    regions = segment(mesh, n_regions, progress=part(progress, 0.0, 0.2))
    size = suggested_size(regions) if n_cage_vertices is None else n_cage_vertices
    is_fixed = np.zeros(mesh.n_vertices, dtype=bool)
    is_fixed[stays] = True
    regions, rigid = clamped(
        regions, fixed=is_fixed, handle=moves, targets=places, n_cage_vertices=size
    )
    fitting = part(progress, 0.2, 0.7)
    cages = fit_cages(mesh, regions, size, fixed=rigid, progress=fitting)
    deformer = Deformer(
        mesh,
        regions,
        cages,
        fixed=fixed,
        handle=handle,
        preserve_volume=preserve_volume,
        lids=lids,
        avoid_folds=avoid_folds,
        avoid_contact=avoid_contact,
        progress=part(progress, 0.7, 0.9),
    )
    solution = deformer.solve(targets, progress=part(progress, 0.9, 0.95))
    return finished(deformer, solution, refine, progress=part(progress, 0.95, 1.0))


def checked_refine(refine: bool | None) -> bool | None:
    """Return *refine*; ArgumentError if it is neither a flag nor None."""
    return None if refine is None else as_flag(refine, "refine")


def finished(
    deformer: Deformer,
    solution: Solution,
    refine: bool | None,
    *,
    progress: Progress | None = None,
) -> Solution:
    """Return the pose of the last solve, finished on the mesh itself if *refine*; see `deform`."""
    is_wanted = deformer.mesh.n_vertices <= sizes.FINISHED if refine is None else refine
    if not is_wanted:
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
