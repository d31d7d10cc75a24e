"""Every public callable of the package, discovered automatically, with a valid call of each.

Functions and classes of the modules below, public methods of these classes, and the setters of
their properties.  `ARGUMENTS` has a valid value for each parameter name, but for flags; where a
name has several meanings, `SPECIAL` has the value under "Class.method.name".
"""

from __future__ import annotations

import copy
import enum
import functools
import importlib
import inspect
import tempfile
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
import pyvista as pv

import vtk_segdeform as sd
import vtk_segdeform.filters
import vtk_segdeform.geometry.local_volume
import vtk_segdeform.io.meshlab
import vtk_segdeform.io.meshlab_project
import vtk_segdeform.widgets
import vtk_segdeform.widgets.plugin
from vtk_segdeform import models
from vtk_segdeform.deformer.deformer import Deformer
from vtk_segdeform.mesh.faults import Search, as_soup
from vtk_segdeform.session import Handles, Painting, finishing
from vtk_segdeform.session.session import Session
from vtk_segdeform.subspace.passengers import Passengers
from vtk_segdeform.widgets.films.film import Film
from vtk_segdeform.widgets.scene.surface_display import SurfaceStyle

CORE = (
    "vtk_segdeform",
    "vtk_segdeform.models",
    "vtk_segdeform.io.convert",
    "vtk_segdeform.io.meshlab",
    "vtk_segdeform.geometry.distortion",
    "vtk_segdeform.subspace.passengers",
    "vtk_segdeform.geometry.local_volume",
    "vtk_segdeform.io.meshlab_project",
    "vtk_segdeform.pictures.pictures",
    "vtk_segdeform.filters.deform_filter",
    "vtk_segdeform.widgets.plugin",
    "vtk_segdeform.io.repaired",
)
WIDGETS = ("vtk_segdeform.widgets", "vtk_segdeform.widgets.films.film")

# Hooks that `Widget` calls with its own objects, and arithmetic of a view at every event.
NOT_CALLED = {"on_press", "on_hover", "on_wheel", "on_key", "reset_pivot_at"}
NOT_CALLED |= {"inner_balls"}  # of the local volume, on arrays of the solver
NOT_CALLED |= {
    "contains",
    "guarded",
    "lifted",
    "line_of_sight",
    "pixel_at",
    "pointer",
    "ray",
    "to_display",
    "to_world",
}
NOT_CALLED |= {"FillInputPortInformation", "RequestData"}  # by VTK's pipeline
NOT_CALLED |= {"add_surface", "draw_mesh"}  # in a plotter created by `pictures`


@dataclass(frozen=True)
class Call:
    """One public callable; *bound* returns it with fresh objects, *parameters* are its names."""

    name: str
    bound: Callable[[], Callable[..., Any]]
    parameters: tuple[str, ...]
    required: tuple[str, ...]

    def arguments(self) -> dict[str, Any]:
        """Return valid values of all required parameters."""
        return {name: valid(self.name, name) for name in self.required}


def calls(modules: tuple[str, ...]) -> Iterator[Call]:
    """Yield every public callable of *modules*, once if several have it."""
    seen = set(NOT_CALLED)
    for module in map(importlib.import_module, modules):
        for name in _names(module):
            thing = getattr(module, name)
            if name in seen:
                continue
            seen.add(name)
            if inspect.isclass(thing):
                groups = (Handles, Painting) if thing is Session else ()
                for each in (thing, *groups):
                    yield from _calls_of_class(each)
            elif callable(thing):
                yield _call(name, functools.partial(lambda f: f, thing), thing)


def expensive(call: Call) -> bool:
    """Return whether a call takes a second: a window, cages, or a new body."""
    return call.name in {
        "PlotterTools.edit", "PolyDataTools.deform", "PolyDataTools.pull", "PolyDataTools.regions",
        "batch", "random_poses",
        "cactus", "deform", "dinosaur", "edit", "fit_cages", "fit_landmarks", "film",
        "picture_before_after", "picture_distortion", "picture_landmarks",
        "picture_regions_and_cages", "picture_volume_change", "pull", "random_limbs",
    }  # fmt: skip


