"""Files that were cut off, scrambled or made to harm: a clear error, soon, and nothing else.

Every reader that takes a path reads files that something was done to: in a process of its own,
with 2 GB and 20 seconds, because VTK's readers are native code.  A file is either read, or refused
by an error of ours that names it; it never ends the process, hangs, or takes all the memory.
"""

from __future__ import annotations

import json
import os
import re
import struct
import subprocess
import sys
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from scenes import sausage
from solids import OCTAHEDRON, icosphere

import vtk_segdeform as sd
from vtk_segdeform.convert import to_polydata, write_mesh
from vtk_segdeform.meshlab_project import write_project

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="needs fork and memory limits")

HERE = Path(__file__).resolve().parent
RECORDING = """vtk_segdeform recording 1
0.0 Window 400 300
0.1 Camera position 0 0 5 focus 0 0 0 up 0 1 0 angle 30 parallel 0 scale 1 range 0.1 100
0.2 MouseMove 10 20
0.3 LeftButtonPress 10 20 shift
0.4 KeyPress 10 20 key=g code=103
0.5 Timer 3
"""
MATRIX = "1 0 0 0.5\n0 1 0 0\n0 0 1 0\n0 0 0 1\n"
MESHES = [".ply", ".obj", ".off", ".stl", ".vtk", ".vtp", ".vtkhdf"]
HUGE = [b"4294967295", b"2147483647", b"99999999999999999999", b"-1", b"1e308", b"nan", b"0"]


def originals(folder):
    """Write a sound file of every kind; return [(reader, path)]."""
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
    save_glb(folder / "sound.glb", *OCTAHEDRON)
    files.append(("surface", folder / "sound.glb"))
    sd.save_session(folder / "sound.segdeform", session())
    files.append(("session", folder / "sound.segdeform"))
    write_project(folder / "sound.mlp", mesh)
    files.append(("project", folder / "sound.mlp"))
    for name, text, reader in [
        ("sound.recording.txt", RECORDING, "recording"),
        ("sound.def", MATRIX, "matrix"),
        ("sound.sel", "0 0 1 1 2 2\n", "selection"),
        ("ids.txt", "0, 1 2 # three of them\n5\n", "selection"),
    ]:
        (folder / name).write_text(text)
        files.append((reader, folder / name))
    return files


def session():
    """Return a small session with something of everything."""
    scene = sausage(1)
    result = sd.Session(sd.Mesh(*OCTAHEDRON))
    result.set_regions(sd.Regions.single(result.mesh))
    result.set_cages([sd.Cage(scene.cages[0].vertices, scene.cages[0].faces)])
    result.add_handle([0], "h")
    result.drag(result.targets["h"] + [0.2, 0.1, 0.0], max_steps=2)
    return result


def save_glb(path, vertices, faces):
    """Write a binary glTF by hand: one mesh, positions and indices."""
    places, corners = vertices.astype("<f4").tobytes(), faces.astype("<u2").tobytes()
    blob = places + corners + b"\0" * (-len(corners) % 4)
    low, high = vertices.min(axis=0).tolist(), vertices.max(axis=0).tolist()
    head = {
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "buffers": [{"byteLength": len(blob)}],
        "bufferViews": [{"buffer": 0, "byteOffset": 0, "byteLength": len(places)},
                        {"buffer": 0, "byteOffset": len(places), "byteLength": len(corners)}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": len(vertices), "type": "VEC3",
             "min": low, "max": high},
            {"bufferView": 1, "componentType": 5123, "count": faces.size, "type": "SCALAR"},
        ],
    }  # fmt: skip
    text = json.dumps(head).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text
    chunks += struct.pack("<I4s", len(blob), b"BIN\0") + blob
    path.write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks)


