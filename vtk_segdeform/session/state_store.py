"""States in a file: their part of the header, and their arrays.  `store` lists both.

Saved poses are not part of it: those with the regions and cages of the session are stored for its
handles, and others as states of their own.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, fields
from typing import Any

import numpy as np

from ..arrays import FloatArray
from ..cages import Cage
from ..checks import shown
from ..deformer import Slide
from ..errors import SessionError
from ..mesh import Mesh, SurfacePoint
from ..regions import Regions
from .archive import (
    Archive,
    anything,
    field,
    flag,
    list_of,
    map_of,
    number,
    optional,
    row_of,
    text,
    whole,
)
from .state import Finished, LandmarkSet, Locality, Options, Pose, State, split_rows

# The options of version 1; a file has others only if they are not at their defaults.
FIRST_OPTIONS = {
    "n_cage_vertices", "offset", "preserve_volume", "preserve_region_volumes", "stretch",
    "rotation_groups",
}  # fmt: skip


def state_parts(state: State) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return the parts of the header, and the arrays, for *state* without its saved poses."""
    regions = state.regions
    options = {name: _plain(value) for name, value in asdict(state.options).items()}
    defaults = asdict(Options())
    options = {k: v for k, v in options.items() if k in FIRST_OPTIONS or v != defaults[k]}
    header: dict[str, Any] = {
        "n_regions": 0 if regions is None else regions.n_regions,
        "smoothness": 1.0 if regions is None else float(regions.smoothness),
        "cages": [[cage.n_vertices, cage.n_faces] for cage in state.cages],
        "n_fixed": len(state.fixed),
        "handles": [[name, len(ids)] for name, ids in state.handles.items()],
        "options": options,
    }
    if state.region_names:  # optional: earlier versions ignore it
        header["region_names"] = list(state.region_names)
    arrays: dict[str, Any] = {"fixed": state.fixed, "handle": state.handle}
    if regions is not None:
        arrays["membership"] = regions.membership
        if regions.carrier is not None:  # optional: earlier versions have the same membership
            header["n_components"] = len(regions.carrier)
            arrays["carrier"] = regions.carrier
        if regions.leader is not None:
            header["n_components"], header["has_leaders"] = len(regions.leader), True
            arrays["leader"] = regions.leader
    if state.cages:
        arrays["cage_vertices"] = np.concatenate([cage.vertices for cage in state.cages])
        arrays["cage_faces"] = np.concatenate([cage.faces for cage in state.cages])
    if state.pulls:  # optional, like what follows
        header["pulls"] = list(state.pulls)
    if state.locality is not None:
        last = state.locality
        point, reach = last.point, None if last.reach == math.inf else last.reach
        header["locality"] = [point.vertex, reach, last.spread, last.follows]
        if last.depth:
            header["pulled_limb"] = last.depth
        if last.hinge:
            header["hinge"] = last.hinge
        if not point.is_vertex:
            header["pulled_point"] = [point.corners, point.shares]
        arrays["locality"] = np.concatenate(state.locality.cage_vertices)
    more, posed = pose_parts(state)
    header |= more
    arrays |= posed
    if state.pivots:
        header["pivots"] = {name: point.tolist() for name, point in state.pivots.items()}
    if state.stiffness is not None:
        header["has_stiffness"] = True
        arrays["stiffness"] = state.stiffness
    if state.slides:
        sliding = [np.asarray(each.vertices) for each in state.slides]
        header["slides"] = [
            [
                len(ids),
                each.along,
                None if each.direction is None else np.asarray(each.direction).tolist(),
            ]
            for ids, each in zip(sliding, state.slides, strict=True)
        ]
        arrays["sliding"] = np.concatenate(sliding)
    more, points = landmark_parts(state)
    header |= more
    arrays |= points
    if state.parts:
        header["parts"] = [[name, len(ids)] for name, ids in state.parts]
        arrays["parts"] = np.concatenate([ids for _, ids in state.parts])
    return header, arrays


