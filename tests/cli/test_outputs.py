"""File names of commands: long names, unusual characters and unwritable files."""

from __future__ import annotations

import os

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from vtk_segdeform import models, read_mesh
from vtk_segdeform.cli import commands
from vtk_segdeform.cli.main import main
from vtk_segdeform.cli.outputs import report_pose
from vtk_segdeform.errors import ConstraintError, MeshError
from vtk_segdeform.io import convert
from vtk_segdeform.io import surface as surface_module
from vtk_segdeform.io.array_names import set_names
from vtk_segdeform.mesh.selection import parse_selection
from vtk_segdeform.pictures import canvas
from vtk_segdeform.solver import Solution, Status

BAR = models.bar(divisions=(3, 3, 9))
LONG = "n" * 256
POSE = ["--fixed", "z<10%", "--handle", "z>90%", "--translate", "0,0,0.1"]
POSE += ["--regions", "1", "--cage-vertices", "40"]
posix = pytest.mark.skipif(os.name != "posix", reason="names of any bytes, pipes")


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    convert.write_mesh("bar.ply", BAR)
    return tmp_path


def no_solver(*_, **__):
    raise AssertionError("the solver was set up")


@pytest.mark.parametrize(
    ("picture", "says"),
    [
        ("a.tiff", "a picture must be a .png file"), ("a", "a picture must be a .png file"),
        ("no/a.png", "there is no folder"), ("folder.png", "is a folder, not a file"),
        (f"{LONG}.png", "too long"),
        pytest.param("pipe.png", "a device or a pipe", marks=posix),
    ],
)  # fmt: skip
def test_a_picture_that_cannot_be_written_is_an_error_before_the_solve(
    folder, monkeypatch, capsys, picture, says
):
    (folder / "folder.png").mkdir()
    if os.name == "posix":
        os.mkfifo(folder / "pipe.png")
    before = set(os.listdir(folder))
    monkeypatch.setattr(commands, "Deformer", no_solver)
    monkeypatch.setattr(commands, "_regions", no_solver)
    assert main(["deform", "bar.ply", "-o", "out.ply", *POSE, "--picture", picture]) == 1
    error = capsys.readouterr().err
    assert says in error
    assert picture in error
    assert set(os.listdir(folder)) == before


def test_a_picture_that_fails_after_the_solve_is_an_error_too(folder, monkeypatch, capsys):
    real = os.replace

    def full(draft, target):
        if str(target).endswith(".png"):
            raise OSError(28, "No space left on device")
        real(draft, target)

    monkeypatch.setattr(os, "replace", full)
    monkeypatch.setattr(canvas, "_HEIGHT", 100)
    assert main(["deform", "bar.ply", "-o", "out.ply", *POSE, "--picture", "a.png"]) == 1
    assert "a.png: cannot be written (No space left" in capsys.readouterr().err
    assert sorted(os.listdir(folder)) == ["bar.ply", "out.ply"]


def test_a_selection_may_be_longer_than_a_name_of_a_file(folder):
    long = "&".join([f"z>{k}%" for k in range(90)])
    assert len(long) > 255
    assert_array_equal(parse_selection(long, BAR.vertices), parse_selection("z>89%", BAR.vertices))
    many = {LONG: np.arange(BAR.n_vertices) == 5}
    assert_array_equal(parse_selection(LONG, BAR.vertices, point_arrays=many), [5])
    assert_array_equal(parse_selection(f"{LONG} = 1", BAR.vertices, point_arrays=many), [5])
    handles = [word if word != "z>90%" else long for word in POSE]
    assert main(["deform", "bar.ply", "-o", "out.ply", *handles]) == 0


@pytest.mark.parametrize("text", [LONG, f"{LONG}=2", "z<0%&" * 200 + "x<0%", "a\0b", "/" * 5000])
def test_a_long_invalid_selection_is_named_and_truncated(text):
    with pytest.raises(ConstraintError, match=r"cannot read the selection|selects none") as error:
        parse_selection(text, BAR.vertices)
    assert len(str(error.value)) < 700


def test_a_mesh_that_exceeds_memory_is_an_error_that_names_it(folder, monkeypatch, capsys):
    def read(path):
        raise MemoryError

    convert.write_mesh("vast.obj", BAR)
    os.truncate("vast.obj", 1_400_000_000)
    monkeypatch.setitem(convert._FORMATS, ".obj", (read, convert.write_obj))
    assert main(["check", "vast.obj"]) == 1
    told = capsys.readouterr().err
    assert told == "segdeform check: vast.obj: not enough memory to read this file (1.4 GB)\n"


