"""The landmarks of a session: named points of the mesh at rest, and where each of them is to be.

A fit to them is the pose x of `fit_landmarks`, kept like one that was finished: the cages are those
that are nearest to it.  Where the body may grow, its new volume becomes the goal, so that later
drags keep it.  In any pose, a landmark is where its nearest face at rest takes it,

    x_0 + c_1 e_1 + c_2 e_2 + c_3 n,        n normal to the edges e_1, e_2, |n|^2 = |e_1 x e_2|
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import FloatArray, IntArray, frozen
from ..checks import shown
from ..deformer import SurfaceTrack, checked_place, checked_point
from ..errors import ConstraintError
from ..landmarks import (
    LANDMARK_SUFFIXES,
    LEAST_PAIRS,
    LandmarkFit,
    Landmarks,
    fit_landmarks,
    read_landmarks,
    write_landmarks,
)
from ..mesh import SurfacePoint
from ..progress import Progress, part
from . import preparing, solving
from .handles import require_near, targets_at
from .poses import Poses
from .state import Finished, LandmarkSet, Pose, State, owned_landmarks
from .timeline import Timeline

_MOST = 10_000  # landmarks: a scan that was taken for a list of them has more points
_PREPARED, _FITTED = 0.3, 0.95  # of the progress of a fit


class FittedState(NamedTuple):
    """The result of `SessionLandmarks.fitted`."""

    state: State
    fit: LandmarkFit


class SessionLandmarks(Mapping[str, tuple[FloatArray, FloatArray]]):
    """The landmarks of a session by name, and edits of them.

    Each is a point of the mesh at rest and its target, (3,) float each, in the mesh's unit; NaN
    where it is not known yet.  Edits do not move the mesh.
    """

    SUFFIXES: ClassVar[frozenset[str]] = LANDMARK_SUFFIXES
    """Of files that hold landmarks only, which `read` takes beside those of surfaces."""

    def __init__(self, history: Timeline, poses: Poses) -> None:
        self._history, self._poses = history, poses
        self._own = history.state.landmarks
        self._places = {name: k for k, name in enumerate(self._own.names)}

    def __getitem__(self, name: str) -> tuple[FloatArray, FloatArray]:
        k = self._places[name]
        return self._own.source[k], self._own.target[k]

    def __iter__(self) -> Iterator[str]:
        return iter(self._places)

    def __len__(self) -> int:
        return len(self._places)

    def __repr__(self) -> str:
        return repr(tuple(self))

    def add(
        self, point: int | ArrayLike | SurfacePoint, target: ArrayLike, name: str | None = None
    ) -> str:
        """Add a landmark, or change the one called *name*; return its name.

        Parameters
        ----------
        point : int, (3,) float or SurfacePoint
            A vertex, or a point of the surface, given at rest: of a position, the nearest one.
        target : (3,) float
            Where it is to be.
        name : str, optional
            By default "landmark 1", "landmark 2", ...

        Raises
        ------
        ConstraintError
            If the name is invalid, there is no such point, or the target is too far away.
        """
        name = self.new_name if name is None else name
        self._step(f"set {name}", self._changed(name, target, point))
        return name

    @property
    def new_name(self) -> str:
        """The first unused name of "landmark 1", "landmark 2", ..."""
        numbers = range(1, len(self) + 2)
        return next(name for n in numbers if (name := f"landmark {n}") not in self)

    def move(
        self, name: str, target: ArrayLike, *, point: int | ArrayLike | SurfacePoint | None = None
    ) -> None:
        """Move the target of a landmark, as part of a drag, to be ended by ``commit``.

        With a *point*, as of `add`, there need not be such a landmark yet.
        """
        after = self._changed(name if point is not None else self._known(name), target, point)
        self._history.move(replace(self._history.state, landmarks=after), f"target of {name}")

    def remove(self, *names: str) -> None:
        """Remove one or more landmarks, in one undo step."""
        gone = {self._known(name) for name in names}
        if gone:
            label = names[0] if len(gone) == 1 else f"{len(gone)} landmarks"
            kept = np.array([name not in gone for name in self])
            left = tuple(name for name in self if name not in gone)
            own = self._own
            after = LandmarkSet(left, own.source[kept], own.target[kept], own.uncertainty[kept])
            self._step(f"remove {label}", after)

    def rename(self, name: str, new_name: str) -> None:
        """Rename a landmark; the order does not change."""
        self._known(name)
        if new_name != name:
            names = tuple(new_name if each == name else each for each in self)
            self._step(f"rename {name}", replace(self._own, names=names))

    def read(self, path: str | Path, *, targets: bool = False) -> tuple[str, ...]:
        """Add the landmarks of a file, or with *targets* their targets, in one undo step.

        Those of the same name as one that is there replace its point, or its target.

        Parameters
        ----------
        path : path
            As of `read_landmarks`: .csv, .mrk.json, .fcsv, .pp, or the points of a surface.
        targets : bool
            Whether its points are targets.

        Returns
        -------
        names : tuple of str
            The landmarks that are not complete: without a point, or without a target.

        Raises
        ------
        MeshError
            If it cannot be read, has no landmarks, or two of the same name.
        ConstraintError
            If it has too many, or a name is invalid.
        """
        found = read_landmarks(path)
        if len(found.names) > _MOST:
            raise ConstraintError(f"{path} has {len(found.names):,} points; the limit is {_MOST:,}")
        names = tuple(dict.fromkeys((*self, *found.names)))
        places, after = {name: k for k, name in enumerate(names)}, self._enlarged(names)
        rows, given = [places[name] for name in found.names], np.isfinite(found.uncertainty)
        (after.target if targets else after.source)[rows] = found.points
        after.uncertainty[np.array(rows)[given]] = found.uncertainty[given]
        what = "targets" if targets else "landmarks"
        self._step(f"load {what}", after)
        lacking = np.asarray(np.isnan(after.source + after.target).any(axis=1))
        return tuple(name for name, lacks in zip(names, lacking, strict=True) if lacks)

    def write(self, path: str | Path, *, targets: bool = False) -> None:
        """Write the landmarks, at rest, or with *targets* their targets, to a .csv file.

        Raises
        ------
        ConstraintError
            If there are none.
        ArgumentError
            If *path* has another ending.
        MeshError
            If it cannot be written.
        """
        own = self._own
        points = own.target if targets else own.source
        rows = np.flatnonzero(np.isfinite(points).all(axis=1))
        if not len(rows):
            raise ConstraintError(f"there are no {'targets' if targets else 'landmarks'} to write")
        names = tuple(own.names[k] for k in rows)
        write_landmarks(path, Landmarks(names, points[rows], own.uncertainty[rows]))

    @property
    def places(self) -> FloatArray:
        """(k, 3) float: where they are in the current pose; NaN without a point of the mesh."""
        own, poses, mesh = self._own, self._poses, self._poses.mesh
        known = np.flatnonzero(np.isfinite(own.source).all(axis=1))

        def attached() -> tuple[IntArray, FloatArray]:
            source = own.source[known]
            faces, _ = SurfaceTrack(mesh).nearest(source)
            origin, frames = _frames(mesh.vertices[mesh.faces[faces]])
            return faces, np.einsum("kij,kj->ki", np.linalg.pinv(frames), source - origin)

        found = np.full((len(self), 3), np.nan)
        if len(known):
            faces, shares = poses.memo.get("landmarks", (own.source,), attached)
            x = poses.vertices(self._history.state, live=self._history.drag is not None)
            origin, frames = _frames(x[mesh.faces[faces]])
            found[known] = origin + np.einsum("kij,kj->ki", frames, shares)
        return found

    @property
    def residuals(self) -> FloatArray:
        """(k,) float: their distances from their targets, in the mesh's unit; NaN without one."""
        return np.asarray(np.linalg.norm(self._own.target - self.places, axis=1))

    def fit(self, *, volume: str | float = "free", progress: Progress | None = None) -> LandmarkFit:
        """Let the mesh grow and bend to where its landmarks are at their targets, in one undo step.

        Contact is avoided if that is an option of the session.

        Parameters
        ----------
        volume : str or float
            As of `fit_landmarks`: "free", "keep", or a goal.
        progress : Progress, optional
            May cancel; then nothing changes.

        Returns
        -------
        fit : LandmarkFit
            Its ``moved`` moves other points along.

        Raises
        ------
        ConstraintError
            If fewer than three landmarks have targets, or *volume* is no goal.
        CageError
            If a landmark is too far from the mesh.
        """
        after, fit = self.fitted(volume, progress)
        self._history.step("fit landmarks", after)
        return fit

    def fitted(self, volume: str | float = "free", progress: Progress | None = None) -> FittedState:
        """Return the state after `fit`, and the fit, without changing the session.

        It may run in another thread.
        """
        state, poses, own = self._history.state, self._poses, self._own
        rows = np.flatnonzero(np.isfinite(own.source + own.target).all(axis=1))
        if len(rows) < LEAST_PAIRS:
            raise ConstraintError(
                f"a fit needs {LEAST_PAIRS} landmarks with targets or more; there are {len(rows)}"
            )
        if not poses.bindings.is_bound(state):
            ready = preparing.preparation(poses, state, part(progress, 0.0, _PREPARED))
            state = preparing.prepared(ready, state)
            preparing.adopt(poses, state.options, ready)
        fit = fit_landmarks(
            poses.mesh,
            own.source[rows],
            own.target[rows],
            uncertainty=np.nan_to_num(own.uncertainty[rows]),
            volume=volume,
            avoid_contact=state.options.avoid_contact,
            progress=part(progress, _PREPARED, _FITTED),
        )
        return FittedState(_in_fit(poses, state, frozen(fit.vertices.copy())), fit)

    def _changed(
        self, name: str, target: ArrayLike, point: int | ArrayLike | SurfacePoint | None
    ) -> LandmarkSet:
        """Return the landmarks, one of them, or one more, with another target and point."""
        mesh, place = self._poses.mesh, checked_point(target, "target")
        require_near(mesh, place, "coordinates of the target")
        after = self._enlarged(tuple(dict.fromkeys((*self, name))))
        k = self._places.get(name, len(self))
        after.target[k] = place
        if point is None:  # the same array, to which what is known of the others belongs
            return replace(after, source=self._own.source, target=frozen(after.target))
        after.source[k] = checked_place(mesh, point, "point").at(mesh.vertices)
        return owned_landmarks(mesh, after)

    def _enlarged(self, names: tuple[str, ...]) -> LandmarkSet:
        """Return the landmarks, and more of them up to *names*, with arrays of their own."""
        own, more = self._own, len(names) - len(self)
        source, target = (
            np.concatenate([each, np.full((more, 3), np.nan)]) for each in (own.source, own.target)
        )
        sigma = np.append(own.uncertainty, np.full(more, np.nan))
        return LandmarkSet(names, source, target, sigma)

    def _known(self, name: str) -> str:
        if not isinstance(name, str) or name not in self:
            names = ", ".join(map(repr, self))
            advice = f"the landmarks are {names}" if names else "add one first"
            raise ConstraintError(f"there is no landmark {shown(name)}; {advice}")
        return name

    def _step(self, label: str, landmarks: LandmarkSet) -> None:
        checked = owned_landmarks(self._poses.mesh, landmarks)
        self._history.commit()
        self._history.step(label, replace(self._history.state, landmarks=checked))


