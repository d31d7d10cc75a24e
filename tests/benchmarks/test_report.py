"""Experiments of `segdeform bench` at tiny sizes: their results, not their times."""

from __future__ import annotations

import json
import math
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from vtk_segdeform.benchmarks import (
    browser,
    charts,
    drags,
    experiments,
    felt,
    history,
    mechanisms,
    paper,
    peers,
    programs,
    report,
)
from vtk_segdeform.benchmarks.bodies import Hand
from vtk_segdeform.benchmarks.scale import Scale
from vtk_segdeform.benchmarks.sections import Figure, Ratio, Section, Table
from vtk_segdeform.benchmarks.tasks import bent_cactus
from vtk_segdeform.errors import ArgumentError, MissingDependencyError
from vtk_segdeform.models import random_limbs
from vtk_segdeform.session import Session

TINY = Scale(
    "tiny", paper_size=500, n_cage_vertices=60, drag_sizes=(600,), repeats=1, regions=(2,),
    peer_sizes=(500,), most_iterations=100, own_process=False,
)  # fmt: skip


@pytest.fixture(scope="module")
def task():
    return bent_cactus(500)


@pytest.fixture(autouse=True)
def without_peers(monkeypatch):
    """Hide optional programs and the benchmark poses."""
    for name in ("igl", "open3d", "bpy"):
        monkeypatch.setitem(sys.modules, name, None)
    monkeypatch.delenv("SEGDEFORM_DATA", raising=False)
    for module in (felt, peers, report):
        monkeypatch.setattr(module, "warm_up", lambda: None)


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
    assert calls[0][1] == 3
    assert all(3 <= most <= 8 for _, most in calls)
    if pulls:
        np.testing.assert_allclose(own.point.at(session.vertices), goals[6], atol=1e-4)


def test_what_a_drag_feels_like_is_measured(monkeypatch, body):
    own, preparation = body
    path = drags.hand(is_short=True)[::4]
    monkeypatch.setattr(drags, "hand", lambda **_: path)
    monkeypatch.setattr(drags, "_CHECKED", 4)
    session = drags.ready(preparation, own, handle=True)
    record = drags.Record(session, preparation, 4)
    for k, frame in enumerate(drags.frames(session, drags.way_of_handle(own), None)):
        record.add(replace(frame, jump=7.0) if k == 5 else frame)
    drag = record.drag
    assert drag.first > 0.0
    assert 0.0 < drag.felt[0] <= drag.felt[1] <= drag.felt[2] == drag.times.max()
    assert 0.0 <= drag.away.max() < 1e-2
    assert (drag.jump, drag.folds) == (7.0, 0)
    assert drag.volume < 1e-12


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
def test_the_report_of_drags_has_limits_and_names_arap_when_it_is_absent():
    section = felt.run(TINY)
    set_up, frames = section.tables
    assert set_up.column("vertices") == [600, 600]
    assert min(set_up.column("total")) > 0.0
    assert frames.column("drag") == 2 * ["handle", "handle, avoiding contact", "pull"]
    for name in ("first, ms", "median", "longest", "away", "jump"):
        assert all(math.isfinite(each) and each >= 0.0 for each in frames.column(name))
    assert all(math.isnan(each) for each in frames.column("median / ARAP"))
    assert len(section.skipped) == 2
    verdicts = {r.what.rpartition(": ")[2]: r.verdict for r in section.ratios}
    assert verdicts["volume change"] == "met"


def test_frames_are_limited_and_drawn_beside_iterations_of_arap():
    drag = drags.Drag(
        1.0, np.array([0.5, 0.5, 3.0]), np.ones(4), np.zeros(1), 1.0, 0.0, 0.0, 0.0, 0.0, 0, 0.0
    )
    drags_of = {"handle": drag, "pull": replace(drag, times=2.0 * drag.times)}
    found = felt.Felt("cactus", 5430, 1.0, 1.0, 1.0, drags_of, 1.0, "")
    assert felt.lines([found]) == {
        "handle, median": [500.0], "handle, longest": [3000.0],
        "pull, median": [1000.0], "pull, longest": [6000.0], "ARAP iteration": [1000.0],
    }  # fmt: skip
    ratios = [ratio for ratio in felt._ratios([found]) if "handle" in ratio.what]
    verdicts = {r.what.rpartition(": ")[2]: r.verdict for r in ratios}
    assert verdicts["median frame / ARAP"] == "met"
    assert verdicts["95 % frame / ARAP"] == "**not met**"
    assert verdicts["longest frame / ARAP"] == "met"


