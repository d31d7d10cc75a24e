"""The command `pull`: what was given is written, moved; errors name the option."""

from __future__ import annotations

import re

import numpy as np
import pytest
import pyvista as pv
from given_surfaces import holed, require_only_moved
from numpy.testing import assert_allclose

from vtk_segdeform import models
from vtk_segdeform.cli.main import main
from vtk_segdeform.geometry import lids_of
from vtk_segdeform.geometry.volume import signed_volume
from vtk_segdeform.io import Surface, read_polydata, write_mesh
from vtk_segdeform.mesh import SurfacePoint


@pytest.fixture(scope="module")
def given(tmp_path_factory) -> str:
    path = tmp_path_factory.mktemp("pull") / "holed.vtp"
    write_mesh(path, holed())
    return str(path)


def text(point) -> str:
    return ",".join(map(str, point))


def test_pull_moves_the_point_keeps_the_pins_and_writes_what_was_given(given, tmp_path, capsys):
    before = read_polydata(given)
    mesh = Surface(before).mesh
    x = mesh.vertices
    at, pin = x[x[:, 2].argmax()], x[x[:, 2].argmin()]
    to, out = at + [0.1 * mesh.diagonal, 0.0, 0.0], tmp_path / "pulled.vtp"
    words = ["pull", given, "-o", str(out), "--at", text(at), "--to", text(to), "--pin", text(pin)]
    words += ["--regions", "1", "--cage-vertices", "40", "--radius", "0.5", "--avoid-contact"]
    assert main(words) == 0
    printed = capsys.readouterr().out
    assert "volume kept under lids" in printed
    assert "status          converged" in printed or "status          not fully" in printed
    assert "crossings       none\n" in printed
    assert "folds           none\n" in printed
    after = read_polydata(out)
    require_only_moved(before, after)
    moved = Surface(after).mesh.vertices
    assert_allclose(moved[x[:, 2].argmax()], to, atol=1e-3 * mesh.diagonal)
    assert_allclose(moved[x[:, 2].argmin()], pin, atol=1e-3 * mesh.diagonal)
    lids, closed = lids_of(mesh), lids_of(mesh).closed(mesh)
    volumes = [signed_volume(lids.extension @ each, closed) for each in (x, moved)]
    assert np.ptp(volumes) < 1e-6 * volumes[0]  # of single precision coordinates


def test_places_far_from_the_origin_have_all_their_digits(tmp_path, capsys):
    mesh = models.bar(divisions=(2, 2, 7))
    far = mesh.with_vertices(mesh.vertices + [1e6, -1e6, 0.0])
    path, vertex = tmp_path / "far.ply", 40
    write_mesh(path, far)
    at = far.vertices[vertex]
    words = ["pull", str(path), "-o", str(tmp_path / "out.ply"), "--to", text(at + [0.05, 0, 0])]
    words += ["--regions", "1", "--cage-vertices", "40"]
    assert main([*words, "--at", text(at)]) == 0
    assert main([*words, "--at", text(at - [1.0, 0, 0])]) == 2
    printed = capsys.readouterr()
    for words in (printed.out, printed.err):
        place = re.search(r" at (\S+,\S+,\S+)", words)[1]
        assert np.linalg.norm(far.vertices - np.array(place.split(","), float), axis=1).min() < 2e-6


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["--at", "9,9,9", "--to", "0,0,1"], "--at is .* away from the surface; .* one is at"),
        (["--at", "0,1", "--to", "0,0,1"], "--at must be three numbers"),
        (
            ["--at", "{top}", "--to", "0,0,9", "--radius", "-1"],
            "--radius must be a positive number;",
        ),
        (["--at", "{top}", "--to", "0,0,9", "--regions", "0"], "--regions must be a whole number"),
        (["--at", "{top}", "--to", "0,0,9", "--cage-vertices", "1"], "--cage-vertices must be"),
        (["--at", "{top}", "--to", "0,0,x"], "to must be x,y,z"),
        (["--at", "{top}", "--to", "-.1,0,9", "--pin", "-5,0,0"], "--pin is"),
        (["--at", "{top}", "--to", "0,0,9", "--local", "2"], "--local must be a number from 0 to"),
        (["--at", "{top}", "--to", "0,0,9", "--limb", "-1"], "--limb must be None or a whole num"),
        (["--at", "{top}", "--to", "0,0,9", "--hinge", "2"], "--hinge must be a number from 0 to"),
        (["--at", "{top}", "--to", "0,0,9", "--pin", "{top}"], "both pins and handle"),
    ],
)
def test_wrong_options_are_errors_that_name_them(words, says, given, tmp_path, capsys):
    x = Surface.read(given).mesh.vertices
    words = [word.replace("{top}", text(x[x[:, 2].argmax()])) for word in words]
    quick = ["--regions", "1", "--cage-vertices", "40"]
    assert main(["pull", given, "-o", str(tmp_path / "out.vtp"), *quick, *words]) == 2
    message = capsys.readouterr().err
    assert re.search(says, message), message
    assert not list(tmp_path.iterdir())


