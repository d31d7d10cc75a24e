"""The command `landmarks`: a mesh, and what is carried, fitted to landmarks from files."""

from __future__ import annotations

import csv

import numpy as np
import pytest
import pyvista as pv
from numpy.testing import assert_allclose

from vtk_segdeform import landmarks, models
from vtk_segdeform.cli import fitting
from vtk_segdeform.cli.main import main
from vtk_segdeform.io import read_mesh, read_points, write_mesh
from vtk_segdeform.landmarks import Landmarks, read_landmarks, write_landmarks

BAR = models.bar(divisions=(3, 3, 12))
SOME = np.random.default_rng(1).permutation(BAR.n_vertices)[:12]
GROWTH = np.array([1.5, 0.8, 1.1])
UNKNOWN = np.full(12, np.nan)


def names(count: int) -> tuple[str, ...]:
    return tuple(f"L{k}" for k in range(count))


@pytest.fixture
def words(tmp_path) -> list[str]:
    write_mesh(tmp_path / "in.ply", BAR)
    own, here = BAR.vertices[SOME], tmp_path
    write_landmarks(here / "own.csv", Landmarks(names(12), own, UNKNOWN))
    order = np.arange(12)[::-1]  # pairs are by name
    given = Landmarks((*(f"L{k}" for k in order[:-1]), "other"), (own * GROWTH)[order], UNKNOWN)
    write_landmarks(here / "to.csv", given)
    files = "in.ply -o out.ply --source own.csv --target to.csv".replace("in.", f"{here}/in.")
    for name in ("out.ply", "own.csv", "to.csv"):
        files = files.replace(f" {name}", f" {here}/{name}")
    return ["landmarks", *files.split(), "--regions", "1", "--cage-vertices", "40"]


