"""Deform dense meshes by dragging handles, with fine detail and exact volume preserved.

    import vtk_segdeform as sd

    mesh = sd.models.cactus()
    regions = sd.segment(mesh, n_regions=3)
    cages = sd.fit_cages(mesh, regions, n_vertices=155)
    deformer = sd.Deformer(mesh, regions, cages, fixed=..., handle=...)
    solution = deformer.solve(targets)

The folders follow the paper: `mesh`, `geometry`, `regions`, `cages`, `subspace`, `energy`,
`solver`, `deformer`.  The main algorithm is `Deformer.solve` in `deformer/deformer.py` and
`GaussNewton` in `solver/gauss_newton.py`.

Every name is imported on first use, so that ``import vtk_segdeform`` takes no time and loads
neither SciPy nor VTK.
"""

from __future__ import annotations

import sys as _sys
from pathlib import Path as _Path
from typing import TYPE_CHECKING as _TYPE_CHECKING

# Source checkout: the folder ``widgets/`` beside this package is the subpackage
# ``vtk_segdeform.widgets`` (package_dir in setup.cfg).  An installed package has it inside.
_root = _Path(__file__).resolve().parent.parent
if not (_root / "vtk_segdeform" / "widgets").exists() and (_root / "setup.cfg").is_file():
    __path__.append(str(_root))
del _Path, _root

from .importing import imported as _imported
from .version import __version__ as __version__

if _TYPE_CHECKING:
    from . import (  # noqa: F401
        cages,
        deformer,
        energy,
        errors,
        filters,
        geometry,
        inside,
        io,
        landmarks,
        mesh,
        mesh_repair,
        models,
        pictures,
        regions,
        session,
        solver,
        subspace,
        widgets,
    )
    from .any_mesh import Deformed, deform, pull, segment
    from .batches import PoseStore, batch, random_poses
    from .cages import Cage, fit_cages, mean_value_coordinates
    from .deformer import Deformer, Slide
    from .errors import Cancelled
    from .geometry import local_volume_change, volume_summary
    from .inside import VolumeMesh
    from .io import Surface, read_mesh, write_mesh
    from .landmarks import LandmarkFit, Landmarks, fit_landmarks, read_landmarks, write_landmarks
    from .mesh import Mesh, find_faults
    from .mesh_repair import repair
    from .motions import Motion, write_motion
    from .regions import Regions
    from .session import Change, Options, Session, load_session, save_session
    from .solver import Solution, Status
    from .widgets.plugin import edit

# The module from which each public name is imported.
_MODULE_OF = {
    "Cage": "cages",
    "Cancelled": "errors",
    "Change": "session",
    "Deformed": "any_mesh",
    "Deformer": "deformer",
    "LandmarkFit": "landmarks",
    "Landmarks": "landmarks",
    "Mesh": "mesh",
    "Motion": "motions",
    "Options": "session",
    "PoseStore": "batches",
    "Regions": "regions",
    "Slide": "deformer",
    "Session": "session",
    "Solution": "solver",
    "Status": "solver",
    "Surface": "io",
    "VolumeMesh": "inside",
    "batch": "batches",
    "deform": "any_mesh",
    "edit": "widgets.plugin",
    "find_faults": "mesh",
    "fit_cages": "cages",
    "fit_landmarks": "landmarks",
    "load_session": "session",
    "local_volume_change": "geometry",
    "mean_value_coordinates": "cages",
    "pull": "any_mesh",
    "read_landmarks": "landmarks",
    "random_poses": "batches",
    "read_mesh": "io",
    "repair": "mesh_repair",
    "save_session": "session",
    "segment": "any_mesh",
    "volume_summary": "geometry",
    "write_landmarks": "landmarks",
    "write_mesh": "io",
    "write_motion": "motions",
}
_SUBPACKAGES = {
    "cages", "deformer", "energy", "errors", "filters", "geometry", "inside", "io", "landmarks",
    "mesh", "mesh_repair", "models", "pictures", "regions", "session", "solver", "subspace",
    "widgets",
}  # fmt: skip

__all__ = [
    "Cage",
    "Cancelled",
    "Change",
    "Deformed",
    "Deformer",
    "LandmarkFit",
    "Landmarks",
    "Mesh",
    "Motion",
    "Options",
    "PoseStore",
    "Regions",
    "Session",
    "Slide",
    "Solution",
    "Status",
    "Surface",
    "VolumeMesh",
    "batch",
    "deform",
    "edit",
    "errors",
    "find_faults",
    "fit_cages",
    "fit_landmarks",
    "load_session",
    "local_volume_change",
    "mean_value_coordinates",
    "models",
    "pull",
    "random_poses",
    "read_landmarks",
    "read_mesh",
    "repair",
    "save_session",
    "segment",
    "volume_summary",
    "write_landmarks",
    "write_mesh",
    "write_motion",
]


def __getattr__(name: str) -> object:
    if name in _SUBPACKAGES:
        return _imported(f"{__name__}.{name}")
    if name in _MODULE_OF:
        value = getattr(_imported(f"{__name__}.{_MODULE_OF[name]}"), name)
        globals()[name] = value  # found without this function from now on
        return value
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__, *_SUBPACKAGES})


# Entry points do not reach the plotters of pyvistaqt; importing this package after pyvista does.
if hasattr(_sys.modules.get("pyvista"), "register_plotter_component"):
    from .widgets import plugin as _plugin  # noqa: F401 - gives plotters and meshes their .segdeform
