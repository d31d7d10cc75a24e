"""Experiments of `segdeform bench` at tiny sizes: their results, not their times."""

from __future__ import annotations

import math
import sys
from dataclasses import replace

import numpy as np
import pytest

from vtk_segdeform.benchmarks import (
    batching,
    constrained,
    drags,
    felt,
    mechanisms,
    paper,
    peers,
    report,
)
from vtk_segdeform.benchmarks.results import Scale, Section, Table
from vtk_segdeform.benchmarks.tasks import Hand, bent_cactus
from vtk_segdeform.errors import MissingDependencyError
from vtk_segdeform.models import random_limbs
from vtk_segdeform.session import Session
from vtk_segdeform.widgets.handle_dragger import STEPS

TINY = Scale(
    "tiny", paper_size=500, n_cage_vertices=60, drag_sizes=(600,), repeats=1, regions=(2,),
    peer_sizes=(500,), mechanism_bodies=1, batch=(2, 2, 600),
)  # fmt: skip


@pytest.fixture(scope="module")
def task():
    return bent_cactus(500)


@pytest.fixture(autouse=True)
def without_peers(monkeypatch):
    """Hide libigl and the benchmark poses, and run everything in this process."""
    monkeypatch.setitem(sys.modules, "igl", None)
    monkeypatch.delenv("SEGDEFORM_DATA", raising=False)
    for module in (constrained, felt, peers, report):
        monkeypatch.setattr(module, "warm_up", lambda: None)
    for module in (constrained, felt, peers):
        monkeypatch.setattr(module, "in_own_process", lambda work, *given: work(*given))


@pytest.fixture(scope="module")
def body():
    """Return a hand on a small body, and a preparation of the body."""
    mesh = random_limbs(600, 1)
    return Hand.on(mesh), Session(mesh).preparation()


def test_the_hand_turns_back_flicks_and_hesitates():
    for is_short in (False, True):
        turns, aside = zip(*drags.hand(is_short=is_short), strict=True)
        ways = np.diff([0.0, *turns])
        assert len(set(np.sign(ways))) == 3
        assert np.abs(ways).max() > 3 * np.median(np.abs(ways))
        rests = np.flatnonzero((ways == 0.0) & (np.arange(len(ways)) > 0))
        assert len(rests) == 13  # ten of the hesitation, and one at each turn
        assert all((aside[k] == aside[k - 1]).all() for k in rests)


@pytest.mark.parametrize("pulls", [False, True])
def test_a_drag_calls_the_session_as_the_widgets_do(monkeypatch, body, pulls):
    own, preparation = body
    calls = []
    for name in ("drag", "pull", "refine"):
        known = getattr(Session, name)

        def call(self, *given, known=known, name=name, **options):
            calls.append((name, options["max_steps"]))
            return known(self, *given, **options)

        monkeypatch.setattr(Session, name, call)
    session = drags.ready(preparation, own, handle=not pulls)
    goals = drags.way_of_tip(session, own) if pulls else drags.way_of_handle(own)
    pulled = own.point if pulls else None
    frames = list(drags.frames(session, [*goals[:6], *6 * [goals[6]]], pulled))
    names = [name for name, _ in calls]
    assert names[:7] == 7 * ["pull" if pulls else "drag"]
    assert set(names[7:]) == {"refine"}  # until it has settled
    assert len(names) == len(frames) < 12
    assert not session.is_unsettled
    assert {most for _, most in calls} == {STEPS}
    if pulls:
        np.testing.assert_allclose(own.point.at(session.vertices), goals[6], atol=1e-4)


def test_what_a_drag_feels_like_is_measured(monkeypatch, body):
    own, preparation = body
    path = drags.hand(is_short=True)[::4]
    monkeypatch.setattr(drags, "hand", lambda **_: path)
    monkeypatch.setattr(felt, "_CHECKED", 4)
    session = drags.ready(preparation, own, handle=True)
    drag = felt.dragged(session, own, preparation, pulls=False)
    count = len(drag.steps)
    assert len(drag.seconds) == len(drag.jumps) == len(drag.volumes) == count >= len(path) - 3
    assert len(drag.shapes) == count // 4
    assert 0.0 < drag.felt[0] <= drag.felt[1] <= drag.felt[2] == max(drag.seconds[1:])
    assert 0.0 <= drag.each("away").max() < 1e-2
    assert 0.5 < drag.jump < 10.0
    assert not drag.each("folds").any()
    assert max(drag.volumes) < 1e-12


def test_how_far_a_pose_is_from_the_converged_one_is_seen(body):
    """One step of the paper's method leaves it far away."""
    own, preparation = body
    session = drags.ready(preparation, own, handle=True)
    session.drag(own.targets(0.3), max_steps=1)
    away = np.linalg.norm(drags.converged(session, preparation) - session.vertices, axis=1).max()
    drags_on = session.refine(max_steps=200)
    there = np.linalg.norm(drags.converged(session, preparation) - drags_on.vertices, axis=1).max()
    assert away > 1e-3 * own.mesh.diagonal
    assert there < 1e-5 * own.mesh.diagonal


def test_the_measures_of_a_pose_find_its_faults(body):
    own, preparation = body
    session = drags.ready(preparation, own, handle=True)
    solution = session.drag(own.targets(0.0))
    rest = drags.Shape.of(own.mesh, solution)
    assert max(rest.error, rest.distortion, rest.worst, rest.detail) < 1e-6
    x = np.array(solution.vertices)
    face = own.mesh.faces[0]
    x[face[0]] += 0.05 * own.mesh.diagonal * np.array([0.0, 0.0, 1.0])
    spike = drags.Shape.of(own.mesh, replace(solution, vertices=x))
    assert spike.worst > 0.3
    assert spike.worst > 3 * spike.distortion
    assert spike.detail > 1.0