def test_work_that_exceeds_memory_is_an_error_in_one_line(folder, monkeypatch, capsys):
    def solve(*_, **__):
        raise MemoryError

    monkeypatch.setattr(commands.Deformer, "solve", solve)
    assert main(["deform", "bar.ply", "-o", "bent.ply", *POSE]) == 1
    assert capsys.readouterr().err.endswith("segdeform deform: out of memory\n")


@pytest.mark.parametrize(
    "words",
    [
        ["deform", "bar.ply", "-o", f"{LONG}.ply", *POSE],
        ["deform", f"{LONG}.ply", "-o", "out.ply", *POSE],
        ["deform", "bar.ply", "-o", "out.ply", *POSE, "--matrix", LONG],
        ["regions", "bar.ply", "-o", f"{LONG}.ply"],
        ["check", f"{LONG}.ply"],
        ["edit", f"{LONG}.segdeform"],
    ],
)
def test_a_name_that_is_too_long_is_an_error_that_names_it(capsys, words):
    assert main(words) in (1, 2)
    error = capsys.readouterr().err
    assert LONG[:100] in error
    assert "Traceback" not in error
    with pytest.raises(MeshError, match=LONG[:100]):
        read_mesh(f"{LONG}.ply")


ESCAPES = "\x1b]0;title\x07\x1b[2J\r\nfake line\x9b31m"


def named(name):
    """Return a bar with *name* wherever a surface has names and texts."""
    surface = convert.to_polydata(BAR)
    for sort in ("point", "cell"):
        getattr(surface, f"{sort}_data")[name] = np.zeros(getattr(surface, f"n_{sort}s"))
    for key in ("Object", "Group", "Material"):
        surface.cell_data[key] = np.zeros(surface.n_cells, dtype=int)
        set_names(surface, f"{key}Names", [name])
    for key in ("Header", "Comments", "MaterialLibrary", name):
        set_names(surface, key, [name])
    return surface


@posix
@pytest.mark.parametrize("suffix", [".obj", ".glb"])
def test_names_never_reach_the_terminal_as_control_characters(folder, monkeypatch, capsys, suffix):
    given, missing = named(ESCAPES), f"missing{ESCAPES}.ply"
    name, out = f"{ESCAPES}{suffix}", f"{ESCAPES}2{suffix}"
    with monkeypatch.context() as patch:  # as if a file had the names
        patch.setattr(surface_module, "read_polydata", lambda path: given)
        codes = [
            main(["regions", "bar.ply", "--regions", ESCAPES]),
            main(["deform", "bar.ply", "-o", out, *POSE, "--fixed", ESCAPES]),
            main(["deform", "bar.ply", "-o", out, "--fixed", "z<10%", "--handle", ESCAPES]),
            main(["check", "bar.ply", ESCAPES, f"--{ESCAPES}"]),
            main(["deform", "bar.ply", "-o", name, *POSE]),
        ]
    codes += [main(["check", name]), main(["check", missing]), main(["check", missing, "--json"])]
    assert codes == [1, 2, 2, 2, 0, 0, 1, 1]
    told = capsys.readouterr()
    for text in (told.out, told.err):
        assert [c for c in text if not c.isprintable() and c != "\n"] == []
        assert not any(line.startswith("fake line") for line in text.split("\n"))


def test_a_finish_that_has_not_converged_tells_its_estimate_as_the_least_motion():
    estimate = 0.04  # of the cactus of the demo, which further finishes move by 0.12 in all
    nowhere = np.empty(0, dtype=np.int64)
    solution = Solution(
        vertices=BAR.vertices, cage_vertices=(), steps=1, status=Status.STEP_LIMIT, merits=(),
        errors=lambda _: (0.0, 0.0), volume=lambda: 0.0, region_volumes=lambda _: np.empty(0),
        crossed=lambda _: nowhere, folded=lambda _: nowhere, remaining=estimate,
        unfinished=BAR.vertices,
    )  # fmt: skip
    lines: list[str] = []
    report_pose(solution, BAR, lines.append)
    assert lines[0].endswith("to finish it again would move it by 4 % of model size or more")