def _in_fit(poses: Poses, state: State, x: FloatArray) -> State:
    """Return *state* in the pose with the vertices *x* (n, 3), whose volume is its goal."""
    deformer, options = poses.bindings.bind(state), state.options
    p = solving.carried(poses, state, x)
    for vertices in p:
        frozen(vertices)
    offset = frozen(x - poses.surface(state, p))
    nothing = frozen(np.empty(0, dtype=np.int64)), frozen(np.empty((0, 3)))
    finished = Finished(x, *nothing, p, offset)
    pose = Pose(p, targets_at(state.handles, x), finished, state.stiffness)
    goals: tuple[tuple[str, str | float], ...] = ()
    if options.preserve_volume and poses.lids(state).has_volume:
        goals = (("whole", deformer.volume("whole", x)[0]),)
    after = replace(state.at_rest(), pose=pose, options=replace(options, volumes=goals))
    return replace(after, fixed_at=frozen(x[state.fixed]) if len(state.fixed) else None)


def _frames(corners: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the first of the *corners* (k, 3, 3) of faces, and (e_1, e_2, n) as columns."""
    one, other = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    normal = np.cross(one, other)
    size = np.sqrt(np.linalg.norm(normal, axis=1, keepdims=True))
    normal /= np.where(size > 0.0, size, 1.0)
    return corners[:, 0], np.stack([one, other, normal], axis=2)
