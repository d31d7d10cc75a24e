"""Landmarks in the files of other programs."""

from __future__ import annotations

import json

import numpy as np
import pytest
import pyvista as pv
from numpy.testing import assert_array_equal

from vtk_segdeform import models
from vtk_segdeform.errors import ArgumentError, MeshError
from vtk_segdeform.io import write_mesh
from vtk_segdeform.landmarks import Landmarks, paired, read_landmarks, write_landmarks

POINTS = np.array([[1.25, -2.0, 3.0], [4.0, 5.5, -6.0]])
CSV = "label,x,y,z,uncertainty\nnasion,1.25,-2,3,\ntip,4,5.5,-6,0.5\n"
FCSV = """\
# Markups fiducial file version = 4.11
# CoordinateSystem = {}
# columns = id,x,y,z,ow,ox,oy,oz,vis,sel,lock,label,desc,associatedNodeID
1,{}1.25,{}2,3,0,0,0,1,1,1,0,nasion,"a, b",
2,{}4,{}5.5,-6,0,0,0,1,1,1,0,tip,,
"""
PICKED = """\
<!DOCTYPE PickedPoints>
<PickedPoints>
 <DocumentData><DateTime date="2024-01-01" time="10:00:00"/></DocumentData>
 <point x="1.25" y="-2" z="3" active="1" name="nasion"/>
 <point x="9" y="9" z="9" active="0" name="not picked"/>
 <point x="4" y="5.5" z="-6" active="1" name="tip"/>
</PickedPoints>
"""


def markups(system: str, sign: float) -> str:
    places = POINTS * [sign, sign, 1.0]
    points = [
        {"label": name, "position": place.tolist(), "positionStatus": "defined"}
        for name, place in zip(("nasion", "tip"), places, strict=True)
    ]
    points.append({"label": "to come", "position": [0, 0, 0], "positionStatus": "undefined"})
    return json.dumps({"markups": [{"coordinateSystem": system, "controlPoints": points}]})


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("a.csv", CSV),
        ("a.csv", CSV.replace(",", ";")),
        ("a.csv", "\ufeff" + CSV.replace(",", "\t")),
        ("a.csv", "nasion,1.25,-2,3\n\ntip,4,5.5,-6\n"),
        ("a.fcsv", FCSV.format("LPS", "", "-", "", "")),
        ("a.fcsv", FCSV.format("1", "", "-", "", "")),
        ("a.fcsv", FCSV.format("0", "-", "", "-", "-")),
        ("a.fcsv", FCSV.format("RAS", "-", "", "-", "-")),
        ("a.mrk.json", markups("LPS", 1.0)),
        ("a.mrk.json", markups("RAS", -1.0)),
        ("a.pp", PICKED),
    ],
)
def test_names_and_points_are_read(tmp_path, name, text):
    (tmp_path / name).write_text(text, encoding="utf-8")
    found = read_landmarks(tmp_path / name)
    assert found.names == ("nasion", "tip")
    assert_array_equal(found.points, POINTS)
    assert_array_equal(found.uncertainty, [np.nan, 0.5 if "uncertainty" in text else np.nan])


def test_points_of_meshes_and_of_files_without_names_are_numbered(tmp_path):
    write_mesh(tmp_path / "a.obj", models.sphere(12))
    assert read_landmarks(tmp_path / "a.obj").names[:2] == ("1", "2")
    pv.PolyData(POINTS).save(tmp_path / "a.ply")
    assert_array_equal(read_landmarks(tmp_path / "a.ply").points, POINTS)
    (tmp_path / "a.csv").write_text("1.25,-2,3\n4,5.5,-6\n")
    assert read_landmarks(tmp_path / "a.csv").names == ("1", "2")


def test_what_is_written_is_read_again_to_the_last_digit(tmp_path):
    for sigma in (np.full(2, np.nan), np.array([0.1, np.nan])):
        one = Landmarks(('a "b", c', "2"), POINTS / 3.0, sigma)
        write_landmarks(tmp_path / "a.csv", one)
        again = read_landmarks(tmp_path / "a.csv")
        assert again.names == one.names
        assert_array_equal(again.points, one.points)
        assert_array_equal(again.uncertainty, one.uncertainty)
    with pytest.raises(ArgumentError, match=r"must end in \.csv"):
        write_landmarks(tmp_path / "a.fcsv", one)


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("a.csv", "a,1,2\n", "landmark 1 has 3 columns|could not convert"),
        ("a.csv", "a,1,2,3\nb,1,2\n", "landmark 2 has 3 columns"),
        ("a.csv", "a,1,2,nan\n", "coordinates of 'a' are not finite"),
        ("a.csv", "", "^[^(]*a.csv: has no landmarks$"),
        ("a.csv", "a,1,2,3,-1\n", "negative"),
        ("a.csv", "a,1,2,3\na,1,2,4\n", "has 2 landmarks called 'a'"),
        ("a.fcsv", "# CoordinateSystem = IJK\n1,2,3,4\n", "not LPS or RAS"),
        ("a.fcsv", "# columns = id,x\n1,2\n", "is no file of landmarks"),
        ("a.mrk.json", "{}", "is no file of landmarks"),
        ("a.mrk.json", "[", "is no file of landmarks"),
        ("a.pp", "<a", "is no file of landmarks"),
        ("a.pp", '<!DOCTYPE a [<!ENTITY b "c">]><a/>', "declares entities"),
        ("a.pp", "<PickedPoints/>", "has no landmarks"),
        ("a.ply", "ply\n", "PLY"),
    ],
)
def test_files_without_landmarks_are_errors(tmp_path, name, text, message):
    (tmp_path / name).write_text(text)
    with pytest.raises(MeshError, match=message):
        read_landmarks(tmp_path / name)
    with pytest.raises(MeshError):
        read_landmarks(tmp_path / f"missing-{name}")


def test_pairs_have_a_name_in_common_and_both_uncertainties():
    one = Landmarks(("a", "b", "c"), np.eye(3), np.array([3.0, np.nan, 1.0]))
    other = Landmarks(("c", "x", "a", "b"), np.arange(12.0).reshape(4, 3), np.full(4, np.nan))
    pairs = paired(one, other)
    assert pairs.names == ("a", "b", "c")
    assert_array_equal(pairs.target, other.points[[2, 3, 0]])
    assert_array_equal(pairs.uncertainty, [3.0, np.nan, 1.0])
