"""The plugin in pvpython gives the results of the Python API (`make test-paraview`).

That ParaView's loader can execute its file, and what it says where it cannot work, is tested
without ParaView, whose decorators are then replaced.
"""

from __future__ import annotations

import configparser
import os
import re
import runpy
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

import vtk_segdeform as sd
from vtk_segdeform.cages import suggested_size

ROOT = Path(__file__).resolve().parents[2]
PLUGIN = ROOT / "vtk_segdeform" / "filters" / "paraview_plugin.py"
LIBRARIES = os.pathsep.join(each for each in sys.path if each.endswith("site-packages"))

# As ParaView does: the file alone, under its own name.
LOAD = """
import importlib.util, platform, sys
platform.python_version = lambda: sys.argv[2]
spec = importlib.util.spec_from_file_location("paraview_plugin", sys.argv[1])
plugin = importlib.util.module_from_spec(spec)
spec.loader.exec_module(plugin)
print(plugin.SegmentedCageDeform.__mro__[1].__module__)
made = plugin.SegmentedCageDeform()
made.SetAttach("1=0, 2=free")
print(made._settings.attach)
"""
DECORATORS = """
class Decorators:
    def __getattr__(self, name):
        return lambda *given, **options: lambda decorated: decorated
smdomain = smhint = smproperty = smproxy = Decorators()
"""

SCRIPT = """
import inspect
inspect.getargspec = inspect.getfullargspec

import sys
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

# A ball whose top is shifted by .2; prints how far it has come.
BEND = """
import numpy as np
from vtk_segdeform.filters import SegmentedCageDeformFilter
from vtkmodules.util.numpy_support import numpy_to_vtk, vtk_to_numpy
from vtkmodules.vtkFiltersSources import vtkSphereSource

source = vtkSphereSource()
source.SetThetaResolution(24)
source.SetPhiResolution(24)
source.Update()
surface = source.GetOutput()
vertices = vtk_to_numpy(surface.GetPoints().GetData()).copy()
height = vertices[:, 2]
for name, marked in (("fixed", height < -0.3), ("handle", height > 0.4)):
    array = numpy_to_vtk(marked.astype(float))
    array.SetName(name)
    surface.GetPointData().AddArray(array)
bent = SegmentedCageDeformFilter()
bent.SetInputDataObject(surface)
bent.SetTranslation(0.2, 0.0, 0.0)
bent.Update()
moved = vtk_to_numpy(bent.GetOutputDataObject(0).GetPoints().GetData())
print(round(float((moved - vertices)[height > 0.4, 0].mean()), 3))
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
    regions = sd.segment(mesh)
    cages = sd.fit_cages(mesh, regions, suggested_size(regions))

    def solved(targets):
        deformer = sd.Deformer(mesh, regions, cages, fixed=fixed, handle=handle)
        return deformer.solve(targets)

    shift = np.array([0.25, 0.0, -0.05])
    shifted = solved(mesh.vertices[handle] + shift)
    assert_allclose(got["shifted"], shifted.vertices, rtol=0, atol=1e-9)
    assert abs(got["volume"]) < 1e-12
    centre, angle = mesh.vertices[handle].mean(axis=0), np.radians(30.0)
    turn = np.array(
        [[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]]
    )
    targets = (mesh.vertices[handle] - centre) @ turn.T + centre + shift
    turned = solved(targets)
    assert_allclose(got["turned"], turned.vertices, rtol=0, atol=1e-9)
    assert (got["again"] == got["turned"]).all()


@pytest.fixture
def loaded(tmp_path):
    """Return a function that executes a plugin file in a fresh Python, without its site-packages.

    It returns the standard output, or the last line of the error.
    """
    module = tmp_path / "stand-in" / "paraview" / "util" / "vtkAlgorithm.py"
    module.parent.mkdir(parents=True)
    module.write_text(DECORATORS)

    def load(plugin, *folders, python="3.11.2"):
        path = os.pathsep.join(map(str, (tmp_path / "stand-in", *folders)))
        done = subprocess.run(
            [sys.executable, "-S", "-c", LOAD, str(plugin), python], cwd=tmp_path,
            env={**os.environ, "PYTHONPATH": path}, capture_output=True, text=True, check=False,
        )  # fmt: skip
        return done.stderr.strip().split("\n")[-1] or done.stdout.strip()

    return load


