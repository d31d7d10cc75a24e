"""The pictures of the pages.

``python -m making.figures NAME ...`` draws some of them.  Pictures to be compared are separate
files, NAME-1.png, NAME-2.png ..., with one camera and one scale, so that each has a caption and a
narrow screen shows them below each other.
"""

from __future__ import annotations

import runpy
import shutil
import sys
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyvista as pv
from matplotlib.colors import LinearSegmentedColormap

import vtk_segdeform as sd
from making.constrained import balance, rigid, slide, symmetry
from making.made import EXAMPLES
from making.made import FIGURES as FOLDER
from making.plots import convergence, volume_along_a_step
from making.scene import (
    Drawing,
    add_spheres,
    add_wires,
    bar,
    body,
    cactus,
    cut_open,
    deformer_of,
    label_map,
    region_colours,
    rotated,
    write,
)
from vtk_segdeform.filters import SegmentedCageDeformFilter
from vtk_segdeform.geometry import lids_of
from vtk_segdeform.io import polydata_of, to_polydata
from vtk_segdeform.pictures import (
    BODY,
    FIXED,
    HANDLE,
    add_surface,
    of_region,
    picture_landmarks,
    picture_volume_change,
    rgb,
)

RISING = LinearSegmentedColormap.from_list("rising", ["#DFE7EE", "#E69F00", "#A63A00"])
MUSCLE = rgb("#D0705F")


def front() -> None:
    """Draw the cactus with its regions, with its cages, and bent."""
    parts = cactus()
    mesh, cages = parts["mesh"], parts["cages"]
    solution = deformer_of(parts).solve(rotated(mesh, parts["handle"], 60))
    colours = region_colours(mesh, parts["regions"].weights)

    def caged(vertices: Any, cage_vertices: Sequence[Any]) -> Drawing:
        def draw(plotter: pv.Plotter) -> None:
            body(mesh, vertices, 0.45 * colours + 0.55 * 255)(plotter)
            for r, (cage, p) in enumerate(zip(cages, cage_vertices, strict=True)):
                add_wires(plotter, r, cage.faces, p)

        return draw

    at_rest = [cage.vertices for cage in cages]
    drawings = [
        body(mesh, None, colours),
        caged(mesh.vertices, at_rest),
        caged(solution.vertices, solution.cage_vertices),
    ]
    write("front", drawings, np.concatenate([*at_rest, *solution.cage_vertices]))


def regions() -> None:
    """Draw labels, overlapping regions and blend weights."""
    mesh, labels = cactus()["mesh"], cactus()["regions"].labels
    grown = sd.Regions.from_labels(mesh, labels, overlap=8)
    apart = labels == np.arange(3)[:, None]
    mixed = grown.membership / grown.membership.sum(axis=0)
    drawings = [body(mesh, None, region_colours(mesh, s)) for s in (apart, mixed, grown.weights)]
    write("regions", drawings, mesh.vertices)


def cages() -> None:
    """Draw all cages, and one of them with the vertices it moves."""
    parts = cactus()
    mesh, fitted, weights, arm = parts["mesh"], parts["cages"], parts["regions"].weights, 1
    pale = 0.35 * region_colours(mesh, weights) + 0.65 * 255
    share = weights[arm][mesh.faces].mean(axis=1)[:, None]

    def all_of_them(plotter: pv.Plotter) -> None:
        body(mesh, None, pale)(plotter)
        for r, cage in enumerate(fitted):
            add_wires(plotter, r, cage.faces, cage.vertices)

    def one(plotter: pv.Plotter) -> None:
        body(mesh, None, share * of_region(arm) + (1.0 - share) * 235.0)(plotter)
        add_wires(plotter, arm, fitted[arm].faces, fitted[arm].vertices)

    write("cages", [all_of_them, one], np.concatenate([cage.vertices for cage in fitted]))


def influence() -> None:
    """Draw the weights of one cage vertex, and the deformation when it moves."""
    mesh = sd.models.bar(size=(0.25, 0.25, 1.0), divisions=(12, 12, 48))
    box = sd.models.bar(size=(0.4, 0.4, 1.15), divisions=(1, 1, 3))
    cage = box.vertices - [0.0, 0.0, 0.075]
    weights = sd.mean_value_coordinates(mesh.vertices, cage, box.faces)
    corner = int(np.argmax(cage @ [1.0, -0.3, 0.6] - (cage[:, 2] > 1.0)))
    pulled = cage.copy()
    pulled[corner] += [0.3, 0.0, 0.08]

    def coloured(p: Any) -> Drawing:
        def draw(plotter: pv.Plotter) -> None:
            surface = polydata_of(weights @ p, np.full(mesh.n_faces, 3), mesh.faces.ravel())
            surface.point_data["weight"] = weights[:, corner]
            add_surface(plotter, surface, scalars="weight", cmap=RISING)
            add_wires(plotter, 5, box.faces, p)
            add_spheres(plotter, p[[corner]], HANDLE, 30.0)

        return draw

    write("influence", [coloured(cage), coloured(pulled)], np.concatenate([cage, pulled]))