def valid(call: str, name: str) -> Any:
    """Return a valid value of one parameter; KeyError if there is none in the tables."""
    special = f"{call}.{name}"
    return SPECIAL[special]() if special in SPECIAL else ARGUMENTS[name]()


def _names(module: Any) -> list[str]:
    if hasattr(module, "__all__"):
        return sorted(module.__all__)
    own = (n for n, v in vars(module).items() if getattr(v, "__module__", "") == module.__name__)
    return sorted(name for name in own if not name.startswith("_"))


def _calls_of_class(cls: type) -> Iterator[Call]:
    if issubclass(cls, enum.Enum | BaseException):
        return
    is_widget = cls.__module__.startswith("vtk_segdeform.widgets")
    by_pyvista = cls.__module__ == "vtk_segdeform.widgets.plugin"  # which pyvista constructs
    if cls in MADE_BY_HAND or (is_widget and not by_pyvista):
        yield _call(cls.__name__, lambda: cls, cls)
    for name, member in inspect.getmembers(cls):
        if name.startswith("_") or name in NOT_CALLED:
            continue
        label = f"{cls.__name__}.{name}"
        if isinstance(member, property):
            if member.fset is not None:
                yield Call(label, functools.partial(_setter, cls, name), ("value",), ("value",))
        elif callable(member) and str(getattr(member, "__module__", "")).startswith(
            "vtk_segdeform"
        ):  # not VTK's own
            yield _call(label, functools.partial(_bound, cls, name), getattr(cls, name))


# Without which the error says how to make one, or what to move.
ALSO_NEEDED = {"Mesh.faces", "deform.handle", "deform.targets"}


def _call(label: str, bound: Callable[[], Any], signed: Any) -> Call:
    signature = inspect.signature(signed)
    plain = [
        p
        for p in signature.parameters.values()
        if p.name != "self" and p.kind in (p.POSITIONAL_OR_KEYWORD, p.KEYWORD_ONLY)
    ]
    for p in plain:
        if isinstance(p.default, bool):
            ARGUMENTS.setdefault(p.name, lambda: True)
    names = tuple(p.name for p in plain)
    needed = tuple(
        p.name for p in plain if p.default is p.empty or f"{label}.{p.name}" in ALSO_NEEDED
    )
    if label in EXTRA:  # passed on as keywords
        names += EXTRA[label]
    return Call(label, bound, names, needed)


def _bound(cls: type, name: str) -> Any:
    return getattr(instance(cls), name)


def _setter(cls: type, name: str) -> Callable[..., None]:
    thing = instance(cls)
    return lambda value: setattr(thing, name, value)


# The objects that methods are called on.


@functools.cache
def mesh() -> sd.Mesh:
    return models.sphere(200)


def _left() -> np.ndarray:
    return np.flatnonzero(mesh().vertices[:, 0] < -0.8)


def _right() -> np.ndarray:
    return np.flatnonzero(mesh().vertices[:, 0] > 0.8)


def _targets() -> np.ndarray:
    return mesh().vertices[_right()] + [0.1, 0.0, 0.0]


@functools.cache
def regions() -> sd.Regions:
    x = mesh().vertices[:, 0]
    return sd.Regions.from_masks(mesh(), [x < 0.3, x > -0.3])


@functools.cache
def cages() -> tuple[sd.Cage, ...]:
    return sd.fit_cages(mesh(), regions(), 24)


@functools.cache
def bound() -> Deformer:
    return Deformer(mesh(), regions(), cages(), fixed=_left(), handle=_right())


@functools.cache
def passengers() -> Passengers:
    return bound().passengers(mesh().vertices[:5])


