"""Saving and loading sessions: one file of arrays and a header, without executable content.

The file is an `archive`, which ``numpy.load`` reads as an .npz file:

    header.json           format, version, counts, names, options
    mesh_vertices.npy     (n, 3) float     mesh_faces.npy   (m, 3) int
    membership.npy        (r, n) bool      region by vertex                        if any
    cage_vertices.npy     (c, 3) float     cage_faces.npy   (k, 3) int             if any
    fixed.npy             (f,) int         handle.npy       (h,) int
    pose.npy              (c, 3) float     targets.npy      (h, 3) float           if not at rest
    locality.npy          (c, 3) float     the cages where a pull began            if any
    finished.npy          (n, 3) float     the mesh in a finished pose             if any
    finished_held.npy, finished_shifts.npy, finished_cages.npy, finished_offset.npy
                                           as in `state.Finished`
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

import math
import os
import struct
import zipfile
from collections.abc import Mapping
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np

from ..cages import Cage
from ..checks import as_flag, as_path, require
from ..errors import SessionError
from ..files import open_regular, replacing
from ..importing import imported
from ..mesh import Mesh, SurfacePoint
from ..regions import Regions
from .archive import Archive, write_archive
from .session import Session
from .state import Finished, Locality, Options, Pose, State, split_rows

if TYPE_CHECKING:
    from ..io import Surface

FORMAT = "vtk_segdeform session"
VERSION = 2

_LATER = {
    "lids": None,
    "avoid_folds": False,
    "avoid_contact": False,
}  # options that version 1 does not have, and their defaults

# Errors of zipfile, numpy and json on invalid content.
_ERRORS = (zipfile.BadZipFile, ValueError, KeyError, TypeError, EOFError, OverflowError,
           RuntimeError, NotImplementedError, struct.error, OSError)  # fmt: skip


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
    view = header.get("view") if isinstance(header, dict) else None
    return view if isinstance(view, dict) else {}


def _write(
    file: Any, session: Session, given: Surface | None, view: Mapping[str, Any] | None
) -> None:
    mesh, state = session.mesh, session.state
    regions, pose = state.regions, state.pose
    options = {name: _plain(value) for name, value in asdict(state.options).items()}
    options = {k: v for k, v in options.items() if k not in _LATER or v != _LATER[k]}
    is_simple = given is None and mesh.is_closed and not _LATER.keys() & options.keys()
    header: dict[str, Any] = {
        "format": FORMAT,
        "version": 1 if is_simple else VERSION,
        "n_vertices": mesh.n_vertices,
        "n_faces": mesh.n_faces,
        "n_regions": 0 if regions is None else regions.n_regions,
        "smoothness": 1.0 if regions is None else float(regions.smoothness),
        "cages": [[cage.n_vertices, cage.n_faces] for cage in state.cages],
        "n_fixed": len(state.fixed),
        "handles": [[name, len(ids)] for name, ids in state.handles.items()],
        "posed": pose is not None,
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
    if state.cages:
        arrays["cage_vertices"] = np.concatenate([cage.vertices for cage in state.cages])
        arrays["cage_faces"] = np.concatenate([cage.faces for cage in state.cages])
    if pose is not None:
        arrays["pose"] = np.concatenate(pose.cage_vertices)
        arrays["targets"] = np.concatenate([np.empty((0, 3)), *pose.targets.values()])
    if state.pulls:  # optional, like what follows
        header["pulls"] = list(state.pulls)
    if state.locality is not None:
        point, reach, *lengths, _ = vars(state.locality).values()
        header["locality"] = [point.vertex, None if reach == math.inf else reach, *lengths]
        if not point.is_vertex:
            header["pulled_point"] = [point.corners, point.shares]
        arrays["locality"] = np.concatenate(state.locality.cage_vertices)
    if pose is not None and pose.finished is not None:
        header["n_finished_held"] = len(pose.finished.held)
        arrays["finished"] = pose.finished.vertices
        arrays["finished_held"] = pose.finished.held
        arrays["finished_shifts"] = pose.finished.shifts
        arrays["finished_cages"] = np.concatenate(pose.finished.cage_vertices)
        arrays["finished_offset"] = pose.finished.offset
    if state.fixed_at is not None:
        header["fixed_in_pose"] = True
        arrays["fixed_at"] = state.fixed_at
    if state.pivots:
        header["pivots"] = {name: point.tolist() for name, point in state.pivots.items()}
    if given is not None:
        imported("vtk_segdeform.session.surface_store")  # imports pyvista
        from .surface_store import surface_parts

        header["surface"], more = surface_parts(given)
        arrays |= more
    write_archive(file, header, arrays)


def _read(archive: Archive) -> tuple[Mesh | Surface, State]:
    header = _checked_header(archive.header())
    n, r = _count(header, "n_vertices"), _count(header, "n_regions")
    mesh = Mesh(
        archive.array("mesh_vertices", "f", (n, 3)),
        archive.array("mesh_faces", "i", (_count(header, "n_faces"), 3)),
    )
    regions = None
    if r:
        membership = archive.array("membership", "b", (r, n))
        regions = Regions(mesh, membership, _number(header, "smoothness"))
    counts = [(_whole(m, "cages"), _whole(k, "cages")) for m, k in _list(header, "cages")]
    n_vertices, n_faces = [m for m, _ in counts], [k for _, k in counts]
    total = sum(n_vertices)
    cages: tuple[Cage, ...] = ()
    if counts:
        vertices = split_rows(archive.array("cage_vertices", "f", (total, 3)), n_vertices)
        faces = split_rows(archive.array("cage_faces", "i", (sum(n_faces), 3)), n_faces)
        cages = tuple(Cage(*pair) for pair in zip(vertices, faces, strict=True))

    sizes = {str(name): _whole(k, "handles") for name, k in _list(header, "handles")}
    if len(sizes) != len(_list(header, "handles")):
        raise SessionError("two handles have the same name")
    lengths, n_handle = list(sizes.values()), sum(sizes.values())
    ids = split_rows(archive.array("handle", "i", (n_handle,)), lengths)
    pose = None
    if not isinstance(header["posed"], bool):
        raise SessionError(f"posed must be true or false in the header; got {header['posed']!r}")
    if header["posed"]:
        places = split_rows(archive.array("pose", "f", (total, 3)), n_vertices)
        targets = split_rows(archive.array("targets", "f", (n_handle, 3)), lengths)
        finished = None
        if "n_finished_held" in header:
            held = _count(header, "n_finished_held")
            finished = Finished(
                archive.array("finished", "f", (n, 3)),
                archive.array("finished_held", "i", (held,)),
                archive.array("finished_shifts", "f", (held, 3)),
                tuple(split_rows(archive.array("finished_cages", "f", (total, 3)), n_vertices)),
                archive.array("finished_offset", "f", (n, 3)),
            )
        pose = Pose(tuple(places), dict(zip(sizes, targets, strict=True)), finished)
    fixed = archive.array("fixed", "i", (_count(header, "n_fixed"),))
    options = Options(**header["options"])
    names = tuple(_list(header, "region_names")) if "region_names" in header else ()
    pulls = tuple(_list(header, "pulls")) if "pulls" in header else ()
    locality = None
    if "locality" in header:
        entries = _list(header, "locality")
        if len(entries) != 4:
            raise SessionError(f"locality must have 4 entries in the header; got {entries!r}")
        vertex, reach, spread, follows = entries
        kept = split_rows(archive.array("locality", "f", (total, 3)), n_vertices)
        reach = math.inf if reach is None else reach
        point = SurfacePoint.at_vertex(_whole(vertex, "locality"))
        if "pulled_point" in header:
            corners, shares = _list(header, "pulled_point")
            point = SurfacePoint(tuple(corners), tuple(shares))
        locality = Locality(point, reach, spread, follows, tuple(kept))
    handles = dict(zip(sizes, ids, strict=True))
    more = {"pivots": header["pivots"]} if "pivots" in header else {}
    if header.get("fixed_in_pose"):
        more["fixed_at"] = archive.array("fixed_at", "f", (len(fixed), 3))
    state = State(regions, cages, fixed, handles, pose, options, names, pulls, locality, **more)
    if "surface" not in header:
        return mesh, state
    imported("vtk_segdeform.session.surface_store")  # imports pyvista
    from .surface_store import read_surface

    return read_surface(archive, header["surface"], mesh), state


def _checked_header(header: Any) -> Mapping[str, Any]:
    if not isinstance(header, dict) or header.get("format") != FORMAT:
        raise SessionError(f"the header does not contain the format {FORMAT!r}")
    version = _count(header, "version")
    if version > VERSION:
        raise SessionError(f"version {version} is newer than {VERSION}; update vtk_segdeform")
    if version < 1:
        raise SessionError(f"version must be at least 1; got {version}")
    return header


def _plain(value: Any) -> Any:
    return value.item() if isinstance(value, np.generic) else value


def _list(header: Mapping[str, Any], name: str) -> list[Any]:
    value = header[name]
    if not isinstance(value, list):
        raise SessionError(f"{name} must be a list in the header; got {value!r}")
    return value


def _count(header: Mapping[str, Any], name: str) -> int:
    return _whole(header[name], name)


def _whole(value: Any, name: str) -> int:
    if not isinstance(value, int) or isinstance(value, bool) or value < 0:
        raise SessionError(f"{name} must be a whole number in the header; got {value!r}")
    return value


def _number(header: Mapping[str, Any], name: str) -> float:
    if not isinstance(header[name], int | float):
        raise SessionError(f"{name} must be a number in the header; got {header[name]!r}")
    return float(header[name])