def handles() -> None:
    """Draw fixed vertices and a handle, at rest and bent."""
    parts = cactus()
    mesh = parts["mesh"]
    bent = deformer_of(parts).solve(rotated(mesh, parts["handle"], 60)).vertices
    colours = np.tile(rgb(BODY), (mesh.n_faces, 1)).astype(float)
    for name, colour in (("fixed", FIXED), ("handle", HANDLE)):
        colours[np.isin(mesh.faces, parts[name]).all(axis=1)] = rgb(colour)
    drawings = [body(mesh, None, colours), body(mesh, bent, colours)]
    write("handles", drawings, np.concatenate([mesh.vertices, bent]))


def exact_volume() -> None:
    """Draw figure 7 of the paper: the same bend without and with volume preservation."""
    parts, free, exact = bar()
    poses = [free.vertices, exact.vertices]
    write("exact_volume", [body(parts["mesh"], x) for x in poses], np.concatenate(poses))


def several() -> None:
    """Draw figure 9 of the paper: one cage bends the trunk as well, several do not."""
    mesh = sd.models.cactus(2500)
    x, _, height = mesh.vertices.T
    foot, tip = np.flatnonzero(height < 0.08), np.flatnonzero((x > 0.17) & (height > 0.75))
    targets = rotated(mesh, tip, 90, np.array([0.2, 0.0, 0.56]))
    drawings, seen = [body(mesh)], [mesh.vertices]
    for found in (sd.Regions.single(mesh), sd.segment(mesh, n_regions=5)):
        fitted = sd.fit_cages(mesh, found, n_vertices=155)
        deformer = sd.Deformer(mesh, found, fitted, fixed=foot, handle=tip)
        seen.append(deformer.solve(targets).vertices)
        drawings.append(body(mesh, seen[-1], region_colours(mesh, found.weights)))
    write("several", drawings, np.concatenate(seen))


def local_volume() -> None:
    """Draw the local volume change."""
    parts = cactus()
    mesh = parts["mesh"]
    x = deformer_of(parts).solve(rotated(mesh, parts["handle"], 60)).vertices
    picture_volume_change(FOLDER / "local_volume.png", mesh, x, sd.local_volume_change(mesh, x))


def pipeline() -> None:
    """Draw the output of the filter for three motions."""
    parts = cactus(2500)
    bend = SegmentedCageDeformFilter()
    bend.SetInputDataObject(0, to_polydata(parts["mesh"]))
    bend.SetFixed(parts["fixed"])
    bend.SetHandle(parts["handle"])
    bend.SetRotationAxis(0, 1, 0)
    poses = []
    for angle, x, z in ((0, 0.0, 0.0), (30, 0.28, -0.08), (60, 0.49, -0.28)):
        bend.SetRotationAngle(angle)
        bend.SetTranslation(x, 0.0, z)
        bend.Update()
        poses.append(np.array(pv.wrap(bend.GetOutputDataObject(0)).points))
    write("pipeline", [body(parts["mesh"], pose) for pose in poses], np.concatenate(poses))


def followers() -> None:
    """Draw a sleeve and a bead that follow an arm, at rest, bent, and free."""
    sys.argv[1:] = []  # or the example would write its own pictures
    names = runpy.run_path(str(EXAMPLES / "an_arm_in_a_sleeve.py"))
    mesh, bent = names["mesh"], [each.vertices for each in names["solutions"].values()]
    owner = mesh.components[mesh.faces[:, 0]]
    colours = np.array([rgb("#f0d9b5"), rgb("#3d6b8f"), rgb("#d55e00")])[owner]
    poses = [mesh.vertices, *bent]
    write("followers", [body(mesh, x, colours) for x in poses], np.concatenate(poses))


def derivatives() -> None:
    """Draw how far the cactus of the example moves with each of two handles."""
    sys.argv[1:] = []
    names = runpy.run_path(str(EXAMPLES / "find_the_handles.py"))
    mesh, deformer = names["mesh"], names["deformer"]
    solution, drawings = deformer.solve(names["truth"]), []
    for k in (0, 1):
        along = np.zeros((3, 3))
        along[k, 0] = 1.0
        share = np.linalg.norm(deformer.jvp(solution, along), axis=1)
        of_faces = share[mesh.faces].mean(axis=1)
        colours = 255.0 * RISING(np.clip(of_faces, 0.0, 1.0))[:, :3]
        drawings.append(body(mesh, solution.vertices, colours))
    write("derivatives", drawings, solution.vertices)


