"""What each step of a session did, where, and by how much: "pull left hand, 4.1"."""

from __future__ import annotations

import re
from weakref import WeakKeyDictionary

import numpy as np

from vtk_segdeform.arrays import FloatArray
from vtk_segdeform.geometry import rigid_fit
from vtk_segdeform.session import Session, State, pulls, region_name

_AUTOMATIC = re.compile(r"(pull|pin) \d+")  # names of handles that tell nothing
_known: WeakKeyDictionary[State, tuple[State, str, str]] = WeakKeyDictionary()


def step_texts(session: Session) -> tuple[str, ...]:
    """Return the labels of all states, the oldest first, with the place and size of each step."""
    labels, texts, before = session.history.labels, list[str](), None
    for position, label in enumerate(labels):
        after = session.history.state_at(position)
        if before is None:
            texts.append(label)
        else:
            known = _known.get(after)
            if known is None or known[0] is not before or known[1] != label:
                known = _known[after] = before, label, _text(session, label, before, after)
            texts.append(known[2])
        before = after
    return tuple(texts)


def _text(session: Session, label: str, before: State, after: State) -> str:
    verb = label.partition(" ")[0]
    if label == "pin":
        new = [name for name in after.handles if name not in before.handles]
        return f"{label} {_place(session, after, new[0])}" if new else label
    if label.startswith("set the volume of"):
        goals = [str(goal) for name, goal in after.options.volumes
                 if dict(before.options.volumes).get(name) != goal]  # fmt: skip
        return ", ".join([label, *goals])
    if verb not in ("pull", "drag", "rotate") or after.pose is None:
        return label
    moved = list[tuple[float, str]]()
    for name, points in after.pose.targets.items():
        start = _start(session, name, before, after)
        if label == f"rotate {name}":
            cosine = 0.5 * np.trace(rigid_fit(start, points)[0]) - 0.5
            return f"{label}, {np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))):.3g}°"
        if label == f"drag {name}":
            return f"{label}, {np.linalg.norm((points - start).mean(axis=0)):.3g}"
        moved.append((float(np.linalg.norm(points - start, axis=1).max()), name))
    if label == "pull" and moved:
        distance, name = max(moved)
        return f"pull {_place(session, after, name)}, {distance:.3g}"
    return label


def _start(session: Session, name: str, before: State, after: State) -> FloatArray:
    """Return where the vertices of a handle of *after* were in *before*, (k, 3)."""
    ids, pose = after.handles[name], before.pose
    is_old = name in before.handles and np.array_equal(before.handles[name], ids)
    if pose is not None and is_old:
        return pose.targets[name]
    vertices = session.poses.peek(before)
    return np.asarray((session.mesh.vertices if vertices is None else vertices)[ids])


def _place(session: Session, state: State, name: str) -> str:
    """Return the name of a handle if it was given by a person, or else of the region there."""
    if not _AUTOMATIC.fullmatch(name) or state.regions is None:
        return name
    vertex = pulls.middle_vertex(session.mesh, state.handles[name])
    return region_name(state.region_names, state.regions.label_at(vertex))
