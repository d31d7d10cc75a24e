"""Rigid parts, slides, symmetry and three volumes at once, in random sessions."""

from __future__ import annotations

import numpy as np
import pytest
from limbed import torso

import vtk_segdeform as sd
from vtk_segdeform.deformer import Mirror, Stiffness
from vtk_segdeform.geometry import rigid_fit

BODY = torso(3)
X, SIZE = BODY.vertices, BODY.diagonal
MIRROR = Mirror.of(BODY, "x")
FOOT = np.flatnonzero((X[:, 2] < -1.3) & (X[:, 0] < 0.0))
FEET = np.concatenate([FOOT, MIRROR.mates[FOOT]])
STIFFNESS = np.where((X[:, 0] > 0.8) & (X[:, 0] < 1.4), np.inf, 1.0)
RIGID = Stiffness.of(BODY, STIFFNESS, MIRROR).rigid
# A handle takes precedence over a slide, and two handles in a rigid part can contradict it.
PULLED = np.setdiff1d(np.arange(len(X)), np.concatenate([*RIGID, FEET]))


class Random:
    """A session to which random events happen, one after the other."""

    def __init__(self, seed: int) -> None:
        self.rng = np.random.default_rng(seed)
        self.finished = self.unfinished = 0
        self.count = dict.fromkeys(("drag", "pull", "undo", "redo", "volume"), 0)
        self.worst = dict.fromkeys(("mirror", "rigid", "slide", "volume"), 0.0)

    def begin(self) -> None:
        """Begin a new session; pulls leave handles, which would fill the surface."""
        self.session = session = sd.Session(BODY)
        self.failed = []  # poses of the cages, which could not be finished
        labels = np.digitize(X[:, 2], [-0.5, 0.8])
        session.set_regions(sd.Regions.from_labels(BODY, labels, overlap=1))
        session.change_options(n_cage_vertices=70)
        session.fit_cages()
        session.change_options(symmetry="x", volumes={"whole": "free"})
        session.set_stiffness(STIFFNESS)
        session.set_slides([sd.Slide(FOOT, "plane", (0.0, 0.0, 1.0))])
        session.handles.add(np.flatnonzero(X[:, 0] > 1.6), "hand")
        session.handles.add(np.flatnonzero(X[:, 2] > 1.5), "head")
        self.rest = session.volumes()

    def act(self) -> None:
        """Let one event happen, and measure the finished pose."""
        kind = self.rng.choice(list(self.count), p=[0.4, 0.2, 0.15, 0.1, 0.15])
        if getattr(self, f"_{kind}")():
            self.count[kind] += 1
        self.measure()

    def _drag(self) -> bool:
        name, motion = str(self.rng.choice(["hand", "head"])), np.eye(4)
        by = 0.25 * self.rng.normal(size=3)
        for share in (0.5, 1.0):
            motion[:3, 3] = share * by
            self.session.move_handle(name, motion, max_steps=8)
        return self._finished()

    def _pull(self) -> bool:
        vertex = int(self.rng.choice(PULLED))
        to = self.session.vertices[vertex] + 0.1 * self.rng.normal(size=3)
        try:
            self.session.pull(vertex, to, max_steps=8)
        except sd.errors.SegDeformError:  # a handle is there
            self.session.revert()
            return False
        return self._finished()

    def _volume(self) -> bool:
        name = str(self.rng.choice(["whole", "region 0", "region 2"]))
        self.session.set_volume(name, self.rest[name] * self.rng.uniform(0.9, 1.1))
        return self._finished()

    def _finished(self) -> bool:
        self.session.commit()
        self.session.refine()
        if not self.session.finish().is_finished:
            self.failed.append(self.session.state.pose.finished)
        return True

    def _undo(self) -> bool:
        return self.session.state.pose is not None and self.session.undo() is not None

    def _redo(self) -> bool:
        return self.session.redo() is not None

    def measure(self) -> None:
        """Keep what is farthest from kept so far, in all finished poses."""
        pose = self.session.state.pose
        if pose is None or pose.finished is None:
            return
        if any(pose.finished is each for each in self.failed):
            self.unfinished += 1
            return
        self.finished += 1
        x = self.session.vertices
        u, worst = x - X, self.worst
        worst["mirror"] = max(worst["mirror"], np.abs(u - MIRROR.mirrored(u)).max() / SIZE)
        worst["slide"] = max(worst["slide"], np.abs(u[FEET, 2]).max() / SIZE)
        for ids in RIGID:
            turn, shift = rigid_fit(X[ids], x[ids])
            off = np.abs(X[ids] @ turn.T + shift - x[ids]).max() / SIZE
            worst["rigid"] = max(worst["rigid"], off)
        now = self.session.volumes()
        for name, goal in self.session.options.volumes:
            if goal != "free":
                worst["volume"] = max(worst["volume"], abs(now[name] / goal - 1.0))


@pytest.mark.campaign  # test_stiffness_slides_symmetry has such a session every day
def test_random_events_keep_all_of_them_in_every_finished_pose():
    seed, count = 2, 10_000
    happening = Random(seed)
    for k in range(count):
        if k % 40 == 0:
            happening.begin()
        happening.act()
    print(f"seed {seed}: {happening.count}; at most {happening.worst}")
    print(f"{happening.finished} finished poses, {happening.unfinished} that cannot be finished")
    assert min(happening.count.values()) > 0
    assert happening.finished > count / 2
    assert happening.unfinished < count / 100
    assert happening.worst["volume"] <= 1e-12
    for name in ("mirror", "rigid", "slide"):
        assert happening.worst[name] <= 1e-9
