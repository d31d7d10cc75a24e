"""What every test runs under: no window, one thread per worker, no user settings."""

from __future__ import annotations

import os
import sys

# Set before numpy, scipy or VTK are imported, which read them once.  Several workers with
# several threads each would fight for the cores, and sums in another order change last digits.
for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"):
    os.environ.setdefault(_name, "1")
os.environ["PYVISTA_OFF_SCREEN"] = "true"
os.environ["SEGDEFORM_CACHE"] = "0"  # nothing is left in the user's folders
os.environ.setdefault("SEGDEFORM_THREADS", "1")
if sys.platform == "linux" and not os.environ.get("DISPLAY"):
    # Without a screen VTK warns once per window that X cannot be reached; EGL needs none.
    os.environ.setdefault("VTK_DEFAULT_OPENGL_WINDOW", "vtkEGLRenderWindow")
