"""Motions in files: morph targets that blend to the poses, and series for ParaView."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys

import numpy as np
import pytest
import pyvista as pv
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation
from solids import icosphere

import vtk_segdeform as sd
from vtk_segdeform.cli import main
from vtk_segdeform.errors import ArgumentError, MeshError
from vtk_segdeform.geometry import signed_volume

VALIDATE = """
const read = require("fs").readFileSync;
require("gltf-validator").validateBytes(new Uint8Array(read(process.argv[1])))
  .then((found) => console.log(JSON.stringify(found.issues)));
"""

# Prints the evaluated vertices, in glTF's axes, of the only mesh of a file at some seconds.
BLENDER = """
import json, os, sys
import bpy
bpy.ops.wm.read_factory_settings(use_empty=True)
bpy.ops.import_scene.gltf(filepath=sys.argv[1])
(shown,) = (each for each in bpy.data.objects if each.type == "MESH")
scene, found = bpy.context.scene, []
for seconds in map(float, sys.argv[2:]):
    frame = seconds * scene.render.fps / scene.render.fps_base
    scene.frame_set(int(frame), subframe=frame % 1.0)
    graph = bpy.context.evaluated_depsgraph_get()
    own = shown.evaluated_get(graph)
    mesh, place = own.to_mesh(), own.matrix_world.copy()
    found.append([[x, z, -y] for x, y, z in (place @ vertex.co for vertex in mesh.vertices)])
