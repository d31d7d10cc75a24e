"""
Find the handles
================

Of a deformed cactus only the surface is known: where were its three handles?  Gradients of poses
find them again, by a method of SciPy for smooth functions.

    python examples/find_the_handles.py FOLDER

writes a picture of how far each vertex moves with the first handle.
"""

import sys
from pathlib import Path

import numpy as np
from scipy.optimize import minimize

import vtk_segdeform as sd

mesh = sd.models.cactus(2000)
x, _, z = mesh.vertices.T
regions = sd.segment(mesh, n_regions=3)
handle = [int(np.argmax(z)), int(np.argmin(x)), int(np.argmax(x))]
deformer = sd.Deformer(
    mesh, regions, sd.fit_cages(mesh, regions, 120), fixed=z < 0.1, handle=handle
)
rest, unit = mesh.vertices[handle], mesh.diagonal
truth = rest + unit * np.array([[0.1, 0.05, -0.02], [-0.06, 0.0, 0.08], [0.02, 0.1, 0.05]])
known = deformer.copy().solve(truth).vertices

# Each evaluation is a solve, from the pose of the last one, and one derivative.
changes = []


def misfit(motion):
    """Return the mean square distance from the known surface, and its gradient by *motion*."""
    solution = deformer.solve(rest + unit * motion.reshape(-1, 3))
    changes.append(abs(solution.volume_change))
    away = (solution.vertices - known) / unit
    gradient = deformer.vjp(solution, 2.0 * away / len(away)).targets
    return np.mean((away**2).sum(axis=1)), gradient.ravel()


found = minimize(misfit, np.zeros(9), jac=True, method="L-BFGS-B", options={"ftol": 1e-16})
off = np.linalg.norm(rest + unit * found.x.reshape(-1, 3) - truth, axis=1).max() / unit
print(f"{found.nit} steps, {found.nfev} solves")
print(f"the handles are off by at most {off:.0e} of the diagonal")
print(f"largest relative change of the volume in all of them: {max(changes):.0e}")

if len(sys.argv) > 1:
    from vtk_segdeform.pictures import view_of, write_panels

    solution = deformer.solve(truth)
    along = np.zeros((3, 3))
    along[0, 0] = 1.0
    share = np.linalg.norm(deformer.jvp(solution, along), axis=1)
    surface = sd.io.to_polydata(mesh.with_vertices(solution.vertices))

    def influence(plotter):
        """Draw how far each vertex moves with the first handle."""
        shown = surface.copy()
        shown["moves with the tip"] = share
        bar = {
            "title": " ",
            "color": "black",
            "vertical": False,
            "position_x": 0.2,
            "position_y": 0.02,
        }
        plotter.add_mesh(
            shown, cmap="cividis", clim=(0.0, 1.0), smooth_shading=True, scalar_bar_args=bar
        )

    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    view = view_of(mesh.vertices, solution.vertices)
    panels = [("how far it moves with the tip", influence)]
    write_panels(folder / "influence.png", panels, solution.vertices, view, foot=0.15)
