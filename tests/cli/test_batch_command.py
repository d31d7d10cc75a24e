"""``segdeform batch`` and ``pose``: a plan in a file, and a pose as a mesh."""

from __future__ import annotations

import json
from concurrent.futures import ThreadPoolExecutor
from functools import partial

import numpy as np
from limbed import torso

import vtk_segdeform as sd
from vtk_segdeform.batches import run
from vtk_segdeform.batches.tasks import compute
from vtk_segdeform.cli.main import main


def here(run, count, settings):
    """Compute the tasks in threads: test_batches starts processes."""
    with ThreadPoolExecutor(count) as pool:
        run.on(partial(pool.submit, compute), count)


def test_a_plan_is_computed_and_a_pose_is_written(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(run, "_run_here", here)
    monkeypatch.setenv("SEGDEFORM_CACHE", str(tmp_path / "cache"))
    sd.write_mesh(tmp_path / "limb.ply", torso(2))
    poses = [{"random": 1, "seed": 7}, {"fixed": "z<-9", "volumes": {"whole": "+5%"}}]
    plan, out = tmp_path / "plan.json", str(tmp_path / "out")
    plan.write_text(json.dumps({"meshes": ["limb*.ply"], "poses": poses, "n_cage_vertices": 40}))
    assert main(["batch", str(plan), "-o", out, "--workers", "1"]) == 1
    printed = capsys.readouterr().out
    assert "2: 1 converged, 1 failed" in printed
    assert "'z<-9' selects none" in printed
    written = tmp_path / "pose.ply"
    assert main(["pose", out, "0", "-o", str(written)]) == 0
    expected = sd.PoseStore(out).vertices(0)
    np.testing.assert_allclose(sd.read_mesh(written).vertices, expected, atol=1e-12)
    assert main(["pose", out, "1", "-o", str(written)]) == 1
    assert "without vertices" in capsys.readouterr().err
