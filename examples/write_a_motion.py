"""
Write a motion
==============

A cactus bends by 70 degrees in 36 poses.  A ``.glb`` file gets so few of them as morph targets that
a viewer's blend stays within 0.2 % of the diagonal of every pose; ParaView gets all of them.

    python examples/write_a_motion.py FOLDER

writes both, and a picture.
"""

import sys
import tempfile
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

import vtk_segdeform as sd

mesh = sd.models.cactus()
height = mesh.vertices[:, 2]
regions = sd.segment(mesh, n_regions=3)
cages = sd.fit_cages(mesh, regions)
deformer = sd.Deformer(mesh, regions, cages, fixed=height < 0.1, handle=height > 0.9)
tip, pivot = mesh.vertices[deformer.handle], np.array([0.0, 0.0, 0.4])

poses = []
for angle in np.linspace(0.0, 70.0, 37)[1:]:
    turn = Rotation.from_euler("y", angle, degrees=True)
    poses.append(deformer.solve(turn.apply(tip - pivot) + pivot))

with tempfile.TemporaryDirectory() as temporary:
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else temporary)
    folder.mkdir(parents=True, exist_ok=True)
    motion = sd.write_motion(folder / "bend.glb", mesh, poses)
    sd.write_motion(folder / "bend.pvd", mesh, poses)

print(f"{len(motion.kept)} of {len(poses)} poses are morph targets")
print(f"a blend is off by at most {100 * motion.deviation:.2f} % of the diagonal")
print(f"and changes the volume by at most {100 * motion.volume_change:.2f} %")
print(f"largest change of the volume in a pose: {max(abs(p.volume_change) for p in poses):.0e}")

if len(sys.argv) > 1:
    from vtk_segdeform.pictures import BODY, view_of, write_panels

    def drawing(vertices):
        """Return a function that draws the cactus."""
        surface = sd.io.to_polydata(mesh.with_vertices(vertices))
        return lambda plotter: plotter.add_mesh(surface, color=BODY, smooth_shading=True)

    shown = [mesh.vertices, *(poses[k].vertices for k in (11, 23, 35))]
    panels = [(f"{k / 24:.1f} s", drawing(x)) for k, x in zip((0, 12, 24, 36), shown, strict=True)]
    view = view_of(mesh.vertices, poses[-1].vertices)
    write_panels(folder / "bend.png", panels, np.concatenate(shown), view)
