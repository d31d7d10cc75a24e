"""Every example runs, and one number of each is right."""

from __future__ import annotations

import functools
import runpy
from pathlib import Path

import numpy as np
import pytest

import vtk_segdeform
from vtk_segdeform import models
from vtk_segdeform.errors import MissingDependencyError
from vtk_segdeform.pictures.canvas import require_offscreen

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
RIGHT = {
    "an_arm_in_a_sleeve": lambda names: (
        not len(names["solutions"]["follow"].crossings())
        and len(names["solutions"]["free"].crossings()) > 100
    ),
    "a_pull": lambda names: (
        abs(names["solution"].volume_change) < 1e-12 and names["solution"].handle_error < 1e-3
    ),
    "bend_a_scan": lambda names: (
        abs(names["solution"].volume_change) < 1e-12
        and (names["bent"].faces == names["scan"].faces).all()
        and (names["bent"]["temperature"] == names["scan"]["temperature"]).all()
    ),
    "bend_the_cactus": lambda names: abs(names["solution"].volume_change) < 1e-12,
    "beat_a_ventricle": lambda names: (
        max(names["errors"]) < 1e-12
        and names["after"] > 1.2 * names["before"]
        and not len(names["solution"].crossings())
    ),
    "keep_its_balance": lambda names: (
        np.abs(names["centroid"](names["balanced"].vertices) - names["centroid"](names["x"]))[
            :2
        ].max()
        < 1e-12 * names["size"]
        and abs(names["area"](names["balanced"].vertices) / names["area"](names["x"]) - 1.02) < 1e-9
        and names["balanced"].volume_error < 1e-12
    ),
    "find_the_handles": lambda names: names["off"] < 1e-3 and max(names["changes"]) < 1e-12,
    "write_a_motion": lambda names: (
        len(names["motion"].kept) < 20 and names["motion"].deviation < 0.002
    ),
    "with_and_without_volume": lambda names: (
        abs(names["changes"][True]) < 1e-12 and abs(names["changes"][False]) > 1e-3
    ),
    # 0.4 as printed; of the small models, whose limbs have few vertices, 0.5 to 0.7.
    "one_cage_or_several": lambda names: names["distortions"][1] < 0.75 * names["distortions"][0],
    "dinosaur": lambda names: (
        abs(names["session"].volume_change) < 1e-12 and names["solution"].handle_error < 1e-3
    ),
    "dinosaur_with_constraints": lambda names: (
        max(names["off_rigid"], names["off_ground"]) < 1e-9
        and abs(names["solution"].volume_change) < 1e-12
        and names["along_ground"] > 0.01
    ),
    "custom_regions": lambda names: (
        names["session"].regions.n_regions == 3 and abs(names["session"].volume_change) < 1e-12
    ),
    "custom_cage": lambda names: (
        max(abs(names["direct"][0]), abs(names["session"].volume_change)) < 1e-12
    ),
    "editor_in_a_plotter": lambda names: (
        names["moved"] > 0.2 and abs(names["session"].volume_change) < 1e-12
    ),
    "carry_a_grid": lambda names: names["sizes"].min() > 0.2 and len(names["sizes"]) > 1000,
    "fit_an_atlas": lambda names: names["errors"]["fitted"] < 0.9 * names["errors"]["spline"],
    "bend_a_solid": lambda names: (
        not len(names["solution"].inside.inverted)
        and abs(names["solution"].volume_change) < 1e-12
        and names["bent"].cell_data["fibre"][-1] @ names["turn"].apply([0, 0, 1]) > 0.99
    ),
    "many_poses": lambda names: (
        len(names["changes"]) == 18 and max(names["changes"]) < 1e-12 and names["moved"] > 0.02
    ),
    "film_a_drag": lambda names: (
        len(names["changes"]) > 14 and max(map(abs, names["changes"])) < 1e-12
    ),
}

LEAVES = {
    "bend_a_solid": ["bent.vtu", "solids.png"],
    "carry_a_grid": ["bent.vtu", "grid.vtu", "grids.png"],
}  # the others' pictures: `make docs`
# In the campaign only: pages and the tests of the folders make the same calls every day, those of
# the editor in a plotter in test_plugin.
LONG = {
    "an_arm_in_a_sleeve", "beat_a_ventricle", "bend_a_scan", "bend_a_solid", "carry_a_grid",
    "dinosaur", "dinosaur_with_constraints", "editor_in_a_plotter", "film_a_drag",
    "find_the_handles", "fit_an_atlas", "keep_its_balance", "many_poses", "one_cage_or_several",
    "with_and_without_volume", "write_a_motion",
}  # fmt: skip
FEW = {"cactus": 600, "dinosaur": 1000, "random_limbs": 600}  # vertices
DRAW = {"bend_a_solid", "carry_a_grid", "editor_in_a_plotter", "film_a_drag"}
ELSEWHERE = {"qt_application"}  # in test_qt_view, which has a screen


def test_every_example_has_a_number_to_hold():
    assert sorted([*RIGHT, *ELSEWHERE]) == sorted(path.stem for path in EXAMPLES.glob("*.py"))


@pytest.mark.parametrize("whole", [False, pytest.param(True, marks=pytest.mark.campaign)])
@pytest.mark.parametrize(
    "name",
    [pytest.param(n, marks=[pytest.mark.campaign] if n in LONG else []) for n in RIGHT],
)
def test_the_example_runs_and_its_number_is_right(name, whole, monkeypatch, tmp_path):
    folder = tmp_path / "some" / "where"  # which it makes
    monkeypatch.setattr("sys.argv", [name, str(folder)] if name in LEAVES else [name])
    if not whole:  # the models and the cages are smaller than those that its pages show
        for model in (models.cactus, models.dinosaur, models.random_limbs):
            monkeypatch.setattr(models, model.__name__, smaller(model))
        for call in (vtk_segdeform.deform, vtk_segdeform.pull):
            monkeypatch.setattr(
                vtk_segdeform, call.__name__, functools.partial(call, n_cage_vertices=60)
            )
    if name in DRAW:
        try:
            require_offscreen()
        except MissingDependencyError as missing:
            pytest.skip(str(missing))
    assert RIGHT[name](runpy.run_path(str(EXAMPLES / f"{name}.py")))
    assert sorted(path.name for path in folder.glob("*")) == LEAVES.get(name, [])


def smaller(model):
    """Return what makes a model of few vertices, whatever is asked for."""
    few = FEW[model.__name__]
    return lambda n_vertices=few, **seed: model(min(n_vertices, few), **seed)


def test_the_readme_shows_the_first_example_as_it_is():
    readme = (EXAMPLES.parent / "README.md").read_text()
    _, _, code = (EXAMPLES / "bend_the_cactus.py").read_text().split('"""\n', 2)
    assert len(code.splitlines()) > 10
    assert code.strip() in readme
