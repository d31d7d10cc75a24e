"""The command ``pull``: one point of a surface is pulled, the rest follows or stays."""

from __future__ import annotations

import time
from argparse import Namespace

from ..arrays import FloatArray
from ..deformer import checked_place, checked_radius, fault_of_grab, place_text
from ..deformer import pull as pulled
from ..errors import ConstraintError
from ..geometry import lids_of, parse_vector
from ..mesh import Mesh, SurfacePoint
from ..pictures import picture_before_after, require_picture
from ..progress import Progress
from .commands import constraints_of
from .outputs import (
    LIDS,
    Say,
    report_approximate,
    report_goals,
    report_pose,
    report_surface,
    report_volume,
    require_met,
    surface_and_volume,
    written,
)


def pull(options: Namespace, say: Say, progress: Progress) -> bool:
    """Pull one point of a surface and write it as it was given, apart from coordinates."""
    if options.picture is not None:
        require_picture(options.picture)
    at, to = parse_vector(options.at, "at"), parse_vector(options.to, "to")
    pins = [parse_vector(text, "pin") for text in options.pin]
    surface, volume = surface_and_volume(options)
    mesh = surface.mesh
    report_surface(surface, say, is_volume=volume is not None)
    if not mesh.is_closed:
        say(f"volume          {lids_of(mesh, LIDS[options.lids]).summary(preserved=True)}")
    point, radius = checked_place(mesh, at, "--at"), checked_radius(mesh, options.radius)
    say(f"grabbed         {_named(point)} of the mesh at {place_text(mesh, point)}")
    pinned = [_pinned(mesh, pin, radius, say) for pin in pins]
    start = time.perf_counter()
    solution = pulled(
        mesh,
        point,
        to,
        radius,
        pins=pinned,
        locality=options.local,
        limb=options.limb,
        hinge=options.hinge,
        n_regions=options.regions,
        n_cage_vertices=options.cage_vertices,
        **constraints_of(options, surface, volume),
        attach=dict(options.attach),
        refine=options.refine,
        progress=progress,
    )
    seconds = time.perf_counter() - start
    stored, inside = written(surface, solution, options, volume=volume)
    report_volume(stored.volume_change, say)
    report_goals(stored, surface, options.input, say)
    say(f"handle error    {100 * stored.handle_error:.3f} % of model size")
    say(f"pull            {solution.steps} steps, {seconds:.1f} s including regions and cages")
    report_pose(stored, mesh, say, avoids_contact=options.avoid_contact, inside=inside)
    report_approximate(stored, options, say)
    say(f"written         {options.output}")
    if options.picture is not None:
        picture_before_after(
            options.picture, mesh, solution.vertices, fixed=pinned, handle=point.corners
        )
        say(f"written         {options.picture}")
    require_met(solution, options.output, "the point", inside=inside)
    return True


def _pinned(mesh: Mesh, place: FloatArray, radius: float, say: Say) -> int:
    """Return the vertex that is pinned at *place* (3,): the nearest corner of the face there."""
    point = checked_place(mesh, place, "--pin")
    if fault := fault_of_grab(mesh, point, radius):
        raise ConstraintError(f"--pin: {fault}")
    vertex = SurfacePoint.at_vertex(point.vertex)
    say(f"pinned          {_named(vertex)} of the mesh at {place_text(mesh, vertex)}")
    return vertex.vertex


def _named(point: SurfacePoint) -> str:
    """Return "vertex 3", or "a point between the vertices 3, 5, 8"."""
    if point.is_vertex:
        return f"vertex {point.vertex}"
    return f"a point between the vertices {', '.join(map(str, point.corners))}"
