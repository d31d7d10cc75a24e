"""
Many poses of many bodies
=========================

Random poses of three random bodies, their limbs bent and their volumes exact, stored in one file.

A program that leaves the executor out has a process on each core; it must then call ``batch`` under
``if __name__ == "__main__":``.
"""

import tempfile
from concurrent.futures import ThreadPoolExecutor

import vtk_segdeform as sd

plan = {
    "meshes": [sd.models.random_limbs(1500, seed=seed) for seed in range(3)],
    "poses": [
        {"random": 5, "seed": 7, "degrees": 50},
        {"fixed": "z<10%", "handles": [{"select": "z>90%", "rotate": "y,30"}]},
    ],
}
folder = tempfile.mkdtemp()
with ThreadPoolExecutor(1) as executor:
    poses = sd.batch(plan, folder, executor=executor)

table = poses.table()
changes = [abs(change) for change in table["volume_change"]]
print(f"{len(poses)} poses; largest volume change {max(changes):.0e}")
mesh, vertices = poses.mesh(0), poses.vertices(0)
moved = abs(vertices - mesh.vertices).max() / mesh.diagonal
print(f"the first one moves a vertex by {100 * moved:.0f} % of the diagonal")
