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
    saved_0_pose.npy ...  the same of saved poses, for the handles of the session  if any;
                          all of the above of a pose that was saved with other cages
    landmark_source.npy, landmark_target.npy, landmark_uncertainty.npy
                          as in `state.LandmarkSet`                                if any
    carried_0.npy ...     the bytes of files that are carried along                if any
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
import os
import struct
import zipfile
from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ..checks import as_flag, as_path, require
from ..errors import SessionError
from ..files import open_regular, replacing
from ..importing import imported
from ..mesh import Mesh
from .archive import (
    Archive,
    anything,
    field,
    list_of,
    map_of,
    row_of,
    text,
    whole,
    write_archive,
)
from .saved_poses import has_cages, in_pose
from .session import Session
from .state import CarriedFile, State
from .state_store import (
    FIRST_OPTIONS,
    pose_parts,
    read_places,
    read_pose,
    read_state,
    state_parts,
)

if TYPE_CHECKING:
    from ..io import Surface

FORMAT = "vtk_segdeform session"
VERSION = 5

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
    more, arrays = state_parts(state)
    options = more["options"]
    is_simple = given is None and mesh.is_closed and options.keys() <= FIRST_OPTIONS
    is_new = state.stiffness is not None or bool(state.slides)
    is_new |= state.regions is not None and state.regions.leader is not None
    is_new |= bool(state.parts) or (state.locality is not None and not state.locality.reach)
    header: dict[str, Any] = {
        "format": FORMAT,
        "version": 3 if is_new else 1 if is_simple else 2,
        "n_vertices": mesh.n_vertices,
        "n_faces": mesh.n_faces,
        **more,
    }
    if view is not None:
        header["view"] = dict(view)
    arrays = {"mesh_vertices": mesh.vertices, "mesh_faces": mesh.faces, **arrays}
    saved = list[dict[str, Any]]()
    for k, (name, each) in enumerate(state.saved):
        if each.pose is None or has_cages(state, each):  # with the handles of the session
            more, posed = pose_parts(in_pose(session.poses, replace(state, saved=()), each))
            more["volumes"] = dict(each.options.volumes)
        else:
            own, posed = state_parts(each)
            more = {"state": own}
        saved.append({"name": name, **more})
        arrays |= {f"saved_{k}_{key}": array for key, array in posed.items()}
    if saved:
        header["saved_poses"] = saved
    if any("rigid_in_pose" in each for each in (header, *saved)):
        header["version"] = 4
    if any("state" in each for each in saved):
        header["version"] = 5
    if state.carried:  # optional: earlier versions ignore them
        header["carried"] = [[each.name, len(each.content)] for each in state.carried]
        contents = (np.frombuffer(each.content, np.uint8) for each in state.carried)
        arrays |= {f"carried_{k}": content for k, content in enumerate(contents)}
    if given is not None:
        imported("vtk_segdeform.session.surface_store")  # imports pyvista
        from .surface_store import surface_parts

        header["surface"], more = surface_parts(given)
        arrays |= more
    write_archive(file, header, arrays)


def _read(archive: Archive) -> tuple[Mesh | Surface, State]:
    header = _checked_header(archive.header())
    n = field(header, "n_vertices", whole)
    mesh = Mesh(
        archive.array("mesh_vertices", "f", (n, 3)),
        archive.array("mesh_faces", "i", (field(header, "n_faces", whole), 3)),
    )
    state, saved = read_state(archive, header, mesh), list[tuple[str, State]]()
    cages = [cage.n_vertices for cage in state.cages]
    sizes = {name: len(ids) for name, ids in state.handles.items()}
    listed = header.get("saved_poses", [])
    for k, each in enumerate(list_of(map_of(anything))(listed, "saved_poses")):
        within = archive.within(f"saved_{k}_")
        if "state" in each:
            posed = read_state(within, field(each, "state", map_of(anything)), mesh)
        else:
            volumes = field(each, "volumes", map_of(anything))
            posed = replace(
                state,
                pose=read_pose(within, each, cages, sizes, n_vertices=n),
                fixed_at=read_places(within, each, len(state.fixed)),
                options=replace(state.options, volumes=tuple(volumes.items())),
                locality=None,
            )
        saved.append((field(each, "name", text), posed))
    files = header.get("carried", [])
    carried = tuple(
        CarriedFile(name, archive.array(f"carried_{k}", "u1", (size,)).tobytes())
        for k, (name, size) in enumerate(list_of(row_of(text, whole))(files, "carried"))
    )
    state = replace(state, saved=tuple(saved), carried=carried)
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
