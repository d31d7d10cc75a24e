"""The steps of a session, and of the ones before and after it: a repaired copy is another session.

    opened, set fixed vertices, repair    steps of the original; the last one changes nothing there
                                opened, pull    steps of its repaired copy
    opened, set fixed vertices, repair, pull    the history of both

A step of the original in place of its last one replaces the copy.  The label of a step says what it
did, where, and by how much: "pull left hand, 4.1".
"""

from __future__ import annotations

import re
from collections.abc import Callable
from weakref import WeakKeyDictionary

import numpy as np

from vtk_segdeform.arrays import FloatArray
from vtk_segdeform.geometry import rigid_fit
from vtk_segdeform.session import Session, State, pulls, region_name

_REPAIR = "repair"
_AUTOMATIC = re.compile(r"(pull|pin) \d+")  # names of handles that tell nothing
_known: WeakKeyDictionary[State, tuple[State, str, str]] = WeakKeyDictionary()


class SessionHistory:
    """The history of the current session, with those of the sessions before and after it.

    Parameters
    ----------
    session : Session
        The only one, at first.
    enter : callable
        ``enter(session)``, called to edit another one.
    """

    def __init__(self, session: Session, enter: Callable[[Session], object]) -> None:
        self._enter = enter
        self.begin(session)

    def begin(self, session: Session) -> None:
        """Start over with *session* as the current one."""
        self._sessions, self._current = [session], 0

    def repaired(self, session: Session) -> None:
        """Enter *session*, a repaired copy of the current one, by a step."""
        steps = self._sessions[self._current].history
        steps.move(steps.state)
        steps.commit(_REPAIR)
        self._current += 1
        self._sessions[self._current :] = [session]
        self._enter(session)

    @property
    def labels(self) -> tuple[str, ...]:
        """What led to each state, the oldest first; see `step_texts`."""
        first, *others = map(step_texts, self._linked)
        return first + tuple(label for labels in others for label in labels[1:])

    @property
    def position(self) -> int:
        """The index of the current state in `labels`."""
        before, now = self._sessions[: self._current], self._sessions[self._current]
        return sum(map(_n_steps, before)) + now.history.position

    @property
    def undo_label(self) -> str | None:
        """The label of the step to undo, or None."""
        return self.labels[self.position] if self.position else None

    @property
    def redo_label(self) -> str | None:
        """The label of the step to redo, or None."""
        return next(iter(self.labels[self.position + 1 :]), None)

    def own(self, position: int) -> int | None:
        """Return the *position* in the current session; None if that state is of another one."""
        k, own = self._find(position)
        return own if k == self._current else None

    def jump(self, position: int) -> None:
        """Undo or redo as many steps as lead to the state at *position*, of whichever session."""
        k, own = self._find(position)
        if k != self._current:
            self._current = k
            self._enter(self._sessions[k])
        self._sessions[k].history.jump(own)

    @property
    def _linked(self) -> list[Session]:
        """The sessions, without those whose originals have other last steps now."""
        end = self._current + 1
        while end < len(self._sessions) and self._sessions[end - 1].history.labels[-1] == _REPAIR:
            end += 1
        return self._sessions[:end]

    def _find(self, position: int) -> tuple[int, int]:
        """Return the index of the session with a state, and the position of the state in it."""
        *originals, _ = self._linked
        for k, session in enumerate(originals):
            if position < _n_steps(session):
                return k, position
            position -= _n_steps(session)
        return len(originals), position


def _n_steps(session: Session) -> int:
    return len(session.history.labels) - 1


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
