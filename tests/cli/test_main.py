"""Commands: printed lines, written files and exit codes."""

from __future__ import annotations

import io
import os
import runpy
import sys

import numpy as np
import pytest
import pyvista as pv
from numpy.testing import assert_allclose, assert_array_equal
from solids import OCTAHEDRON

import vtk_segdeform
from vtk_segdeform import models
from vtk_segdeform.benchmarks import report
from vtk_segdeform.benchmarks.results import Section, Table
from vtk_segdeform.cli.main import ProgressBar, main
from vtk_segdeform.geometry import turned_over
from vtk_segdeform.geometry.volume import signed_volume
from vtk_segdeform.io import convert, read_mesh, write_mesh
from vtk_segdeform.mesh import new_crossings
from vtk_segdeform.mesh.mesh import Mesh

QUICK = ["--regions", "2", "--cage-vertices", "60"]


@pytest.fixture(scope="module")
def bar() -> Mesh:
    return models.bar(divisions=(4, 4, 14))


@pytest.fixture(scope="module")
def bar_file(bar, tmp_path_factory) -> str:
    path = tmp_path_factory.mktemp("bar") / "bar.vtp"
    surface = convert.to_polydata(bar)
    surface.point_data["height"] = bar.vertices[:, 2]
    surface.point_data["half"] = (bar.vertices[:, 2] > 0.5).astype(int)
    surface.cell_data["number"] = np.arange(bar.n_faces)
    convert.write_mesh(path, surface)
    return str(path)


def lines(text: str) -> dict[str, str]:
    """Return the printed lines by their first word."""
    return {line.split()[0]: line for line in text.splitlines() if line.strip()}


def test_deform_moves_the_handle_keeps_the_volume_and_all_that_came_along(
    bar, bar_file, tmp_path, capsys
):
    out = tmp_path / "bent.vtp"
    code = main(
        ["deform", bar_file, "-o", str(out), "--fixed", "z<10%", "--handle", "z>90%",
         "--rotate", "y,30", "--pivot", "0,0,0.5", *QUICK]
    )  # fmt: skip
    report = lines(capsys.readouterr().out)
    assert code == 0
    assert {"volume", "handle", "solve", "status", "written"} <= set(report)
    assert "ms per step" in report["solve"]
    bent = convert.read_polydata(out)
    mesh = convert.from_polydata(bent)
    assert_array_equal(mesh.faces, bar.faces)
    assert_array_equal(bent.point_data["height"], bar.vertices[:, 2])
    assert_array_equal(bent.cell_data["number"], np.arange(bar.n_faces))
    before, after = (signed_volume(m.vertices, m.faces) for m in (bar, mesh))
    assert after == pytest.approx(before, rel=1e-12)
    top = bar.vertices[:, 2] > 0.9
    c, s = np.cos(np.pi / 6), np.sin(np.pi / 6)
    turn = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
    pivot = np.array([0, 0, 0.5])
    expected = (bar.vertices[top] - pivot) @ turn.T + pivot
    assert_allclose(mesh.vertices[top], expected, atol=1e-3 * bar.diagonal)
    bottom = bar.vertices[:, 2] < 0.1
    assert_allclose(mesh.vertices[bottom], bar.vertices[bottom], atol=1e-3 * bar.diagonal)
    same = vtk_segdeform.deform(bar, bottom, top, expected, n_regions=2, n_cage_vertices=60)
    assert_allclose(mesh.vertices, same.vertices, atol=1e-6 * bar.diagonal)


def test_each_handle_has_its_own_motion_and_a_shift_may_begin_with_a_minus(bar, bar_file, tmp_path):
    out = tmp_path / "two.ply"
    code = main(
        ["deform", bar_file, "-o", str(out), "--fixed", "z>45%&z<55%", "--refine", *QUICK,
         "--handle", "z<5%", "--translate", "-.05,0,0",
         "--handle", "z>95%", "--rotate", "-1,0,0,10", "--translate", "0.05,0,0"]
    )  # fmt: skip
    assert code == 0
    moved = read_mesh(out).vertices - bar.vertices
    close = 1e-6 * bar.diagonal  # refined
    assert_allclose(moved[bar.vertices[:, 2] < 0.05], [[-0.05, 0, 0]] * 25, atol=close)
    top = bar.vertices[:, 2] > 0.95
    assert_allclose(moved[top].mean(axis=0), [0.05, 0, 0], atol=close)  # turned about its centre
    assert np.ptp(moved[top][:, 2]) > 0.02


