"""The command ``check``: what a surface is, how it can be deformed, and its repair.

With ``--json`` it prints one object with these keys:

    file, points, polygons      as given; null what cannot be read
    vertices, faces             of the mesh that is deformed; null if there is none
    components, closed          their number; whether none has a border
    holes                       number of edges of each border, without those of inner walls
    encloses                    whether each component encloses a volume
    volume_under_lids           whether some volume is preserved under lids over holes
    volume                      the volume in words
    volumes                     of bodies and cavities, by the names that --volume takes
    labels                      these names, by the labels of a label map
    workarounds                 what the mesh has differently: objects with kind, text and count,
                                the number of given points there
    faults, notes               of the triangles as given: objects with kind, text and count; the
                                note "single precision" counts triangles that have collapsed
    self_intersections          pairs of faces of the mesh that intersect
    can_be_deformed, reason     whether there is a mesh, and otherwise why not, in words
"""

from __future__ import annotations

import json
from argparse import Namespace
from pathlib import Path
from typing import Any

import numpy as np

from .. import io
from ..arrays import FloatArray, IntArray
from ..errors import ConstraintError, MeshError
from ..geometry import lids_of
from ..io import Surface, repair_surface, triangles_of
from ..mesh import Mesh, counted, find_faults, self_intersections
from ..progress import Progress
from ..solver import Bodies, total_volume
from .outputs import Say

_MOST = 10  # holes or volumes that are listed
_SINGLE = "single precision"  # the kind of a note
_COARSE = 1e-3  # of the median edge: larger steps between coordinates are worth a note


def check(options: Namespace, say: Say, progress: Progress) -> bool:
    """Report what a surface is; with --repair, write a closed mesh."""
    if options.repair != (options.output is not None):
        raise ConstraintError("--repair and -o OUT require each other: -o is the repaired mesh")
    if options.repair and options.json:
        raise ConstraintError("--json reports a surface as it is; it cannot be used with --repair")
    try:
        given = io.read_polydata(options.input)
    except (MeshError, OSError) as error:
        if not options.json:
            raise
        _print_json({**_unread(str(options.input)), "reason": str(error)}, say)
        return False
    if options.repair:
        return _repair(given, options, say, progress)
    progress(0.1, "checking mesh")
    found = described(given, str(options.input))
    progress(1.0, "done")
    if options.json:
        _print_json(found, say)
    else:
        _print(found, say)
    return bool(found["can_be_deformed"])


def described(given: Any, name: str) -> dict[str, Any]:
    """Return the object that ``--json`` prints, of a pyvista.PolyData named *name*."""
    points, faces = np.asarray(given.points, dtype=np.float64), triangles_of(given)
    report = find_faults(points, faces)
    found = {
        **_unread(name),
        "points": given.n_points,
        "polygons": given.n_cells - given.n_lines - given.n_verts,
        "components": report.n_components,
        "closed": report.is_two_manifold,
        "faults": [_counted(fault) for fault in report.faults],
        "notes": [*map(_counted, report.notes), *_of_precision(points, faces)],
    }
    try:
        surface = Surface(given)
        mesh = surface.mesh
    except MeshError as fault:
        return {**found, "reason": str(fault)}
    return {
        **found,
        **_of_mesh(mesh),
        "labels": surface.labels(),
        "workarounds": [
            {
                "kind": each.kind.name.lower() if each.kind else "",
                "text": each.text,
                "count": each.count,
            }
            for each in surface.workarounds
        ],
        "can_be_deformed": True,
    }


def _unread(name: str) -> dict[str, Any]:
    """Return what is known of the file *name* before it is read."""
    unknown = ("points", "polygons", "vertices", "faces", "components", "closed")
    none = ("holes", "encloses", "workarounds", "faults", "notes")
    return {
        "file": name,
        **dict.fromkeys(unknown),
        **{key: [] for key in none},
        "volume_under_lids": False,
        "self_intersections": None,
        "can_be_deformed": False,
        "reason": None,
        "volume": None,
        "volumes": {},
        "labels": {},
    }


def _of_mesh(mesh: Mesh) -> dict[str, Any]:
    lids = lids_of(mesh)
    bodies = Bodies(mesh, total_volume(mesh, lids), lids)
    volumes = {f"body {k}": float(each) for k, each in enumerate(bodies.volumes) if each > 0.0}
    for k, component in enumerate(bodies.cavities.tolist()):
        volumes[f"cavity {k}"] = abs(bodies.component(component).target)
    return {
        "vertices": mesh.n_vertices,
        "faces": mesh.n_faces,
        "components": len(lids.encloses),
        "closed": mesh.is_closed,
        "holes": sorted(
            (len(mesh.borders[k]) for k in np.flatnonzero(~lids.of_wall)), reverse=True
        ),
        "encloses": lids.encloses.tolist(),
        "volume_under_lids": bool(lids.used.any()),
        "volume": lids.summary(),
        "volumes": volumes,
        "self_intersections": len(self_intersections(mesh.vertices, mesh.faces)),
    }


