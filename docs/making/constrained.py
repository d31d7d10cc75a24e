"""The pictures of rigid parts, slides, symmetry and a held centroid."""

from __future__ import annotations

import runpy
from pathlib import Path
from typing import Any

import numpy as np
import pyvista as pv
from scipy.spatial.transform import Rotation

import vtk_segdeform as sd
from making.scene import Drawing, body, write
from vtk_segdeform.models.implicit import Limb, standing_body
from vtk_segdeform.pictures import BODY, FIXED, HANDLE, add_surface, rgb


def coloured(mesh: sd.Mesh, x: Any, **parts: Any) -> Drawing:
    """Return a function that draws a pose with *parts*, masks (n,), in colours."""
    colours = np.tile(rgb(BODY), (mesh.n_faces, 1)).astype(float)
    for name, mask in parts.items():
        colour = {"rigid": HANDLE, "held": FIXED}[name]
        colours[np.asarray(mask)[mesh.faces].all(axis=1)] = rgb(colour)
    return body(mesh, x, colours)


def rigid() -> None:
    """Draw a bent bar, all of it soft and with a rigid part."""
    mesh = sd.models.bar(size=(0.2, 0.12, 1.0), divisions=(10, 6, 50))
    x, height = mesh.vertices, mesh.vertices[:, 2]
    low, top = height < height.min() + 0.05, np.flatnonzero(height > height.max() - 0.05)
    middle = np.abs(height - height.mean()) < 0.17
    turn = Rotation.from_euler("y", 100, degrees=True)
    targets = turn.apply(x[top] - x[top].mean(axis=0)) + x[top].mean(axis=0) + [0.45, 0.0, -0.3]
    poses = []
    for stiffness in (None, np.where(middle, np.inf, 1.0)):
        poses.append(sd.deform(mesh, low, top, targets, stiffness=stiffness).vertices)
    drawings = [
        coloured(mesh, poses[0], held=low),
        coloured(mesh, poses[1], held=low, rigid=middle),
    ]
    write("rigid", drawings, np.concatenate(poses))


def balance(example: Path) -> None:
    """Draw the figure of the *example* from above, its centroid free and held.

    A ring is around the centroid at rest, a disc at that of the pose.
    """
    names = runpy.run_path(str(example))
    mesh, feet = names["mesh"], names["feet"]
    poses = [names[each].vertices for each in ("plain", "balanced")]
    top, size = np.concatenate(poses)[:, 2].max(), mesh.diagonal
    rest = names["centroid"](mesh.vertices)

    def over(pose: Any) -> Drawing:
        def draw(plotter: pv.Plotter) -> None:
            coloured(mesh, pose, held=np.isin(np.arange(len(pose)), feet))(plotter)
            for centre, inner, outer in (
                (rest, 0.025, 0.032),
                (names["centroid"](pose), 0.0, 0.018),
            ):
                at = (centre[0], centre[1], top)
                disc = pv.Disc(center=at, inner=inner * size, outer=outer * size, c_res=40)
                add_surface(plotter, disc.triangulate(), color=rgb(HANDLE) / 255)

        return draw

    write("balance", [over(pose) for pose in poses], np.concatenate(poses))


def slide() -> None:
    """Draw a block on a plate whose top is dragged; its base is fixed, or slides."""
    mesh = sd.models.bar(size=(0.45, 0.3, 1.1), divisions=(15, 10, 36))
    x, height = mesh.vertices, mesh.vertices[:, 2]
    base, top = height < height.min() + 1e-9, np.flatnonzero(height > height.max() - 1e-9)
    targets = x[top] + [0.4, 0.0, -0.1]
    fixed = sd.deform(mesh, base, top, targets, refine=True).vertices
    sliding = sd.deform(mesh, [], top, targets, slides=[sd.Slide(base)], refine=True).vertices
    plate = pv.Box((-0.5, 0.8, -0.2, 0.2, height.min() - 0.03, height.min() - 0.002))

    def on_plate(pose: Any) -> Drawing:
        def draw(plotter: pv.Plotter) -> None:
            coloured(mesh, pose, held=base)(plotter)
            add_surface(plotter, plate.triangulate(), color=rgb(FIXED) / 255)

        return draw

    points = np.concatenate([fixed, sliding, np.asarray(plate.points)])
    write("slide", [on_plate(fixed), on_plate(sliding)], points)


def symmetry() -> None:
    """Draw a body whose one arm is pulled, without and with symmetry."""
    limbs = [
        Limb([(0, 0, 0.4), (0, 0, 0.9)], [0.17, 0.15]),
        Limb([(0, 0, 0.9), (0, 0, 1.2)], [0.1, 0.13]),
        *(
            limb
            for side in (-1, 1)
            for limb in (
                Limb([(0.1 * side, 0, 0.85), (0.75 * side, 0, 0.75)], [0.09, 0.07]),
                Limb([(0.09 * side, 0, 0.4), (0.15 * side, 0, 0.0)], [0.11, 0.08]),
            )
        ),
    ]
    mesh = standing_body(limbs, 6000, blend=0.05)
    x = mesh.vertices
    hand = int(np.argmax(x[:, 0]))
    size = mesh.diagonal
    to = x[hand] + size * np.array([-0.08, 0.0, 0.25])
    poses = [
        sd.pull(mesh, hand, to, pins=x[:, 2] < 0.05 * size, symmetry=each) for each in (None, "x")
    ]
    drawings = [body(mesh, x), *(body(mesh, pose.vertices) for pose in poses)]
    write("symmetry", drawings, np.concatenate([x, *(pose.vertices for pose in poses)]))
