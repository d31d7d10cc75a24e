"""Saving and loading sessions: one file of arrays and a header, without executable content.

The file is an `archive`, which ``numpy.load`` reads as an .npz file:

    header.json           format, version, counts, names, options
    mesh_vertices.npy     (n, 3) float     mesh_faces.npy   (m, 3) int
    membership.npy        (r, n) bool      region by vertex                        if any
    carrier.npy           (c,) int         `Regions.carrier`                       if any
    leader.npy            (c,) int         `Regions.leader`                        if any
    cage_vertices.npy     (c, 3) float     cage_faces.npy   (k, 3) int             if any
    fixed.npy             (f,) int         handle.npy       (h,) int
    pose.npy              (c, 3) float     targets.npy      (h, 3) float           if not at rest
    locality.npy          (c, 3) float     the cages where a pull began            if any
    finished.npy          (n, 3) float     the mesh in a finished pose             if any
    pose_stiffness.npy    (n,) float       of its solve, if something was rigid
    finished_held.npy, finished_shifts.npy, finished_cages.npy, finished_offset.npy
                                           as in `state.Finished`
    saved_0_pose.npy ...  the same of saved poses, for the handles of the session  if any
    landmark_source.npy, landmark_target.npy, landmark_uncertainty.npy
                          as in `state.LandmarkSet`                                if any
    surface_...npy        the given surface, as in `surface_store`                 if any

The header may also have the ``view`` of the editor: camera, mode and up axis.  Nothing else depends
on it.

The arrays of cages and of handles are concatenated; the header has their counts.  A loaded session
is bitwise identical to the saved one, but has no history.

Version 1 has closed meshes without a given surface; such sessions are still written in it, so that
earlier programs can read them.  Of all others they say that the version is newer.

Files may be damaged or malicious: `archive` checks the arrays, and the mesh, regions, cages,
handles and pose are checked like arguments of a caller.
"""

from __future__ import annotations

import json
import math
import os
import struct
import zipfile
from collections.abc import Mapping
from dataclasses import asdict, fields, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ..cages import Cage
from ..checks import as_flag, as_path, require, shown
from ..deformer import Slide
from ..errors import SessionError
from ..files import open_regular, replacing
from ..importing import imported
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
    write_archive,
)
from .pose_store import landmark_parts, pose_parts, read_landmarks, read_places, read_pose
from .saved_poses import in_pose
from .session import Session
from .state import Locality, Options, State, split_rows

if TYPE_CHECKING:
    from ..io import Surface

FORMAT = "vtk_segdeform session"
VERSION = 4

# The options of version 1; a file has others only if they are not at their defaults.
_FIRST = {
    "n_cage_vertices", "offset", "preserve_volume", "preserve_region_volumes", "stretch",
    "rotation_groups",
}  # fmt: skip

# Errors of zipfile, numpy and json on invalid content, and ours, which are ValueErrors.
_ERRORS = (zipfile.BadZipFile, ValueError, EOFError, RuntimeError, struct.error, OSError)


def save_session(
    path: str | os.PathLike[str],
    session: Session,
    *,
    surface: bool = True,
    view: Mapping[str, Any] | None = None,
) -> None:
    """Save *session*; if writing fails, an existing file remains unchanged.

    Parameters
    ----------
    path : path
        An existing file is replaced.  The folder must exist.
    session : Session
        The current state, including an ongoing drag, is saved; the history is not.
    surface : bool
        Save the given surface as well.  Without it, the file has a session of the mesh alone.
    view : mapping, optional
        The state of an editor's view, for JSON; see `saved_view`.

    Raises
    ------
    SessionError
        If the file cannot be written: no such folder, no permission, no space, or *path* is a
        folder or a device.
    ArgumentError
        If an argument has the wrong type.
    """
    path = as_path(path)
    require(session, Session, "session")
    given = session.surface if as_flag(surface, "surface") else None
    if view is not None:
        require(view, Mapping, "view")
        try:
            json.dumps(dict(view))
        except (TypeError, ValueError, RecursionError) as fault:
            raise SessionError(f"view must be plain JSON; {fault}") from None
    try:
        with replacing(path) as draft, open(draft, "wb") as file:
            _write(file, session, given, view)
    except OSError as fault:
        raise SessionError(f"{path}: cannot be written ({fault.strerror or fault})") from fault


def load_session(path: str | os.PathLike[str]) -> Session:
    """Load a session from a file written by `save_session`.

    The vertices, regions, cages, fixed vertices, handles, targets and options are bitwise identical
    to the saved ones, and so is the given surface, if there is one.  The history is empty.

    Raises
    ------
    SessionError
        If the file does not exist, is not a session, is damaged, or was written by a newer version;
        the message names the file and the reason.
    """
    path = as_path(path)
    try:
        file = open_regular(path)
    except OSError as fault:
        raise SessionError(f"{path}: cannot be read ({fault.strerror or fault})") from fault
    try:
        with file:
            mesh, state = _read(Archive(file))
        return Session(mesh, state=state)
    except _ERRORS as fault:
        reason = str(fault) or type(fault).__name__
        raise SessionError(f"{path}: is not a readable session file: {reason}") from fault


