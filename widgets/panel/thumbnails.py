"""Small pictures of saved poses, drawn without a window: shaded points of the surface.

The points are spread evenly over the surface at rest, and of each pixel the nearest one remains.
Only their places are computed, so a picture takes milliseconds whatever the size of the mesh.
"""

from __future__ import annotations

import base64
from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np

from vtk_segdeform.arrays import FloatArray, IntArray
from vtk_segdeform.mesh import Mesh
from vtk_segdeform.pictures import BODY, PAPER, png_of, rgb
from vtk_segdeform.session import State

from ..editor import DeformEditor

_WIDTH, _HEIGHT, _MARGIN = 64, 48, 3  # pixels
_POINTS = 6000  # twice as many as pixels, as half of them are behind
_PLASTIC = 1.32471795724475  # its powers spread points evenly over a square
_AMBIENT = 0.35
_pictures: WeakKeyDictionary[State, tuple[bytes, str]] = WeakKeyDictionary()
_points: WeakKeyDictionary[Mesh, _Points] = WeakKeyDictionary()


@dataclass(frozen=True, eq=False)
class _Points:
    """Points spread over the surface."""

    vertices: IntArray  # (k,), at their corners
    corners: IntArray  # (s, 3), among these
    shares: FloatArray  # (s, 3)

    @classmethod
    def of(cls, mesh: Mesh) -> _Points:
        ends = np.cumsum(mesh.face_areas)
        face = np.searchsorted(ends, (np.arange(_POINTS) + 0.5) / _POINTS * ends[-1])
        u, v = np.outer([1.0 / _PLASTIC, 1.0 / _PLASTIC**2], np.arange(_POINTS)) % 1.0
        u, v = np.where(u + v > 1.0, 1.0 - u, u), np.where(u + v > 1.0, 1.0 - v, v)
        chosen = mesh.faces[np.minimum(face, mesh.n_faces - 1)]
        vertices, corners = np.unique(chosen, return_inverse=True)
        return cls(vertices, corners.reshape(-1, 3), np.stack([1.0 - u - v, u, v], axis=1))


def thumbnail(editor: DeformEditor, name: str) -> str:
    """Return a picture of the saved pose *name*, as a data URL; "" if it has other cages.

    A picture that was drawn once remains, also when other cages have been fitted since.
    """
    session, state = editor.session, editor.session.saved_poses[name]
    away, up = editor.controller.camera.viewpoint.directions("home")
    key = np.stack([away, up]).tobytes()
    known = _pictures.get(state, (b"", ""))
    if known[0] == key:
        return known[1]
    if session.mesh not in _points:
        _points[session.mesh] = _Points.of(session.mesh)
    points = _points[session.mesh]
    places = session.saved_poses.places(name, points.vertices)
    if places is None:
        return known[1]
    url = _drawn(places[points.corners], points.shares, away, up)
    _pictures[state] = key, url
    return url


def _drawn(corners: FloatArray, shares: FloatArray, away: FloatArray, up: FloatArray) -> str:
    """Return the picture of points with *shares* (s, 3) of their *corners* (s, 3, 3)."""
    away = away / np.linalg.norm(away)
    right = np.cross(up, away)
    right /= np.linalg.norm(right)
    axes = np.stack([right, np.cross(away, right), away])
    places = np.einsum("ij,ijk->ik", shares, corners) @ axes.T
    a, b, c = corners.transpose(1, 0, 2)
    normals = np.cross(b - a, c - a) @ axes.T
    normals /= np.maximum(np.linalg.norm(normals, axis=1), np.finfo(float).tiny)[:, None]
    light = np.abs(normals @ (np.array([-0.4, 0.5, 0.77])))  # from the upper left
    order = np.argsort(places[:, 2])
    low, high = places[:, :2].min(axis=0), places[:, :2].max(axis=0)
    size = np.array([_WIDTH, _HEIGHT])
    scale = ((size - 2 * _MARGIN) / np.maximum(high - low, 1e-6 * (high - low).max())).min()
    x, y = (0.5 * size + scale * (places[:, :2] - 0.5 * (low + high))).astype(np.int64)[order].T
    shades = (_AMBIENT + (1.0 - _AMBIENT) * light[order])[:, None] * rgb(BODY)
    picture = np.full((_HEIGHT, _WIDTH, 3), rgb(PAPER), dtype=np.uint8)
    for left, down in ((1, 1), (1, 0), (0, 1), (0, 0)):
        picture[_HEIGHT - 1 - y + down, x - left] = shades
    return "data:image/png;base64," + base64.b64encode(png_of(picture)).decode()