@pytest.mark.parametrize(
    ("shift", "more", "advice"),
    [
        *((shift, [], ", or use --avoid-contact") for shift in (0.05, -0.8)),
        (-0.5, ["--avoid-contact"], ""),
    ],
)
def test_faces_that_cross_or_are_turned_over_are_counted(
    shift, more, advice, bar, bar_file, tmp_path, capsys
):
    out = tmp_path / "moved.ply"
    words = ["deform", bar_file, "-o", str(out), "--fixed", "z<10%", "--handle", "z>90%"]
    words += ["--translate", f"0,0,{shift}", "--regions", "1", "--cage-vertices", "40"]
    main([*words, "--no-refine", *more])
    x, said = read_mesh(out).vertices, lines(capsys.readouterr().out)
    crossings = len(new_crossings(x, bar.vertices, bar.faces))
    folds = len(turned_over(x, bar.vertices, bar.faces))
    assert (crossings > 0) == (shift < 0.0)
    what = f"{crossings} faces cross that did not at rest: move less, or add cage vertices"
    assert said["crossings"] == f"crossings       {what + advice if crossings else 'none'}"
    what = f"{folds} turned-over face{'s' * (folds > 1)}: move less, or add cage vertices"
    assert said["folds"] == f"folds           {what if folds else 'none'}"


def test_a_part_that_nothing_moves_is_named(bar, tmp_path, capsys):
    path = tmp_path / "two.ply"
    x = np.concatenate([bar.vertices, bar.vertices + [2.0, 0.0, 0.0]])
    write_mesh(path, Mesh(x, np.concatenate([bar.faces, bar.faces + bar.n_vertices])))
    words = ["deform", str(path), "-o", str(tmp_path / "out.ply"), "--fixed", "z<10%&x<50%"]
    words += ["--handle", "z>90%&x<50%", "--translate", "0,0,0.1", "--cage-vertices", "60"]
    assert main(words) == 0
    expected = f"part 2 ({bar.n_vertices} vertices) has no handle and no fixed vertices: it stays"
    assert lines(capsys.readouterr().out)["parts"].startswith(f"parts           {expected}")


def test_check_says_that_an_open_mesh_can_be_deformed_and_changes_nothing(tmp_path, capsys):
    path = tmp_path / "open.off"
    vertices, faces = OCTAHEDRON
    convert.write_mesh(path, pv.make_tri_mesh(vertices, faces[:-1]))
    before = path.read_bytes()
    assert main(["check", str(path)]) == 0
    text = capsys.readouterr().out
    assert "can be deformed as it is. 1 hole: volume kept under a lid" in text
    assert "1 border of 3 edges" in text
    assert path.read_bytes() == before
    assert sorted(tmp_path.iterdir()) == [path]


def test_check_repairs_into_another_file_and_keeps_the_arrays(tmp_path, capsys):
    path, out = tmp_path / "open.vtp", tmp_path / "closed.vtp"
    vertices, faces = OCTAHEDRON
    surface = pv.make_tri_mesh(vertices, faces[:-1])
    surface.point_data["number"] = np.arange(6)
    surface.cell_data["number"] = np.arange(1, 8)
    convert.write_mesh(path, surface)
    assert main(["check", str(path), "--repair", "-o", str(out)]) == 0
    assert "repaired: fill 1 hole" in capsys.readouterr().out
    closed = convert.read_polydata(out)
    mesh = convert.from_polydata(closed)
    assert_array_equal(mesh.vertices, vertices)
    assert_array_equal(mesh.faces[:-1], faces[:-1])
    assert_array_equal(closed.point_data["number"], np.arange(6))
    assert_array_equal(closed.cell_data["number"], [1, 2, 3, 4, 5, 6, 7, 0])


def test_regions_are_written_as_an_array_that_deform_and_cages_take_up(
    bar, bar_file, tmp_path, capsys
):
    path = tmp_path / "regions.ply"
    assert main(["regions", bar_file, "-o", str(path), "--regions", "2"]) == 0
    assert lines(capsys.readouterr().out)["regions"].split()[1] == "2:"
    written = convert.read_polydata(path)
    assert set(np.unique(written.point_data["region"])) == {0, 1}
    assert written.point_data["regions_here"].max() == 2
    assert written.n_points == bar.n_vertices
    assert main(["cages", str(path), "--regions", "region", "--cage-vertices", "60"]) == 0
    assert lines(capsys.readouterr().out)["regions"].split()[1] == "2:"