@functools.cache
def _worked_on() -> Session:
    session = Session(mesh())
    session.set_regions(regions())
    session.set_cages(cages())
    session.set_fixed(_left())
    session.handles.add(_right())
    session.drag(_targets())
    session.commit()
    return session


def session() -> Session:
    return copy.copy(_worked_on())


@functools.cache
def _preparation() -> Any:
    return session().preparation()


def _finished() -> Any:
    done = _worked_on()
    return finishing.finish(done.poses, done.state)()


def surface() -> pv.PolyData:
    return sd.io.to_polydata(mesh())


@functools.cache
def given() -> sd.Surface:
    """Return a surface with seams."""
    return sd.Surface(pv.Cube(x_length=3.0))


@functools.cache
def volume() -> sd.VolumeMesh:
    """Return a volume mesh of a few cells."""
    return sd.VolumeMesh(pv.ImageData(dimensions=(4, 4, 4)).cast_to_unstructured_grid())


@functools.cache
def view() -> Any:
    from hands import plain_view

    return plain_view((64, 64), is_own=True)


@functools.cache
def meshset() -> Any:
    return sd.io.to_meshset(mesh())


@functools.cache
def shared_session() -> Session:
    """Return the session of the widgets, which live as long as the tests."""
    return session()


made_widgets: list[Any] = []


def solution() -> sd.Solution:
    """Return a pose of the bound mesh."""
    return bound().copy().solve(_targets())


def vars_of(thing: Any) -> dict[str, Any]:
    """Return the fields of a dataclass, by name."""
    return {each.name: getattr(thing, each.name) for each in fields(thing)}


def _widget(cls: type) -> Any:
    widgets = sd.widgets
    if cls is widgets.View:
        return view()
    made_widgets.append(cls(view(), shared_session()))
    return made_widgets[-1]


def tidy() -> None:
    """Remove the created widgets from their shared view."""
    while made_widgets:
        remove(made_widgets.pop())


def remove(widget: Any) -> None:
    """Remove a widget from its view and stop what a call started; ignore anything else."""
    if inspect.isroutine(widget):
        widget()
    elif type(widget).__module__.startswith("vtk_segdeform.widgets"):
        getattr(widget, "remove", lambda: None)()


def instance(cls: type) -> Any:
    """Return an object to call methods of, with its own state if it has any."""
    name = cls.__name__
    made = {
        "Mesh": mesh,
        "Regions": regions,
        "Cage": lambda: cages()[0],
        "Deformer": lambda: bound().copy(),
        "Session": session,
        "Handles": lambda: session().handles,
        "Painting": lambda: session().painting,
        "Surface": given,
        "VolumeMesh": volume,
        "Passengers": passengers,
        "Solution": solution,
        "PoseStore": pose_store,
        "Deformed": lambda: sd.Deformed(**vars_of(solution()), mesh=mesh()),
        "Options": sd.Options,
        "LocalVolume": lambda: sd.geometry.LocalVolume(mesh()),
        "SegmentedCageDeformFilter": sd.filters.SegmentedCageDeformFilter,
        "PolyDataTools": lambda: surface().segdeform,
        "PlotterTools": lambda: _plotter().segdeform,
        "Film": _film,
        "LandmarkFit": _fit,
    }
    return made[name]() if name in made else _widget(cls)


@functools.cache
def _landmarks() -> sd.Landmarks:
    return sd.Landmarks(("a", "b"), mesh().vertices[:2], np.zeros(2))


@functools.cache
def _fit() -> sd.LandmarkFit:
    x = mesh().vertices[:60:10]
    return sd.fit_landmarks(mesh(), x, x + 0.1, n_regions=1, n_cage_vertices=24)


@functools.cache
def _poses() -> Path:
    """Return a folder with the poses of a batch."""
    folder = Path(tempfile.mkdtemp())
    with ThreadPoolExecutor(1) as executor:
        sd.batch(_plan(), folder, executor=executor)
    return folder