def test_what_a_mechanism_improves_is_told_from_noise():
    equal = dict.fromkeys(mechanisms.QUANTITIES, (1.0, 1.0))
    assert not mechanisms.improves(equal)
    assert not mechanisms.improves({**equal, "time": (1.0, 1.04), "away": (1e-5, 9e-5)})
    for better in ({"time": (1.0, 1.06)}, {"folds": (0.0, 1.0)}, {"away": (1e-5, 2e-4)}):
        assert mechanisms.improves({**equal, **better})
    assert not mechanisms.improves({**equal, "steps": (1.0, 9.0)})


@pytest.mark.campaign
def test_the_tables_of_the_paper_have_its_numbers_beside_ours():
    section = paper.run(replace(TINY, regions=(1, 3)))
    first, second, units, ours = section.tables
    assert first.columns[1:] == (
        "one cage", "three regions", "paper: one cage", "paper: three regions",
    )  # fmt: skip
    rows = {row[0]: row[1:] for row in first.rows}
    assert rows["cage vertices"] == (60, 60, 155, 155)
    assert rows["step, s"][2:] == (0.55, 0.2)
    assert rows["non-zeros of W"][:2] == tuple(second.column("non-zeros of W"))
    assert rows["steps of the bend"][:2] == tuple(second.column("steps of the bend"))
    assert rows["non-zeros of W"][0] > rows["non-zeros of W"][1]
    assert units.column("diagonal, units") == [1.0, 10.0, 100.0, 1000.0]
    errors = units.column("handle error, diagonals")
    assert errors[0] > 100 * errors[2]  # rows (5) outweigh (7) in small units
    printed, exact = rows["its volume change, %"], ours.rows[-1]
    assert exact[0] == "its volume change, %"
    assert max(map(abs, exact[1:])) <= 1e-10 < abs(printed[1])
    assert len(section.ratios) == 5


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
def test_only_the_case_that_lets_the_volume_go_changes_it(monkeypatch, task):
    cases = {"preserved": (3, {}), "not preserved": (3, {"preserve_volume": False})}
    monkeypatch.setattr(experiments, "figures_of", lambda _: {"figure 7": (task, cases)})
    section = experiments.run(TINY)
    changes = dict(
        zip(*(section.tables[0].column(name) for name in ("case", "volume change")), strict=True)
    )
    assert abs(changes["preserved"]) <= 1e-12
    assert abs(changes["not preserved"]) > 1e-3
    assert len(section.figures) == len(section.tables) == 1


@pytest.mark.campaign
def test_peers_that_are_absent_are_named_with_a_reason():
    section = peers.run(TINY)
    (table,) = section.tables
    assert table.column("method") == [
        "vtk_segdeform, three regions",
        "vtk_segdeform, one cage",
    ]
    assert all(abs(change) < 1e-10 for change in table.column("volume change"))
    told = "\n".join(section.skipped)
    for name in ("libigl ARAP", "Open3D ARAP", "Blender Laplacian Deform", "Botsch-Sorkine"):
        assert name in told


def test_iterations_end_near_their_limit_and_not_where_they_are_slow():
    goal, near = np.ones((1, 3)), 1e-4
    for rate in (0.5, 0.99):
        pose, count = programs.iterate_to_convergence(
            np.zeros((1, 3)), near, 5000, lambda x, rate=rate: goal + rate * (x - goal)
        )
        assert np.linalg.norm(pose - goal) <= 1.01 * near
        assert count == pytest.approx(np.log(near / np.sqrt(3.0)) / np.log(rate), abs=1.0)
        pose, _, doubled = programs.double_to_convergence(
            near, 5000, lambda count, rate=rate: (goal * (1.0 - rate**count), 0.0)
        )
        assert np.linalg.norm(pose - goal) <= near
        assert doubled >= count


