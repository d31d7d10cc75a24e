"""The file formats of PyMeshLab, if it is installed.

PyMeshLab has the GPL (version 3), unlike this package: only the confined process imports it, and
everything else works without it.
"""

from __future__ import annotations

import importlib.util
import os
from pathlib import Path

import numpy as np

from ..arrays import FloatArray, IntArray
from ..errors import MeshError, MissingDependencyError
from .confined import read_confined

READS = frozenset({".3ds", ".bre", ".ctm", ".dae", ".ptx", ".qobj", ".x3d", ".x3dv", ".wrl"})


def read_faces(path: Path) -> tuple[FloatArray, IntArray]:
    """Return the vertices (n, 3) and triangles (m, 3) of a file, unchecked.

    Raises
    ------
    MissingDependencyError
        If PyMeshLab is not installed.
    MeshError
        If it cannot read the file.
    """
    if importlib.util.find_spec("pymeshlab") is None:
        raise MissingDependencyError(
            f"{path}: reading this format needs PyMeshLab: pip install 'vtk-segdeform[meshlab]', "
            "or convert the file to .ply, .obj or .glb"
        )
    try:
        os.fspath(path).encode()
    except UnicodeEncodeError:
        raise MeshError(f"{path}: PyMeshLab cannot open it: its name is not valid UTF-8") from None
    try:
        arrays = read_confined("meshlab", path)
        vertices = np.ascontiguousarray(arrays["vertices"], dtype=np.float64).reshape(-1, 3)
        return vertices, np.ascontiguousarray(arrays["faces"], dtype=np.int64).reshape(-1, 3)
    except (MeshError, OSError, KeyError, ValueError) as error:
        raise MeshError(f"{path}: PyMeshLab cannot read it: {error}") from None