print("found", json.dumps(found), flush=True)
os._exit(0)  # bpy 4.2 crashes when Python ends
"""


def ellipsoid() -> sd.Mesh:
    vertices, faces = icosphere(3)
    return sd.Mesh(vertices * [2.0, 1.0, 0.7], faces)


def turned(mesh: sd.Mesh, degrees: float) -> np.ndarray:
    return Rotation.from_euler("z", degrees, degrees=True).apply(np.array(mesh.vertices))


def blended(path, seconds):
    """Return the positions that a viewer shows at a time, from a .gltf file."""
    import base64

    head = json.loads(path.read_text())
    binary = base64.b64decode(head["buffers"][0]["uri"].partition(",")[2])

    def values(number):
        accessor = head["accessors"][number]
        view = head["bufferViews"][accessor["bufferView"]]
        width = {"SCALAR": 1, "VEC3": 3}[accessor["type"]]
        start, count = view["byteOffset"], accessor["count"] * width
        return np.frombuffer(binary, "<f4", count, start).reshape(-1, width)

    (animation,) = head["animations"]
    (sampler,) = animation["samplers"]
    assert animation["channels"] == [{"sampler": 0, "target": {"node": 0, "path": "weights"}}]
    times = values(sampler["input"]).ravel()
    weights = values(sampler["output"]).reshape(len(times), -1)
    (primitive,) = head["meshes"][0]["primitives"]
    found = values(primitive["attributes"]["POSITION"]).astype(float)
    for k, target in enumerate(primitive["targets"]):
        found = found + np.interp(seconds, times, weights[:, k]) * values(target["POSITION"])
    return found + head["nodes"][0].get("translation", 0.0)


def test_a_blend_of_morph_targets_is_near_every_pose(tmp_path):
    mesh, path = ellipsoid(), tmp_path / "turn.gltf"
    angles = np.arange(1, 91)
    poses, seconds = [turned(mesh, angle) for angle in angles], angles / 30.0
    found = sd.write_motion(path, mesh, poses, seconds=seconds)
    assert 5 < len(found.kept) < 30
    assert found.kept[-1] == len(poses) - 1
    away = [
        np.linalg.norm(blended(path, time) - pose, axis=1).max()
        for time, pose in zip(seconds, poses, strict=True)
    ]
    assert max(away) / mesh.diagonal == pytest.approx(found.deviation, rel=1e-3)
    assert found.deviation <= 0.002
    between = np.linspace(0.0, 3.0, 400)
    volumes = [signed_volume(blended(path, time), mesh.faces) for time in between]
    rest = signed_volume(mesh.vertices, mesh.faces)
    largest = max(abs(volume / rest - 1.0) for volume in volumes)
    assert largest == pytest.approx(found.volume_change, rel=0.02)


def test_the_tolerance_decides_how_many_poses_are_kept(tmp_path):
    mesh, path = ellipsoid(), tmp_path / "turn.glb"
    poses = [turned(mesh, angle) for angle in range(1, 61)]
    every = sd.write_motion(path, mesh, poses, tolerance=0.0)
    assert every.kept == tuple(range(60))
    few = sd.write_motion(path, mesh, poses, tolerance=0.02)
    assert len(few.kept) < 5
    assert every.volume_change < few.volume_change
    straight = [mesh.vertices + [0.1 * k, 0.0, 0.0] for k in range(1, 9)]
    assert sd.write_motion(path, mesh, straight).kept == (7,)


def test_normals_and_far_origins_move_along(tmp_path):
    mesh, path = ellipsoid(), tmp_path / "far.gltf"
    given = pv.PolyData.from_regular_faces(mesh.vertices + [1e4, 0.0, 0.0], mesh.faces)
    given = given.compute_normals(split_vertices=False, consistent_normals=False)
    pose = turned(mesh, 90.0) + [1e4, 0.0, 0.0]
    sd.write_motion(path, given, [pose])
    assert_allclose(blended(path, 1.0), pose, atol=1e-3)
    head = json.loads(path.read_text())
    (target,) = head["meshes"][0]["primitives"][0]["targets"]
    assert set(target) == {"POSITION", "NORMAL"}


def test_a_series_has_every_pose_and_array(tmp_path):
    mesh, path = ellipsoid(), tmp_path / "turn.pvd"
    given = pv.PolyData.from_regular_faces(mesh.vertices, mesh.faces)
    given["height"] = mesh.vertices[:, 2]
    poses = [turned(mesh, angle) for angle in (30.0, 60.0)]
    found = sd.write_motion(path, given, poses, seconds=[0.5, 2.0])
    assert found == ((0, 1), 0.0, pytest.approx(0.0, abs=1e-12))
    series = pv.get_reader(path)
    assert series.time_values == [0.0, 0.5, 2.0]
    for time, pose in zip(series.time_values, [mesh.vertices, *poses], strict=True):
        series.set_active_time_value(time)
        (block,) = series.read()
        assert_allclose(block.points, pose)
        assert_allclose(block["height"], mesh.vertices[:, 2])
    with pytest.raises(MeshError, match="exists already"):
        sd.write_motion(path, given, poses)


def test_what_is_no_motion_is_refused_and_nothing_is_written(tmp_path):
    mesh, path = ellipsoid(), tmp_path / "out.glb"
    pose = turned(mesh, 10.0)
    for fault, arguments, options in (
        (ArgumentError, (path, mesh, []), {}),
        (ValueError, (path, mesh, [pose[:-1]]), {}),
        (ArgumentError, (path, mesh, [pose]), {"seconds": [0.0]}),
        (ArgumentError, (path, mesh, [pose, pose]), {"seconds": [2.0, 1.0]}),
        (ArgumentError, (path, mesh, [pose]), {"tolerance": -1.0}),
        (MeshError, (tmp_path / "out.ply", mesh, [pose]), {}),
        (MeshError, (tmp_path / "no" / "out.glb", mesh, [pose]), {}),
        (MeshError, (tmp_path / "no" / "out.pvd", mesh, [pose]), {}),
    ):
        with pytest.raises(fault):
            sd.write_motion(*arguments, **options)
    assert not list(tmp_path.iterdir())


def test_the_command_writes_poses_from_files(tmp_path, capsys):
    mesh = ellipsoid()
    names = [tmp_path / f"{angle}.ply" for angle in (0, 20, 40)]
    for name, angle in zip(names, (0, 20, 40), strict=True):
        sd.write_mesh(name, mesh.with_vertices(turned(mesh, angle)))
    out = tmp_path / "turn.gltf"
    assert main(["motion", *map(str, names), "-o", str(out), "--fps", "1"]) == 0
    printed = capsys.readouterr().out
    assert "2 after rest, of which 2 are written" in printed
    assert "changes by at most" in printed
    assert_allclose(blended(out, 2.0), turned(mesh, 40), atol=1e-5)
    sd.write_mesh(names[1], sd.models.sphere(300))
    assert main(["motion", *map(str, names), "-o", str(out)]) == 1
    assert "is no pose" in capsys.readouterr().err


@pytest.mark.campaign
def test_the_validator_of_khronos_finds_no_fault(tmp_path):
    if shutil.which("npm") is None:
        pytest.skip("needs npm")
    install = ["npm", "install", "--prefix", str(tmp_path), "gltf-validator"]
    if subprocess.run(install, capture_output=True, check=False, timeout=120).returncode:
        pytest.skip("gltf-validator could not be installed")
    mesh = ellipsoid()
    given = pv.PolyData.from_regular_faces(mesh.vertices, mesh.faces).compute_normals()
    for k, surface in enumerate((mesh, given)):
        path, rest = tmp_path / f"{k}.glb", sd.Surface(given).mesh if k else mesh
        sd.write_motion(path, surface, [turned(rest, angle) for angle in range(1, 30)])
        done = subprocess.run(
            ["node", "-e", VALIDATE, str(path)],
            env={**os.environ, "NODE_PATH": str(tmp_path / "node_modules")},
            capture_output=True, text=True, check=True, timeout=60,
        )  # fmt: skip
        issues = json.loads(done.stdout)
        assert not issues["numErrors"], issues
        assert not issues["numWarnings"], issues


@pytest.mark.campaign
def test_blender_shows_the_poses(tmp_path):
    """In a Python with bpy, that of SEGDEFORM_BPY or this one; bpy is under the GPL."""
    python = shutil.which(os.environ.get("SEGDEFORM_BPY", sys.executable))
    probe = [python or "", "-c", "import bpy"]
    if python is None or subprocess.run(probe, capture_output=True, check=False).returncode:
        pytest.skip("needs bpy")
    mesh, path = ellipsoid(), tmp_path / "turn.glb"
    poses = [turned(mesh, angle) for angle in (15.0, 30.0, 45.0)]
    sd.write_motion(path, mesh, poses, seconds=[1.0, 2.0, 3.0])
    sd.write_motion(path.with_suffix(".gltf"), mesh, poses, seconds=[1.0, 2.0, 3.0])
    moments = [0.0, 1.0, 1.5, 2.0, 3.0]
    done = subprocess.run(
        [python, "-c", BLENDER, str(path), *map(str, moments)],
        capture_output=True, text=True, check=True, timeout=120,
    )  # fmt: skip
    (line,) = (each for each in done.stdout.splitlines() if each.startswith("found"))
    shown = json.loads(line.removeprefix("found"))
    for seconds, vertices in zip(moments, shown, strict=True):
        expected = blended(path.with_suffix(".gltf"), seconds)
        assert_allclose(vertices, expected, atol=1e-5 * mesh.diagonal)
    assert_allclose(shown[-1], poses[-1], atol=2e-3 * mesh.diagonal)