def harmed(data, rng):
    """Return *data* after one of the things that happen to files."""
    data = bytearray(data)
    at = int(rng.integers(len(data)))
    kind = int(rng.integers(8))
    if kind == 0:
        del data[at:]
    elif kind == 1:
        for place in rng.integers(len(data), size=rng.integers(1, 9)):
            data[place] ^= 1 << int(rng.integers(8))
    elif kind == 2:
        data[at : at + int(rng.integers(1, 200))] = rng.bytes(int(rng.integers(1, 200)))
    elif kind == 3:  # a number, in words, is another one
        found = list(re.finditer(rb"\d+", data[:4000]))
        if found:
            match = found[int(rng.integers(len(found)))]
            data[match.start() : match.end()] = HUGE[int(rng.integers(len(HUGE)))]
    elif kind == 4:  # a number, in bytes, is another one
        data[at : at + 4] = [b"\xff\xff\xff\x7f", b"\xff" * 4, b"\0\0\0\x40"][int(rng.integers(3))]
    elif kind == 5:
        other = int(rng.integers(len(data)))
        data[at:at] = data[min(at, other) : max(at, other)]
    elif kind == 6:
        del data[at : at + int(rng.integers(1, 400))]
    else:
        data[at : at + int(rng.integers(1, 400))] = b"\0" * int(rng.integers(1, 400))
    return bytes(data)


def mutants(folder, count, seed):
    """Write *count* harmed files; return [(reader, path)]."""
    rng = np.random.default_rng(seed)
    files = []
    sound = originals(folder)
    for number in range(count):
        reader, path = sound[number % len(sound)]
        place = folder / f"m{number}{path.suffix}"
        data = path.read_bytes()
        for _ in range(int(rng.integers(1, 3))):
            data = harmed(data or b"\0", rng)
        place.write_bytes(data)
        files.append((reader, place))
    return files


def answers(files):
    """Return (answer, text) for each of [(reader, path)]."""
    text = "".join(f"{reader}\t{path}\n" for reader, path in files)
    done = subprocess.run(
        [sys.executable, HERE / "careful_reader.py"],
        input=text, capture_output=True, text=True, timeout=60 + 21 * len(files), check=False,
        env={**os.environ, "OMP_NUM_THREADS": "1", "PYTHONPATH": f"{HERE}:{HERE.parent}"},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-2000:]
    lines = [line.partition("\t")[::2] for line in done.stdout.splitlines()]
    assert len(lines) == len(files)
    return lines


def wrong_among(files, told):
    """Return in words what was neither read nor refused by name."""
    return [
        f"{path}: {answer}: {text[:300]}"
        for (_, path), (answer, text) in zip(files, told, strict=True)
        if answer not in ("read", "refused")
    ]


def special(folder):
    """Write, or name, what is no file, or another file than its name says."""
    sound = originals(folder)
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


@pytest.fixture(scope="module")
def seen(tmp_path_factory):
    """Have a few files of every kind read, by one program: [(files, answers)] of three sorts."""
    folder = tmp_path_factory.mktemp("files")
    sound, harmed = originals(folder), mutants(folder, 34, seed=1)
    sorts = [sound, harmed, special(folder)[::4]]
    before = sorted(folder.rglob("*"))
    told = iter(answers([file for files in sorts for file in files]))
    assert sorted(folder.rglob("*")) == before  # reading writes nothing
    return [(files, [next(told) for _ in files]) for files in sorts]


def test_sound_files_of_every_kind_are_read(seen):
    files, told = seen[0]
    assert {path.name: answer for (_, path), (answer, _) in zip(files, told, strict=True)} == {
        path.name: "read" for _, path in files
    }


def test_harmed_files_of_every_kind_are_read_or_refused_by_their_names(seen):
    assert not wrong_among(*seen[1])


def test_what_is_no_file_or_another_kind_is_refused_by_its_name(seen):
    files, told = seen[2]
    assert not wrong_among(files, told)
    assert Counter(answer for answer, _ in told)["refused"] > 0.9 * len(files)


@pytest.mark.campaign
def test_two_thousand_harmed_files_are_read_or_refused(tmp_path):
    counts, wrong = Counter(), []
    for seed in range(10):
        folder = tmp_path / str(seed)
        folder.mkdir()
        files = mutants(folder, 200, seed=100 + seed) + ([] if seed else special(tmp_path))
        told = answers(files)
        counts += Counter(answer for answer, _ in told)
        wrong += wrong_among(files, told)
    print(f"\n{sum(counts.values())} files: {dict(counts)}")
    assert not wrong, "\n".join(wrong)
