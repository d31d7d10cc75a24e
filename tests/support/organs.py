"""Bodies with several volumes: a ventricle, a tube in a tube, and organs of a label map."""

from __future__ import annotations

import numpy as np
import pyvista as pv
from bodies import revolved, tube
from open_meshes import combined

from vtk_segdeform.geometry import signed_volume
from vtk_segdeform.mesh import Mesh, mesh_of

FloatArray = np.ndarray


def surface_of(labels: np.ndarray, smoothing: int = 0) -> pv.PolyData:
    """Return the surfaces between *labels*, also between two labels, of voxels of volume 1."""
    grid = pv.ImageData(dimensions=labels.shape)
    grid.point_data["labels"] = labels.ravel(order="F").astype(np.int32)
    return grid.contour_labels(
        boundary_style="all", scalars="labels", smoothing=smoothing > 0,
        smoothing_iterations=smoothing, output_mesh_type="triangles",
    )  # fmt: skip


def mesh_from(surface: pv.PolyData) -> Mesh:
    """Return the mesh of a surface with inner walls."""
    return mesh_of(surface.points.astype(float), surface.regular_faces).mesh


def nearest_labels(seed: int, size: int, count: int | None = None) -> np.ndarray:
    """Return a ball, divided among 2 to 8 labels, or *count*, by the nearest of as many points.

    Outside the label is 0.
    """
    rng = np.random.default_rng(seed)
    places = np.moveaxis(np.indices((size,) * 3), 0, -1) / (size - 1) - 0.5
    points = rng.uniform(-0.35, 0.35, (count or rng.integers(2, 9), 3))
    labels = np.linalg.norm(places[..., None, :] - points, axis=-1).argmin(axis=-1) + 1
    return np.where(np.linalg.norm(places, axis=-1) < 0.42, labels, 0)


def ventricle(around: int = 48) -> tuple[Mesh, np.ndarray]:
    """Return the ventricle of Land et al. 2015 at rest, in mm, and a mask of its endocardium.

    Two ellipsoids with half axes of 7 and 17, and of 10 and 20, cut off at z = 5.
    """

    def ellipse(radius: float, length: float, count: int) -> FloatArray:
        u = np.linspace(np.pi, np.arccos(5.0 / length), count + 1)
        return np.stack([radius * np.sin(u), length * np.cos(u)], axis=1)

    outer, inner = ellipse(10.0, 20.0, around // 2), ellipse(7.0, 17.0, around // 2)
    outer[0, 0] = inner[0, 0] = 0.0
    middle = (outer[-1:] + inner[-1:]) / 2.0
    profile = np.concatenate([outer, middle, inner[::-1]])
    mesh = Mesh(*revolved(profile, around, np.inf))
    r, z = np.hypot(*mesh.vertices[:, :2].T), mesh.vertices[:, 2]
    return mesh, np.abs((r / 7.0) ** 2 + (z / 17.0) ** 2 - 1.0) < 1e-9


def tubes() -> Mesh:
    """Return a tube of 2 x 8 with a wall, in which there is another one, with a wall of its own."""
    walls = (tube(inner, inner + 0.2, -4.0, 4.0, n=16, step=1 / 3) for inner in (0.8, 0.4))
    return combined(*(Mesh(*wall) for wall in walls))


def organs(seed: int = 4, size: int = 16, count: int = 3) -> Mesh:
    """Return the smoothed surfaces of a ball of *count* labels."""
    return mesh_from(surface_of(nearest_labels(seed, size, count), 16))


def under_a_lid(mesh: Mesh, part: np.ndarray, x: FloatArray) -> float:
    """Return the volume at *x* (n, 3) of a *part* with one border, under a fan to its centre."""
    faces = mesh.faces[part[mesh.faces].sum(axis=1) >= 2]
    halves = np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1).reshape(-1, 2).tolist()
    both = {tuple(half) for half in halves}
    border = np.array([half for half in halves if tuple(half[::-1]) not in both])
    lid = np.column_stack([border[:, ::-1], np.full(len(border), len(x))])
    centre = x[np.unique(border)].mean(axis=0)
    return abs(signed_volume(np.vstack([x, centre]), np.concatenate([faces, lid])))
