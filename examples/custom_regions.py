"""
Custom regions
==============

Regions from labels, then painted, merged and split. Each step can be undone.

    python examples/custom_regions.py FOLDER

writes a picture.
"""

import sys
from pathlib import Path

import numpy as np

import vtk_segdeform as sd

mesh = sd.models.cactus(2500)
x, _, height = mesh.vertices.T

# One label per vertex; each region then grows over its neighbours by `overlap` edge rings.
left, right = (x < -0.15) & (height > 0.3), (x > 0.13) & (height > 0.45)
labels = np.select([left, right, height > 0.6], [1, 2, 3], default=0)
session = sd.Session(mesh)
session.set_regions(sd.Regions.from_labels(mesh, labels, overlap=4))

session.painting.paint(0, (height > 0.55) & (height < 0.7) & ~left & ~right)  # a wider overlap
session.painting.merge([0, 3])  # one region for the trunk
session.painting.split(0, height > 0.45, overlap=5)  # split lower down
session.undo()

session.fit_cages()
session.set_fixed(height < 0.08)
session.handles.add(right & (height > 0.75), "right hand")
up = np.eye(4)
up[:3, 3] = 0.1, 0.0, 0.15
session.move_handle("right hand", up)
session.commit()

print(f"vertices in each region: {session.regions.membership.sum(axis=1)}")
print(f"volume change: {session.volume_change:.0e}")
if len(sys.argv) > 1:
    from vtk_segdeform.pictures import picture_regions_and_cages

    Path(sys.argv[1]).mkdir(parents=True, exist_ok=True)
    path = Path(sys.argv[1]) / "custom-regions.png"
    picture_regions_and_cages(path, mesh, session.regions.membership, session.cages)
