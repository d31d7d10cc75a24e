"""
Custom cage
===========

Any closed mesh around a region can be its cage. Here it is a box, moved directly and by a handle.

    python examples/custom_cage.py FOLDER

writes pictures.
"""

import sys
from pathlib import Path

import numpy as np

import vtk_segdeform as sd
from vtk_segdeform.errors import CageError

mesh = sd.models.bar(size=(0.2, 0.2, 1.0), divisions=(8, 8, 40))
session = sd.Session(mesh)
session.set_regions(sd.Regions.single(mesh))

box = sd.models.bar(size=(0.3, 0.3, 1.1), divisions=(1, 1, 5))  # 24 vertices
try:
    session.set_cages([sd.Cage(box.vertices + [0.0, 0.0, 0.1], box.faces)])
except CageError as error:
    print(f"CageError: {error}")
cage = sd.Cage(box.vertices - [0.0, 0.0, 0.05], box.faces)
session.set_cages([cage])

# Directly: the mesh follows the cage, which is then corrected so that the volume is preserved.
twisted = cage.vertices.copy()
angle = np.radians(120) * (twisted[:, 2] / twisted[:, 2].max())
cos, sin, (x, y, z) = np.cos(angle), np.sin(angle), twisted.T
session.move_cage(0, np.stack([cos * x - sin * y, sin * x + cos * y, z], axis=-1))
session.commit()
direct = session.volume_change, session.vertices
print(f"cage twisted:   volume change {direct[0]:.0e}")

# By a handle: the solver finds the cage vertices.
session.reset_pose()
session.set_fixed(mesh.vertices[:, 2] < 0.05)
session.handles.add(mesh.vertices[:, 2] > 0.95, "top")
aside = np.eye(4)
aside[0, 3] = 0.3
session.move_handle("top", aside)
session.commit()
print(f"handle dragged: volume change {session.volume_change:.0e}")
if len(sys.argv) > 1:
    from vtk_segdeform.pictures import picture_before_after, picture_regions_and_cages

    Path(sys.argv[1]).mkdir(parents=True, exist_ok=True)
    folder, ends = Path(sys.argv[1]), {"fixed": session.fixed, "handle": session.handles["top"]}
    picture_regions_and_cages(folder / "custom-cage.png", mesh, [[True] * mesh.n_vertices], [cage])
    picture_before_after(folder / "custom-cage-twisted.png", mesh, direct[1], **ends)
    picture_before_after(folder / "custom-cage-dragged.png", mesh, session.vertices, **ends)
