"""The plugin in pvpython gives the results of the Python API.  `make test-paraview`."""

from __future__ import annotations

import os
import runpy
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

import vtk_segdeform as sd

ROOT = Path(__file__).resolve().parents[2]
PLUGIN = ROOT / "vtk_segdeform" / "filters" / "paraview_plugin.py"

SCRIPT = """
import inspect, json, sys
inspect.getargspec = getattr(inspect, "getargspec", inspect.getfullargspec)  # ParaView 5.11
import numpy as np
from paraview.simple import *
from vtkmodules.util.numpy_support import vtk_to_numpy

plugin, surface, out = sys.argv[1:]
LoadPlugin(plugin, remote=False, ns=globals())
bent = SegmentedCageDeform(Input=XMLPolyDataReader(FileName=[surface]))

def told():
    bent.UpdatePipeline()
    data = servermanager.Fetch(bent)
    volume = data.GetFieldData().GetArray("VolumeChange")
    points = data.GetPoints()
    return points and vtk_to_numpy(points.GetData()), volume and volume.GetValue(0)

bent.Translation = [0.25, 0.0, -0.05]
shifted, volume = told()
bent.RotationAxis, bent.RotationAngle = [0.0, 1.0, 0.0], 30.0
turned, _ = told()
bent.HandleArray = "nothing"
nothing, _ = told()
assert nothing is None
bent.HandleArray = "handle"
again, _ = told()
np.savez(out, shifted=shifted, turned=turned, again=again, volume=volume)
"""

needs_paraview = pytest.mark.skipif(
    not (shutil.which("pvpython") and os.environ.get("SEGDEFORM_PARAVIEW")),
    reason="needs ParaView's pvpython: make test-paraview",
)


def pvpython(script, *arguments, **environment):
    return subprocess.run(
        ["pvpython", "--force-offscreen-rendering", str(script), *map(str, arguments)],
        env={**os.environ, **environment}, capture_output=True, text=True, timeout=300, check=False,
    )  # fmt: skip


@needs_paraview
def test_its_results_are_those_of_the_api(tmp_path):
    from vtk_segdeform.io.convert import to_polydata

    mesh = sd.models.cactus(1500)
    height = mesh.vertices[:, 2]
    fixed, handle = np.flatnonzero(height < 0.1), np.flatnonzero(height > 0.9)
    surface = to_polydata(mesh)
    surface.point_data["fixed"] = (height < 0.1).astype(np.uint8)
    surface.point_data["handle"] = (height > 0.9).astype(float)
    surface.save(tmp_path / "cactus.vtp")
    script = tmp_path / "script.py"
    script.write_text(SCRIPT)
    done = pvpython(
        script, PLUGIN, tmp_path / "cactus.vtp", tmp_path / "out.npz",
        PYTHONPATH=os.environ["SEGDEFORM_PARAVIEW"],
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    assert "no point array 'nothing'" in done.stdout + done.stderr
    got = np.load(tmp_path / "out.npz")
    shift = np.array([0.25, 0.0, -0.05])
    shifted = sd.deform(mesh, fixed, handle, mesh.vertices[handle] + shift, refine=False)
    assert_allclose(got["shifted"], shifted.vertices, rtol=0, atol=1e-9)
    assert abs(got["volume"]) < 1e-12
    centre, angle = mesh.vertices[handle].mean(axis=0), np.radians(30.0)
    turn = np.array(
        [[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]]
    )
    targets = (mesh.vertices[handle] - centre) @ turn.T + centre + shift
    turned = sd.deform(mesh, fixed, handle, targets, refine=False)
    assert_allclose(got["turned"], turned.vertices, rtol=0, atol=1e-9)
    assert (got["again"] == got["turned"]).all()


@needs_paraview
def test_a_scipy_that_is_too_old_is_an_error(tmp_path):
    (tmp_path / "scipy.py").write_text("__version__ = '1.10.1'")
    script = tmp_path / "script.py"
    script.write_text(
        "import inspect, sys, importlib.util as u\n"
        "inspect.getargspec = inspect.getfullargspec\n"
        "s = u.spec_from_file_location('plugin', sys.argv[1])\n"
        "s.loader.exec_module(u.module_from_spec(s))\n"
    )
    done = pvpython(script, PLUGIN, PYTHONPATH=str(tmp_path))
    assert "has scipy 1.10.1, vtk_segdeform needs 1.13" in done.stdout + done.stderr


def test_the_plugin_prints_its_path(monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["paraview_plugin", "--path"])
    with pytest.raises(SystemExit) as end:  # as python -m does
        runpy.run_module(
            "vtk_segdeform.filters.paraview_plugin", run_name="__main__", alter_sys=True
        )
    assert end.value.code == 0
    assert Path(capsys.readouterr().out.strip()).samefile(PLUGIN)