def test_the_mesh_and_what_is_carried_grow_alike(words, tmp_path, capsys):
    grid = pv.ImageData(dimensions=(3, 3, 3), spacing=(0.05, 0.05, 0.1)).cast_to_unstructured_grid()
    grid.point_data["value"] = np.arange(27.0)
    grid.save(tmp_path / "grid.vtu")
    pv.Spline(BAR.vertices[:5], 20).save(tmp_path / "curve.vtp")
    pv.PolyData(BAR.vertices[:7]).save(tmp_path / "points.ply")
    for name in ("grid.vtu", "curve.vtp", "points.ply", "own.csv", "in.ply"):
        words += ["--carry", f"{tmp_path / name}={tmp_path / f'moved-{name}'}"]
    words += ["--residuals", str(tmp_path / "residuals.csv")]
    assert main(words) == 0
    text = capsys.readouterr().out
    assert "unpaired        in own.csv: L0\nunpaired        in to.csv: other\n" in text
    assert "landmarks       11, off by" in text
    assert "grown, not bent" in text
    assert_allclose(read_mesh(tmp_path / "out.ply").vertices, BAR.vertices * GROWTH, atol=1e-6)
    for name in ("grid.vtu", "curve.vtp", "points.ply", "in.ply"):
        before, after = read_points(tmp_path / name), read_points(tmp_path / f"moved-{name}")
        assert_allclose(after.points, before.points * GROWTH, atol=1e-6)
        assert after.n_cells == before.n_cells
        assert after.point_data.keys() == before.point_data.keys()
    moved = read_landmarks(tmp_path / "moved-own.csv")
    assert_allclose(moved.points, BAR.vertices[SOME] * GROWTH, atol=1e-9)
    with (tmp_path / "residuals.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["name"] for row in rows] == [f"L{k}" for k in range(1, 12)]
    assert max(float(row["residual"]) for row in rows) < 1e-9
    assert all(float(row["left out"]) < 1e-6 for row in rows)


def test_contact_is_avoided_by_an_option(words, monkeypatch):
    given = []

    def fit_landmarks(*arguments, **options):
        given.append(options["avoid_contact"])
        return landmarks.fit_landmarks(*arguments, **options)

    monkeypatch.setattr(fitting, "fit_landmarks", fit_landmarks)
    assert main(words) == 0
    assert main([*words, "--avoid-contact"]) == 0
    assert given == [False, True]


def test_landmarks_slide_along_a_surface_and_a_curve_by_their_names(words, tmp_path, capsys):
    write_mesh(tmp_path / "patient.ply", BAR.with_vertices(BAR.vertices * GROWTH))
    through = np.linspace(-1.0, 1.0, 9)[:, None] * [0.0, 0.0, 0.3] + BAR.vertices[SOME[1]] * GROWTH
    line = Landmarks(names(9), through, np.full(9, np.nan))
    write_landmarks(tmp_path / "line.csv", line)
    words += ["--slide", f"L0={tmp_path / 'patient.ply'}", "--slide", f"?1={tmp_path / 'line.csv'}"]
    assert main(words) == 0
    text = capsys.readouterr().out
    assert "unpaired        in own.csv" not in text
    assert "landmarks       12, off by" in text
    assert_allclose(read_mesh(tmp_path / "out.ply").vertices, BAR.vertices * GROWTH, atol=1e-5)
    assert main([*words, "--slide", f"M*={tmp_path / 'line.csv'}"]) == 2
    assert "no landmark of --source has a name like M*" in capsys.readouterr().err
    assert main([*words, "--slide", "L1"]) == 2
    assert "must be NAMES=FILE; got 'L1'" in capsys.readouterr().err


def test_a_volume_uncertainty_and_a_picture_are_options(words, tmp_path, capsys):
    words += ["--volume", "+5%", "--uncertainty", "0.01"]
    words += ["--picture", str(tmp_path / "fit.png")]
    assert main(words) == 0
    assert "volume change   +5.0e-02" in capsys.readouterr().out
    image = pv.read(tmp_path / "fit.png")
    colours = image.point_data.active_scalars[:, :3].astype(float)
    is_red = (colours[:, 0] > 120) & (colours[:, 1:] < 90).all(axis=1)
    assert 12 < is_red.sum() < 0.1 * len(colours)


@pytest.mark.parametrize(
    ("more", "code", "message"),
    [
        (["--uncertainty", "-1"], 2, "--uncertainty must be one or 11 numbers, 0 or more"),
        (["--volume", "some"], 2, "the goal of the volume 'whole' must be"),
        (["--carry", "one"], 2, "must be IN=OUT; got 'one'"),
        (["--carry", "own.csv=own.fcsv"], 2, "--carry writes landmarks to .csv; got own.fcsv"),
        (["--target", "missing.csv"], 1, "missing.csv: there is no such file"),
        (["--carry", "missing.vtu=a.vtu"], 1, "missing.vtu: there is no such file"),
        (["--residuals", "/none/a.csv"], 1, "/none/a.csv: there is no folder /none"),
    ],
)
def test_mistakes_are_told_by_option_or_file(words, capsys, more, code, message):
    assert main(words + more) == code
    assert message in capsys.readouterr().err


def test_sets_without_common_names_and_in_other_units_are_told(words, tmp_path, capsys):
    other = Landmarks(tuple("abcd"), BAR.vertices[:4], UNKNOWN[:4])
    write_landmarks(tmp_path / "other.csv", other)
    assert main([*words, "--target", str(tmp_path / "other.csv")]) == 2
    said = capsys.readouterr()
    assert "must have 3 landmarks of the same names or more; they have 0" in said.err
    assert "unpaired        in other.csv: a, b, c and 1 more" in said.out
    write_landmarks(tmp_path / "own.csv", Landmarks(names(12), 10.0 * BAR.vertices[SOME], UNKNOWN))
    assert main(words) == 0
    text = capsys.readouterr().out
    assert "% of the diagonal from the mesh: are the landmarks in other coordinates" in text