def pose_store() -> sd.PoseStore:
    return sd.PoseStore(_poses())


def _plan() -> dict[str, Any]:
    pose = {"fixed": _left(), "handle": _right(), "targets": _targets()}
    return {"meshes": [mesh()], "poses": [pose], "n_regions": 1}


def _film() -> Film:
    film = Film(view())
    film.snap()
    return film


@functools.cache
def _plotter() -> pv.Plotter:
    return pv.Plotter(off_screen=True, window_size=(64, 64))


# Classes that callers construct; others are only returned.
MADE_BY_HAND = {
    sd.Mesh, sd.Surface, sd.Regions, sd.Cage, sd.Deformer, sd.Session, sd.Options, sd.Slide,
    sd.VolumeMesh,
    sd.PoseStore,
}  # fmt: skip
EXTRA = {
    "Session.change_options": tuple(field.name for field in fields(sd.Options)),
}


@functools.cache
def _file(name: str) -> Path:
    """Return a file in the current folder that can be read."""
    path = Path(name).absolute()
    if path.suffix == ".segdeform":
        sd.save_session(path, session())
    elif path.suffix == ".vtu":
        volume().grid.save(path)
    elif path.suffix == ".mlp":
        sd.io.write_project(path, mesh())
    else:
        sd.write_mesh(path, mesh())
    return path


