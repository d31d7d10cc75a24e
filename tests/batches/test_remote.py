"""Batches whose plan, meshes and poses are elsewhere: in fsspec's file system in memory."""

from __future__ import annotations

import json
import sys
from functools import partial

import pytest
from limbed import crab, torso
from test_batches import Here

import vtk_segdeform as sd
from vtk_segdeform.batches import remote, run
from vtk_segdeform.batches.tasks import compute, deformer_of
from vtk_segdeform.cli.main import main
from vtk_segdeform.errors import ArgumentError, MissingDependencyError

fsspec = pytest.importorskip("fsspec")
PLAN, OUT = "memory://there/plan.json", "memory://there/out"


@pytest.fixture(autouse=True)
def files(tmp_path, monkeypatch):
    """Return the file system, with a plan and two meshes."""
    monkeypatch.setenv("SEGDEFORM_CACHE", str(tmp_path / "cache"))
    deformer_of.cache_clear()
    files = fsspec.filesystem("memory")
    files.store.clear()
    for number, body in (2, torso(2)), (1, crab(2)):
        sd.write_mesh(tmp_path / f"limb{number}.ply", body)
        files.put_file(str(tmp_path / f"limb{number}.ply"), f"/there/limb{number}.ply")
    plan = {"meshes": ["limb*.ply"], "poses": [{"random": 2}], "n_cage_vertices": 40, "block": 1}
    files.pipe_file("/there/plan.json", json.dumps(plan).encode())
    yield files
    files.store.clear()


def test_a_plan_by_url_has_the_poses_of_one_here(files, tmp_path):
    stored = sd.batch(PLAN, OUT, executor=Here())
    names = [f"memory:///there/limb{number}.ply" for number in (1, 1, 2, 2)]
    assert stored.table()["mesh"] == names
    assert {"/there/out/poses.segposes"} < {*files.find("/there/out")}  # and the table
    here = {**json.loads(files.cat_file("/there/plan.json")), "meshes": [str(tmp_path / "*.ply")]}
    assert sd.batch(here, tmp_path / "out", executor=Here()).digest() == stored.digest()
    assert sd.PoseStore(OUT).digest() == stored.digest()


def test_it_continues_what_is_there_and_copies_on_the_way(monkeypatch):
    monkeypatch.setattr(remote, "_PERIOD", 0.0)
    monkeypatch.setattr(remote, "_TIMES", 0.0)
    counts = []

    def stop(fraction, text):
        if fraction:
            counts.append(sd.PoseStore(OUT).table()["status"].count("converged"))
        if fraction >= 0.5:
            raise sd.Cancelled

    with pytest.raises(sd.Cancelled):
        sd.batch(PLAN, OUT, executor=Here(), progress=stop)
    assert max(counts) == 2
    done = sd.PoseStore(OUT).table()["status"].count("converged")
    again = Here()
    assert len(sd.batch(PLAN, OUT, executor=again)) == 4
    assert sum(again.tasks) == 4 - done < 4


def test_the_commands_take_urls(tmp_path, monkeypatch, capsys):
    submit = partial(Here().submit, compute)
    monkeypatch.setattr(run, "_run_here", lambda tasks, count, _: tasks.on(submit, count))
    assert main(["batch", PLAN, "-o", OUT, "--workers", "1"]) == 0
    assert f"written         {OUT}" in capsys.readouterr().out
    assert main(["pose", OUT, "3", "-o", str(tmp_path / "pose.ply")]) == 0
    assert sd.read_mesh(tmp_path / "pose.ply").n_vertices == torso(2).n_vertices


def test_what_is_not_there_is_named(files, monkeypatch):
    plan = {"meshes": ["memory://there/no*.ply"], "poses": [{"random": 1}]}
    with pytest.raises(ArgumentError, match=r"none called memory://there/no\*"):
        sd.batch(plan, OUT, executor=Here())
    with pytest.raises(ArgumentError, match="no file memory://nowhere"):
        sd.PoseStore("memory://nowhere")
    with pytest.raises(ArgumentError, match=r"none\.json cannot be read"):
        sd.batch("memory://there/none.json", OUT)
    with pytest.raises(ArgumentError, match="unknown://there"):
        sd.batch("unknown://there/plan.json", OUT)
    files.pipe_file("/there/broken.ply", b"none")
    plan = {"meshes": ["memory://there/broken.ply"], "poses": [{"random": 1}]}
    assert sd.batch(plan, OUT, executor=Here()).table()["status"] == ["failed"]
    monkeypatch.setitem(sys.modules, "fsspec", None)
    with pytest.raises(MissingDependencyError, match=r"vtk-segdeform\[remote\]"):
        sd.PoseStore(OUT)
