"""Truncated, corrupted and malicious files: each reader reads them or raises a clear error.

Every reader that accepts a path reads damaged files, each in a separate process with limits on
memory and time, because VTK's readers are native code.  A file is either read, or rejected by one
of our errors that names it; it never crashes the process, hangs, or exhausts the memory.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
import pyvista as pv
from given_surfaces import save_raw
from gltf_files import octahedron
from scenes import sausage
from solids import OCTAHEDRON, icosphere

import vtk_segdeform as sd
from vtk_segdeform.io import meshlab
from vtk_segdeform.io.convert import to_polydata, write_mesh
from vtk_segdeform.io.meshlab_project import write_project

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="needs fork and memory limits")

ROOT = Path(__file__).resolve().parents[2]
SUPPORT = ROOT / "tests" / "support"
STRIPS = """ply
format ascii 1.0
element vertex 4
property float x
property float y
property float z
element tristrips 1
property list int int vertex_indices
end_header
1 1 1
1 -1 -1
-1 1 -1
-1 -1 1
7 0 1 2 3 0 1 -1
"""
MATRIX = "1 0 0 0.5\n0 1 0 0\n0 0 1 0\n0 0 0 1\n"
MESHES = [".ply", ".obj", ".off", ".stl", ".vtk", ".vtp"]
HUGE = [b"4294967295", b"2147483647", b"99999999999999999999", b"-1", b"1e308", b"nan", b"0"]


FOREIGN = (".x3d", ".wrl", ".dae")  # of PyMeshLab, which is started for every one of them


def originals(folder, foreign=FOREIGN):
    """Write a valid file of every kind, those of PyMeshLab only if in *foreign*.

    Return [(reader, path)].
    """
    mesh = sd.Mesh(*icosphere(1))
    surface = to_polydata(mesh)
    surface.point_data["red"] = np.arange(mesh.n_vertices, dtype=np.uint8)
    surface.point_data["weight"] = np.linspace(0.0, 1.0, mesh.n_vertices)
    files = []
    for suffix in MESHES:
        path = folder / f"sound{suffix}"
        write_mesh(path, surface)
        files.append(("mesh", path))
    text = folder / "text.ply"
    surface.save(text, binary=False)
    files.append(("mesh", text))
    surface.save(folder / "text.vtk", binary=False)
    files.append(("mesh", folder / "text.vtk"))
    surface.save(folder / "text.stl", binary=False)
    files.append(("mesh", folder / "text.stl"))
    surface.cast_to_unstructured_grid().save(folder / "sound.vtu")
    files.append(("mesh", folder / "sound.vtu"))
    for suffix in (".glb", ".gltf"):
        files.append(("mesh", octahedron(*OCTAHEDRON).save(folder / f"sound{suffix}")))
    if meshlab.available():
        for suffix in foreign:
            write_mesh(folder / f"sound{suffix}", mesh)
            files.append(("mesh", folder / f"sound{suffix}"))
    files.append(("mesh", folder / "strips.ply"))
    files[-1][1].write_text(STRIPS)
    files.append(("mesh", folder / "raw.vtp"))
    save_raw(files[-1][1], surface)
    sd.save_session(folder / "sound.segdeform", session())
    files.append(("session", folder / "sound.segdeform"))
    sd.save_session(folder / "surface.segdeform", surface_session())
    files.append(("session", folder / "surface.segdeform"))
    write_project(folder / "sound.mlp", mesh)
    files.append(("project", folder / "sound.mlp"))
    for name, text, reader in [
        ("sound.def", MATRIX, "matrix"),
        ("sound.sel", "0 0 1 1 2 2\n", "selection"),
        ("ids.txt", "0, 1 2 # three of them\n5\n", "selection"),
    ]:
        (folder / name).write_text(text)
        files.append((reader, folder / name))
    return files


def surface_session():
    """Return a session of a surface with seams, a hole, a line, an unused point and arrays."""
    cube = pv.Cube(x_length=3.0).extract_cells(range(5)).extract_surface(algorithm=None)
    given = cube + pv.Line((9.0, 9.0, 9.0), (10.0, 9.0, 9.0))
    given.point_data["weight"] = np.arange(float(given.n_points))
    return sd.Session(sd.Surface(given))


def session():
    """Return a small session with regions, a cage, a handle and a pose."""
    scene = sausage(1)
    result = sd.Session(sd.Mesh(*OCTAHEDRON))
    result.set_regions(sd.Regions.single(result.mesh))
    result.set_cages([sd.Cage(scene.cages[0].vertices, scene.cages[0].faces)])
    result.handles.add([0], "h")
    result.drag(result.targets["h"] + [0.2, 0.1, 0.0], max_steps=2)
    return result


def damaged(data, rng):
    """Return *data* with random damage of one of nine kinds."""
    data = bytearray(data)
    at = int(rng.integers(len(data)))
    kind = int(rng.integers(9))
    if kind == 0:
        del data[at:]
    elif kind == 1:
        for place in rng.integers(len(data), size=rng.integers(1, 9)):
            data[place] ^= 1 << int(rng.integers(8))
    elif kind == 2:
        data[at : at + int(rng.integers(1, 200))] = rng.bytes(int(rng.integers(1, 200)))
    elif kind == 3:  # replace a number in text
        found = list(re.finditer(rb"\d+", data[:4000]))
        if found:
            match = found[int(rng.integers(len(found)))]
            data[match.start() : match.end()] = HUGE[int(rng.integers(len(HUGE)))]
    elif kind == 4:  # replace a binary number
        data[at : at + 4] = [b"\xff\xff\xff\x7f", b"\xff" * 4, b"\0\0\0\x40"][int(rng.integers(3))]
    elif kind == 5:
        other = int(rng.integers(len(data)))
        data[at:at] = data[min(at, other) : max(at, other)]
    elif kind == 8:  # swap two pieces
        a, b, c = np.sort(rng.integers(len(data), size=3)).tolist()
        data[a:c] = data[b:c] + data[a:b]
    elif kind == 6:
        del data[at : at + int(rng.integers(1, 400))]
    else:
        data[at : at + int(rng.integers(1, 400))] = b"\0" * int(rng.integers(1, 400))
    return bytes(data)


def mutants(folder, sound, count, seed):
    """Write *count* damaged files; return [(reader, path)]."""
    rng = np.random.default_rng(seed)
    files = []
    for number in range(count):
        reader, path = sound[number % len(sound)]
        place = folder / f"m{number}{path.suffix}"
        data = path.read_bytes()
        for _ in range(int(rng.integers(1, 3))):
            data = damaged(data or b"\0", rng)
        place.write_bytes(data)
        files.append((reader, place))
    return files


def answers(files):
    """Return (answer, text) for each of [(reader, path)]."""
    text = "".join(f"{reader}\t{path}\n" for reader, path in files)
    done = subprocess.run(
        [sys.executable, SUPPORT / "careful_reader.py"],
        input=text, capture_output=True, text=True, timeout=60 + 21 * len(files), check=False,
        env={**os.environ, "OMP_NUM_THREADS": "1", "PYTHONPATH": f"{SUPPORT}:{ROOT}"},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-2000:]
    lines = [line.partition("\t")[::2] for line in done.stdout.splitlines()]
    assert len(lines) == len(files)
    return lines


def failures(files, found):
    """Describe the files that were neither read nor rejected by name."""
    return [
        f"{path}: {answer}: {text[:300]}"
        for (_, path), (answer, text) in zip(files, found, strict=True)
        if answer not in ("read", "refused")
    ]


def special(folder, sound):
    """Create paths that are not regular files, and files of another format than their suffix."""
    by_suffix = {path.suffix: path for _, path in sound}
    files = []
    for reader, path in sound:
        (folder / f"folder{path.suffix}").mkdir(exist_ok=True)
        (folder / f"empty{path.suffix}").write_bytes(b"")
        for name, target in (("device", "/dev/zero"), ("circle", folder / f"circle{path.suffix}"),
                             ("nowhere", folder / "not there")):  # fmt: skip
            link = folder / f"{name}{path.suffix}"
            if not link.is_symlink():
                link.symlink_to(target)
        files += [
            (reader, folder / f"{name}{path.suffix}")
            for name in ("folder", "empty", "device", "circle", "nowhere", "missing")
        ]
        for other in (".glb", ".segdeform", ".off"):
            wrong = folder / f"is{other}{path.suffix}"
            wrong.write_bytes(by_suffix[other].read_bytes())
            files.append((reader, wrong))
    return files


def test_files_of_every_sort_are_read_or_the_error_names_them(tmp_path):
    """One program reads all of them: starting it takes longer than reading them."""
    valid = originals(tmp_path, ())  # those of PyMeshLab: in the campaign
    damaged_files = mutants(tmp_path, valid, 1, seed=1)
    no_files = special(tmp_path, valid)[::53]
    before = sorted(tmp_path.rglob("*"))
    found = iter(answers([*valid, *damaged_files, *no_files]))
    assert sorted(tmp_path.rglob("*")) == before  # reading writes nothing

    read = {path.name: next(found)[0] for _, path in valid}
    assert read == dict.fromkeys(read, "read")
    assert not failures(damaged_files, [next(found) for _ in damaged_files])

    of_no_files = [next(found) for _ in no_files]
    assert not failures(no_files, of_no_files)
    assert Counter(answer for answer, _ in of_no_files)["refused"] > 0.9 * len(no_files)


@pytest.mark.campaign
def test_four_thousand_damaged_files_are_read_or_rejected(tmp_path):
    counts, wrong = Counter(), []
    sound = originals(tmp_path)
    for seed in range(20):
        folder = tmp_path / str(seed)
        folder.mkdir()
        files = mutants(folder, sound, 200, seed=100 + seed)
        files += [] if seed else special(tmp_path, sound)
        found = answers(files)
        counts += Counter(answer for answer, _ in found)
        wrong += failures(files, found)
    print(f"\n{sum(counts.values())} files: {dict(counts)}")
    assert not wrong, "\n".join(wrong)
