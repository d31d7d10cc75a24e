"""The command ``check``: what a surface is, how it can be deformed, and its repair.

With ``--json`` it prints one object with these keys:

    file, points, polygons      as given
    vertices, faces             of the mesh that is deformed; null if there is none
    components, closed          their number; whether none has a border
    holes                       number of edges of each border
    encloses                    whether each component encloses a volume
    flattened                   whether it does not because it is an open body pressed flat
    volume_under_lids           whether some volume is preserved under lids over holes
    volume                      the volume in words
    workarounds                 what the mesh has differently: objects with kind, text and count,
                                the number of given points there
    faults, notes               of the triangles as given: objects with kind, text and count
    self_intersections          pairs of faces of the mesh that intersect
    can_be_deformed, reason     whether there is a mesh, and otherwise why not
"""

from __future__ import annotations

import json
from argparse import Namespace
from typing import Any

import numpy as np

from .. import io
from ..errors import ConstraintError, MeshError
from ..geometry import lids_of
from ..io import Surface, repair_surface, triangles_of
from ..mesh import Mesh, counted, find_faults, self_intersections
from ..progress import Progress
from .outputs import Say

_MOST_HOLES = 10  # listed one by one


def check(options: Namespace, say: Say, progress: Progress) -> bool:
    """Report what a surface is; with --repair, write a closed mesh."""
    if options.repair != (options.output is not None):
        raise ConstraintError("--repair and -o OUT require each other: -o is the repaired mesh")
    if options.repair and options.json:
        raise ConstraintError("--json reports a surface as it is; it cannot be used with --repair")
    given = io.read_polydata(options.input)
    if options.repair:
        return _repair(given, options, say, progress)
    progress(0.1, "checking mesh")
    found = described(given, str(options.input))
    progress(1.0, "done")
    if options.json:
        say(json.dumps(found, indent=1))
    else:
        _print(found, say)
    return bool(found["can_be_deformed"])


def described(given: Any, name: str) -> dict[str, Any]:
    """Return the object that ``--json`` prints, of a pyvista.PolyData named *name*."""
    report = find_faults(np.asarray(given.points, dtype=np.float64), triangles_of(given))
    found: dict[str, Any] = {
        "file": name,
        "points": given.n_points,
        "polygons": given.n_cells - given.n_lines - given.n_verts,
        "vertices": None,
        "faces": None,
        "components": report.n_components,
        "closed": report.is_two_manifold,
        "holes": [],
        "encloses": [],
        "flattened": [],
        "volume_under_lids": False,
        "workarounds": [],
        "faults": [_counted(fault) for fault in report.faults],
        "notes": [_counted(note) for note in report.notes],
        "self_intersections": None,
        "can_be_deformed": False,
        "reason": None,
    }
    try:
        surface = Surface(given)
        mesh = surface.mesh
    except MeshError as fault:
        return {**found, "reason": str(fault)}
    return {
        **found,
        **_of_mesh(mesh),
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


def _of_mesh(mesh: Mesh) -> dict[str, Any]:
    lids = lids_of(mesh)
    return {
        "vertices": mesh.n_vertices,
        "faces": mesh.n_faces,
        "components": len(lids.encloses),
        "closed": mesh.is_closed,
        "holes": sorted((len(loop) for loop in mesh.borders), reverse=True),
        "encloses": lids.encloses.tolist(),
        "flattened": lids.flattened.tolist(),
        "volume_under_lids": bool(lids.used.any()),
        "volume": lids.summary(),
        "self_intersections": len(self_intersections(mesh.vertices, mesh.faces)),
    }


def _counted(fault: Any) -> dict[str, Any]:
    kind = fault.kind.name.lower().replace("_", " ")
    return {"kind": kind, "text": str(fault), "count": fault.count}


def _print(found: dict[str, Any], say: Say) -> None:
    polygons = counted(found["polygons"], "polygon", "polygons")
    given = f"{found['file']}: {found['points']} points, {polygons}"
    if not found["can_be_deformed"]:
        say(f"{given}: {found['reason']}")
        return
    parts = counted(found["components"], "component", "components")
    faces = counted(found["faces"], "face", "faces")
    say(f"{given}; as a mesh {found['vertices']} vertices, {faces}, {parts}")
    say(f"It can be deformed as it is. {found['volume']}.")
    if any(found["flattened"]):
        say("  --lids on preserves the volume of a flattened body, unless it is 0")
    for each in found["workarounds"]:
        if each["kind"] != "hole":
            say(f"  {each['text']}")
    holes = found["holes"]
    if holes:
        most = ", ".join(map(str, holes[:_MOST_HOLES])) + (
            ", ..." if len(holes) > _MOST_HOLES else ""
        )
        say(f"  {counted(len(holes), 'border', 'borders')} of {most} edges")
    if found["self_intersections"]:
        pairs = counted(found["self_intersections"], "pair", "pairs")
        say(f"  {pairs} of faces intersect; this does not prevent a deformation")


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
    return repair.report.is_closed
