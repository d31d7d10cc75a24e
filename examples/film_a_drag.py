"""
Film of a drag
==============

The cactus bends over and back, one frame for each target.

    python examples/film_a_drag.py FOLDER

keeps the GIF.
"""

import sys
import tempfile
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

import vtk_segdeform as sd
from vtk_segdeform.widgets import film

mesh = sd.models.cactus(2000)
height = mesh.vertices[:, 2]
session = sd.Session(mesh)
session.segment(3)
session.fit_cages()
session.set_fixed(height < 0.08)
session.handles.add(height > 0.92, "tip")

pivot = [0.0, 0.0, 0.4]
angles = 60.0 * np.sin(np.linspace(0.0, np.pi, 16))  # degrees
tip = mesh.vertices[session.handles["tip"]] - pivot
targets = [Rotation.from_euler("y", a, degrees=True).apply(tip) + pivot for a in angles]

changes = []
session.on_change(lambda _: changes.append(session.volume_change))
with tempfile.TemporaryDirectory() as here:
    path = Path(sys.argv[1] if len(sys.argv) > 1 else here) / "bend.gif"
    path.parent.mkdir(parents=True, exist_ok=True)
    film(path, session, targets, fps=12, size=(480, 480))
    print(f"{len(targets)} frames, {path.stat().st_size // 1024} kB")
print(f"largest volume change: {max(map(abs, changes)):.0e}")
