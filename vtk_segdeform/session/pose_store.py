"""The pose and the landmarks of a state in a file: parts of the header, and arrays."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ..arrays import FloatArray
from .archive import Archive, field, flag, list_of, text, whole
from .state import Finished, LandmarkSet, Pose, State, split_rows


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
    prefix: str = "",
) -> Pose | None:
    """Return the pose of a mesh of *n_vertices*, whose arrays begin with *prefix*.

    *cages* and *handles* are their numbers of vertices.
    """
    if not field(header, "posed", flag):
        return None
    total = sum(cages)
    places = split_rows(archive.array(f"{prefix}pose", "f", (total, 3)), cages)
    points = archive.array(f"{prefix}targets", "f", (sum(handles.values()), 3))
    targets = split_rows(points, list(handles.values()))
    finished = None
    if "n_finished_held" in header:
        held = field(header, "n_finished_held", whole)
        then = archive.array(f"{prefix}finished_cages", "f", (total, 3))
        finished = Finished(
            archive.array(f"{prefix}finished", "f", (n_vertices, 3)),
            archive.array(f"{prefix}finished_held", "i", (held,)),
            archive.array(f"{prefix}finished_shifts", "f", (held, 3)),
            tuple(split_rows(then, cages)),
            archive.array(f"{prefix}finished_offset", "f", (n_vertices, 3)),
        )
    stiffness = None
    if "rigid_in_pose" in header and field(header, "rigid_in_pose", flag):
        stiffness = archive.array(f"{prefix}pose_stiffness", "f", (n_vertices,))
    return Pose(tuple(places), dict(zip(handles, targets, strict=True)), finished, stiffness)


def read_places(
    archive: Archive, header: dict[str, Any], n_fixed: int, *, prefix: str = ""
) -> FloatArray | None:
    """Return where fixed vertices stay in a pose; None at rest."""
    if "fixed_in_pose" not in header or not field(header, "fixed_in_pose", flag):
        return None
    return archive.array(f"{prefix}fixed_at", "f", (n_fixed, 3))  # type: ignore[no-any-return]


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