def _of_precision(points: FloatArray, faces: IntArray) -> list[dict[str, Any]]:
    """Return a note if *points* (p, 3) are rounded to coarse steps of single precision."""
    corners = points[faces]
    with np.errstate(over="ignore", invalid="ignore"):  # what is not finite has a fault of its own
        single = corners.astype(np.float32)
        if not len(faces) or not np.isfinite(single).all() or (single != corners).any():
            return []
    lengths = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
    edge = float(np.median(lengths[lengths > 0.0])) if lengths.any() else 0.0
    step = float(np.spacing(np.abs(single).max()))
    if step <= _COARSE * edge:
        return []
    a, b, c = np.moveaxis(corners, 1, 0)
    collapsed = int((np.cross(b - a, c - a) == 0.0).all(axis=1).sum())
    lost = f"{counted(collapsed, 'triangle has', 'triangles have')} collapsed; "
    text = (
        "coordinates are in single precision, at this distance from the origin in steps of "
        f"{step:.2g} (median edge {edge:.2g}); {lost if collapsed else ''}move the model to the "
        "origin before you export it, or export in double precision"
    )
    return [{"kind": _SINGLE, "text": text, "count": collapsed}]


def _counted(fault: Any) -> dict[str, Any]:
    kind = fault.kind.name.lower().replace("_", " ")
    return {"kind": kind, "text": str(fault), "count": fault.count}


def _print_json(found: dict[str, Any], say: Say) -> None:
    for line in json.dumps(found, indent=1).split("\n"):
        say(line)


def _print(found: dict[str, Any], say: Say) -> None:
    polygons = counted(found["polygons"], "polygon", "polygons")
    given = f"{found['file']}: {found['points']} points, {polygons}"
    if not found["can_be_deformed"]:
        say(f"{given}: {found['reason']}")
        _print_precision(found, say)
        return
    parts = counted(found["components"], "component", "components")
    faces = counted(found["faces"], "face", "faces")
    say(f"{given}; as a mesh {found['vertices']} vertices, {faces}, {parts}")
    say(f"It can be deformed as it is. {found['volume']}.")
    for each in found["workarounds"]:
        if each["kind"] != "hole":
            say(f"  {each['text']}")
    _print_precision(found, say)
    labels = {name: f" (label {k})" for k, names in found["labels"].items() for name in names}
    volumes = [f"{name}{labels.get(name, '')} {v:.6g}" for name, v in found["volumes"].items()]
    if len(volumes) > 1:
        say(f"  volumes: {', '.join(_some(volumes))}")
    holes = found["holes"]
    if holes:
        most = ", ".join(_some(list(map(str, holes))))
        say(f"  {counted(len(holes), 'border', 'borders')} of {most} edges")
    if found["self_intersections"]:
        pairs = counted(found["self_intersections"], "pair", "pairs")
        say(f"  {pairs} of faces intersect; this does not prevent a deformation")


def _some(texts: list[str]) -> list[str]:
    return texts if len(texts) <= _MOST else [*texts[:_MOST], "..."]


def _print_precision(found: dict[str, Any], say: Say) -> None:
    for note in found["notes"]:
        if note["kind"] == _SINGLE:
            say(f"  {note['text']}")


def _repair(given: Any, options: Namespace, say: Say, progress: Progress) -> bool:
    progress(0.4, "repairing mesh")
    closed, repair = repair_surface(given, largest_hole=options.largest_hole)
    progress(1.0, "done")
    for step in repair.steps or ("nothing to repair",):
        say(f"repaired: {step}" if repair.steps else step)
    say(f"result: {repair.report}")
    if repair.advice:
        say(repair.advice)
    io.write_mesh(options.output, closed)
    say(f"written: {options.output}")
    if repair.report.is_closed and not _is_closed(options.output):
        say("The file is not closed as it is read again: its format rounds coordinates")
        return False
    return repair.report.is_closed


def _is_closed(path: Path) -> bool:
    """Return whether the surface in a file has a closed mesh."""
    try:
        return Surface.read(path).mesh.is_closed
    except MeshError:
        return False
