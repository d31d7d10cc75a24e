"""The whole method in one call: segment, fit cages, bind, solve."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ..cages import fit_cages, suggested_size
from ..checks import as_flag
from ..mesh import Mesh, require_mesh
from ..progress import Progress, part
from ..regions import segment
from ..solver import Solution
from .arguments import as_lids, checked_constraints, checked_targets
from .clamping import clamped
from .deformer import Deformer


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
    refine: bool = False,
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
    refine : bool
        Finish the pose on the mesh itself (`Deformer.finish`).
    progress : Progress, optional
        Called while cages are fitted and bound, and before every step; may cancel.

    Returns
    -------
    Solution

    Raises
    ------
    ConstraintError
        If *fixed*, *handle* or *targets* are invalid.
    """
    require_mesh(mesh)
    as_flag(preserve_volume, "preserve_volume")
    as_lids(lids)
    as_flag(avoid_folds, "avoid_folds")
    as_flag(avoid_contact, "avoid_contact")
    as_flag(refine, "refine")
    stays, moves = checked_constraints(mesh, fixed, handle)
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
    if not refine:
        return deformer.solve(targets, progress=part(progress, 0.9, 1.0))
    solution = deformer.solve(targets, progress=part(progress, 0.9, 0.95))
    return deformer.finish(solution, progress=part(progress, 0.95, 1.0))
