"""``--attach A=B``: which component follows which."""

from __future__ import annotations

import numpy as np
import pytest
from bodies import bent, rod, tube

from vtk_segdeform.cli import commands
from vtk_segdeform.cli.main import main
from vtk_segdeform.io import read_mesh, write_mesh
from vtk_segdeform.widgets import plugin

POSE = ["--fixed", "z<0.4", "--handle", "z>3.6", "--rotate", "y,50", "--pivot", "0,0,2"]


@pytest.fixture(scope="module")
def mesh():
    return bent(rod(0.5, 0.0, 4.0, n=12, step=0.4), tube(0.56, 0.64, 1.0, 3.0, n=12, step=0.4)).mesh


@pytest.fixture
def given(mesh, tmp_path):
    write_mesh(tmp_path / "in.ply", mesh)
    return str(tmp_path / "in.ply"), str(tmp_path / "out.ply")


@pytest.mark.parametrize(("attach", "moves"), [([], True), (["1=free"], False)])
def test_a_sleeve_follows_unless_it_is_free(mesh, given, attach, moves):
    options = [word for each in attach for word in ("--attach", each)]
    assert main(["deform", given[0], "-o", given[1], *POSE, *options]) == 0
    moved = np.linalg.norm(read_mesh(given[1]).vertices - mesh.vertices, axis=1)
    assert (moved[mesh.components == 1].max() > 0.3) == moves


@pytest.mark.parametrize(
    ("attach", "says"),
    [("1", "must be A=B"), ("1=x", "must be A=B"), ("1=7", "0..1"), ("1=1", "0..1")],
)
def test_what_is_no_attachment_is_a_usage_error(given, attach, says, capsys):
    try:
        status = main(["deform", given[0], "-o", given[1], *POSE, "--attach", attach])
    except SystemExit as end:
        status = end.code
    assert status == 2
    assert says in capsys.readouterr().err


def test_an_edited_mesh_has_them_in_its_session(given, monkeypatch, capsys):
    seen = []
    monkeypatch.setattr(commands, "require_screen", lambda: None)
    monkeypatch.setattr(plugin, "edit", lambda session, **_: seen.append(session) or session)
    assert main(["edit", given[0], "--attach", "1=free"]) == 0
    assert main(["edit", given[0]]) == 0
    assert [dict(each.options.attach) for each in seen] == [{1: "free"}, {}]
    assert main(["edit", given[0], "--attach", "1=7"]) == 2
    assert "--attach must map components, 0..1" in capsys.readouterr().err


def test_attachments_are_for_automatic_regions(given, capsys):
    options = ["--regions", "1", "--attach", "1=0"]
    assert main(["deform", given[0], "-o", given[1], *POSE, *options]) == 2
    assert "--attach" in capsys.readouterr().err
