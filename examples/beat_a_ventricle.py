"""
A ventricle that contracts
==========================

The wall of a heart chamber keeps its volume while the chamber ejects more than half of its blood.
Both volumes are exact in every frame, and the wall thickens as it shortens.

    python examples/beat_a_ventricle.py FOLDER

writes a picture of it at rest and contracted, cut open.
"""

import sys
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

import vtk_segdeform as sd


def ellipse(radius, length):
    """Return the radii and heights of half an ellipse, from the apex to the base at z = 5 mm."""
    angle = np.linspace(np.pi, np.arccos(5.0 / length), 25)
    return np.stack([radius * np.sin(angle), length * np.cos(angle)], axis=1)


# The idealised left ventricle of Land et al. (2015), in mm: two ellipsoids, cut off at the base.
# One profile, up the epicardium, across the base and down the endocardium, turned about the axis.
outer, inner = ellipse(10.0, 20.0), ellipse(7.0, 17.0)
profile = np.concatenate([outer, [(outer[-1] + inner[-1]) / 2.0], inner[::-1]])
turn = 2.0 * np.pi * np.arange(48) / 48
r, z = profile[1:-1, :1], profile[1:-1, 1:]
rings = np.stack([r * np.cos(turn), r * np.sin(turn), z + 0.0 * turn], axis=-1)
number = np.arange(r.size * 48).reshape(r.size, 48)
right = np.roll(number, -1, axis=1)
a, b, c, d = number[:-1], right[:-1], right[1:], number[1:]
apex, bottom = np.full(48, r.size * 48), np.full(48, r.size * 48 + 1)
faces = [(a, b, c), (a, c, d), (apex, right[0], number[0]), (bottom, number[-1], right[-1])]
ends = [[0.0, 0.0, profile[0, 1]], [0.0, 0.0, profile[-1, 1]]]
mesh = sd.Mesh(
    np.concatenate([rings.reshape(-1, 3), ends]),
    np.concatenate([np.stack(corners, axis=-1).reshape(-1, 3) for corners in faces]),
)
x, y, z = mesh.vertices.T
endocardium = np.abs((x**2 + y**2) / 7.0**2 + z**2 / 17.0**2 - 1.0) < 1e-9
epicardium = np.abs((x**2 + y**2) / 10.0**2 + z**2 / 20.0**2 - 1.0) < 1e-9

# The cavity is open at the base: a part of the surface, whose volume is that under a lid.
regions = sd.segment(mesh, n_regions=1)
deformer = sd.Deformer(
    mesh, regions, sd.fit_cages(mesh, regions, 150), parts={"cavity": endocardium}
)
at_rest = deformer.volumes()

# A slider: each frame continues from the last one.
errors, solution = [], None
for percent in np.linspace(97.0, 40.0, 20):
    held = deformer.hold(volumes={"cavity": f"{percent}%", "whole": "keep"})
    if solution is not None:
        held.resume(solution.cage_vertices, [])
    solution = held.solve(np.empty((0, 3)), max_steps=8)
    errors.append(solution.volume_error)
solution = held.finish(held.solve(np.empty((0, 3))))
errors.append(solution.volume_error)


def thickness(vertices):
    """Return the median distance from the endocardium to the epicardium."""
    return np.median(cKDTree(vertices[epicardium]).query(vertices[endocardium])[0])


cavity, wall = solution.volumes["cavity"], solution.volumes["whole"]
before, after = thickness(mesh.vertices), thickness(solution.vertices)
print(f"cavity: {at_rest['cavity'] / 1e3:.2f} ml at rest, {cavity / 1e3:.2f} ml contracted")
print(f"wall:   {at_rest['whole'] / 1e3:.2f} ml at rest, {wall / 1e3:.2f} ml contracted")
print(f"thickness of the wall: {before:.1f} mm at rest, {after:.1f} mm contracted")
print(f"largest relative error of a volume in {len(errors)} poses: {max(errors):.0e}")
print(f"faces that cross: {len(solution.crossings())}")

if len(sys.argv) > 1:
    from vtk_segdeform.pictures import BODY, view_of, write_panels

    def half(vertices):
        """Return a function that draws the half behind the plane x = 0."""
        surface = sd.io.to_polydata(mesh.with_vertices(vertices))
        cut = surface.clip_closed_surface("x", origin=(0.0, 0.0, 0.0))
        return lambda plotter: plotter.add_mesh(
            cut, color=BODY, smooth_shading=True, split_sharp_edges=True
        )

    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    poses = [("at rest", half(mesh.vertices)), ("contracted", half(solution.vertices))]
    view = view_of(mesh.vertices, mesh.vertices)
    write_panels(folder / "contracted.png", poses, mesh.vertices, view)
