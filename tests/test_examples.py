"""Every example runs, and one number of each is right."""

from __future__ import annotations

import runpy
from pathlib import Path

import pytest

from vtk_segdeform.canvas import require_offscreen
from vtk_segdeform.errors import MissingDependencyError

EXAMPLES = Path(__file__).resolve().parent.parent / "examples"
RIGHT = {
    "bend_the_cactus": lambda names: abs(names["solution"].volume_change) < 1e-12,
    "with_and_without_volume": lambda names: (
        abs(names["changes"][True]) < 1e-12 and abs(names["changes"][False]) > 1e-3
    ),
    "one_cage_or_several": lambda names: names["distortions"][1] < 0.6 * names["distortions"][0],
    "dinosaur": lambda names: (
        abs(names["session"].volume_change) < 1e-12 and names["solution"].handle_error < 1e-3
    ),
    "custom_regions": lambda names: (
        names["session"].regions.n_regions == 3 and abs(names["session"].volume_change) < 1e-12
    ),
    "custom_cage": lambda names: (
        max(abs(names["by_hand"][0]), abs(names["session"].volume_change)) < 1e-12
    ),
    "editor_in_a_plotter": lambda names: (
        names["moved"] > 0.2 and abs(names["session"].volume_change) < 1e-12
    ),
    "editor_by_itself": lambda names: (
        names["moved"] > 0.3 and abs(names["session"].volume_change) < 1e-12
    ),
    "carry_a_grid": lambda names: names["sizes"].min() > 0.2 and len(names["sizes"]) > 1000,
    "film_a_drag": lambda names: (
        len(names["changes"]) > 14 and max(map(abs, names["changes"])) < 1e-12
    ),
}

DRAW = {"editor_by_itself", "editor_in_a_plotter", "film_a_drag"}  # in any case
ELSEWHERE = {"qt_application"}  # in test_qt_widget, which has a screen


def test_every_example_has_a_number_to_hold():
    assert sorted([*RIGHT, *ELSEWHERE]) == sorted(path.stem for path in EXAMPLES.glob("*.py"))


@pytest.mark.parametrize("name", RIGHT)
def test_the_example_runs_and_its_number_is_right(name, monkeypatch):
    monkeypatch.setattr("sys.argv", [name])  # no folder for pictures
    if name in DRAW:
        try:
            require_offscreen()
        except MissingDependencyError as missing:
            pytest.skip(str(missing))
    assert RIGHT[name](runpy.run_path(str(EXAMPLES / f"{name}.py")))


def test_an_example_makes_the_folder_it_is_given(monkeypatch, tmp_path):
    monkeypatch.setattr("sys.argv", ["carry_a_grid", str(tmp_path / "some" / "where")])
    runpy.run_path(str(EXAMPLES / "carry_a_grid.py"))
    assert sorted(path.name for path in (tmp_path / "some" / "where").iterdir()) == [
        "bent.vtu", "grid.vtu",
    ]  # fmt: skip


def test_the_readme_shows_the_first_example_as_it_is():
    readme = (EXAMPLES.parent / "README.md").read_text()
    code = (EXAMPLES / "bend_the_cactus.py").read_text().split("\n", 2)[2].strip()
    assert code in readme
