"""Lines between components that move together, so that distances along the surface go on."""

from __future__ import annotations

import itertools

import numpy as np
from scipy.spatial import cKDTree

from ..arrays import BoolArray, FloatArray, IntArray
from .following import SMALL_COMPONENT


def joints(
    points: FloatArray, areas: FloatArray, component: IntArray, part: IntArray
) -> tuple[IntArray, IntArray]:
    """Return the pairs of points that join the components of each part.

    Each point of a large component is joined to the nearest point of the larger ones, each of a
    small component to the nearest point of the large ones.

    Parameters
    ----------
    points, areas, component
        As above.
    part : (n,) int
        The same at all points of a component.

    Returns
    -------
    one, other : (k,) int
        One pair for each point, except those of the largest component of a part.
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
                pairs.append(some[_nearest(points[some], is_larger[component[some]])[0]])
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
    (here, there), away = _nearest(points, large[component])
    order = np.lexsort((away, component[here]))
    _, first = np.unique(component[here[order]], return_index=True)
    chosen = order[first]
    return here[chosen], there[chosen], away[chosen]


def _nearest(points: FloatArray, chosen: BoolArray) -> tuple[IntArray, FloatArray]:
    """Return each point that is not *chosen* with the nearest one that is, (2, k), and how far."""
    there, here = np.flatnonzero(chosen), np.flatnonzero(~chosen)
    tree = cKDTree(points[there], compact_nodes=False, balanced_tree=False)
    away, nearest = (np.asarray(each) for each in tree.query(points[here]))
    return np.stack([here, there[nearest]]), away