def test_cages_are_written_as_one_coloured_surface_of_closed_cages(bar_file, tmp_path, capsys):
    path = tmp_path / "cages.ply"
    assert main(["cages", bar_file, "-o", str(path), *QUICK]) == 0
    assert "= 60 vertices" in lines(capsys.readouterr().out)["cages"]
    written = convert.read_polydata(path)
    assert written.n_points == 60
    assert convert.from_polydata(written).components.max() == 1
    assert len(np.unique(written.point_data["RGB"], axis=0)) == 2


def test_without_a_display_egl_draws_unless_another_window_is_chosen(monkeypatch):
    name, asked = "VTK_DEFAULT_OPENGL_WINDOW", []
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.setitem(main.__globals__, "find_library", lambda _: asked.append(1) or "libEGL.so")
    for display, chosen, expected in (
        ("", "", "vtkEGLRenderWindow"), ("", "vtkOSOpenGLRenderWindow", "vtkOSOpenGLRenderWindow"),
        (":0", "", None),
    ):  # fmt: skip
        monkeypatch.setenv("DISPLAY", display)
        monkeypatch.setenv(name, chosen)
        if not chosen:
            monkeypatch.delenv(name)
        assert main(["check", "missing.ply"]) == 1
        assert os.environ.get(name) == expected
    assert asked == [1]  # it starts a process


def test_the_demo_leaves_meshes_whose_volume_is_the_same(tmp_path, capsys):
    folder = tmp_path / "deep" / "demo"
    assert main(["demo", "-o", str(folder), "--size", "600", "--no-pictures"]) == 0
    report = lines(capsys.readouterr().out)
    assert {"cactus", "regions", "cages", "volume", "solve"} <= set(report)
    assert "= 155 vertices" in report["cages"]
    rest = models.cactus(600)
    bent = read_mesh(folder / "cactus-bent.vtp")
    before, after = (signed_volume(m.vertices, m.faces) for m in (rest, bent))
    assert after == pytest.approx(before, rel=1e-12)
    tip = rest.vertices[:, 2] > 0.92
    assert (bent.vertices - rest.vertices)[tip, 0].mean() > 0.3 * rest.vertices[:, 2].max()


def quick_table(scale, progress) -> Section:
    """Return a table like that of the paper, without its deformations."""
    sizes = f"{scale.paper_size} vertices, {scale.n_cage_vertices} cage vertices"
    return Section("Tables 1 and 2", sizes, [Table(("step, s",), [(0.25,)], "table 1")])


@pytest.mark.parametrize("is_real", [False, pytest.param(True, marks=pytest.mark.campaign)])
def test_bench_writes_a_report_and_prints_its_tables(tmp_path, capsys, monkeypatch, is_real):
    if not is_real:
        monkeypatch.setattr(report, "EXPERIMENTS", {"paper": quick_table, "drag": None})
    monkeypatch.setattr(report, "warm_up", lambda: None)
    size = ["--quick", "--size", "500", "--cage-vertices", "60"]
    assert main(["bench", *size, "--only", "paper", "-o", str(tmp_path / "out")]) == 0
    written = (tmp_path / "out" / "report.md").read_text()
    assert "Tables 1 and 2" in written
    assert "500 vertices, 60 cage vertices" in written
    told = capsys.readouterr().out.splitlines()
    assert told[-1].endswith("report.md")
    assert any("step, s" in line for line in told)
    assert set(told[:-1]) <= set(written.splitlines())


