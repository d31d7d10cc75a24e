"""Rotations of `deform` keep their turns and their direction, or the command tells that not."""

from __future__ import annotations

import functools
import math

import numpy as np
import pytest
from bars import BAR, HEIGHT, RINGS, twist
from campaign import every

from vtk_segdeform import models
from vtk_segdeform.cli.main import main
from vtk_segdeform.cli.turns import turns_off
from vtk_segdeform.deformer import deform
from vtk_segdeform.geometry.motion import rotation, transform
from vtk_segdeform.geometry.volume import signed_volume
from vtk_segdeform.io import read_mesh, write_mesh
from vtk_segdeform.mesh import Mesh

QUICK = ["--regions", "1", "--cage-vertices", "80"]


@pytest.fixture(scope="module")
def turned(tmp_path_factory):
    """Return a function of the option --rotate: the exit code and the vertices written."""
    folder = tmp_path_factory.mktemp("turns")
    path, out = folder / "bar.ply", folder / "turned.ply"
    write_mesh(path, BAR)

    @functools.cache
    def run(*rotate: str, fixed: str = "z<5%", handle: str = "z>95%"):
        words = ["--fixed", fixed, "--handle", handle, *QUICK]
        code = main(["deform", str(path), "-o", str(out), *words, *rotate])
        return code, read_mesh(out).vertices

    return run


@pytest.mark.parametrize("degrees", every(2, [270, -180]))
def test_a_bar_is_wound_evenly_in_the_direction_and_by_the_angle_that_are_told(degrees, turned):
    code, x = turned("--rotate", f"z,{degrees}")
    angles = twist(x)
    assert code == 0
    assert angles[0] == pytest.approx(0.0, abs=1e-3)
    assert angles[-1] == pytest.approx(degrees, abs=1e-3)
    assert (np.diff(angles) * np.sign(degrees) > -1e-3).all()
    before, after = (signed_volume(each, BAR.faces) for each in (BAR.vertices, x))
    assert after == pytest.approx(before, rel=1e-6)  # single precision


def test_turns_that_the_body_loses_are_an_error(turned, capsys):
    code, x = turned("--rotate", "z,720", fixed="z<40%", handle="z>60%")
    assert code == 1
    assert abs(twist(x)[-1] - 720.0) > 180.0
    assert (
        "the body is not wound by 720 degrees: it has snapped back to 0;" in capsys.readouterr().err
    )


@pytest.mark.parametrize(
    ("axis", "divisions"),
    every(4, [("x", (2, 2, 2)), ("z", (2, 2, 2)), ("x", (2, 2, 6)), ("z", (2, 2, 6))]),
)
def test_a_coarse_bar_bends_by_half_a_turn_either_way_and_it_is_told_whether_by_more(
    tmp_path, capsys, divisions, axis
):
    """On a coarse bar, the sums of rotations are far from the angle, by up to half a turn.

    A twist, about z, follows to 270 degrees where there is more than one vertex along the bar.
    """
    path = tmp_path / "bar.ply"
    write_mesh(path, models.bar((0.2, 0.2, 1.0), divisions))
    words = [str(path), "-o", str(tmp_path / "bent.ply"), "--fixed", "z<0.01", "--handle", "z>0.99"]
    follows = axis == "z" and divisions[2] > 2
    for degrees, back in ((180, ""), (-180, ""), (270, "" if follows else "-90")):
        code = main(["deform", *words, *QUICK, "--no-refine", "--rotate", f"{axis},{degrees}"])
        assert code == bool(back)
        message = f"by {degrees} degrees: it has snapped back to {back};" if back else ""
        assert message in capsys.readouterr().err


def test_a_matrix_comes_before_the_rotation_and_both_together_keep_their_sense(tmp_path, turned):
    third = tmp_path / "third.txt"
    np.savetxt(third, rotation([0.0, 0.0, 1.0], math.radians(120.0)))
    code, x = turned("--rotate", "z,120", "--matrix", str(third))
    assert code == 0
    assert twist(x)[-1] == pytest.approx(240.0, abs=1e-3)


def test_deform_goes_through_the_targets_on_the_way():
    z = BAR.vertices[:, 2]
    fixed, handle = z < 0.5, z > HEIGHT - 0.5
    path = [
        transform(BAR.vertices[handle], rotation([0.0, 0.0, 1.0], math.radians(degrees)))
        for degrees in (-90.0, -180.0, -270.0)
    ]
    quick = {"n_regions": 1, "n_cage_vertices": 80, "refine": False}
    solution = deform(BAR, fixed, handle, path[-1], through=path[:-1], **quick)
    assert twist(solution.vertices)[-1] == pytest.approx(-270.0, abs=2.0)
    direct = deform(BAR, fixed, handle, path[-1], **quick)
    assert twist(direct.vertices)[-1] == pytest.approx(90.0, abs=2.0)


def test_the_turn_of_a_handle_is_measured_along_the_surface():
    z = BAR.vertices[:, 2]
    fixed, handle = np.flatnonzero(z < 0.1), np.flatnonzero(z > HEIGHT - 0.1)[::4]
    axis = np.array([0.0, 0.0, 1.0])
    for angle in (0.0, 2.0, -3.5, 12.0):
        x = np.concatenate(
            [
                transform(ring, rotation(axis, angle * ring[0, 2] / HEIGHT))
                for ring in BAR.vertices.reshape(RINGS, -1, 3)
            ]
        )
        for more in (0.0, 2.5, -2.5, 6.5, -12.6):
            off = turns_off(BAR, x, axis, angle + more, fixed=fixed, handle=handle)
            assert off == -round(more / (2.0 * math.pi))
    apart = Mesh(
        np.concatenate([BAR.vertices, BAR.vertices + 5.0]),
        np.concatenate([BAR.faces, BAR.faces + BAR.n_vertices]),
    )
    other = handle + BAR.n_vertices
    assert turns_off(apart, apart.vertices, axis, 9.0, fixed=fixed, handle=other) == 0


def test_where_all_vertices_are_held_this_is_what_is_told(turned, capsys):
    code, _ = turned("--rotate", "x,40", fixed="z<50%", handle="z>=50%")
    assert code == 1
    message = capsys.readouterr().err
    assert "all vertices are fixed or in handles, so nothing is free to move" in message
    assert "add cage vertices" not in message
