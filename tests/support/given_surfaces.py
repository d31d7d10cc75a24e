"""Surfaces as users have them, with everything that a `Mesh` does not: seams, quads, holes, arrays.

All of them stand upright, 0 <= z <= 3, so that a deformation can fix the bottom and bend the top.
"""

from __future__ import annotations

import numpy as np
import pyvista as pv
from vtkmodules.vtkIOXML import vtkXMLPolyDataWriter


def tube(n: int = 16, rows: int = 24) -> pv.PolyData:
    """Return a tube of quads with a seam of doubled points, texture coordinates and normals."""
    u, v = np.meshgrid(np.linspace(0, 1, n + 1), np.linspace(0, 1, rows + 1))
    angle = 2 * np.pi * np.where(u == 1.0, 0.0, u)  # both sides of the seam are at the same place
    outward = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=-1).reshape(-1, 3)
    points = 0.4 * outward + np.array([0, 0, 3.0]) * v.reshape(-1, 1)
    i, j = (each.ravel() for each in np.meshgrid(np.arange(n), np.arange(rows)))
    at = j * (n + 1) + i
    quads = np.stack([np.full(n * rows, 4), at, at + 1, at + n + 2, at + n + 1], axis=1)
    surface = pv.PolyData(points, faces=quads.ravel())
    surface.point_data["Normals"] = outward.astype(np.float32)
    surface.GetPointData().SetActiveNormals("Normals")
    surface.active_texture_coordinates = np.stack([u.ravel(), v.ravel()], axis=1)
    surface.cell_data["number"] = np.arange(surface.n_cells)
    surface.cell_data["name"] = np.array([f"cell {k}" for k in range(surface.n_cells)])
    surface.field_data["made by"] = np.array(["a scanner"])
    return surface


def holed() -> pv.PolyData:
    """Return the tube without some of its quads: two holes and both ends are open."""
    surface = tube()
    return surface.remove_cells([180, 181, 196, 197, 300])


def soup() -> pv.PolyData:
    """Return a closed body of triangles that share no points, in single precision."""
    body = pv.Cylinder(center=(0, 0, 1.5), direction=(0, 0, 1), radius=0.4, height=3.0)
    body = body.triangulate().subdivide(2).clean()
    corners = body.points[body.regular_faces.ravel()].astype(np.float32)
    faces = np.arange(len(corners)).reshape(-1, 3)
    return pv.PolyData(corners, faces=np.insert(faces, 0, 3, axis=1).ravel())


def parts() -> pv.PolyData:
    """Return three bodies beside each other, one of them open, with lines, vertices and strays."""
    left, right = tube().translate((-2, 0, 0)), tube().translate((2, 0, 0))
    ball = pv.Sphere(radius=0.5, center=(0, 0, 1.5), theta_resolution=16, phi_resolution=16)
    merged = pv.PolyData()
    n1, n2 = left.n_points, left.n_points + right.n_points
    merged.points = np.concatenate([left.points, right.points, ball.points, [[9.0, 9.0, 1.0]]])
    shifted = [part.faces.copy() for part in (left, right)]
    shifted[1].reshape(-1, 5)[:, 1:] += n1
    triangles = ball.faces.copy()
    triangles.reshape(-1, 4)[:, 1:] += n2
    merged.faces = np.concatenate([*shifted, triangles])
    merged.lines = [2, 0, n1]
    merged.verts = [1, merged.n_points - 1]
    merged.point_data["height"] = merged.points[:, 2]
    return merged


GIVEN = {"tube": tube, "holed": holed, "soup": soup, "parts": parts}


def require_only_moved(before: pv.PolyData, after: pv.PolyData) -> None:
    """Assert that the surfaces differ in nothing but coordinates and normals."""
    assert after.n_points == before.n_points
    for kind in ("Verts", "Lines", "Polys", "Strips"):
        one, other = (getattr(each, f"Get{kind}")() for each in (before, after))
        assert one.GetNumberOfCells() == other.GetNumberOfCells()
        for part in ("GetOffsetsArray", "GetConnectivityArray"):
            pair = [pv.convert_array(getattr(each, part)()) for each in (one, other)]
            np.testing.assert_array_equal(*pair)
    for place in ("point_data", "cell_data", "field_data"):
        one, other = getattr(before, place), getattr(after, place)
        assert one.keys() == other.keys()
        for name in one:
            assert one[name].dtype == other[name].dtype, name
            if name != "Normals":
                np.testing.assert_array_equal(one[name], other[name])
    for place in ("point_data", "cell_data"):
        for attribute in ("Scalars", "Vectors", "Normals", "TCoords"):
            pair = [getattr(getattr(each, place), f"Get{attribute}")() for each in (before, after)]
            names = [None if each is None else each.GetName() for each in pair]
            assert names[0] == names[1], attribute


def save_raw(path, surface):
    """Write an XML file with its numbers appended in raw binary."""
    writer = vtkXMLPolyDataWriter()
    writer.SetInputData(surface)
    writer.SetFileName(str(path))
    writer.SetDataModeToAppended()
    writer.EncodeAppendedDataOff()
    writer.SetCompressorTypeToNone()
    writer.Write()