def saved_view(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Return the state of the view in a session file; {} if it has none or cannot be read.

    Its values are unchecked: the file may be damaged or malicious.
    """
    try:
        with open_regular(as_path(path)) as file:
            header = Archive(file).header()
    except _ERRORS:
        return {}
    view = header.get("view")
    return view if isinstance(view, dict) else {}


def _write(
    file: Any, session: Session, given: Surface | None, view: Mapping[str, Any] | None
) -> None:
    mesh, state = session.mesh, session.state
    regions = state.regions
    options = {name: _plain(value) for name, value in asdict(state.options).items()}
    defaults = asdict(Options())
    options = {k: v for k, v in options.items() if k in _FIRST or v != defaults[k]}
    is_simple = given is None and mesh.is_closed and options.keys() <= _FIRST
    is_new = state.stiffness is not None or bool(state.slides)
    is_new |= regions is not None and regions.leader is not None
    is_new |= bool(state.parts) or (state.locality is not None and not state.locality.reach)
    header: dict[str, Any] = {
        "format": FORMAT,
        "version": 3 if is_new else 1 if is_simple else 2,
        "n_vertices": mesh.n_vertices,
        "n_faces": mesh.n_faces,
        "n_regions": 0 if regions is None else regions.n_regions,
        "smoothness": 1.0 if regions is None else float(regions.smoothness),
        "cages": [[cage.n_vertices, cage.n_faces] for cage in state.cages],
        "n_fixed": len(state.fixed),
        "handles": [[name, len(ids)] for name, ids in state.handles.items()],
        "options": options,
    }
    if state.region_names:  # optional: earlier versions ignore it
        header["region_names"] = list(state.region_names)
    if view is not None:
        header["view"] = dict(view)
    arrays: dict[str, Any] = {"mesh_vertices": mesh.vertices, "mesh_faces": mesh.faces}
    arrays |= {"fixed": state.fixed, "handle": state.handle}
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
    saved = []
    for k, (name, each) in enumerate(state.saved):  # with the handles and cages of the session
        more, posed = pose_parts(in_pose(session.poses, replace(state, saved=()), each))
        saved.append({"name": name, "volumes": dict(each.options.volumes), **more})
        arrays |= {f"saved_{k}_{key}": array for key, array in posed.items()}
    if saved:
        header["saved_poses"] = saved
    if any("rigid_in_pose" in each for each in (header, *saved)):
        header["version"] = 4
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
    if state.parts:
        header["parts"] = [[name, len(ids)] for name, ids in state.parts]
        arrays["parts"] = np.concatenate([ids for _, ids in state.parts])
    more, points = landmark_parts(state)
    header |= more
    arrays |= points
    if given is not None:
        imported("vtk_segdeform.session.surface_store")  # imports pyvista
        from .surface_store import surface_parts

        header["surface"], more = surface_parts(given)
        arrays |= more
    write_archive(file, header, arrays)


def _read(archive: Archive) -> tuple[Mesh | Surface, State]:
    header = _checked_header(archive.header())
    n, r = field(header, "n_vertices", whole), field(header, "n_regions", whole)
    mesh = Mesh(
        archive.array("mesh_vertices", "f", (n, 3)),
        archive.array("mesh_faces", "i", (field(header, "n_faces", whole), 3)),
    )
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
    if "parts" in header:
        named = field(header, "parts", list_of(row_of(text, whole)))
        lengths = [count for _, count in named]
        own = split_rows(archive.array("parts", "i", (sum(lengths),)), lengths)
        more["parts"] = tuple((name, ids) for (name, _), ids in zip(named, own, strict=True))
    more["landmarks"] = read_landmarks(archive, header)
    options = _options(field(header, "options", map_of(anything)))
    state = State(regions, cages, fixed, handles, pose, options, names, pulls, locality, **more)
    saved = list[tuple[str, State]]()
    if "saved_poses" in header:
        for k, each in enumerate(field(header, "saved_poses", list_of(map_of(anything)))):
            prefix, volumes = f"saved_{k}_", field(each, "volumes", map_of(anything))
            posed = replace(
                state,
                pose=read_pose(archive, each, n_vertices, sizes, n_vertices=n, prefix=prefix),
                fixed_at=read_places(archive, each, len(fixed), prefix=prefix),
                options=replace(options, volumes=tuple(volumes.items())),
                locality=None,
            )
            saved.append((field(each, "name", text), posed))
        state = replace(state, saved=tuple(saved))
    if "surface" not in header:
        return mesh, state
    imported("vtk_segdeform.session.surface_store")  # imports pyvista
    from .surface_store import read_surface

    return read_surface(archive, field(header, "surface", map_of(anything)), mesh), state


def _checked_header(header: dict[str, Any]) -> dict[str, Any]:
    if header.get("format") != FORMAT:
        raise SessionError(f"the header does not contain the format {FORMAT!r}")
    version = field(header, "version", whole)
    if version > VERSION:
        raise SessionError(f"version {version} is newer than {VERSION}; update vtk_segdeform")
    if version < 1:
        raise SessionError(f"version must be at least 1; got {version}")
    return header


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