def read_state(archive: Archive, header: dict[str, Any], mesh: Mesh) -> State:
    """Return the state of *mesh* in a file, without its saved poses."""
    n, r = mesh.n_vertices, field(header, "n_regions", whole)
    regions = None
    if r:
        membership = archive.array("membership", "b", (r, n))
        carrier = leader = None
        if "n_components" in header:
            count = field(header, "n_components", whole)
            carrier = archive.array("carrier", "i", (count,))
            if "has_leaders" in header:
                leader = archive.array("leader", "i", (count,))
        regions = Regions(mesh, membership, field(header, "smoothness", number), carrier, leader)
    counts = field(header, "cages", list_of(row_of(whole, whole)))
    n_vertices, n_faces = [m for m, _ in counts], [k for _, k in counts]
    total = sum(n_vertices)
    cages: tuple[Cage, ...] = ()
    if counts:
        vertices = split_rows(archive.array("cage_vertices", "f", (total, 3)), n_vertices)
        faces = split_rows(archive.array("cage_faces", "i", (sum(n_faces), 3)), n_faces)
        cages = tuple(Cage(*pair) for pair in zip(vertices, faces, strict=True))

    listed = field(header, "handles", list_of(row_of(text, whole)))
    sizes = dict(listed)
    if len(sizes) != len(listed):
        raise SessionError("two handles have the same name")
    lengths, n_handle = list(sizes.values()), sum(sizes.values())
    ids = split_rows(archive.array("handle", "i", (n_handle,)), lengths)
    pose = read_pose(archive, header, n_vertices, sizes, n_vertices=n)
    fixed = archive.array("fixed", "i", (field(header, "n_fixed", whole),))
    names, pulls = (
        tuple(field(header, name, list_of(text))) if name in header else ()
        for name in ("region_names", "pulls")
    )
    locality = None
    if "locality" in header:
        shape = row_of(whole, optional(number), number, number)
        vertex, reach, spread, follows = field(header, "locality", shape)
        kept = split_rows(archive.array("locality", "f", (total, 3)), n_vertices)
        reach = math.inf if reach is None else reach
        point = SurfacePoint.at_vertex(vertex)
        if "pulled_point" in header:
            shape = row_of(list_of(whole), list_of(number))
            corners, shares = field(header, "pulled_point", shape)
            point = SurfacePoint(tuple(corners), tuple(shares))
        depth = field(header, "pulled_limb", number) if "pulled_limb" in header else 0.0
        hinge = field(header, "hinge", number) if "hinge" in header else 0.0
        locality = Locality(point, reach, spread, follows, tuple(kept), depth, hinge)
    handles, more = dict(zip(sizes, ids, strict=True)), dict[str, Any]()
    if "pivots" in header:
        pivots = field(header, "pivots", map_of(row_of(number, number, number)))
        more["pivots"] = {name: np.array(point) for name, point in pivots.items()}
    more["fixed_at"] = read_places(archive, header, len(fixed))
    if "has_stiffness" in header and field(header, "has_stiffness", flag):
        more["stiffness"] = archive.array("stiffness", "f", (n,))
    if "slides" in header:
        kind = row_of(whole, text, optional(row_of(number, number, number)))
        kinds = field(header, "slides", list_of(kind))
        lengths = [count for count, *_ in kinds]
        total = sum(lengths)
        own = split_rows(archive.array("sliding", "i", (total,)), lengths)
        more["slides"] = tuple(
            Slide(ids, *kind) for ids, (_, *kind) in zip(own, kinds, strict=True)
        )
    more["landmarks"] = read_landmarks(archive, header)
    if "parts" in header:
        named = field(header, "parts", list_of(row_of(text, whole)))
        lengths = [count for _, count in named]
        own = split_rows(archive.array("parts", "i", (sum(lengths),)), lengths)
        more["parts"] = tuple((name, ids) for (name, _), ids in zip(named, own, strict=True))
    options = _options(field(header, "options", map_of(anything)))
    return State(regions, cages, fixed, handles, pose, options, names, pulls, locality, **more)