def test_libigl_runs_until_it_has_converged(monkeypatch, task):
    monkeypatch.undo()
    pytest.importorskip("igl")
    answer, further = (programs.libigl_arap(task, most) for most in (5000, 20_000))
    assert answer.iterations < 5000
    assert np.abs(answer.vertices[task.handle] - task.targets).max() < 1e-12
    np.testing.assert_array_equal(answer.vertices, further.vertices)


def test_the_report_says_what_breaks_a_limit_and_what_could_not_be_drawn(tmp_path, monkeypatch):
    def draw(path):
        raise MissingDependencyError("no plots here")

    def found(scale, progress):
        ratios = [Ratio("fast", 2.0, 1.0), Ratio("gain", 3.0, 2.0, at_most=False)]
        figures = [Figure("lost.png", "lost", draw)]
        table = Table(("a", "b"), [("x", 1.5)])
        return Section("Trial", tables=[table], ratios=ratios, figures=figures)

    monkeypatch.setattr(report, "EXPERIMENTS", {"trial": found})
    report.write_report(tmp_path, TINY)
    text = (tmp_path / "report.md").read_text()
    assert "1 of 2 measured limits are met" in text
    assert "| fast | 2 | ≤ 1 | **not met** |" in text
    assert "lost.png was not drawn: no plots here" in text
    assert "![" not in text


def test_frames_in_the_browser_are_compared_with_those_in_process(monkeypatch):
    runs = iter([11.0, 30.0, 35.0, 30.0, 12.0, 30.0])  # by the server and by the page

    def in_browser(*_, draws):
        return browser.Drag(next(runs), (20.0, 40.0) if draws else (50.0, 90.0))

    monkeypatch.setattr(browser, "_in_browser", in_browser)
    monkeypatch.setattr(
        browser, "in_own_process", lambda *_: browser.Drag(20.0, (30.0, 45.0), processors=(9.0,))
    )
    section = browser.run(replace(TINY, drag_sizes=(5430, 500_000)))
    (table,) = section.tables
    assert table.column("frames / s") == [12.0, 30.0, 20.0]
    assert [(r.value, r.verdict) for r in section.ratios] == [(0.6, "**not met**"), (30.0, "met")]

    def absent(*_, **__):
        raise MissingDependencyError("no browser here")

    monkeypatch.setattr(browser, "_in_browser", absent)
    section = browser.run(replace(TINY, drag_sizes=(5430,)))
    assert section.tables[0].column("drawn") == ["in process"]
    assert [line.rpartition(": ")[2] for line in section.skipped] == 2 * ["no browser here"]
    assert not section.ratios


@pytest.mark.parametrize("drawn", ["in process", pytest.param("page", marks=pytest.mark.campaign)])
def test_a_drag_is_followed(monkeypatch, task, drawn):
    pytest.importorskip("trame")
    monkeypatch.setattr(browser, "bent_cactus", {500: task}.get)
    monkeypatch.setattr(browser, "_WARM_UP", 6 if drawn == "page" else 2)
    monkeypatch.setattr(browser, "_MOVES", 120 if drawn == "page" else 6)
    if drawn == "in process":
        drag = browser.in_process(500, TINY, (300, 200))
    else:
        try:
            drag = browser._in_browser(500, TINY, draws=True)
        except MissingDependencyError as missing:
            pytest.skip(str(missing))
        assert drag.size > 500.0
        assert drag.view[0] < 1400
    assert drag.frames > 0.0
    assert 0.0 < drag.latencies[0] <= drag.latencies[1]


def test_numbers_of_a_column_have_one_notation_unless_the_table_is_mixed():
    rows = [("free", 0.02, 3.0), ("exact", -3e-16, 4.0), ("unknown", None, math.nan)]
    table = Table(("case", "volume change", "steps"), rows)
    lines = table.markdown().splitlines()[2:]
    assert lines == ["| free | 2.0e-02 | 3 |", "| exact | -3.0e-16 | 4 |", "| unknown | – | – |"]
    mixed = replace(table, mixed=True).markdown().splitlines()[2:4]
    assert mixed == ["| free | 0.02 | 3 |", "| exact | -3.0e-16 | 4 |"]
    assert Table(("a", "b"), []).markdown().count("---:") == 2


