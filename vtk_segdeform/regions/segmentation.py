"""Automatic segmentation: limbs are separated from the trunk, and large parts sliced evenly.

Limbs are the parts behind short curves along which the surface is concave (`limbs`): heads, arms,
legs, tails, fingers.  If fewer parts are requested than there are limbs, only the most distinct are
separated; if more, the largest parts are cut into slices of about equal area (`slices`).  All this
is computed on a coarse surface (`coarse`), so that it costs about the same for every mesh and
hardly depends on the resolution of the mesh.

Large components have regions of their own.  Buttons, teeth and screws, and eyes in their sockets,
belong to the part that they are nearest to; small components far from everything share a region.

Finally the borders between parts are shortened and moved into creases on the mesh (`borders`), or,
of a large mesh, on a decimated one.
"""

from __future__ import annotations

from operator import itemgetter

import numpy as np

from .. import sizes
from ..arrays import BoolArray, IntArray, is_whole
from ..checks import shown
from ..errors import ArgumentError, RegionError
from ..geometry import (
    SMALL_COMPONENT,
    attached,
    component_shares,
    decimated,
    nearest_pairs,
)
from ..kernels import one_blas_thread
from ..mesh import Mesh, require_mesh
from ..progress import Progress, part, tell
from .borders import connected_parts, smooth_borders
from .coarse import COARSE_POINTS, Surface, coarsen
from .limbs import find_limbs
from .regions import Regions, usual_overlap
from .slices import fair_slice, quotas

_TYPICAL_REGIONS = 16  # of an automatic segmentation, for the area of a region
_LEAST_LIMB = SMALL_COMPONENT * _TYPICAL_REGIONS  # area of a limb, relative to that of a region


@one_blas_thread()
def segment(
    mesh: Mesh,
    n_regions: int | None = None,
    *,
    overlap: int | None = None,
    seed: int = 0,
    progress: Progress | None = None,
) -> Regions:
    """Segment a mesh into overlapping regions.

    Parameters
    ----------
    mesh : Mesh
        n vertices, one or several components.
    n_regions : int, optional
        Number of regions, 1 to n.  None separates every limb and nothing else: one region for
        a sphere, three for a cactus with two arms, six for a man: head, arms, legs and trunk.
        Components that are small and near a large one, or set into one, and all but the 16 largest
        get no region of their own.
    overlap : int, optional
        Number of edge rings by which each region grows over its neighbours.  None means a tenth of
        the width of a region in edges, sqrt(n / regions) / 10, at least 2: the same width in space
        on coarse and fine meshes.
    seed : int
        Seed for sampling the vertices of the coarse surface.
    progress : Progress, optional
        Called with the fraction done; may raise `Cancelled`.

    Returns
    -------
    regions : Regions
        Before they are grown, their parts of one component are connected.  If *n_regions* is less
        than the number of components, each of the largest components is a region; every other
        component is added to the region of the vertex that it is nearest to.  For None, small
        components far from large ones share a region.

    Raises
    ------
    RegionError
        If *n_regions* is not an integer in 1..n.

    Notes
    -----
    Deterministic, and invariant under translation, rotation and scaling up to rounding.
    """
    require_mesh(mesh)
    n = mesh.n_vertices
    if n_regions is not None and not is_whole(n_regions, 1, n):
        raise RegionError(f"n_regions must be a whole number in 1..{n}; got {shown(n_regions)}")
    if overlap is not None and not is_whole(overlap, 0):
        raise RegionError(f"overlap must be a whole number, 0 or more; got {shown(overlap)}")
    if not is_whole(seed, 0):
        raise ArgumentError(f"seed must be a whole number, 0 or more; got {shown(seed)}")
    tell(progress, 0.0, "sampling vertices")
    whole, kept = mesh, np.arange(n)
    main, far = _main_components(mesh, n_regions)
    if not main.all():
        mesh, kept = mesh.of_components(main)
    shape = mesh
    if n_regions is not None and n_regions <= main.sum():
        labels = mesh.components
    else:
        n_regions = None if n_regions is None else int(n_regions)
        points = max(COARSE_POINTS, 16 * (n_regions or 1))
        cluster = None
        if mesh.n_vertices > max(sizes.DECIMATED, points):
            shape, _, cluster = decimated(mesh, max(sizes.DECIMATED_POINTS, points))
        shape = _without_ties(shape)
        sampling = part(progress, 0.02, 0.1)
        cell, surface = coarsen(shape, points, np.random.default_rng(int(seed)), sampling)
        labels = _parts(surface, n_regions, progress)[cell]
        tell(progress, 0.8, "smoothing borders")
        labels = smooth_borders(shape, labels)
        tell(progress, 0.9, "smoothing borders")
        labels = connected_parts(shape, labels)
        if cluster is not None:
            labels = labels[cluster]
    tell(progress, 0.95, "growing regions")
    if overlap is None:
        overlap = usual_overlap(n / (labels.max() + 1))
    regions = Regions.from_labels(whole, _with_others(whole, kept, labels, far), overlap)
    tell(progress, 1.0, "regions found")
    return regions


