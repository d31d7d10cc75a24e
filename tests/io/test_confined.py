"""Files of VTK and PyMeshLab are read in a process that can open nothing but the given file."""

from __future__ import annotations

import logging
import os
import signal
import subprocess
import sys
import threading
import zlib
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from solids import CUBE, icosphere
from vtkmodules.vtkCommonCore import vtkOutputWindow

from vtk_segdeform import Mesh
from vtk_segdeform.errors import MeshError
from vtk_segdeform.files import landlock
from vtk_segdeform.io import confined, meshlab, reading_child
from vtk_segdeform.io.convert import read_polydata, to_polydata, write_mesh
from vtk_segdeform.io.surface import read_mesh

NAMES = ["<&\">'", "a\nb", "100%", "%3C", "Größe", "身体", "a b"]


def named(tmp_path):
    """Write a legacy file, which can store any name; return the surface with all its arrays."""
    surface = to_polydata(Mesh(*CUBE))
    for k, name in enumerate(NAMES):
        surface.point_data[name] = np.arange(8.0) + k
        surface.cell_data[name] = np.arange(12) + k
    surface.field_data["maker"] = ["somebody", "<else>"]
    surface.point_data["uv"] = np.arange(16.0).reshape(8, 2)
    surface.point_data.active_texture_coordinates_name = "uv"
    surface.save(tmp_path / "a.vtk")
    return surface


@pytest.mark.parametrize("frozen", [False, True])
def test_the_whole_file_is_read_with_or_without_the_child_process(
    tmp_path, monkeypatch, caplog, frozen
):
    surface = named(tmp_path)
    monkeypatch.setattr(sys, "frozen", frozen, raising=False)
    window = vtkOutputWindow.GetInstance()
    with caplog.at_level(logging.WARNING):
        again = read_polydata(tmp_path / "a.vtk")
    assert [("without protection" in text) for text in caplog.messages] == [True] * frozen
    assert vtkOutputWindow.GetInstance() is window
    assert_array_equal(again.points, surface.points)
    assert_array_equal(again.faces, surface.faces)
    assert set(again.point_data) == {*NAMES, "uv"}
    for name in NAMES:
        assert_array_equal(again.point_data[name], surface.point_data[name])
        assert_array_equal(again.cell_data[name], surface.cell_data[name])
    assert list(again.field_data["maker"]) == ["somebody", "<else>"]
    assert again.point_data.active_texture_coordinates_name == "uv"


LANDLOCK = pytest.mark.skipif(not landlock.version(), reason="needs Landlock")
MESHLAB = pytest.mark.skipif(not meshlab.available(), reason="needs PyMeshLab")
VERTICES, FACES = CUBE
POINTS = " ".join(map(str, np.ravel(VERTICES)))
INDICES = " -1 ".join(" ".join(map(str, face)) for face in FACES) + " -1"
SHAPE = (
    f"<Shape><IndexedFaceSet coordIndex='{INDICES}'><Coordinate point='{POINTS}'/>"
    "</IndexedFaceSet></Shape>"
)
X3D = "<X3D><Scene>{}</Scene></X3D>"
WRL = "#VRML V2.0 utf8\n{}"
WRL_SHAPE = (
    f"Shape {{ geometry IndexedFaceSet {{ coord Coordinate {{ point [ {POINTS} ] }} "
    f"coordIndex [ {INDICES} ] }} }}\n"
)


@pytest.fixture
def fresh(monkeypatch):
    """Start a process for this test alone."""
    monkeypatch.setattr(confined, "_idle", {})
    yield
    confined._end_all()


def test_one_process_reads_one_file_after_another(tmp_path, fresh):
    write_mesh(tmp_path / "a.vtp", Mesh(*CUBE))
    read_mesh(tmp_path / "a.vtp")
    first = confined._idle["vtk"]
    read_mesh(tmp_path / "a.vtp")
    assert confined._idle["vtk"] is first
    (tmp_path / "b.vtp").write_text("<VTKFile type='PolyData'>")
    with pytest.raises(MeshError):
        read_mesh(tmp_path / "b.vtp")
    first._process.kill()
    first._process.wait()
    assert read_mesh(tmp_path / "a.vtp").n_vertices == 8


