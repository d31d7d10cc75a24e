"""Commands over surfaces as users have them: the output is the input, only moved."""

from __future__ import annotations

import itertools
import json
import re

import numpy as np
import pytest
import pyvista as pv
from campaign import every
from given_surfaces import GIVEN, holed, require_only_moved, tube
from numpy.testing import assert_allclose, assert_array_equal
from organs import surface_of

from vtk_segdeform.cli.main import main
from vtk_segdeform.geometry.volume import signed_volume
from vtk_segdeform.io import Surface, read_polydata, triangles_of, write_mesh
from vtk_segdeform.mesh import Mesh
from vtk_segdeform.models import sphere

QUICK = ["--regions", "1", "--cage-vertices", "40"]
OF_PARTS = ["--regions", "3", "--cage-vertices", "90"]
ROUGH = ["--no-refine"]  # in `test_main` poses are refined
BEND = ["--fixed", "z<15%", "--handle", "z>85%", "--translate", "0.4,0,0", *QUICK, *ROUGH]


def file_of(name, folder, suffix=".vtp"):
    path = folder / f"{name}{suffix}"
    write_mesh(path, GIVEN[name]())
    return path


@pytest.mark.parametrize("name", every(2, GIVEN))
def test_deform_writes_what_was_given_only_moved(name, tmp_path, capsys):
    path, out = file_of(name, tmp_path), tmp_path / "out.vtp"
    words = BEND
    if name == "parts":  # the middle one has neither
        words = ["--fixed", "x<-1&z<20%", "--handle", "x<-1&z>80%", "--translate", "0.2,0,0"]
        words += OF_PARTS
    assert main(["deform", str(path), "-o", str(out), *words]) == 0
    before, after = read_polydata(path), read_polydata(out)
    require_only_moved(before, after)
    surface = Surface(before)
    step = np.asarray(after.points, float) - before.points
    for vertex in (0, surface.mesh.n_vertices // 2):  # points at a seam remain together
        assert np.ptp(step[surface.vertex_of == vertex], axis=0).max() < 1e-6
    assert np.abs(step).max() > 0.15
    printed = capsys.readouterr().out
    for workaround in surface.workarounds:
        assert str(workaround) in printed or "hole" in str(workaround)
    assert ("volume kept under lids" in printed) == (not surface.mesh.is_closed)


def test_both_sides_of_a_seam_follow_a_selection_of_one_of_them(tmp_path):
    path, ids = file_of("tube", tmp_path), tmp_path / "top.txt"
    n = 16
    top = np.arange(24 * (n + 1), 25 * (n + 1))
    ids.write_text(" ".join(map(str, top[:-1])))  # without the doubled last one
    out = tmp_path / "out.vtp"
    words = ["--fixed", "z<10%", "--handle", str(ids), "--translate", "0.2,0,0", *QUICK, *ROUGH]
    assert main(["deform", str(path), "-o", str(out), *words]) == 0
    moved = read_polydata(out).points[top] - read_polydata(path).points[top]
    assert_allclose(moved, np.tile([0.2, 0.0, 0.0], (n + 1, 1)), atol=5e-3)


def test_a_sel_file_has_one_number_per_given_point(tmp_path):
    path, sel, out = file_of("tube", tmp_path), tmp_path / "pose.sel", tmp_path / "out.vtp"
    z = tube().points[:, 2]
    np.savetxt(sel, np.where(z < 0.3, 0, np.where(z > 2.7, 2, 1)), fmt="%d")
    words = ["--fixed", str(sel), "--handle", str(sel), "--translate", "0.2,0,0", *QUICK, *ROUGH]
    assert main(["deform", str(path), "-o", str(out), *words]) == 0
    assert_allclose(read_polydata(out).points[z < 0.3], tube().points[z < 0.3], atol=5e-3)


def test_regions_are_written_at_the_given_points_and_read_again(tmp_path, capsys):
    path, out = file_of("holed", tmp_path), tmp_path / "regions.vtp"
    assert main(["regions", str(path), "-o", str(out), "--regions", "2"]) == 0
    written = read_polydata(out)
    assert written.n_points == holed().n_points
    assert set(written.point_data["region"]) == {0, 1}
    surface = Surface(holed())
    labels = surface.at_vertices(np.asarray(written.point_data["region"]))
    assert_array_equal(surface.at_points(labels), written.point_data["region"])
    words = ["deform", str(out), "-o", str(tmp_path / "bent.vtp"), *BEND]
    words[words.index("--regions") + 1] = "region"
    assert main(words) == 0
    assert "regions         2:" in capsys.readouterr().out


def checked(path, capsys, code=0):
    assert main(["check", str(path), "--json"]) == code
    return json.loads(capsys.readouterr().out)


def test_check_tells_a_script_all_about_a_surface(tmp_path, capsys):
    found = checked(file_of("holed", tmp_path), capsys)
    assert (found["points"], found["polygons"]) == (holed().n_points, holed().n_cells)
    assert found["holes"] == [16, 16, 8, 4]
    assert found["encloses"] == [True]
    assert (found["closed"], found["volume_under_lids"], found["can_be_deformed"]) == (
        False, True, True,
    )  # fmt: skip
    assert found["self_intersections"] == 0
    assert [each["kind"] for each in found["workarounds"]][-1] == "hole"
    assert all(set(each) >= {"kind", "text", "count"} for each in found["workarounds"])
    found = checked(file_of("parts", tmp_path), capsys)
    assert found["components"] == 3
    assert found["encloses"] == [True] * 3
    assert list(found["volumes"]) == ["body 0", "body 1", "body 2"]
    write_mesh(tmp_path / "ball.ply", sphere(300))
    found = checked(tmp_path / "ball.ply", capsys)
    assert found["closed"]
    assert (found["holes"], found["workarounds"], found["faults"]) == ([], [], [])
    assert not found["volume_under_lids"]


def test_check_tells_the_volumes_of_a_label_map(tmp_path, capsys):
    labels = np.zeros((14, 14, 14), dtype=int)
    labels[1:13, 1:13, 1:13], labels[4:8, 4:8, 4:8] = 30, 4
    surface_of(labels).save(tmp_path / "organs.vtp")
    found = checked(tmp_path / "organs.vtp", capsys)
    assert found["labels"] == {"30": ["body 0"], "4": ["cavity 0"]}
    assert found["volumes"]["cavity 0"] == pytest.approx(64.0, rel=0.25)  # round corners
    assert main(["check", str(tmp_path / "organs.vtp")]) == 0
    inside = f"cavity 0 (label 4) {found['volumes']['cavity 0']:.6g}"
    assert inside in capsys.readouterr().out
    pv.Plane(i_resolution=5, j_resolution=5).triangulate().save(tmp_path / "sheet.vtp")
    assert checked(tmp_path / "sheet.vtp", capsys)["volumes"] == {}


def test_check_tells_a_script_of_files_that_cannot_be_read(tmp_path, capsys):
    keys = set(checked(file_of("holed", tmp_path), capsys))
    (tmp_path / "cut.off").write_text("OFF\n4 4 0\n0 0 0\n")
    for name, reason in (("cut.off", "ends after"), ("none.off", "no such file")):
        found = checked(tmp_path / name, capsys, code=1)
        assert set(found) == keys
        assert not found["can_be_deformed"]
        assert reason in found["reason"]


@pytest.mark.parametrize("away", [0.0, 1e4, 4e6])
def test_check_says_where_single_precision_is_too_coarse(away, tmp_path, capsys):
    ball, path = sphere(500), tmp_path / "ball.ply"
    x = ball.vertices + away
    for points in (x, x.astype(np.float32)):
        write_mesh(path, pv.make_tri_mesh(points, ball.faces))
        found = [n for n in checked(path, capsys)["notes"] if n["kind"] == "single precision"]
        assert len(found) == (points is not x and away > 0.0)
    if not found:
        return
    assert main(["check", str(path)]) == 0
    printed = capsys.readouterr().out
    steps = {1e4: "0.00098", 4e6: "0.25"}[away]
    assert f"at this distance from the origin in steps of {steps} (median edge " in printed
    assert "move the model to the origin before you export it" in printed
    assert (found[0]["count"] > 0) == ("collapsed" in printed) == (away == 4e6)


def test_check_counts_self_intersections_and_does_not_refuse_them(tmp_path, capsys):
    two = pv.merge([pv.Sphere(radius=1.0), pv.Sphere(radius=1.0, center=(1, 0, 0))])
    write_mesh(tmp_path / "two.vtp", two.extract_surface(algorithm=None))
    assert checked(tmp_path / "two.vtp", capsys)["self_intersections"] > 10
    assert main(["check", str(tmp_path / "two.vtp")]) == 0
    assert "pairs of faces intersect" in capsys.readouterr().out


def test_check_names_what_cannot_be_deformed(tmp_path, capsys):
    lost = tube()
    lost.points[7] = np.nan
    flat = pv.PolyData(np.zeros((4, 3)), faces=[4, 0, 1, 2, 3])
    for name, surface, word in (("lost", lost, "NaN"), ("flat", flat, "flat")):
        path = tmp_path / f"{name}.vtp"
        surface.save(path)
        found = checked(path, capsys, code=1)
        assert not found["can_be_deformed"]
        assert word in found["reason"]
        assert main(["check", str(path)]) == 1
        assert "cannot be deformed" in capsys.readouterr().out


@pytest.fixture(scope="module")
def far_file(tmp_path_factory):
    """Return a file with a body of 2 m at UTM coordinates."""
    ball = sphere(300)
    far = Mesh(ball.vertices + [500_000.0, 5_400_000.0, 300.0], ball.faces)
    path = tmp_path_factory.mktemp("far") / "ball.ply"
    write_mesh(path, far)
    return path


def numbers_told(text):
    """Return the volume change and the handle error that a command has printed."""
    volume = re.search(r"volume change +(\S+)", text)
    error = re.search(r"handle error +(\S+) %", text)
    return float(volume[1]), float(error[1]) / 100.0 if error else None


@pytest.mark.parametrize(
    ("command", "suffix"),
    every(2, itertools.product(["deform", "pull"], [".stl", ".glb", ".obj"])),
)
def test_numbers_are_told_of_the_file_as_it_is_read_again(
    far_file, tmp_path, capsys, suffix, command
):
    out = tmp_path / f"out{suffix}"
    words = {
        "deform": ["--fixed", "z<10%", "--handle", "z>90%", "--translate", "0,0,0.1",
                   "--regions", "1", "--cage-vertices", "40"],
        "pull": ["--at", "500000,5400000,301", "--to", "500000,5400000,301.1", "--regions", "1"],
    }  # fmt: skip
    assert main([command, str(far_file), "-o", str(out), *words[command]]) == 0
    output = capsys.readouterr()
    change, error = numbers_told(output.out)
    given, again = read_polydata(far_file), read_polydata(out)
    middle = given.points.mean(axis=0)
    before, after = (
        signed_volume(np.asarray(each.points) - middle, triangles_of(each))
        for each in (given, again)
    )
    assert_allclose(change, (after - before) / before, rtol=0.06, atol=1e-7)
    if suffix == ".stl":
        assert abs(change) > 1e-3
        assert error > 0.01 or command == "pull"  # whose target is not rounded
        assert "STL stores single precision: vertices moved by up to 0.25" in output.err
    else:
        assert abs(change) < 1e-6
        assert error < 1e-4
        assert output.err == ""


@pytest.mark.parametrize(("suffix", "code"), [(".stl", 1), (".glb", 0), (".ply", 0)])
def test_a_repair_is_told_closed_only_if_the_file_is(tmp_path, capsys, suffix, code):
    ball, out = sphere(100), tmp_path / f"closed{suffix}"
    far = Mesh(ball.vertices + 3e9, ball.faces)
    write_mesh(tmp_path / "far.ply", far)
    assert main(["check", str(tmp_path / "far.ply"), "--repair", "-o", str(out)]) == code
    assert ("not closed as it is read again" in capsys.readouterr().out) == bool(code)
