"""Meshes with an inside: grids of tetrahedra, hexahedra, wedges and pyramids.

Their surface is deformed as any other; the inside follows.

The files, in reading order:

    cells        corners and faces of cells, and their scaled Jacobians
    untangling   inner points for given surface points: no cell inverted, little distortion
    volume_mesh  `VolumeMesh`: what is given, its surface, and its poses
    volume_files grids from and to files
"""

from .cells import Corners, edges, hat_gradients
from .volume_files import require_volume_writable
from .volume_mesh import VolumeMesh, VolumePose, volume_of

__all__ = [
    "Corners",
    "VolumeMesh",
    "VolumePose",
    "edges",
    "hat_gradients",
    "require_volume_writable",
    "volume_of",
]