def test_files_are_read_by_several_threads(tmp_path, fresh):
    for k in range(4):
        write_mesh(tmp_path / f"{k}.vtp", Mesh(np.asarray(CUBE[0]) + k, CUBE[1]))
    found = {}

    def read(k):
        found[k] = read_mesh(tmp_path / f"{k}.vtp").vertices

    threads = [threading.Thread(target=read, args=(k,)) for k in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for k in range(4):
        assert_array_equal(found[k], np.asarray(CUBE[0]) + k)
    assert len(confined._idle) == 1


@MESHLAB
@LANDLOCK
@pytest.mark.parametrize("suffix", [".x3d", ".wrl"])
@pytest.mark.parametrize("relative", [False, True])
def test_pymeshlab_does_not_load_other_files(tmp_path, suffix, relative):
    (tmp_path / "in").mkdir()
    other = f"../secret{suffix}" if relative else str(tmp_path / f"secret{suffix}")
    whole, shape, inline = {
        ".x3d": (X3D, SHAPE, "<Inline url='\"{}\"'/>"),
        ".wrl": (WRL, WRL_SHAPE, 'Inline {{ url "{}" }}\n'),
    }[suffix]
    (tmp_path / f"secret{suffix}").write_text(whole.format(shape))
    assert read_polydata(tmp_path / f"secret{suffix}").n_cells == 12
    path = tmp_path / "in" / f"a{suffix}"
    path.write_text(whole.format(shape + inline.format(other)))
    try:
        assert read_polydata(path).n_cells == 12
    except MeshError:
        return


@LANDLOCK
def test_the_process_can_open_nothing_but_the_file(tmp_path):
    """What is read with this process's rights before is refused after."""
    allowed, secret = tmp_path / "a", tmp_path / "b"
    allowed.write_text("a")
    secret.write_text("b")
    code = f"""
import os, socket, sys
sys.path.insert(0, {str(Path(landlock.__file__).parent)!r})
import landlock
open({str(secret)!r}).close()
landlock.allow_only({str(allowed)!r})
print(open({str(allowed)!r}).read())
for act in (
    lambda: open({str(secret)!r}), lambda: open({str(allowed)!r}, "w"),
    lambda: open({str(tmp_path / "new")!r}, "w"), lambda: os.remove({str(secret)!r}),
    lambda: os.listdir({str(tmp_path)!r}), lambda: open("/proc/self/environ"),
    lambda: os.rename({str(secret)!r}, {str(tmp_path / "c")!r}),
    lambda: os.execv("/bin/true", ["true"]),
    lambda: os.truncate({str(allowed)!r}, 0),
):
    try:
        act()
    except PermissionError:
        print("refused")
"""
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=tmp_path
    )
    assert done.stdout.split() == ["a"] + 9 * ["refused"]


def test_the_process_has_no_folder_and_no_environment_of_ours(tmp_path, monkeypatch, fresh):
    for name in ("numpy", "vtkmodules", "json", "re", "ctypes", "sitecustomize", "usercustomize"):
        (tmp_path / f"{name}.py").write_text(f"open({str(tmp_path / 'ran')!r}, 'w')")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("SECRET", "1")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    monkeypatch.setattr(sys, "path", ["", *sys.path])
    write_mesh("a.vtp", Mesh(*CUBE))
    assert read_mesh("a.vtp").n_vertices == 8
    assert not (tmp_path / "ran").exists()
    if sys.platform == "linux":
        process = Path(f"/proc/{confined._idle['vtk']._process.pid}")
        assert b"SECRET" not in (process / "environ").read_bytes()
        assert os.readlink(process / "cwd").endswith(" (deleted)")


def test_texts_with_null_characters_do_not_crash_this_process(tmp_path):
    text = b"A%00" * 100
    (tmp_path / "a.vtk").write_bytes(
        b"# vtk DataFile Version 3.0\na title\nASCII\nDATASET POLYDATA\nPOINTS 3 float\n"
        b"0 0 0 1 0 0 0 1 0\nPOLYGONS 1 4\n3 0 1 2\nPOINT_DATA 3\nFIELD FieldData 1\n"
        b"a%00b 1 3 string\n" + text + b"\n" + text + b"\n" + text + b"\n"
    )
    surface = read_polydata(tmp_path / "a.vtk")
    write_mesh(tmp_path / "b.vtp", surface)
    assert read_polydata(tmp_path / "b.vtp").n_points == 3


def test_a_bomb_is_refused_before_it_takes_our_memory(tmp_path):
    n_points = 6_500_000  # 78 MB; 64 are allowed to any file
    blocks = [zlib.compress(bytes(1 << 20), 9)] * (3 * 4 * n_points >> 20)
    sizes = np.array([len(blocks), 1 << 20, 0, *map(len, blocks)], dtype="<u4")
    data = sizes.tobytes() + b"".join(blocks)
    n_points = len(blocks) * (1 << 20) // 12
    (tmp_path / "a.vtp").write_bytes(
        f"""<VTKFile type="PolyData" version="1.0" byte_order="LittleEndian" header_type="UInt32"
compressor="vtkZLibDataCompressor"><PolyData><Piece NumberOfPoints="{n_points}" NumberOfPolys="1">
<Points><DataArray type="Float32" NumberOfComponents="3" format="appended" offset="0"/></Points>
<Polys><DataArray type="Int64" Name="connectivity" format="ascii">0 1 2</DataArray>
<DataArray type="Int64" Name="offsets" format="ascii">3</DataArray></Polys></Piece></PolyData>
<AppendedData encoding="raw">_""".encode()
        + data
        + b"</AppendedData></VTKFile>"
    )
    with pytest.raises(MeshError, match="64 times the memory of the file"):
        read_polydata(tmp_path / "a.vtp")


def replies(data):
    """Return what is made of a reply of the reader."""
    import io

    return confined._reply(io.BytesIO(data), 1000)