ARGUMENTS: dict[str, Callable[[], Any]] = {
    "executor": lambda: ThreadPoolExecutor(1),
    "n": lambda: 1,
    "n_workers": lambda: 1,
    "number": lambda: 0,
    "output": lambda: Path("poses"),
    "plan": _plan,
    "along": lambda: "plane",
    "arrays": lambda: (),
    "attach": dict,
    "blend": lambda: regions().weights,
    "cage_faces": lambda: cages()[0].faces,
    "cage_vertices": lambda: [cage.vertices for cage in cages()],
    "cages": cages,
    "carrier": lambda: None,
    "leader": lambda: None,
    "apart": list,
    "cache": lambda: Path("cache"),
    "callback": lambda: lambda: None,
    "direction": lambda: (0.0, 0.0, 1.0),
    "displacement": lambda: "moved",
    "divisions": lambda: (2, 2, 4),
    "event": lambda: "ModifiedEvent",
    "events": lambda: 1000,
    "exact_volume": lambda: True,
    "faces": lambda: mesh().faces,
    "fixed": _left,
    "fixed_at": lambda: mesh().vertices[_left()],
    "follows": lambda: 0.5,
    "folder": Path,
    "fps": lambda: 20.0,
    "frames": lambda: [None],
    "goal": lambda: "keep",
    "handle": _right,
    "held": _left,
    "hinge": lambda: 0.5,
    "history": lambda: 5,
    "interactor": lambda: view().interactor,
    "join": lambda: False,
    "keys": lambda: "",
    "label": lambda: "a step",
    "labels": lambda: (mesh().vertices[:, 0] > 0).astype(int),
    "landmarks": _landmarks,
    "largest_hole": lambda: 10,
    "lids": lambda: None,
    "locked": lambda: True,
    "listener": lambda: lambda _change: None,
    "depth": lambda: 0.3,
    "limb": lambda: 0,
    "locality": lambda: 0.5,
    "major": lambda: 1.0,
    "masks": lambda: regions().membership,
    "max_steps": lambda: 3,
    "membership": lambda: regions().membership,
    "mesh": mesh,
    "meshset": meshset,
    "minor": lambda: 0.3,
    "motion": lambda: np.eye(4),
    "n_cage_vertices": lambda: 24,
    "n_regions": lambda: 2,
    "n_vertices": lambda: 60,
    "name": lambda: "handle 1",
    "new_name": lambda: "grip",
    "offset": lambda: 0.2,
    "options": sd.Options,
    "overlap": lambda: 1,
    "parts": lambda: {"end": _right()},
    "path": lambda: Path("written.segdeform"),
    "point": lambda: np.array([0.1, 0.2, 0.3]),
    "pins": lambda: [0],
    "pixels": lambda: 1_000_000,
    "points": lambda: mesh().vertices[:4],
    "posed": lambda: [cage.vertices for cage in cages()],
    "polydata": surface,
    "preparation": _preparation,
    "position": lambda: 0,
    "progress": lambda: lambda _fraction, _message: None,
    "radius": lambda: 1.0,
    "region": lambda: 0,
    "report": lambda: sd.find_faults(mesh().vertices, mesh().faces),
    "reach": lambda: 0.5,
    "refine": lambda: True,
    "regions": regions,
    "renderer": lambda: view().renderer,
    "residuals": lambda: np.zeros((6, 3)),
    "result": _finished,
    "rings": lambda: 1,
    "rotation_groups": lambda: 20,
    "seconds": lambda: 5.0,
    "seed": lambda: 3,
    "session": session,
    "size": lambda: (0.2, 0.2, 1.0),
    "source": lambda: mesh().vertices[:60:10],
    "slides": lambda: [sd.Slide(_left())],
    "smoothness": lambda: 1.0,
    "spread": lambda: 0.3,
    "state": lambda: _worked_on().state,
    "stiffness": lambda: np.linspace(1.0, 3.0, mesh().n_vertices),
    "stretch": lambda: 10.0,
    "subtract": lambda: False,
    "surface": surface,
    "symmetry": lambda: None,
    "target": lambda: mesh().vertices[:60:10] + 0.1,
    "targets": _targets,
    "through": lambda: [_targets()],
    "turn": lambda: (),
    "push": lambda: (),
    "volume": lambda: "keep",
    "volumes": lambda: {"whole": "keep"},
    "to": lambda: mesh().vertices[100] + [0.0, 0.0, 0.1],
    "tolerance": lambda: 1e-6,
    "uncertainty": lambda: np.full(6, 0.01),
    "vertex": lambda: 100,
    "vertices": lambda: mesh().vertices,
    "view": view,
    "values": lambda: np.arange(given().mesh.n_vertices),
    "weights": lambda: regions().weights,
    "weld_distance": lambda: 0.0,
    "what": mesh,
    "which": lambda: [0, 1],
    "change": lambda: np.zeros(mesh().n_vertices),
    "amount": lambda: 0.1,
    "axis": lambda: 1,
    "count": lambda: 3,
    "degrees": lambda: 30.0,
    "factor": lambda: 1.1,
    "distortion": lambda: np.zeros(mesh().n_vertices),
    "hidden": lambda: True,
    "hold": lambda: True,
    "on": lambda: True,
    "strength": lambda: 10.0,
    "x": lambda: 1.0,
    "y": lambda: 1.0,
    "z": lambda: 1.0,
    "action": lambda: lambda _controller: None,
    "busy": lambda: lambda: False,
    "colours": lambda: None,
    "shares": lambda: None,
    "enabled": lambda: False,
    "layer": lambda: "layer",
    "message": lambda: "words",
    "milliseconds": lambda: 50,
    "pace": lambda: 0.0,
    "priority": lambda: 1.0,
    "scene": session,
    "skips": lambda: lambda _entry: False,
    "tag": lambda: 1,
    "title": lambda: "segdeform",
    "visible": lambda: True,
    "when": lambda: lambda: True,
    "while_busy": lambda: False,
    "within": lambda: 0.05,
}

