"""Stretch and shear of a pose, per triangle and over the surface.

J_T is the linear map from the rest triangle T, in its own plane, to the deformed one; s1 >= s2 are
its singular values, both 1 if T moved rigidly.  Over the surface,

    distortion = sqrt( sum_T A_T ((s1 - 1)^2 + (s2 - 1)^2) / sum_T A_T ),    A_T the rest area

For example, 0.1 means 10 % of stretch or shear, root mean square.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import FloatArray, as_points
from ..mesh import Mesh, require_mesh


def triangle_distortion(mesh: Mesh, vertices: ArrayLike) -> FloatArray:
    """Return sqrt((s1 - 1)^2 + (s2 - 1)^2) of each face from *mesh* to *vertices* (n, 3), (m,).

    It is 0 for a face without area at rest.
    """
    require_mesh(mesh)
    vertices = as_points(vertices, "vertices", mesh.n_vertices)
    a, b, c = mesh.vertices[mesh.faces.T]
    along, other = b - a, c - a
    length = np.linalg.norm(along, axis=1)
    base = np.divide(along, length[:, None], where=length[:, None] > 0, out=np.zeros_like(along))
    x = np.einsum("ij,ij->i", other, base)
    y = np.linalg.norm(other - x[:, None] * base, axis=1)
    flat = length * y <= 1e-14 * mesh.diagonal**2
    length, y = np.where(flat, 1.0, length), np.where(flat, 1.0, y)

    # J = (u, v) [[length, x], [0, y]]^-1 with u, v the deformed edges.
    a, b, c = vertices[mesh.faces.T]
    first = (b - a) / length[:, None]
    second = (c - a - x[:, None] * first) / y[:, None]
    e, g = (first * first).sum(axis=1), (second * second).sum(axis=1)
    f = (first * second).sum(axis=1)
    # Sum and product of the singular values, from the trace and determinant of J^T J.
    product = np.sqrt(np.maximum(e * g - f * f, 0.0))
    total = np.sqrt(e + g + 2.0 * product)
    square = e + g - 2.0 * total + 2.0
    return np.where(flat, 0.0, np.sqrt(np.maximum(square, 0.0)))


def distortion(mesh: Mesh, vertices: ArrayLike) -> float:
    """Return the distortion of the whole surface, weighted by rest area.

    Examples
    --------
    >>> corners = np.array([[1.0, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]])
    >>> mesh = Mesh(corners, [[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]])
    >>> round(distortion(mesh, 1.1 * corners), 6)  # both singular values are 1.1
    0.141421
    """
    square = triangle_distortion(mesh, vertices) ** 2
    return float(np.sqrt(mesh.face_areas @ square / mesh.face_areas.sum()))