def framed(name, values):
    import io

    whole = io.BytesIO()
    for each in (np.frombuffer(name, dtype=np.uint8), values):
        np.lib.format.write_array(whole, each, version=(1, 0))
    return whole.getvalue()


def test_replies_are_checked_on_arrival():
    end = framed(b"", np.zeros(0))
    good = framed(b"a", np.arange(3))
    assert_array_equal(replies(good + end)["a"], [0, 1, 2])
    for data in (b"", good, good[:-1], good + end[:20]):
        with pytest.raises(EOFError):
            replies(data)
    for values in (
        np.zeros(2, dtype=complex), np.array(["a"]), np.zeros(2, dtype="i4,i4"),
        np.zeros((2, 2), order="F"), np.zeros(2, dtype="M8[s]"),
    ):  # fmt: skip
        with pytest.raises(MeshError, match="the reader did not return plain numbers"):
            replies(framed(b"a", values) + end)
    with pytest.raises(MeshError, match="64 times"):
        replies(framed(b"a", np.zeros(200)) + end)
    with pytest.raises(MeshError, match="64 times"):
        replies(10 * framed(b"a", np.zeros(0)) + end)
    with pytest.raises((MeshError, EOFError)):
        replies(b"not an array at all, whatever it is")
    huge = good.replace(b"(3,), }" + 13 * b" ", b"(30000000000000,), }")
    assert len(huge) == len(good)
    with pytest.raises(MeshError, match="64 times"):
        replies(huge + end)


def test_reading_that_takes_too_long_is_stopped(tmp_path, monkeypatch, fresh):
    write_mesh(tmp_path / "a.vtp", Mesh(*CUBE))
    monkeypatch.setattr(confined, "_SECONDS", 0.0)
    monkeypatch.setattr(confined, "_PER_MEGABYTE", 0.0)
    with pytest.raises(MeshError, match=r"a\.vtp: .*reading was stopped after 0 s"):
        read_mesh(tmp_path / "a.vtp")
    assert not confined._idle


@pytest.mark.skipif(sys.platform != "linux", reason="needs limits of memory")
def test_reading_that_needs_too_much_memory_is_an_error(tmp_path, monkeypatch):
    write_mesh(tmp_path / "a.vtp", Mesh(*icosphere(4)))
    monkeypatch.setattr(confined, "_MEMORY", 1)
    monkeypatch.setattr(confined, "_PER_BYTE", 0)
    with pytest.raises(MeshError, match=r"a\.vtp: "):
        read_mesh(tmp_path / "a.vtp")


@pytest.mark.skipif(sys.platform != "linux", reason="a process that can be stopped")
def test_an_interrupt_ends_the_process_and_the_next_file_is_read(tmp_path, monkeypatch, fresh):
    write_mesh(tmp_path / "a.vtp", Mesh(*CUBE))
    read_mesh(tmp_path / "a.vtp")
    child = confined._idle["vtk"]
    os.kill(child._process.pid, signal.SIGSTOP)  # so that it does not answer
    handler = signal.signal(signal.SIGINT, signal.default_int_handler)  # a background job has none
    timer = threading.Timer(0.1, signal.pthread_kill, [threading.get_ident(), signal.SIGINT])
    timer.start()
    try:
        with pytest.raises(KeyboardInterrupt):
            read_mesh(tmp_path / "a.vtp")
    finally:
        signal.signal(signal.SIGINT, handler)
    assert not child.is_alive()
    assert read_mesh(tmp_path / "a.vtp").n_vertices == 8


@pytest.mark.skipif(sys.platform != "linux", reason="a process that can be stopped")
def test_a_reader_that_another_program_ends_is_not_blamed_on_the_file(tmp_path, fresh):
    write_mesh(tmp_path / "a.vtp", Mesh(*CUBE))
    read_mesh(tmp_path / "a.vtp")
    process = confined._idle["vtk"]._process.pid
    os.kill(process, signal.SIGSTOP)  # so that it does not answer
    timer = threading.Timer(0.1, os.kill, [process, signal.SIGKILL])
    timer.start()
    with pytest.raises(MeshError, match=r"another program ended the reader \(SIGKILL\)"):
        read_mesh(tmp_path / "a.vtp")
    assert read_mesh(tmp_path / "a.vtp").n_vertices == 8


def test_memory_in_use_is_known_without_proc(monkeypatch):
    pytest.importorskip("resource")
    monkeypatch.setattr(reading_child, "Path", lambda _: Path("not there"))
    assert 1 << 20 < reading_child._memory_in_use() < 1 << 40


@MESHLAB
@pytest.mark.skipif(sys.platform != "linux", reason="names of any bytes")
def test_pymeshlab_cannot_open_names_that_are_not_utf_8(tmp_path):
    path = tmp_path / os.fsdecode(b"\xff.x3d")
    path.write_text(X3D.format(SHAPE))
    with pytest.raises(MeshError, match="its name is not valid UTF-8"):
        read_mesh(path)