def pose_parts(state: State) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return the parts of the header, and the arrays, for the pose of *state*."""
    pose, header, arrays = state.pose, dict[str, Any](), dict[str, Any]()
    header["posed"] = pose is not None
    if pose is not None:
        arrays["pose"] = np.concatenate(pose.cage_vertices)
        arrays["targets"] = np.concatenate([np.empty((0, 3)), *pose.targets.values()])
    if pose is not None and pose.finished is not None:
        header["n_finished_held"] = len(pose.finished.held)
        arrays["finished"] = pose.finished.vertices
        arrays["finished_held"] = pose.finished.held
        arrays["finished_shifts"] = pose.finished.shifts
        arrays["finished_cages"] = np.concatenate(pose.finished.cage_vertices)
        arrays["finished_offset"] = pose.finished.offset
    if pose is not None and pose.stiffness is not None and np.isinf(pose.stiffness).any():
        header["rigid_in_pose"] = True  # earlier versions show a pose of other cages
        arrays["pose_stiffness"] = pose.stiffness
    if state.fixed_at is not None:
        header["fixed_in_pose"] = True
        arrays["fixed_at"] = state.fixed_at
    return header, arrays


def read_pose(
    archive: Archive,
    header: dict[str, Any],
    cages: list[int],
    handles: Mapping[str, int],
    *,
    n_vertices: int,
) -> Pose | None:
    """Return the pose of a mesh of *n_vertices*.

    *cages* and *handles* are their numbers of vertices.
    """
    if not field(header, "posed", flag):
        return None
    total = sum(cages)
    places = split_rows(archive.array("pose", "f", (total, 3)), cages)
    points = archive.array("targets", "f", (sum(handles.values()), 3))
    targets = split_rows(points, list(handles.values()))
    finished = None
    if "n_finished_held" in header:
        held = field(header, "n_finished_held", whole)
        then = archive.array("finished_cages", "f", (total, 3))
        finished = Finished(
            archive.array("finished", "f", (n_vertices, 3)),
            archive.array("finished_held", "i", (held,)),
            archive.array("finished_shifts", "f", (held, 3)),
            tuple(split_rows(then, cages)),
            archive.array("finished_offset", "f", (n_vertices, 3)),
        )
    stiffness = None
    if "rigid_in_pose" in header and field(header, "rigid_in_pose", flag):
        stiffness = archive.array("pose_stiffness", "f", (n_vertices,))
    return Pose(tuple(places), dict(zip(handles, targets, strict=True)), finished, stiffness)


def read_places(archive: Archive, header: dict[str, Any], n_fixed: int) -> FloatArray | None:
    """Return where fixed vertices stay in a pose; None at rest."""
    if "fixed_in_pose" not in header or not field(header, "fixed_in_pose", flag):
        return None
    return archive.array("fixed_at", "f", (n_fixed, 3))  # type: ignore[no-any-return]


def _options(values: Mapping[str, Any]) -> Options:
    """Return options of these *values*, which `Options` checks.

    Older files may also avoid folds, and have a rotation for each vertex.
    """
    values = {name: value for name, value in values.items() if name != "avoid_folds"}
    if values.get("rotation_groups", 0) is None:
        del values["rotation_groups"]
    unknown = values.keys() - {each.name for each in fields(Options)}
    if unknown:
        raise SessionError(f"there is no option {shown(sorted(unknown))}")
    return Options(**values)


def _plain(value: Any) -> Any:
    return value.item() if isinstance(value, np.generic) else value


def landmark_parts(state: State) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return the part of the header, and the arrays, for the landmarks of *state*."""
    own = state.landmarks
    if not own.names:
        return {}, {}
    arrays = {"source": own.source, "target": own.target, "uncertainty": own.uncertainty}
    named = {f"landmark_{name}": array for name, array in arrays.items()}
    return {"landmarks": list(own.names)}, named


def read_landmarks(archive: Archive, header: dict[str, Any]) -> LandmarkSet:
    """Return the landmarks in a file."""
    if "landmarks" not in header:
        return State().landmarks
    names = tuple(field(header, "landmarks", list_of(text)))
    source, target = (
        archive.array(f"landmark_{name}", "f", (len(names), 3)) for name in ("source", "target")
    )
    sigma = archive.array("landmark_uncertainty", "f", (len(names),))
    return LandmarkSet(names, source, target, sigma)
