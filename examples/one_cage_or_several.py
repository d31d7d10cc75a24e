"""
One cage or several
===================

Figure 9 of the paper: one arm of the cactus is bent down. With a single cage the trunk and the
other arm move as well, because they are close to it in space. With a cage for each region, and the
same total number of cage vertices, they hardly move.

    python examples/one_cage_or_several.py FOLDER

writes pictures.
"""

import sys
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

import vtk_segdeform as sd
from vtk_segdeform.geometry import distortion

mesh = sd.models.cactus(2500)
x, _, height = mesh.vertices.T
foot, tip = np.flatnonzero(height < 0.08), np.flatnonzero((x > 0.17) & (height > 0.75))
shoulder = [0.2, 0.0, 0.56]
down = Rotation.from_euler("y", 90, degrees=True)
targets = down.apply(mesh.vertices[tip] - shoulder) + shoulder

distortions = []
for n_regions in (1, 5):
    regions = sd.segment(mesh, n_regions) if n_regions > 1 else sd.Regions.single(mesh)
    cages = sd.fit_cages(mesh, regions, n_vertices=155)
    deformer = sd.Deformer(mesh, regions, cages, fixed=foot, handle=tip)
    solution = deformer.solve(targets)
    distortions.append(distortion(mesh, solution.vertices))
    other_arm = np.linalg.norm(solution.vertices - mesh.vertices, axis=1)[x < -0.15].max()
    print(
        f"cages: {n_regions}, distortion {distortions[-1]:.3f}, {solution.steps} steps, "
        f"other arm moved by {other_arm:.2f}"
    )
    if len(sys.argv) > 1:
        from vtk_segdeform.pictures import picture_before_after, picture_regions_and_cages

        Path(sys.argv[1]).mkdir(parents=True, exist_ok=True)
        stem = f"{Path(sys.argv[1])}/{n_regions}-cages"
        picture_regions_and_cages(f"{stem}.png", mesh, regions.membership, cages)
        picture_before_after(f"{stem}-bent.png", mesh, solution.vertices, fixed=foot, handle=tip)