def _without_ties(mesh: Mesh) -> Mesh:
    """Return the mesh with each vertex moved slightly towards its first neighbour.

    Symmetric shapes have many equal distances, and rounding must not decide between them, since it
    differs between frames of reference.  The moves depend on the vertex indices only.
    """
    start, end = mesh.adjacency.indptr[:-1], mesh.adjacency.indptr[1:]
    joined = np.flatnonzero(start < end)  # all vertices, unless a mesh is decimated
    first = np.arange(mesh.n_vertices)
    first[joined] = mesh.adjacency.indices[start[joined]]
    share = 1e-3 * np.random.default_rng(0).random((mesh.n_vertices, 1))
    return mesh.with_vertices(mesh.vertices + share * (mesh.vertices[first] - mesh.vertices))


def _parts(surface: Surface, n_regions: int | None, progress: Progress | None) -> IntArray:
    """Return the part of each point, (k,) int: limbs first, then slices of large parts."""
    labels = np.empty(len(surface.areas), dtype=np.int64)
    share = surface.areas.sum() / (n_regions or _TYPICAL_REGIONS)
    components = surface.pieces(np.ones(len(labels), dtype=bool))
    limbs: list[tuple[float, float, IntArray]] = []
    for label, ids in enumerate(components):
        labels[ids] = label
        for limb in find_limbs(surface.part(ids), _LEAST_LIMB * share):
            rank = limb.score * max(1.0, share / limb.area) ** 2  # large and distinct ones first
            limbs.append((rank if n_regions else limb.score, limb.area, ids[limb.inside]))
        tell(progress, 0.1 + 0.4 * (label + 1) / len(components), "detecting limbs")
    limbs.sort(key=itemgetter(0))
    if n_regions is not None:
        limbs = limbs[: n_regions - len(components)]
    limbs.sort(key=itemgetter(1), reverse=True)  # those inside others last
    for label, (_, _, ids) in enumerate(limbs, len(components)):
        labels[ids] = label
    labels = np.unique(labels, return_inverse=True)[1].astype(np.int64)

    count = int(labels.max()) + 1
    areas = np.bincount(labels, surface.areas).astype(float)
    to_slice = list(enumerate(quotas(areas, np.bincount(labels), n_regions or count)))
    while to_slice:
        label, quota = to_slice.pop()
        if quota > 1:
            ids = np.flatnonzero(labels == label)
            part = surface.part(ids)
            cut = np.asarray(
                surface.contact[ids].sum(axis=1) - part.contact.sum(axis=1), dtype=float
            )
            rim = np.where(cut > 1e-9 * np.sqrt(share), cut, 0.0)
            inside = fair_slice(part, rim, (quota // 2) / quota)
            labels[ids[inside]] = count
            size = int(inside.sum())  # neither side gets more parts than it has points
            inner = int(np.clip(quota // 2, quota - (len(ids) - size), size))
            to_slice += [(label, quota - inner), (count, inner)]
            count += 1
            tell(progress, 0.5 + 0.3 * count / (n_regions or count), "slicing large parts")
    return labels


def _main_components(mesh: Mesh, n_regions: int | None) -> tuple[BoolArray, BoolArray]:
    """Return which components are segmented, and which others are small and far, (c,) bool each."""
    main = np.ones(int(mesh.components.max()) + 1, dtype=bool)
    far = np.zeros_like(main)
    if len(main) == 1 or (n_regions is not None and n_regions >= len(main)):
        return main, far
    share = component_shares(mesh.vertex_areas, mesh.components)
    main[np.argsort(-share, kind="stable")[n_regions or _TYPICAL_REGIONS :]] = False
    if n_regions is None:
        small = share < SMALL_COMPONENT
        small[share.argmax()] = False
        near = attached(mesh.vertices, mesh.vertex_areas, mesh.components)
        main &= ~(small | near)
        far = small & ~near
    return main, far


def _with_others(mesh: Mesh, kept: IntArray, labels: IntArray, far: BoolArray) -> IntArray:
    """Return the labels (n,) of all vertices, from those of the *kept* ones.

    Other components have the label of the nearest of these, those that are *far* one of their own.
    """
    if len(kept) == mesh.n_vertices:
        return labels
    component, every = mesh.components, np.full(mesh.n_vertices, -1, dtype=np.int64)
    every[kept] = labels
    one, other, _ = nearest_pairs(
        _without_ties(mesh).vertices, component, np.isin(np.arange(len(far)), component[kept])
    )
    of_component = np.empty(len(far), dtype=np.int64)
    of_component[component[one]] = every[other]
    of_component[far] = labels.max() + 1
    return np.where(every < 0, of_component[component], every)