def ventricle() -> None:
    """Draw the ventricle of the example at rest and contracted, cut open."""
    sys.argv[1:] = []  # an example writes its pictures to the folder that is named there
    names = runpy.run_path(str(EXAMPLES / "beat_a_ventricle.py"))
    mesh, solution = names["mesh"], names["solution"]
    poses = [mesh.vertices, solution.vertices]
    drawings = [cut_open([(mesh.faces, x, MUSCLE)], "x") for x in poses]
    write("ventricle", drawings, mesh.vertices)


def solids() -> None:
    """Draw the solid of the example at rest and bent, cut open."""
    with tempfile.TemporaryDirectory() as folder:
        sys.argv[1:] = [folder]
        runpy.run_path(str(EXAMPLES / "bend_a_solid.py"))
        FOLDER.mkdir(parents=True, exist_ok=True)
        shutil.copy(Path(folder) / "solids.png", FOLDER / "solids.png")


def organs() -> None:
    """Draw the parts of a label map at rest and bent, cut open."""
    mesh = label_map()
    x, z = mesh.vertices, mesh.vertices[:, 2]
    regions = sd.segment(mesh, 1)
    cages = sd.fit_cages(mesh, regions, 155)
    ends = {"fixed": z < z.min() + 0.1 * np.ptp(z), "handle": z > z.max() - 0.1 * np.ptp(z)}
    deformer = sd.Deformer(mesh, regions, cages, **ends)
    targets = rotated(mesh, deformer.handle, 50, pivot=x.mean(axis=0) * [1.0, 1.0, 0.9])
    bent = deformer.solve(targets).vertices
    chambers = lids_of(mesh).chambers.inside

    def cut(points: Any) -> Drawing:
        parts = [(faces, points, of_region(r)) for r, faces in enumerate(chambers)]
        return cut_open(parts, "y")

    write("organs", [cut(x), cut(bent)], np.concatenate([x, bent]))


def landmarks() -> None:
    """Draw the landmarks of the example, and the atlas fitted to them."""
    sys.argv[1:] = []
    names = runpy.run_path(str(EXAMPLES / "fit_an_atlas.py"))
    ids, fit = names["landmarks"], names["fit"]
    ends = {"source": names["x"][ids], "target": names["truth"][ids]}
    FOLDER.mkdir(parents=True, exist_ok=True)
    picture_landmarks(
        FOLDER / "landmarks.png", names["atlas"], fit.vertices, residuals=fit.residuals, **ends
    )


def batch() -> None:
    """Draw a body with limbs and three random poses of it."""
    mesh = sd.models.random_limbs(5430, seed=3)
    colours = region_colours(mesh, sd.segment(mesh).weights)
    poses = [pose.vertices for pose in sd.random_poses(mesh, 3, seed=8).poses]
    drawings = [body(mesh, x, colours) for x in (mesh.vertices, *poses)]
    write("batch", drawings, np.concatenate([mesh.vertices, *poses]))


FIGURES: dict[str, tuple[Callable[[], None], int]] = {
    "front": (front, 3),
    "regions": (regions, 3),
    "cages": (cages, 2),
    "influence": (influence, 2),
    "handles": (handles, 2),
    "exact_volume": (exact_volume, 2),
    "several": (several, 3),
    "local_volume": (local_volume, 0),
    "pipeline": (pipeline, 3),
    "followers": (followers, 3),
    "derivatives": (derivatives, 2),
    "ventricle": (ventricle, 2),
    "organs": (organs, 2),
    "landmarks": (landmarks, 0),
    "solids": (solids, 0),
    "batch": (batch, 4),
    "balance": (lambda: balance(EXAMPLES / "keep_its_balance.py"), 2),
    "rigid": (rigid, 2),
    "slide": (slide, 2),
    "symmetry": (symmetry, 3),
    "volume_along": (volume_along_a_step, 0),
    "convergence": (convergence, 0),
}
"""The function that draws each, and its number of files; 0 for a single one, NAME.png."""


def files(name: str) -> list[str]:
    """Return the file names of a figure."""
    count = FIGURES[name][1]
    return [f"{name}-{k}.png" for k in range(1, count + 1)] if count else [f"{name}.png"]


if __name__ == "__main__":
    for wanted in sys.argv[1:]:
        FIGURES[wanted][0]()