SPECIAL: dict[str, Callable[[], Any]] = {
    "PlotterTools.edit.callback": lambda: lambda _: None,
    "PlotterTools.edit.cmap": lambda: "magma",
    "PlotterTools.edit.scalars": lambda: mesh().vertices[:, 2],
    "Cage.faces": lambda: cages()[0].faces,
    "Deformer.volume.name": lambda: "whole",
    "Session.volume.name": lambda: "whole",
    "Session.slide_fixed.slides": lambda: True,
    "Session.set_volume.name": lambda: "whole",
    "Session.forget_volume.name": lambda: "whole",
    "Slide.vertices": _left,
    "read_landmarks.path": lambda: _file("saved.ply"),
    "write_landmarks.path": lambda: Path("saved.csv"),
    "Cage.vertices": lambda: cages()[0].vertices,
    "CageDisplay.opacity.value": lambda: 0.5,
    "DeformEditor.keys.value": lambda: "Blender",
    "DeformEditor.load.path": lambda: _file("saved.segdeform"),
    "DeformEditor.mode.value": lambda: sd.widgets.Mode.DEFORM,
    "DeformEditor.show_cube.value": lambda: True,
    "DeformEditor.run.name": lambda: "undo",
    "DeformEditor.path.value": lambda: Path("other.segdeform"),
    "Deformer.finish.solution": lambda: bound().copy().solve(mesh().vertices[_right()]),
    "Deformer.jvp.solution": lambda: bound().copy().solve(mesh().vertices[_right()]),
    "Deformer.jvp.volumes": dict,
    "Deformer.vjp.solution": lambda: bound().copy().solve(mesh().vertices[_right()]),
    "Deformer.vjp.cotangent": lambda: np.ones(mesh().vertices.shape),
    "Deformer.vjp.volumes": tuple,
    "Deformer.vjp.stiffness": lambda: True,
    "Film.save.path": lambda: Path("saved.gif"),
    "HandleDragger.handle.value": lambda: "handle 1",
    "HandleDragger.local.value": lambda: True,
    "RegionSelector.radius.value": lambda: 0.1,
    "RegionSelector.tool.value": lambda: sd.widgets.Tool.LASSO,
    "Handles.add.vertices": lambda: [int(np.abs(mesh().vertices[:, 0]).argmin())],
    "Session.move_cage.vertices": lambda: cages()[0].vertices * 1.05,
    "Painting.paint.vertices": lambda: [0, 1, 2],
    "Painting.rename.name": lambda: "arm",
    "Session.set_fixed.vertices": _left,
    "Session.set_part.vertices": _left,
    "Painting.split.vertices": lambda: None,
    "Surface.at_vertices.values": lambda: np.arange(given().given.n_points),
    "Surface.of.soup": lambda: sd.mesh.mesh_of(mesh().vertices, mesh().faces),
    "as_polydata.expected": lambda: "a PolyData",
    "as_polydata.mesh": lambda: given().given,
    "Mesh.of.search": lambda: Search(*as_soup(mesh().vertices, mesh().faces)),
    "Mesh.of_components.which": lambda: [0],
    "Surface.moved.vertices": lambda: given().mesh.vertices,
    "Surface.read.path": lambda: _file("mesh.ply"),
    "Surface.targets_at.points": lambda: [0, 5],
    "Surface.targets_at.targets": lambda: given().given.points[[0, 5]],
    "Surface.vertices_at.points": lambda: [0, 5],
    "Surface.write.path": lambda: Path("written.vtp"),
    "Surface.write.vertices": lambda: given().mesh.vertices,
    "VolumeMesh.mesh": lambda: volume().grid,
    "VolumeMesh.moved.pose": lambda: volume().at_rest,
    "VolumeMesh.pose.vertices": lambda: volume().surface.mesh.vertices,
    "VolumeMesh.read.path": lambda: _file("cells.vtu"),
    "VolumeMesh.write.path": lambda: Path("written.vtu"),
    "VolumeMesh.write.pose": lambda: volume().at_rest,
    "SurfaceDisplay.instead.value": lambda: None,
    "SurfaceDisplay.only.value": lambda: None,
    "SurfaceDisplay.style.value": lambda: SurfaceStyle.EDGES,
    "VolumeOverlay.wanted_range.value": lambda: 0.2,
    "blend_at.points": lambda: mesh().vertices[:4],
    "cactus.n_vertices": lambda: 600,
    "dinosaur.n_vertices": lambda: 1200,
    "film.path": lambda: Path("film.gif"),
    "film.size": lambda: (64, 64),
    "fit_cages.n_vertices": lambda: 24,
    "load_session.path": lambda: _file("saved.segdeform"),
    "mean_value_coordinates.cage_vertices": lambda: cages()[0].vertices,
    "read.path": lambda: _file("mesh.ply"),
    "picture_before_after.path": lambda: Path("a.png"),
    "picture_distortion.path": lambda: Path("a.png"),
    "picture_regions_and_cages.path": lambda: Path("a.png"),
    "picture_volume_change.path": lambda: Path("a.png"),
    "read_project.path": lambda: _file("project.mlp"),
    "write_project.path": lambda: Path("written.mlp"),
    "Session.write_deformed.path": lambda: Path("written.vtp"),
    "SegmentedCageDeformFilter.SetFixed.points": _left,
    "SegmentedCageDeformFilter.SetHandle.points": _right,
    "read_faces.path": lambda: _file("mesh.ply"),
    "read_mesh.path": lambda: _file("mesh.ply"),
    "read_polydata.path": lambda: _file("mesh.ply"),
    "read_points.path": lambda: _file("mesh.ply"),
    "write_points.path": lambda: Path("written.vtp"),
    "write_points.data": surface,
    "require_writable.arrays": lambda: False,
    "save_session.view": lambda: {"mode": "PULL"},
    "require_writable.path": lambda: Path("written.vtp"),
    "write.path": lambda: Path("written.ply"),
    "write_motion.path": lambda: Path("written.glb"),
    "write_motion.poses": lambda: [mesh().vertices + 0.1],
    "write_motion.seconds": lambda: [1.0],
    "write_motion.surface": mesh,
    "write_mesh.path": lambda: Path("written.ply"),
    "PoseStore.path": _poses,
    "PoseStore.write_mesh.path": lambda: Path("written.ply"),
}