def test_a_run_is_appended_to_the_history_as_one_line(tmp_path, monkeypatch):
    path = tmp_path / "history.jsonl"
    for commit in ("aaa", None):
        monkeypatch.setattr(history, "commit_of", lambda source, commit=commit: commit)
        history.record(path, "tiny", [Ratio("frame", 0.25, 1.0), Ratio("lost", math.nan, 1.0)])
    first, second = (json.loads(line) for line in path.read_text().splitlines())
    assert (first["commit"], second["commit"]) == ("aaa", None)
    assert first["ratios"] == {"frame": 0.25, "lost": None}
    assert set(first) == {"date", "commit", "version", "processor", "scale", "ratios"}
    assert history.read_history(path) == [first, second]


@pytest.mark.parametrize("line", ["{", "[1]", '{"date": "2026-11-22"}', "\udcff"])
def test_a_file_that_is_not_a_history_is_refused_and_kept(tmp_path, line):
    path = tmp_path / "notes.txt"
    path.write_bytes(b"\n" + line.encode(errors="surrogateescape"))
    before = path.read_bytes()
    with pytest.raises(ArgumentError, match="line 2 of"):
        history.record(path, "tiny", [])
    assert path.read_bytes() == before


def test_the_commit_is_that_of_the_checkout_and_says_if_it_was_changed(tmp_path):
    (tmp_path / "setup.cfg").write_text("")
    assert history.commit_of(tmp_path) is None  # not a repository
    git = ["git", "-C", str(tmp_path), "-c", "user.name=n", "-c", "user.email=e"]
    try:
        subprocess.run([*git, "init", "-q"], check=True)
    except FileNotFoundError:
        pytest.skip("needs git")
    for words in (["add", "."], ["commit", "-qm", "first"], ["tag", "-am", "nine", "v9"]):
        subprocess.run([*git, *words], check=True)
    words = [*git, "rev-parse", "--short=12", "HEAD"]
    commit = subprocess.run(words, check=True, capture_output=True, text=True).stdout.strip()
    assert history.commit_of(tmp_path) == commit
    (tmp_path / "setup.cfg").write_text("changed")
    assert history.commit_of(tmp_path) == f"{commit}-dirty"
    (tmp_path / "setup.cfg").unlink()
    assert history.commit_of(tmp_path) is None  # a repository, but not ours


def test_the_history_is_plotted_by_ratio_and_machine(tmp_path, monkeypatch):
    drawn = {}
    monkeypatch.setattr(
        history, "small_multiples", lambda path, labels, panels: drawn.update(panels, x=labels)
    )
    run = {"date": "2026-11-22T10:00:00+00:00", "commit": "aaa", "processor": "A", "scale": "tiny"}
    runs = [
        run | {"ratios": {"frame": 1.0, "map": 2.0}},
        run | {"ratios": {"frame": 3.0}, "processor": "B", "commit": None},
        run | {"ratios": {"frame": None, "map": 4.0}},
    ]
    history.plot_history(runs, tmp_path / "history.png")
    assert drawn["x"] == ["aaa", "2026-11-22", "aaa"]
    nan = math.nan
    for name, line in (
        ("frame", {"A, tiny": [1.0, nan, nan], "B, tiny": [nan, 3.0, nan]}),
        ("map", {"A, tiny": [2.0, nan, 4.0], "B, tiny": [nan, nan, nan]}),
    ):
        assert list(drawn[name]) == list(line)
        np.testing.assert_array_equal(list(drawn[name].values()), list(line.values()))
    with pytest.raises(ArgumentError, match="no runs yet"):
        history.plot_history([], tmp_path / "history.png")


@pytest.mark.campaign
def test_small_multiples_have_a_panel_for_each_quantity(tmp_path, monkeypatch):
    figures = []
    pytest.importorskip("matplotlib")
    make = charts._figure
    monkeypatch.setattr(
        charts, "_figure", lambda *count: figures.append(made := make(*count)) or made
    )
    panels = {str(k): {"A": [1.0, math.nan, 2.0]} for k in range(4)}
    charts.small_multiples(tmp_path / "history.png", ["a", "b", "c"], panels)
    ((_, axes),) = figures
    assert [axis.get_title() for axis in axes if axis.get_visible()] == ["0", "1", "2", "3"]
    assert list(axes[0].lines[0].get_xdata()) == [0, 2]
    assert axes[0].get_ylim() == pytest.approx((0.0, 2.2))
    assert (tmp_path / "history.png").stat().st_size > 5000
