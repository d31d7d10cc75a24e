"""Components that belong together: a coat and its buttons, a jaw and its teeth.

A component is *attached* to the nearest large one if it is smaller than the smallest limb that the
segmentation looks for, and near: it has no region of its own.  The components of a *part*, those
that share regions, are joined where they are nearest, so that distances along the surface go on.
"""

from __future__ import annotations

import itertools

import numpy as np
from scipy.spatial import cKDTree

from ..arrays import BoolArray, FloatArray, IntArray

SMALL_COMPONENT = 0.0125  # of the whole area
_NEAR = 0.05  # gap, in diagonals of all points


def attached(
    points: FloatArray, areas: FloatArray, component: IntArray
) -> tuple[IntArray, IntArray]:
    """Return where small components are attached to large ones: the nearest pairs of points.

    Parameters
    ----------
    points, areas : (n, 3) and (n,) float
        Areas in any unit.
    component : (n,) int
        From 0; every number occurs.

    Returns
    -------
    one, other : (k,) int
        A point of each attached component, and one of a large component.
    """
    none = np.empty(0, dtype=np.int64)
    if not component.any():
        return none, none
    share = component_shares(areas, component)
    large = share >= SMALL_COMPONENT
    large[share.argmax()] = True
    one, other, gap = nearest_pairs(points, component, large)
    near = gap <= _NEAR * float(np.linalg.norm(np.ptp(points, axis=0)))
    return one[near], other[near]


def joints(
    points: FloatArray, areas: FloatArray, component: IntArray, part: IntArray
) -> tuple[IntArray, IntArray]:
    """Return the nearest pairs of points that join the components of each part.

    A large component is joined to the nearest larger one, a small one to the nearest large one.

    Parameters
    ----------
    points, areas, component
        As above.
    part : (n,) int
        The same at all points of a component.

    Returns
    -------
    one, other : (k,) int
        One pair less than a part has components.
    """
    share = component_shares(areas, component)
    part_of, order = np.empty(len(share), dtype=np.int64), np.argsort(-share, kind="stable")
    part_of[component] = part
    pairs = [np.empty((2, 0), dtype=np.int64)]
    for own in (order[part_of[order] == k] for k in np.unique(part)):
        n_large = max(1, int(np.count_nonzero(share[own] >= SMALL_COMPONENT)))
        for larger, end in itertools.pairwise([*range(1, n_large + 1), len(own)]):
            if larger < end:
                some = np.flatnonzero(np.isin(component, own[:end]))
                is_larger = np.isin(np.arange(len(share)), own[:larger])
                one, other, _ = nearest_pairs(points[some], component[some], is_larger)
                pairs.append(np.stack([some[one], some[other]]))
    one, other = np.concatenate(pairs, axis=1)
    return one, other


def component_shares(areas: FloatArray, component: IntArray) -> FloatArray:
    """Return the share of each component in the area, (c,), rounded: equal ones are equal."""
    area = np.bincount(component, areas)
    return np.asarray(np.round(area / area.sum(), 9))


def nearest_pairs(
    points: FloatArray, component: IntArray, large: BoolArray
) -> tuple[IntArray, IntArray, FloatArray]:
    """Return for each component that is not *large*, (c,) bool, the nearest point of a large one.

    Its own nearest point, that of the large one, and their distance, (k,) each.
    """
    is_large = large[component]
    there, here = np.flatnonzero(is_large), np.flatnonzero(~is_large)
    tree = cKDTree(points[there], compact_nodes=False, balanced_tree=False)
    away, nearest = (np.asarray(each) for each in tree.query(points[here]))
    order = np.lexsort((away, component[here]))
    _, first = np.unique(component[here[order]], return_index=True)
    chosen = order[first]
    return here[chosen], there[nearest[chosen]], away[chosen]
