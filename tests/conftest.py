"""Settings of all tests: no window, one thread per worker, no user settings."""

from __future__ import annotations

import functools
import os
import sys

# Set before numpy, scipy or VTK are imported, which read them once.  Several workers with
# several threads each would fight for the cores, and sums in another order change last digits.
for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"):
    os.environ.setdefault(_name, "1")
os.environ.setdefault("LP_NUM_THREADS", "0")  # Mesa's, beside the one that asks it to draw
os.environ["PYVISTA_OFF_SCREEN"] = "true"
os.environ["SEGDEFORM_CACHE"] = "0"  # nothing is left in the user's folders
os.environ.setdefault("SEGDEFORM_THREADS", "1")
if sys.platform == "linux" and not os.environ.get("DISPLAY"):
    # Without a screen VTK warns once per window that X cannot be reached; EGL needs none.
    os.environ.setdefault("VTK_DEFAULT_OPENGL_WINDOW", "vtkEGLRenderWindow")

import pytest  # noqa: E402
import pyvista as pv  # noqa: E402 - reads what is set above

from vtk_segdeform import models  # noqa: E402

pv.global_theme.multi_samples = 1  # smooth edges take five times as long to draw in software

_MODELS = {name: functools.cache(getattr(models, name)) for name in ("cactus", "dinosaur")}


@pytest.fixture
def cached_models(monkeypatch: pytest.MonkeyPatch) -> None:
    """Create each cactus and dinosaur once per process; meshes are immutable."""
    for name, cached in _MODELS.items():
        monkeypatch.setattr(models, name, cached)
