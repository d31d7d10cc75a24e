"""Regions of your own: labels to begin with, then painted, merged and split as you like.

Each step can be undone, and whatever is wrong is said in words.  Pictures go to a folder, if one
is given.
"""

import sys
from pathlib import Path

import numpy as np

import vtk_segdeform as sd

mesh = sd.models.cactus(2500)
x, _, height = mesh.vertices.T

# A number for each vertex; neighbours then grow into each other by so many rings of edges.
left, right = (x < -0.15) & (height > 0.3), (x > 0.13) & (height > 0.45)
labels = np.select([left, right, height > 0.6], [1, 2, 3], default=0)
session = sd.Session(mesh)
session.set_regions(sd.Regions.from_labels(mesh, labels, overlap=4))

session.paint_region(0, (height > 0.55) & (height < 0.7) & ~left & ~right)  # more overlap
session.merge_regions([0, 3])  # the trunk is one after all
session.split_region(0, height > 0.45, overlap=5)  # no: two, cut lower
session.undo()

session.fit_cages()
session.set_fixed(height < 0.08)
session.add_handle(right & (height > 0.75), "right hand")
up = np.eye(4)
up[:3, 3] = 0.1, 0.0, 0.15
session.move_handle("right hand", up)
session.commit()

print(f"{session.regions.n_regions} regions of {session.regions.membership.sum(axis=1)} vertices")
print(f"volume changed by {session.volume_change:.0e} of itself")
if len(sys.argv) > 1:
    from vtk_segdeform.pictures.pictures import picture_regions_and_cages

    Path(sys.argv[1]).mkdir(parents=True, exist_ok=True)
    path = Path(sys.argv[1]) / "custom-regions.png"
    picture_regions_and_cages(path, mesh, session.regions.membership, session.cages)