OURS = "vtk_segdeform.filters.deform_filter\n((1, 0), (2, 'free'))"


def test_the_file_in_the_package_finds_the_package_that_contains_it(loaded, tmp_path):
    (tmp_path / "vtk_segdeform").mkdir()  # as a checkout in the current folder: not the package
    assert loaded(PLUGIN, LIBRARIES) == OURS


@pytest.mark.campaign  # another process; those of the file itself remain
def test_a_copy_needs_the_package_in_the_path(loaded, tmp_path):
    (tmp_path / "vtk_segdeform").mkdir()
    copy = shutil.copy(PLUGIN, tmp_path / "vtk_segdeform" / "copy.py")
    assert loaded(copy, ROOT, LIBRARIES) == OURS
    text = loaded(copy)
    assert text.startswith("RuntimeError: the plugin needs the package vtk_segdeform, which ParaV")
    assert "paraview_plugin --path prints" in text
    assert "PYTHONPATH=FOLDER" in text


def test_numpy_scipy_and_vtk_are_enough(tmp_path):
    """All that the Python of a ParaView has to have; the others are not in its path here."""
    site = Path(np.__file__).parents[1]
    for name in ("numpy", "scipy", "numpy.libs", "scipy.libs", "vtkmodules", "vtk.libs"):
        if (site / name).exists():
            (tmp_path / name).symlink_to(site / name)
    path = os.pathsep.join(map(str, (tmp_path, ROOT)))
    done = subprocess.run(
        [sys.executable, "-S", "-c", BEND], cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": path}, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.stdout.strip() == "0.2", done.stderr


@pytest.mark.parametrize(
    ("library", "source", "found"),
    [("numpy", "__version__ = '1.24.2'", "has 1.24.2"),
     ("scipy", "__version__ = '1.10.1'", "has 1.10.1"),
     ("scipy", "import nothing", "cannot import it (No module named 'nothing')")],
)  # fmt: skip
def test_a_library_that_is_too_old_or_missing_is_named(loaded, tmp_path, library, source, found):
    for name in ("numpy", "scipy"):
        (tmp_path / "stand-in" / f"{name}.py").write_text("__version__ = '9.0.0rc1'")
    (tmp_path / "stand-in" / f"{library}.py").write_text(source)
    text = loaded(PLUGIN)
    assert re.search(
        rf"needs {library} [\d.]+ or newer; ParaView's Python {re.escape(found)}: pip", text
    )
    assert "pip install --target FOLDER numpy scipy with Python 3.11.2" in text


def test_a_python_that_is_too_old_is_named(loaded):
    assert "a ParaView with Python 3.10 or newer; this one has 3.9.18" in loaded(
        PLUGIN, python="3.9.18"
    )


def test_the_lowest_versions_are_those_of_setup_cfg():
    setup = configparser.ConfigParser()
    setup.read(ROOT / "setup.cfg", encoding="utf-8")
    requires = (
        f"{setup['options']['install_requires']}\npython{setup['options']['python_requires']}"
    )
    lowest = dict(re.findall(r"(?m)^([\w-]+)>=([\d.]+)", requires))
    written = re.findall(r'"(\w+)": "([\d.]+)"', PLUGIN.read_text(encoding="utf-8"))
    assert written == [(name, lowest[name]) for name in ("python", "numpy", "scipy")]


def test_the_plugin_prints_its_path(monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["paraview_plugin", "--path"])
    with pytest.raises(SystemExit) as end:  # as python -m does
        runpy.run_module(
            "vtk_segdeform.filters.paraview_plugin", run_name="__main__", alter_sys=True
        )
    assert end.value.code == 0
    assert Path(capsys.readouterr().out.strip()).samefile(PLUGIN)
