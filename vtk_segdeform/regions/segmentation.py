"""Automatic segmentation: limbs are separated from the trunk, and large parts sliced evenly.

Limbs are the parts behind short curves along which the surface is concave (`limbs`): heads, arms,
legs, tails, fingers.  If fewer parts are requested than there are limbs, only the most distinct are
separated; if more, the largest parts are cut into slices of about equal area (`slices`).  All this
is computed on a coarse surface (`coarse`), so that it costs about the same for every mesh and
hardly depends on the resolution of the mesh.

Components that follow others have no regions of their own, but are in those of the nearest points
of their carriers (`geometry.following`).  Small components far from everything share a region.

Finally the borders between parts are shortened and moved into creases on the mesh (`borders`), or,
of a large mesh, on a decimated one.
"""

from __future__ import annotations

from operator import itemgetter

import numpy as np
from numpy.typing import ArrayLike

from .. import sizes
from ..arrays import BoolArray, IntArray, as_ids, is_whole
from ..checks import shown
from ..errors import ArgumentError, RegionError
from ..geometry import (
    SMALL_COMPONENT,
    Attach,
    carriers,
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
    attach: Attach | None = None,
    held: ArrayLike = (),
    apart: ArrayLike = (),
    seed: int = 0,
    progress: Progress | None = None,
) -> Regions:
    """Segment a mesh into overlapping regions.

    Parameters
    ----------
    mesh : Mesh
        n vertices, one or several components.  ``sd.segment`` takes any surface, as ``sd.deform``
        does; the regions are those of its mesh.
    n_regions : int, optional
        Number of regions, 1 to n.  None separates every limb and nothing else: one region for
        a sphere, three for a cactus with two arms, six for a man: head, arms, legs and trunk.
        Components that follow others get no region of their own.
    overlap : int, optional
        Number of edge rings by which each region grows over its neighbours.  None means a tenth of
        the width of a region in edges, sqrt(n / regions) / 10, at least 2: the same width in space
        on coarse and fine meshes.
    attach : mapping of int to int or "free", optional
        For components, numbered as in `Mesh.components`, the one that each follows; ``"free"`` if
        it follows none.  By default a component follows one that it lies against, is around or
        inside of; see `geometry.following`.
    held : (k,) int or (n,) bool
        Vertices that will be fixed or in handles.  Components with any of them follow none, unless
        *attach* has another carrier for them.
    apart : (j,) int
        Components whose volumes will change.  In the cage of another one they could not, so all
        that follow each other with one of them get regions of their own, and follow in these; then
        there are at least as many regions as components that nothing carries.
    seed : int
        Seed for sampling the vertices of the coarse surface.
    progress : Progress, optional
        Called with the fraction done; may raise `Cancelled`.

    Returns
    -------
    regions : Regions
        Before they are grown, their parts of one component are connected.  If *n_regions* is less
        than the number of components that follow none, each of the largest of these is a region,
        and the others follow the one that they are nearest to.  For None, these are at most 16, and
        small components far from all others share a region.

    Raises
    ------
    RegionError
        If *n_regions* is not an integer in 1..n.
    ArgumentError
        If *attach* is for other components, or they carry each other.

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
    carrier = carriers(mesh, attach, roots=mesh.components[as_ids(held, n, "held")])
    carrier, leader = with_regions_apart(carrier, apart)
    if leader is not None and n_regions is not None:
        roots = int(np.count_nonzero(carrier == np.arange(len(carrier))))
        n_regions = max(int(n_regions), roots)
    main = _main_components(mesh, n_regions, carrier)
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
    every = np.full(n, labels.max() + 1)  # components that are far share a region
    every[kept] = labels
    is_carried = carrier != np.arange(len(carrier))
    every[is_carried[whole.components]] = labels[0]  # will be those of the carrier
    follows = carrier if is_carried.any() or leader is not None else None
    regions = Regions.from_labels(whole, every, overlap, carrier=follows, leader=leader)
    tell(progress, 1.0, "regions found")
    return regions


def with_regions_apart(carrier: IntArray, apart: ArrayLike) -> tuple[IntArray, IntArray | None]:
    """Return *carrier* (c,) without the trees of components *apart*, and the leaders in these."""
    own = np.arange(len(carrier))
    root = carrier
    while (root[root] != root).any():
        root = root[root]
    ids = as_ids(apart, len(carrier), "apart")
    moved = np.isin(root, root[ids]) & (carrier != own)
    if not moved.any():
        return carrier, None
    return np.where(moved, own, carrier), np.where(moved, carrier, own)


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


def _main_components(mesh: Mesh, n_regions: int | None, carrier: IntArray) -> BoolArray:
    """Return which components are segmented, (c,) bool.

    If there are too many for regions of their own, the others get the nearest one as their
    *carrier*; for None, small ones are far from all others and get none.
    """
    main: BoolArray = carrier == np.arange(len(carrier))
    share = np.where(main, component_shares(mesh.vertex_areas, mesh.components), 0.0)
    if main.sum() <= (n_regions or 1):
        return main
    main[np.argsort(-share, kind="stable")[n_regions or _TYPICAL_REGIONS :]] = False
    is_far = np.zeros_like(main)
    if n_regions is None:
        is_far = (share > 0.0) & (share < SMALL_COMPONENT) & (share < share.max())
        main &= ~is_far
    one, other, _ = nearest_pairs(_without_ties(mesh).vertices, mesh.components, main)
    here, there = mesh.components[one], mesh.components[other]
    joins = (carrier[here] == here) & ~is_far[here]
    carrier[here[joins]] = there[joins]
    return main
