"""Small meshes with borders, and other surfaces that are no closed two-manifolds."""

from __future__ import annotations

import numpy as np
from solids import icosphere, joined

from vtk_segdeform.mesh.mesh import Mesh


def plate(nx, ny, length=1.0, width=1.0):
    """Return a flat rectangle of 2 nx ny triangles."""
    x, y = np.indices((nx + 1, ny + 1)).reshape(2, -1) * [[length / nx], [width / ny]]
    a = (np.arange(nx)[:, None] * (ny + 1) + np.arange(ny)).ravel()
    b, c, d = a + ny + 1, a + ny + 2, a + 1
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    return np.stack([x, y, np.zeros_like(x)], axis=1), faces


def bent(vertices, radius):
    """Return *vertices* of a plate rolled onto a cylinder; lengths in it do not change."""
    x, y, z = vertices.T
    angle = x / radius
    return np.stack([(radius + z) * np.sin(angle), y, (radius + z) * np.cos(angle)], axis=1)


def welded(vertices, faces):
    """Return the surface with equal vertices joined, and only the vertices of its faces."""
    rounded = np.round(vertices[faces.ravel()], 9) + 0.0
    points, number = np.unique(rounded, axis=0, return_inverse=True)
    return points, number.reshape(-1, 3)


def tube(around=24, along=20, radius=0.3, length=2.0):
    """Return a cylinder along z, open at both ends, facing outward."""
    vertices, faces = plate(around, along)
    angle = 2.0 * np.pi * vertices[:, 0]
    ring = radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return welded(np.column_stack([ring, length * vertices[:, 1]]), faces)


def cup(around=24, along=12, radius=0.5, height=1.0):
    """Return a tube along z with a bottom at z = 0, open at the top."""
    vertices, faces = plate(around, along + 6)
    angle, t = 2.0 * np.pi * vertices[:, 0], vertices[:, 1] * (along + 6)
    size = radius * np.minimum(t / 6.0, 1.0)
    z = height * np.maximum(t - 6.0, 0.0) / along
    soup = np.stack([size * np.cos(angle), size * np.sin(angle), z], axis=1)
    vertices, faces = welded(soup, faces)
    a, b, c = faces.T
    return vertices, faces[(a != b) & (b != c) & (c != a)]


def moebius(along=60, across=4):
    """Return a Moebius strip, cut once where its orientation turns."""
    vertices, faces = plate(along, across)
    angle, t = 2.0 * np.pi * vertices[:, 0], 0.6 * (vertices[:, 1] - 0.5)
    ring = 1.0 + t * np.cos(angle / 2.0)
    z = t * np.sin(angle / 2.0)
    return welded(np.stack([ring * np.cos(angle), ring * np.sin(angle), z], axis=1), faces)


def bowl(share=0.1):
    """Return the part of a unit sphere above a height; 0.0 is a hemisphere."""
    vertices, faces = icosphere(4)
    return welded(vertices, faces[(vertices[faces][:, :, 2] > share).all(axis=1)])


def fin():
    """Return a ball with a sheet that stands on it; their common edges have three faces."""
    ball, faces = icosphere(3)
    y = ball[:, 1] == 0.0
    i, j = np.unique(np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)), axis=0).T
    seam = np.stack([i, j], axis=1)[y[i] & y[j]]
    seam = seam[(ball[seam][:, :, 2] > 0.3).all(axis=1)]
    seam = np.where(ball[seam][:, :1, 0] < ball[seam][:, 1:, 0], seam, seam[:, ::-1])
    inner, outer = ball[seam], 1.6 * ball[seam]
    a = np.arange(len(seam))[:, None] * 4
    sheet = np.concatenate([inner, outer], axis=1).reshape(-1, 3)
    return welded(*joined((ball, faces), (sheet, np.concatenate([a + [0, 1, 3], a + [0, 3, 2]]))))


def crossing():
    """Return two squares that share a line of vertices."""
    vertices, faces = plate(12, 12)
    flat = vertices - [0.5, 0.5, 0.0]
    return welded(*joined((flat, faces), (flat[:, [0, 2, 1]], faces)))


def folded():
    """Return a rectangle folded over itself along a line."""
    vertices, faces = plate(40, 16, 2.0, 1.0)
    s = (vertices[:, 0] - 1.0) / 0.05
    turn = np.clip(s, -np.pi / 2.0, np.pi / 2.0)
    x = 0.05 * (np.cos(turn) - np.abs(s - turn))
    return np.stack([x, vertices[:, 1], 0.05 * np.sin(turn)], axis=1), faces


def hollow():
    """Return a square, closed by its own back: a shell without thickness or volume."""
    vertices, faces = plate(12, 12)
    inner = ((vertices[:, :2] > 0.0) & (vertices[:, :2] < 1.0)).all(axis=1)
    faces = faces[inner[faces].any(axis=1)]
    back = np.where(inner, len(vertices) + np.cumsum(inner) - 1, np.arange(len(vertices)))
    both = np.concatenate([faces, back[faces[:, ::-1]]])
    points = np.concatenate([vertices, vertices[inner]])
    used, number = np.unique(both, return_inverse=True)
    return points[used], number.reshape(-1, 3)


def several():
    """Return two sheets, two balls and a cup, apart from each other."""
    ball, faces = icosphere(2)
    square = plate(10, 10)
    up = square[0][:, [0, 2, 1]] + [0.0, 2.0, 0.0]
    large, small = (0.5 * ball + [2.0, 0.0, 0.0], faces), (0.2 * ball + [2.0, 1.5, 0.0], faces)
    return joined(square, (up, square[1]), large, small, (cup()[0] + [0.0, 0.0, 1.0], cup()[1]))


SHEETS = {
    "plate": lambda: plate(16, 16),
    "ribbon": lambda: plate(100, 4, 25.0, 1.0),
    "strip": lambda: plate(40, 1, 10.0, 1.0),
    "triangle": lambda: (np.eye(3), np.array([[0, 1, 2]])),
    "two triangles": lambda: plate(1, 1),
    "cylinder": lambda: (bent(plate(20, 20)[0], 0.5), plate(20, 20)[1]),
    "folded": folded,
    "bowl": bowl,
    "tube": tube,
    "cup": cup,
    "Moebius strip": moebius,
    "fin": fin,
    "crossing": crossing,
    "hollow": hollow,
    "several": several,
}


def mesh_of(name):
    """Return one of `SHEETS` as a `Mesh`."""
    return Mesh(*SHEETS[name]())
