"""Small components that belong to another one: buttons, teeth, screws.

A component is attached to the nearest large one if it is smaller than the smallest limb that the
segmentation looks for, and near: it has no region of its own, and a pull takes it along.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from ..arrays import BoolArray, FloatArray, IntArray

SMALL_COMPONENT = 0.0125  # of the whole area
_NEAR = 0.05  # gap, in diagonals of all points


def attached(points: FloatArray, areas: FloatArray, component: IntArray) -> tuple[IntArray, ...]:
    """Return the nearest pair of points between each attached component and the large ones.

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


def component_shares(areas: FloatArray, component: IntArray) -> FloatArray:
    """Return the share of each component in the area, (c,), rounded: equal ones are equal."""
    area = np.bincount(component, areas)
    return np.round(area / area.sum(), 9)


def nearest_pairs(
    points: FloatArray, component: IntArray, large: BoolArray
) -> tuple[IntArray, IntArray, FloatArray]:
    """Return the nearest points of each component that is not *large* and of those that are.

    The pairs and their distances, (k,) each, by component.
    """
    is_large = large[component]
    there, here = np.flatnonzero(is_large), np.flatnonzero(~is_large)
    tree = cKDTree(points[there], compact_nodes=False, balanced_tree=False)
    away, nearest = tree.query(points[here])
    order = np.lexsort((away, component[here]))
    _, first = np.unique(component[here[order]], return_index=True)
    chosen = order[first]
    return here[chosen], there[nearest[chosen]], away[chosen]