@pytest.fixture
def beam(tmp_path) -> str:
    """Return a file of a beam with vertices at its ends only, as CAD programs write it."""
    path = tmp_path / "beam.ply"
    write_mesh(path, pv.Box((0.0, 6.0, 0.0, 1.0, 0.0, 1.0)))
    return str(path)


QUICK = ["--regions", "1", "--cage-vertices", "40"]


def test_a_point_in_the_middle_of_a_large_face_is_refused_until_it_is_subdivided(
    beam, tmp_path, capsys
):
    fine, out = str(tmp_path / "fine.ply"), tmp_path / "out.ply"
    words = ["--at", "2.93,0.37,1", "--to", "2.93,0.37,1.8", *QUICK]
    assert main(["pull", beam, "-o", str(out), *words]) == 2
    assert "% of model size away" in (message := capsys.readouterr().err)
    assert "segdeform subdivide" in message
    assert not out.exists()
    assert main(["subdivide", beam, "-o", fine, "--edge", "8"]) == 0
    before, after = Surface.read(beam), Surface.read(fine)
    x, edges = after.mesh.vertices, after.mesh.edges
    assert_allclose(after.given.points[: before.given.n_points], before.given.points, atol=1e-6)
    assert after.mesh.is_closed
    longest = np.linalg.norm(x[edges[:, 0]] - x[edges[:, 1]], axis=1).max()
    assert longest < 0.08 * before.mesh.diagonal
    assert signed_volume(x, after.mesh.faces) == pytest.approx(6.0, rel=1e-6)
    assert main(["pull", fine, "-o", str(out), *words]) == 0
    assert "a point between the vertices" in capsys.readouterr().out
    point = SurfacePoint.nearest(after.mesh, np.array([2.93, 0.37, 1.0]))
    assert len(point.corners) == 3
    assert_allclose(point.at(Surface.read(out).mesh.vertices), [2.93, 0.37, 1.8], atol=1e-3)


def test_a_pin_in_the_middle_of_a_large_face_is_refused(beam, tmp_path, capsys):
    words = ["--at", "0.1,0.1,1", "--to", "0.1,0.1,1.5", "--pin", "3,0.5,0", *QUICK]
    assert main(["pull", beam, "-o", str(tmp_path / "out.ply"), *words]) == 2
    assert "--pin: no vertex is near this point" in capsys.readouterr().err


def test_edges_are_subdivided_by_a_sensible_share_only(beam, tmp_path, capsys):
    for edge in ("0", "-1", "nan", "101"):
        words = ["subdivide", beam, "-o", str(tmp_path / "out.ply"), f"--edge={edge}"]
        assert main(words) == 2
        assert "--edge must be from 0.5 to 100" in capsys.readouterr().err
