"""A cage of your own: any closed mesh around a region, moved by hand or by a handle.

Pictures go to a folder, if one is given.
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
    print(f"refused: {error}")
cage = sd.Cage(box.vertices - [0.0, 0.0, 0.05], box.faces)
session.set_cages([cage])

# By hand: the mesh follows the cage, whose vertices move a little more to keep the volume.
twisted = cage.vertices.copy()
angle = np.radians(120) * (twisted[:, 2] / twisted[:, 2].max())
cos, sin, (x, y, z) = np.cos(angle), np.sin(angle), twisted.T
session.move_cage(0, np.stack([cos * x - sin * y, sin * x + cos * y, z], axis=-1))
session.commit()
by_hand = session.volume_change, session.vertices
print(f"twisted by its cage: volume changed by {by_hand[0]:.0e} of itself")

# By a handle: the solver finds where the cage has to go.
session.reset_pose()
session.set_fixed(mesh.vertices[:, 2] < 0.05)
session.add_handle(mesh.vertices[:, 2] > 0.95, "top")
aside = np.eye(4)
aside[0, 3] = 0.3
session.move_handle("top", aside)
session.commit()
print(f"dragged aside:       volume changed by {session.volume_change:.0e} of itself")
if len(sys.argv) > 1:
    from vtk_segdeform.pictures.pictures import picture_before_after, picture_regions_and_cages

    Path(sys.argv[1]).mkdir(parents=True, exist_ok=True)
    folder, ends = Path(sys.argv[1]), {"fixed": session.fixed, "handle": session.handles["top"]}
    picture_regions_and_cages(folder / "custom-cage.png", mesh, [[True] * mesh.n_vertices], [cage])
    picture_before_after(folder / "custom-cage-twisted.png", mesh, by_hand[1], **ends)
    picture_before_after(folder / "custom-cage-dragged.png", mesh, session.vertices, **ends)
