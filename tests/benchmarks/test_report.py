"""Experiments of `segdeform bench` at tiny sizes: their results, not their times."""

from __future__ import annotations

import itertools
import json
import math
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from vtk_segdeform.benchmarks import (
    browser,
    cage_making,
    charts,
    drag_profile,
    experiments,
    frame_profile,
    history,
    paper,
    peers,
    programs,
    report,
    segmentation_study,
)
from vtk_segdeform.benchmarks.drags import drag_path, frames, seconds_per_step, steps_to_convergence
from vtk_segdeform.benchmarks.full_space import full_space
from vtk_segdeform.benchmarks.measuring import clocked
from vtk_segdeform.benchmarks.scale import Scale
from vtk_segdeform.benchmarks.sections import Figure, Ratio, Section, Table
from vtk_segdeform.benchmarks.tasks import CONVERGED, bent_cactus, prepare
from vtk_segdeform.errors import ArgumentError, MissingDependencyError
from vtk_segdeform.geometry.volume import signed_volume
from vtk_segdeform.solver.gauss_newton import GaussNewton

TINY = Scale(
    "tiny", paper_size=500, n_cage_vertices=60, drag_sizes=(500,), frames=2, repeats=1,
    regions=(2,), study_vertices=60, study_each=30, peer_sizes=(500,), most_iterations=3,
    cage_sizes=(500,), own_process=False,
)  # fmt: skip


@pytest.fixture(scope="module")
def task():
    return bent_cactus(500)


@pytest.fixture(scope="module")
def deformer(task):
    return prepare(task, 3, 60).deformer


@pytest.fixture(autouse=True)
def without_peers(monkeypatch):
    """Hide optional programs and the benchmark poses."""
    for name in ("igl", "open3d", "bpy", "gpytoolbox", "gpytoolbox.copyleft", "igl.copyleft"):
        monkeypatch.setitem(sys.modules, name, None)
    monkeypatch.delenv("SEGDEFORM_DATA", raising=False)
    for module in (frame_profile, peers, report):
        monkeypatch.setattr(module, "warm_up", lambda: None)


@pytest.fixture
def steady(monkeypatch):
    """Replace the measured time of a step, which is NaN on a busy machine, by a constant."""
    for module in (segmentation_study, frame_profile):
        monkeypatch.setattr(module, "seconds_per_step", lambda cases, *_, **__: [1e-3] * len(cases))


def numbers(table):
    return [x for row in table.rows for x in row if isinstance(x, int | float)]


def test_a_frame_ends_where_the_next_step_moves_hardly_anything(task, deformer):
    (goal,) = drag_path(task, 1)
    deformer.reset()
    steps, here = steps_to_convergence(deformer, goal)
    ahead = deformer.solve(goal, max_steps=1)
    assert (
        np.linalg.norm(ahead.vertices - here.vertices, axis=1).max()
        <= CONVERGED * task.mesh.diagonal
    )
    (frame,) = frames(deformer, [goal])
    assert frame.steps == steps
    assert frame.solution.steps == steps
    assert np.abs(frame.solution.vertices - here.vertices).max() < 1e-9
    deformer.reset()
    poses = [deformer.solve(goal, max_steps=1).vertices for _ in range(steps + 1)]
    moves = [np.linalg.norm(b - a, axis=1).max() for a, b in itertools.pairwise(poses)]
    assert [move > CONVERGED * task.mesh.diagonal for move in moves] == [True] * (steps - 1) + [
        False
    ]


@pytest.mark.campaign
@pytest.mark.usefixtures("steady")
def test_the_clock_of_a_step_leaves_the_solver_and_the_drag_as_they_were(task, deformer):
    before = GaussNewton.minimise
    costs = seconds_per_step([(deformer, task), (deformer.copy(), task)], 1)
    assert len(costs) == 2
    assert all(math.isnan(cost) or 0.0 < cost < 60.0 for cost in costs)
    assert GaussNewton.minimise is before
    with pytest.raises(RuntimeError), clocked(GaussNewton, "minimise"):
        raise RuntimeError
    assert GaussNewton.minimise is before
    deformer.reset()


