"""Files in formats that only PyMeshLab reads, if it is installed."""

from __future__ import annotations

import importlib.util

HAS_PYMESHLAB = importlib.util.find_spec("pymeshlab") is not None


def save_foreign(path, mesh):
    """Write the vertices and triangles of *mesh* to a .dae, .x3d, .wrl, .3ds or .ctm file."""
    import pymeshlab

    meshset = pymeshlab.MeshSet(verbose=False)
    meshset.add_mesh(pymeshlab.Mesh(mesh.vertices, mesh.faces))
    meshset.save_current_mesh(str(path.absolute()))