@pytest.mark.campaign
def test_each_constraint_of_the_comparison_is_at_work():
    sessions = constrained.begun(300, 40)
    poses, volumes = {}, {}
    for name, (own, session) in sessions.items():
        poses[name] = session.drag(own.targets(0.4)).vertices
        volumes[name] = session.volumes()
    rest = sessions["none"][1].deformer.volumes()
    without = poses.pop("none"), poses.pop("avoiding contact")  # nothing comes into contact
    np.testing.assert_allclose(*without, atol=1e-6)
    apart = [np.abs(x[: len(without[0])] - without[0]).max() for x in poses.values()]
    assert min(apart) > 1e-4
    assert abs(volumes["none"]["body 1"] / rest["body 1"] - 1.0) > 1e-4
    for name in ("three volumes", "seven volumes"):
        assert volumes[name]["body 1"] == pytest.approx(rest["body 1"], rel=1e-12)


def test_what_a_mechanism_improves_is_told_from_noise():
    equal = dict.fromkeys(mechanisms.QUANTITIES, (1.0, 1.0))
    assert not mechanisms.improves(equal)
    assert not mechanisms.improves({**equal, "time": (1.0, 1.04), "away": (1e-5, 9e-5)})
    for better in ({"time": (1.0, 1.06)}, {"folds": (0.0, 1.0)}, {"away": (1e-5, 2e-4)}):
        assert mechanisms.improves({**equal, **better})
    assert not mechanisms.improves({**equal, "steps": (1.0, 9.0)})


def test_a_bend_in_other_units_is_a_task_of_the_same_shape(task):
    scaled = paper.in_units(task, 100.0)
    assert scaled.mesh.diagonal == pytest.approx(100.0)
    factor = 100.0 / task.mesh.diagonal
    np.testing.assert_allclose(scaled.targets, factor * task.targets)
    at_rest = replace(scaled, targets=scaled.mesh.vertices[scaled.handle])
    still = paper.bend(paper.printed(scaled, 1, 60), at_rest)
    assert (still.steps, still.early) == (1, still.volume_change)
    assert still.handle_error < 1e-9
    assert still.distortion < 1e-6


@pytest.mark.campaign
def test_batches_are_measured(monkeypatch):
    monkeypatch.setenv("SEGDEFORM_CACHE", "")  # restored, since it changes
    monkeypatch.setattr(batching, "_LARGE", 700)
    monkeypatch.setattr(batching, "in_own_process", lambda work, *given: work(*given))
    (table,) = batching.run(TINY).tables
    found = dict(table.rows)
    assert found["same bytes"] == "yes"
    assert found["poses without vertices"] == 0
    assert found["largest volume change"] < 1e-12
    assert found["bytes of a pose"] % 24 == 0
    assert found["bytes of the file for each pose"] > found["bytes of a pose"]
    assert found["one process / two"] == found["one process, s"] / found["two processes, s"]


def test_iterations_end_near_their_limit_and_not_where_they_are_slow():
    goal, near = np.ones((1, 3)), 1e-4
    for rate in (0.5, 0.99):
        pose, count = peers.iterate_to_convergence(
            np.zeros((1, 3)), near, 5000, lambda x, rate=rate: goal + rate * (x - goal)
        )
        assert np.linalg.norm(pose - goal) <= 1.01 * near
        assert count == pytest.approx(np.log(near / np.sqrt(3.0)) / np.log(rate), abs=1.0)


@pytest.mark.campaign  # a peer, not this package
def test_libigl_runs_until_it_has_converged(monkeypatch, task):
    monkeypatch.undo()
    pytest.importorskip("igl")
    rows = []
    for most in (5000, 20_000):
        monkeypatch.setattr(peers, "_MOST_ITERATIONS", most)
        rows.append(dict(zip(peers._COLUMNS[1:], peers.arap(task), strict=True)))
    assert rows[0]["iterations"] < 5000
    assert rows[0]["handle error"] < 1e-12
    for name in ("iterations", "volume change", "distortion"):
        assert rows[0][name] == rows[1][name]


def test_the_report_has_each_section_and_what_was_not_measured(tmp_path, monkeypatch):
    def found(scale, progress):
        return Section("Trial", scale.name, [Table(("a", "b"), [("x", 1.5)], "two")], ["c: no"])

    def fails(scale, progress):
        raise MissingDependencyError("no peers here")

    monkeypatch.setattr(report, "EXPERIMENTS", {"trial": found, "lost": fails})
    report.write_report(tmp_path, TINY)
    text = (tmp_path / "report.md").read_text()
    assert "## Trial\n\ntiny\n\n*two*\n\n| a | b |" in text
    assert "| x | 1.5 |" in text
    assert "- Not measured: c: no" in text
    assert "- Not measured: all of lost: no peers here" in text


def test_numbers_of_a_column_have_one_notation_unless_the_table_is_mixed():
    rows = [("free", 0.02, 3.0), ("exact", -3e-16, 4.0), ("unknown", None, math.nan)]
    table = Table(("case", "volume change", "steps"), rows, "title")
    lines = table.markdown().splitlines()[4:]
    assert lines == ["| free | 2.0e-02 | 3 |", "| exact | -3.0e-16 | 4 |", "| unknown | – | – |"]
    mixed = replace(table, mixed=True).markdown().splitlines()[4:6]
    assert mixed == ["| free | 0.02 | 3 |", "| exact | -3.0e-16 | 4 |"]
    assert Table(("a", "b"), [], "empty").markdown().count("---:") == 2
