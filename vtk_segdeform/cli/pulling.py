"""The command ``pull``: one point of a surface is pulled, the rest follows or stays."""

from __future__ import annotations

import time
from argparse import Namespace

import numpy as np

from .. import io
from ..arrays import FloatArray
from ..deformer import pull as pulled
from ..errors import ConstraintError, MeshError
from ..geometry import lids_of
from ..io import Surface
from ..mesh import Mesh, distance_to_surface
from ..pictures import picture_before_after, require_picture
from ..progress import Progress
from .commands import LIDS
from .motion import coordinate_text, parse_vector
from .outputs import HANDLE_TOLERANCE, Say, report_crossings, report_surface, report_volume, written

_FARTHEST = 0.05  # diagonals between a given point and the surface


def pull(options: Namespace, say: Say, progress: Progress) -> bool:
    """Pull one point of a surface and write it as it was given, apart from coordinates."""
    io.require_writable(options.output)
    if options.picture is not None:
        require_picture(options.picture)
    at, to = parse_vector(options.at, "at"), parse_vector(options.to, "to")
    pins = [parse_vector(text, "pin") for text in options.pin]
    surface = Surface.read(options.input)
    mesh, lids = surface.mesh, LIDS[options.lids]
    report_surface(surface, say)
    if not mesh.is_closed:
        say(f"volume          {lids_of(mesh, lids).summary(preserved=True)}")
    vertex = _nearest(mesh, at, "at")
    pinned = [_nearest(mesh, pin, "pin") for pin in pins]
    say(f"grabbed         vertex {vertex} of the mesh at {_place(mesh, vertex)}")
    start = time.perf_counter()
    solution = pulled(
        mesh,
        vertex,
        to,
        options.radius,
        pins=pinned,
        locality=options.local,
        n_regions=options.regions,
        n_cage_vertices=options.cage_vertices,
        lids=lids,
        avoid_contact=options.avoid_contact,
        refine=options.refine,
        progress=progress,
    )
    seconds = time.perf_counter() - start
    stored = written(surface, solution, options.output, lids)
    report_volume(stored.volume_change, say)
    say(f"handle error    {100 * stored.handle_error:.3f} % of model size")
    say(f"pull            {solution.steps} steps, {seconds:.1f} s including regions and cages")
    say(f"status          {solution.status}")
    if options.avoid_contact:
        report_crossings(stored, say)
    say(f"written         {options.output}")
    if options.picture is not None:
        picture_before_after(
            options.picture, mesh, solution.vertices, fixed=pinned, handle=[vertex]
        )
        say(f"written         {options.picture}")
    if solution.handle_error > HANDLE_TOLERANCE:
        raise MeshError(
            f"{options.output} was written, but the point misses its target by "
            f"{100 * solution.handle_error:.3f} % of model size: {solution.status}"
        )
    return True


def _nearest(mesh: Mesh, point: FloatArray, name: str) -> int:
    """Return the vertex nearest to *point* (3,); ConstraintError if it is far from the surface."""
    vertex = int(np.linalg.norm(mesh.vertices - point, axis=1).argmin())
    apart = float(distance_to_surface(point[None], mesh.vertices, mesh.faces)[0]) / mesh.diagonal
    if apart > _FARTHEST:
        raise ConstraintError(
            f"--{name} is {100 * apart:.3g} % of model size away from the surface; give a point on "
            f"it. The nearest vertex is at {_place(mesh, vertex)}"
        )
    return vertex


def _place(mesh: Mesh, vertex: int) -> str:
    return ",".join(coordinate_text(x, mesh.diagonal) for x in mesh.vertices[vertex])