@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        ([], 2, "COMMAND"),
        (["dance"], 2, "dance"),
        (["check"], 2, "IN"),
        (["deform", "BAR", "-o", "x.ply", "--fixed", "z<1%"], 2, "--handle"),
        (["deform", "BAR", "-o", "x.ply", "--fixed", "z<1%", "--rotate", "z,1"], 2, "come after"),
        (["deform", "BAR", "-o", "x.ply", "--fixed", "z<9%", "--handle", "z>9%"], 2, "not move"),
        (["deform", "BAR", "-o", "x.ply", "--fixed", "up", "--handle", "z>9%"], 2, "z>80%"),
        (["deform", "BAR", "-o", "x.ply", "--fixed", "z<9%", "--handle", "z>9%", "--rotate", "q,1"],
         2, "rotate must be"),
        (["deform", "BAR", "-o", "x.ply", "--fixed", "z<50%", "--handle", "z>30%", *QUICK,
          "--translate", "0,0,1"], 2, "both fixed and handle"),
        (["regions", "BAR", "--regions", "none"], 2, "height, half"),
        (["regions", "BAR", "--regions", "0"], 2, "number from 1"),
        (["regions", "BAR", "--regions", "2", "--overlap", "9"], 2, "of a point array only"),
        (["pull", "BAR", "-o", "x.ply", "--at", "0,0,1", "--to", "0,0,2", "--raduis", "1"],
         2, "segdeform pull: error: unrecognized arguments: --raduis 1; did you mean --radius?"),
        (["pull", "BAR", "-o", "x.ply", "--at", "0", "0", "1", "--to", "0,0,2"],
         2, "unrecognized arguments: 0 1; write points with commas and without blanks: 0,0,1"),
        (["demo", "-o", "BAR"], 2, "is a file; give a folder"),
        (["bench", "--size", "-3"], 2, "--size"),
        (["check", "BAR", "--repair"], 2, "-o"),
        (["check", "no-such-file.ply"], 1, "no-such-file.ply"),
        (["cages", "BAR", "-o", "no/such/folder/x.ply", *QUICK], 1, "no folder"),
        (["regions", "BAR", "-o", "x.xyz", "--regions", "1"], 1, ".xyz"),
        (["regions", "BAR", "-o", "x.stl", "--regions", "1"], 1, "cannot store arrays"),
        (["cages", "BAR", "-o", "x.obj", "--regions", "1"], 1, "cannot store arrays"),
    ],
)  # fmt: skip
def test_what_goes_wrong_is_one_line_on_stderr_and_an_exit_code(
    bar_file, tmp_path, monkeypatch, capsys, arguments, code, message
):
    monkeypatch.chdir(tmp_path)
    assert main([bar_file if word == "BAR" else word for word in arguments]) == code
    error = capsys.readouterr().err
    assert message in error.splitlines()[-1]
    assert "Traceback" not in error
    assert error.startswith(("segdeform", "usage"))
    assert list(tmp_path.iterdir()) == []


def test_debug_shows_where_an_error_came_from():
    with pytest.raises(ValueError, match="no such file"):
        main(["--debug", "check", "no-such-file.ply"])


@pytest.mark.parametrize(
    ("missing", "advice"),
    [
        (set(), ""),
        ({"numba"}, "numba is not installed: frames take 3 to 6 times as long. pip install numba"),
        (
            {"numba", "threadpoolctl"},
            "numba and threadpoolctl are not installed: frames take 3 to 6 times as long. "
            "pip install numba threadpoolctl",
        ),
    ],
)
def test_version_says_which_libraries_are_missing_for_full_speed(
    missing, advice, monkeypatch, capsys
):
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None if name in missing else name)
    monkeypatch.setattr("vtk_segdeform.files.landlock.version", lambda: 1)
    assert main(["--version"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines == [f"segdeform {vtk_segdeform.__version__}", *filter(None, [advice])]


@pytest.mark.parametrize("known", [0, 3])
def test_version_says_if_the_reading_of_files_cannot_be_confined(known, monkeypatch, capsys):
    monkeypatch.setattr("vtk_segdeform.files.landlock.version", lambda: known)
    assert main(["--version"]) == 0
    assert ("Landlock" in capsys.readouterr().out) == (not known)


def test_version_and_help_end_well(capsys):
    assert main(["--version"]) == 0
    assert vtk_segdeform.__version__ in capsys.readouterr().out
    assert main(["--help"]) == 0
    text = capsys.readouterr().out
    assert "examples:" in text
    assert "exit codes:" in text
    assert main(["deform", "--help"]) == 0
    assert "selections (SEL):" in capsys.readouterr().out


def test_python_m_is_the_same_program(monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["segdeform", "check", "no-such-file.ply"])
    monkeypatch.delitem(sys.modules, "vtk_segdeform.__main__", raising=False)
    with pytest.raises(SystemExit) as end:
        runpy.run_module("vtk_segdeform", run_name="__main__", alter_sys=True)  # as python -m does
    assert end.value.code == 1
    assert capsys.readouterr().err.count("\n") == 1


class Terminal(io.StringIO):
    """A stream that is a terminal."""

    def isatty(self) -> bool:
        """Return True."""
        return True


def test_the_bar_waits_a_second_then_shows_and_leaves_no_trace(monkeypatch):
    clock = [0.0]
    monkeypatch.setattr("time.monotonic", lambda: clock[0])
    stream = Terminal()
    bar = ProgressBar(stream)
    bar(0.1, "fitting cages")
    assert stream.getvalue() == ""
    clock[0] = 2.0
    bar(0.5, "fitting cages")
    assert "[###############...............]  50% fitting cages" in stream.getvalue()
    bar.clear()
    assert stream.getvalue().endswith("\r\x1b[K")
