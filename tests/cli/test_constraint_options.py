"""``--rigid``, ``--stiffness``, ``--slide``, ``--symmetry`` and the arrays that follow."""

from __future__ import annotations

import re

import numpy as np
import pytest
import pyvista as pv
from limbed import torso
from numpy.testing import assert_allclose

from vtk_segdeform.cli import commands, pulling
from vtk_segdeform.cli.main import main
from vtk_segdeform.deformer import Mirror, Stiffness
from vtk_segdeform.errors import ConstraintError
from vtk_segdeform.geometry import rigid_fit
from vtk_segdeform.io import Surface, read_polydata, write_mesh

BODY = torso(3)
X, SIZE = BODY.vertices, BODY.diagonal
MIRROR = Mirror.of(BODY, "x")
TIP = X[X[:, 0].argmax()]
MOTIONS = {
    "deform": ["--handle", "x>1.6", "--translate", "-0.2,0.1,0.5", "--refine"],
    "pull": [
        *("--at", ",".join(map(str, TIP))),
        *("--to", ",".join(map(str, TIP + [-0.2, 0.1, 0.5]))),
    ],
}


@pytest.fixture(scope="module")
def given(tmp_path_factory) -> str:
    faces = np.hstack([np.full((BODY.n_faces, 1), 3), BODY.faces]).ravel()
    surface = pv.PolyData(X, faces)
    surface["fibre"] = np.tile([0.0, 0.0, 1.0], (len(X), 1))
    surface["flow"] = np.tile([0.0, 2.0, 0.0], (len(X), 1))
    surface["plane"] = (X[:, 2] < -1.3).astype(int)
    path = tmp_path_factory.mktemp("given") / "torso.vtp"
    write_mesh(path, surface)
    return str(path)


def command(given, out, name: str, *more: str) -> list[str]:
    """Return the words of a command with few cages."""
    few = ["--regions", "1", "--cage-vertices", "80"]
    return [name, given, "-o", str(out), *MOTIONS[name], *more, *few]


@pytest.mark.parametrize(
    ("name", "place", "more"),
    [
        ("deform", (commands, "Deformer"), {"stretch": 3.0, "rotation_groups": 7}),
        ("pull", (pulling, "pulled"), {}),
    ],
)
def test_options_named_as_in_python_are_passed_on(name, place, more, given, tmp_path, monkeypatch):
    passed = {}

    def refuse(*_, **options):
        passed.update(options)
        raise ConstraintError("enough")

    monkeypatch.setattr(*place, refuse)
    expected = {"avoid_contact": True, "symmetry": "x", **more}
    words = ["--avoid-contact", "--symmetry", "x"]
    words += [w for k, v in more.items() for w in (f"--{k.replace('_', '-')}", str(v))]
    assert main(command(given, tmp_path / "out.vtp", name, *words)) == 2
    assert {key: passed[key] for key in expected} == expected


@pytest.mark.parametrize("name", ["deform", "pull"])
def test_all_of_them_are_kept_in_the_file(name, given, tmp_path, capsys):
    out = tmp_path / "posed.vtp"
    more = ["--rigid", "z>1.2", "--slide", "z<-1.3", "--symmetry", "x", "--stiffness", "x>0.8=4"]
    more += ["--turn", "fibre", "--push", "flow", "--displacement", "moved"]
    assert main(command(given, out, name, *more)) == 0
    printed = capsys.readouterr().out
    assert re.search(r"status +converged", printed)
    assert "approximate" not in printed
    posed = read_polydata(out)
    x = Surface(posed).mesh.vertices
    u = x - X
    assert np.linalg.norm(u, axis=1).max() > 0.5
    assert np.abs(u - MIRROR.mirrored(u)).max() < 1e-9 * SIZE
    (head,) = Stiffness.of(BODY, np.where(X[:, 2] > 1.2, np.inf, 1.0)).rigid
    turn, shift = rigid_fit(X[head], x[head])
    assert np.abs(X[head] @ turn.T + shift - x[head]).max() < 1e-9 * SIZE
    feet = X[:, 2] < -1.3
    normal = np.linalg.eigh(np.cov(X[feet].T))[1][:, 0]  # of the plane nearest to both feet
    assert np.abs(u[feet] @ normal).max() < 1e-9 * SIZE
    assert_allclose(posed.point_data["moved"], u, atol=1e-12)
    within = head[[np.isin(BODY.faces[(BODY.faces == v).any(1)], head).all() for v in head]]
    assert len(within) > 5
    for array, before in (("fibre", [0.0, 0.0, 1.0]), ("flow", [0.0, 2.0, 0.0])):
        expected = np.tile(turn @ before, (len(within), 1))
        assert_allclose(posed.point_data[array][within], expected, atol=1e-9)
    lengths = np.linalg.norm(posed.point_data["fibre"], axis=1)
    assert_allclose(lengths, 1.0, atol=1e-12)
    assert np.ptp(np.linalg.norm(posed.point_data["flow"], axis=1)) > 0.02


def test_a_slide_along_a_line_or_the_surface_follows_a_colon(given, tmp_path):
    for along in ("line", "surface"):
        out = tmp_path / f"{along}.vtp"
        assert main(command(given, out, "pull", "--slide", f"z<-1.3:{along}")) == 0
        u = Surface(read_polydata(out)).mesh.vertices - X
        feet = X[:, 2] < -1.3
        if along == "line":
            across = np.linalg.eigh(np.cov(X[feet].T))[1][:, :2]
            assert np.abs(u[feet] @ across).max() < 1e-9 * SIZE
        assert np.abs(u[feet]).max() > 1e-4


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (["--stiffness", "x>0.8"], "--stiffness must be a selection and how many times stiffer"),
        (["--stiffness", "x>0.8=soft"], "got 'x>0.8=soft'"),
        (["--stiffness", "x>0.8=-1"], "got 'x>0.8=-1'"),
        (["--stiffness", "x>0.8=nan"], "got 'x>0.8=nan'"),
        (["--rigid", "w>3"], "'w>3'"),
        (["--rigid", "z>99"], "z>99"),
        (["--slide", "z<-1.3:curve"], "z<-1.3:curve"),
        (["--symmetry", "y"], "not symmetric about this plane"),
        (["--turn", "nothing"], "no array 'nothing' of vectors or tensors"),
        (["--push", "nothing"], "no array 'nothing' of vectors or tensors"),
    ],
)
@pytest.mark.parametrize("name", ["deform", "pull"])
def test_errors_name_what_is_wrong(name, words, text, given, tmp_path, capsys):
    out = tmp_path / "posed.vtp"
    assert main(command(given, out, name, *words)) == 2
    assert text in capsys.readouterr().err
    assert not out.exists()


@pytest.mark.parametrize("more", [["--rigid", "z>1.2"], ["--slide", "z<-1.3"], ["--symmetry", "x"]])
def test_without_a_finish_they_are_said_to_be_approximate(more, given, tmp_path, capsys):
    words = command(given, tmp_path / "posed.vtp", "pull", "--no-refine", *more)
    assert main(words) == 0
    assert "rigid parts, slides and symmetry are approximate" in capsys.readouterr().out