# The words for an argument in messages, where they are clearer than its name.
SAID_AS: dict[str, tuple[str, ...]] = {
    "volumes": ("volume",),
    "symmetry": ("symmet", "mirror"),
    "Session.set_volume.name": ("volume",),
    "Cage.require_encloses.points": ("handle 1",),
    "HandleDragger.handle.value": ("handle",),
    "HandleDragger.set_hidden.name": ("handle",),
    "HandleDragger.set_locked.name": ("handle",),
    "Cage.vertices": ("faces",),
    "film.frames": ("film", "targets"),
    "Mesh.faces": ("oriented mesh",),
    "Mesh.vertices": ("oriented mesh",),
    "Regions.from_masks.masks": ("membership",),
    "Handles.add.vertices": ("handle",),
    "Session.drag.targets": ("handle",),
    "Handles.to_patch.name": ("handle",),
    "Handles.to_pin.name": ("handle",),
    "Painting.merge.which": ("region",),
    "Session.move_handle.motion": ("targets",),
    "Session.move_handle.name": ("handle",),
    "Handles.pivot.name": ("handle",),
    "Handles.remove.name": ("handle",),
    "Handles.rename.name": ("handle",),
    "Handles.rename.new_name": ("handle's name",),
    "Session.set_fixed.vertices": ("fixed",),
    "Handles.set_pivot.name": ("handle",),
    "Surface.targets_at.points": ("points", "targets"),
    "Surface.targets_at.targets": ("points", "targets"),
    "blend_at.vertices": ("weights",),
    "board.cages": ("weights",),
    "mean_value_coordinates.cage_vertices": ("cage_faces",),
    "film.scene": ("view",),
    "from_meshset.arrays": ("attribute",),
    "repair.faces": ("cannot be repaired",),
    "repair.vertices": ("cannot be repaired",),
    "to_meshset.what": ("Mesh",),
    "write_project.what": ("Mesh",),
}