@pytest.mark.campaign
@pytest.mark.usefixtures("steady")
def test_the_drag_profile_has_finite_times_and_names_arap_when_it_is_absent():
    section = drag_profile.run(TINY)
    frame, options, set_up = section.tables
    assert frame.column("vertices") == set_up.column("vertices") == [500]
    assert all(0.3 < options.column(name)[0] < 30.0 for name in ("avoid folds", "avoid contact"))
    for name in ("frame", "other", "map", "volume", "read W"):
        assert math.isfinite(frame.column(name)[0])
    assert frame.column("volume change")[0] <= 1e-12
    assert math.isnan(frame.column("ARAP iteration")[0])
    assert any("libigl" in line for line in section.skipped)
    assert section.ratios[-1].verdict == "met"


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
@pytest.mark.usefixtures("steady")
def test_the_segmentation_study_has_a_row_for_each_number_of_regions():
    section = segmentation_study.run(TINY)
    total, each = section.tables
    assert total.columns == segmentation_study.COLUMNS
    assert total.column("regions") == each.column("regions") == [2]
    assert total.column("cage vertices") == [60]
    assert each.column("cage vertices") == [60]
    assert np.isfinite(numbers(total)).all()
    assert all("n_regions=None" in words for words in section.text)


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
        "full space",
    ]
    assert all(abs(change) < 1e-10 for change in table.column("volume change"))
    told = "\n".join(section.skipped)
    for name in ("libigl ARAP", "Open3D ARAP", "Blender Laplacian Deform", "Botsch-Sorkine"):
        assert name in told


def test_without_cages_the_energy_settles_on_the_exact_volume(task, deformer):
    answer = full_space(task, deformer.subspace, 200)
    mesh = task.mesh
    change = signed_volume(answer.vertices, mesh.faces) / signed_volume(mesh.vertices, mesh.faces)
    assert abs(change - 1.0) < 1e-12
    away = np.linalg.norm(answer.vertices[task.handle] - task.targets, axis=1).max()
    assert away < 1e-3 * mesh.diagonal
    at_rest = replace(task, targets=mesh.vertices[task.handle])
    still = full_space(at_rest, deformer.subspace, 5)
    assert np.abs(still.vertices - mesh.vertices).max() < 1e-9
    assert still.iterations == 1


def test_libigl_is_asked_until_it_rests(monkeypatch, task):
    monkeypatch.undo()
    pytest.importorskip("igl")
    answer = programs.libigl_arap(task, 100)
    assert 1 < answer.iterations <= 100
    assert np.abs(answer.vertices[task.handle] - task.targets).max() < 1e-12


@pytest.mark.campaign
def test_cages_are_judged_and_vtk_agrees_on_the_coordinates():
    section = cage_making.run(TINY)
    cages, coordinates = section.tables
    assert cages.column("program") == ["fit_cages"]
    assert cages.column("valid") == ["yes"]
    assert cages.column("volume / mesh")[0] > 1.0
    assert max(coordinates.column("largest difference")) < 1e-9
    assert {line.partition(",")[0] for line in section.skipped} == {
        "libigl progressive hulls", "gpytoolbox lazy_cage",
    }  # fmt: skip
    mesh = bent_cactus(500).mesh
    shrunk = (0.5 * mesh.vertices, mesh.faces)
    assert "does not enclose" in cage_making.cage_row("shrunk", mesh, shrunk, 1.0)[4]


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


def test_a_plot_is_written_for_every_figure_of_the_study(tmp_path):
    pytest.importorskip("matplotlib")
    row = (1, 60, 4200, 1.0, 3, 4.0, 0.1, 1e-4)
    table = Table(segmentation_study.COLUMNS, [row, (2, *row[1:])], "60 in all")
    figure = segmentation_study._figure(table, 0)
    figure.draw(tmp_path / figure.name)
    assert (tmp_path / figure.name).stat().st_size > 5000


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
