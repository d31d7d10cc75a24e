"""--volume and --part: goals on the command line, what they print, and errors."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose
from open_meshes import combined
from organs import surface_of

from vtk_segdeform import models
from vtk_segdeform.cli.main import main
from vtk_segdeform.geometry import signed_volume
from vtk_segdeform.io import Surface, write_mesh
from vtk_segdeform.mesh import Mesh
from vtk_segdeform.solver import area_of

QUICK = ["--regions", "1", "--cage-vertices", "50"]


@pytest.fixture(scope="module")
def hollow() -> Mesh:
    """Return a bar with a cavity."""
    outer = models.bar(size=(0.4, 0.4, 1.0), divisions=(4, 4, 10))
    inner = models.bar(size=(0.2, 0.2, 0.7), divisions=(3, 3, 7))
    return combined(outer, inner.with_vertices(inner.vertices + [0.0, 0.0, 0.15]))


@pytest.fixture(scope="module")
def given(hollow, tmp_path_factory) -> str:
    path = tmp_path_factory.mktemp("hollow") / "hollow.vtp"
    write_mesh(path, hollow)
    return str(path)


def volumes(mesh: Mesh, x: np.ndarray) -> tuple[float, float]:
    """Return the volumes of the cavity and of the wall around it."""
    is_inner = mesh.components[mesh.faces[:, 0]] == 1
    whole = signed_volume(x, mesh.faces)
    return abs(signed_volume(x, mesh.faces[is_inner])), whole


def test_deform_sets_volumes_without_a_handle(hollow, given, tmp_path, capsys):
    out = tmp_path / "out.vtp"
    words = ["deform", given, "-o", str(out), "--volume", "cavity=-40%", "--volume", "wall = keep"]
    assert main([*words, *QUICK]) == 0
    x = Surface.read(out).mesh.vertices
    before, after = volumes(hollow, hollow.vertices), volumes(hollow, x)
    assert_allclose(np.divide(after, before), [0.6, 1.0], rtol=1e-12)
    printed = capsys.readouterr().out
    assert f"volume          cavity: {after[0]:.6g}, -40 % of the original" in printed
    assert "handle error" not in printed
    wall = next(line for line in printed.splitlines() if " wall: " in line)
    assert f"wall: {after[1]:.6g}, " in wall
    assert abs(float(wall.split(",")[1].split("%")[0])) < 1e-10


def test_pull_sets_volumes(hollow, given, tmp_path, capsys):
    out = tmp_path / "out.vtp"
    words = ["pull", given, "-o", str(out), "--at", "0,0,1", "--to", "0.1,0,1.1"]
    assert main([*words, "--volume", "cavity=keep", "--volume", "wall=+3%", *QUICK]) == 0
    after = volumes(hollow, Surface.read(out).mesh.vertices)
    before = volumes(hollow, hollow.vertices)
    assert_allclose(np.divide(after, before), [1.0, 1.03], rtol=1e-12)
    assert "wall: " in capsys.readouterr().out


def test_areas_and_centroids_are_printed_as_such(hollow, given, tmp_path, capsys):
    out = tmp_path / "out.vtp"
    words = ["pull", given, "-o", str(out), "--at", "0,0,1", "--to", "0.1,0,1.1", *QUICK]
    assert main([*words, "--volume", "centroid x=0.01", "--volume", "area=+2%"]) == 0
    x, faces = Surface.read(out).mesh.vertices, hollow.faces
    printed = capsys.readouterr().out
    area = area_of(x, faces).target
    assert area == pytest.approx(1.02 * area_of(hollow.vertices, faces).target, rel=1e-9)
    assert f"area            {area:.6g}, +2 % of the original" in printed
    assert "centroid x      0.01, moved by " in printed


@pytest.mark.campaign  # test_volume_goals has such a goal
@pytest.mark.parametrize(
    "goal",
    ["1e-9", "1e9"],  # the latter takes 40 s
)
def test_a_goal_that_cannot_be_met_is_an_error_although_the_mesh_is_written(
    given, tmp_path, capsys, goal
):
    out = tmp_path / "out.vtp"
    assert main(["deform", given, "-o", str(out), "--volume", f"cavity={goal}", *QUICK]) == 1
    assert "was written, but a volume is off by" in capsys.readouterr().err
    assert out.exists()


def test_organs_of_a_label_map_are_called_by_their_labels(tmp_path, capsys):
    path, out = tmp_path / "organs.vtp", tmp_path / "out.vtp"
    labels = np.zeros((12, 12, 12), dtype=int)
    labels[2:10, 2:10, 2:7], labels[2:10, 2:10, 7:10] = 30, 4
    surface_of(labels).save(path)
    assert main(["deform", str(path), "-o", str(out), "--volume", "label 4=-10%", *QUICK]) == 0
    assert ", -10 % of the original" in capsys.readouterr().out
    (body,) = Surface.read(path).labels()[4]
    for goal, says in (
        ("label 5=keep", "there is no single volume 'label 5'; there are label 4: body"),
        (f"{body}=keep", "given twice for the same volume: label 4, "),
    ):
        words = ["--volume", "label 4=-10%", "--volume", goal]
        assert main(["deform", str(path), "-o", str(out), *words, *QUICK]) == 2
        assert says in capsys.readouterr().err


def test_only_a_format_in_metres_has_volumes_in_ml(hollow, given, tmp_path, capsys):
    write_mesh(tmp_path / "hollow.glb", hollow)
    for path, has_unit in ((str(tmp_path / "hollow.glb"), True), (given, False)):
        words = ["deform", path, "-o", str(tmp_path / "out.ply"), "--volume", "cavity=0.02"]
        assert main([*words, *QUICK]) == 0
        assert ("cavity: 0.02 m^3 (20000 ml), " in capsys.readouterr().out) == has_unit


@pytest.mark.parametrize(
    ("more", "says"),
    [
        ([], "nothing would move: add --handle SEL with a motion, or --volume"),
        (["--volume", "cavity"], "--volume must be a name and a value, as whole=+10%; got"),
        (["--volume", "=keep"], "--volume must be a name and a value"),
        (["--volume", "belly=keep"], "there is no volume 'belly'; there are whole, cavity"),
        (["--volume", "wall=much"], "the goal of the volume 'wall' must be keep"),
        (["--volume", "wall=-100%"], "the volume of 'wall' must be positive"),
        (["--volume", "wall=keep", "--volume", "whole=+1%"], "follows from that of 'wall'"),
        (["--volume", "tip=keep", "--part", "tip"], "--part must be a name and a value, as tip=z"),
        (["--volume", "tip=keep", "--part", "tip=z>200%"], "selects none of the 298 points"),
        (["--volume", "wall=keep", "--volume", "wall=+1%"], "--volume is given twice for 'wall'"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_one_line_and_nothing_is_written(given, tmp_path, capsys, more, says):
    out = tmp_path / "out.vtp"
    assert main(["deform", given, "-o", str(out), *more, *QUICK]) == 2
    printed = capsys.readouterr()
    assert says in printed.err
    assert printed.err.count("\n") == 1
    assert not out.exists()
