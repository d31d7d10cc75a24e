"""The paper's cages (section 2.2): the patch of each region, simplified and then scaled.

The faces of a region are closed by a fan around the centre of each border, simplified to the wanted
number of vertices (`simplify`), and scaled about their centre.  For comparison only: a surface that
is not star-shaped about its centre, such as a cactus, is not enclosed by its own enlargement.  Some
vertices are outside then, where mean value coordinates may be negative; `fit_cages` encloses all.
"""

from __future__ import annotations

import numpy as np

from ..arrays import BoolArray, FloatArray, IntArray
from ..errors import CageError
from ..mesh import Mesh, connectivity_faults
from ..regions import Regions
from .simplify import simplify


def scaled_cages(regions: Regions, n_vertices: int, scale: float) -> tuple[Mesh, ...]:
    """Return one cage around each region, by simplification and scaling.

    Parameters
    ----------
    regions : Regions
        r regions of a mesh.
    n_vertices : int
        Total number of cage vertices, divided among the regions in proportion to their areas.
    scale : float
        Factor by which each simplified patch is enlarged; the paper does not give it.

    Returns
    -------
    cages : tuple of r Mesh
        Closed two-manifolds, all that mean value coordinates need.  They may cross themselves, and
        need not enclose their regions.

    Raises
    ------
    CageError
        If a closed patch is no two-manifold.
    """
    patches = [_closed_patch(regions.mesh, members) for members in regions.membership]
    ends = np.cumsum([Mesh(*patch).face_areas.sum() for patch in patches])
    numbers = np.diff(np.rint(n_vertices * ends / ends[-1]), prepend=0.0)
    cages = []
    for (points, faces), number in zip(patches, numbers, strict=True):
        points, faces = simplify(points, faces, int(number))
        centre = points.mean(axis=0)
        cages.append(Mesh(centre + scale * (points - centre), faces))
    return tuple(cages)


def _closed_patch(mesh: Mesh, members: BoolArray) -> tuple[FloatArray, IntArray]:
    """Return the faces between *members* (n,), with a fan of faces over each border."""
    used, numbers = np.unique(mesh.faces[members[mesh.faces].all(axis=1)], return_inverse=True)
    patch = Mesh(mesh.vertices[used], numbers.reshape(-1, 3))
    points, faces = [patch.vertices], [patch.faces]
    for k, border in enumerate(patch.borders):
        tip = np.full(len(border), len(used) + k)
        points.append(patch.vertices[border].mean(axis=0, keepdims=True))
        faces.append(np.stack([np.roll(border, -1), border, tip], axis=1))
    closed = np.concatenate(points), np.concatenate(faces)
    if faults := connectivity_faults(len(closed[0]), closed[1]):
        raise CageError(f"the patch of a region cannot be closed: {'; '.join(faults)}")
    return closed
