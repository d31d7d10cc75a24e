"""glTF and GLB: agreement with VTK's reader, and errors for inconsistent files."""

from __future__ import annotations

import json
import struct
from urllib.parse import quote

import numpy as np
import pytest
import pyvista as pv
from gltf_files import Gltf, glb, octahedron
from numpy.testing import assert_allclose
from solids import CUBE, OCTAHEDRON, icosphere

from vtk_segdeform.errors import MeshError
from vtk_segdeform.io.convert import read_polydata
from vtk_segdeform.io.polygons import triangles_of
from vtk_segdeform.io.surface import read_mesh

VERTICES, FACES = icosphere(1)


def rotation(rng):
    turn = rng.normal(size=4)
    return (turn / np.linalg.norm(turn)).tolist()


def scene():
    """Return a document with all transforms of a vertex: nodes, morphs and skins."""
    rng, document = np.random.default_rng(1), Gltf()
    attributes = {
        "NORMAL": document.array(VERTICES),
        "TEXCOORD_0": document.array(rng.random((len(VERTICES), 2))),
        "COLOR_0": document.array(
            rng.integers(0, 256, (len(VERTICES), 4)), "u1", normalized=True
        ),
    }  # fmt: skip
    inner = document.add(
        "nodes", mesh=document.mesh(VERTICES, FACES, attributes=attributes),
        translation=[1, 2, 3], rotation=rotation(rng), scale=[1, 2, 0.5],
    )  # fmt: skip
    matrix = np.eye(4)
    matrix[:3] = rng.normal(size=(3, 4))
    matrix[:3, 0] *= np.sign(np.linalg.det(matrix[:3, :3]))
    strip = document.mesh(CUBE[0], np.arange(8), mode=5)
    outer = document.add(
        "nodes", mesh=strip, matrix=matrix.T.ravel().tolist(), children=[inner]
    )  # fmt: skip
    fan = document.add("nodes", mesh=document.mesh(CUBE[0], np.arange(8), mode=6, kind="u4"))
    weights = rng.random((len(VERTICES), 4))
    weights /= weights.sum(axis=1, keepdims=True)
    attributes = {
        "JOINTS_0": document.array(rng.integers(0, 2, (len(VERTICES), 4)), "u1"),
        "WEIGHTS_0": document.array(weights),
    }
    skinned = document.add(
        "nodes", mesh=document.mesh(VERTICES, FACES, attributes=attributes), skin=0,
        translation=[5, 5, 5],
    )  # fmt: skip
    bound = np.tile(np.eye(4), (2, 1, 1))
    bound[1, 3, 0] = 1.0  # column by column
    document.add(
        "skins", joints=[outer, inner],
        inverseBindMatrices=document.array(bound.reshape(2, 16)),
    )  # fmt: skip
    target = document.array(rng.random((len(VERTICES), 3)))
    morph = document.mesh(VERTICES, FACES, targets=[{"POSITION": target}])
    document.head["meshes"][morph]["weights"] = [0.3]
    document.head |= {"scene": 0, "scenes": [{"nodes": [outer, fan, skinned]}]}
    document.head["scenes"][0]["nodes"].append(document.add("nodes", mesh=morph))
    document.add("nodes", mesh=morph)  # in no scene
    return document


def theirs(path):
    """Return the triangles (m, 3, 3) of VTK's reader for a valid file."""
    pieces = list(pv.read(path).recursive_iterator(skip_none=True))
    return np.concatenate([piece.points[triangles_of(piece)] for piece in pieces])


@pytest.mark.parametrize("suffix", [".glb", ".gltf"])
def test_nodes_morphs_and_skins_move_vertices_as_in_vtk(tmp_path, suffix):
    path = scene().save(tmp_path / f"a{suffix}")
    ours = read_polydata(path)
    triangles = ours.points[triangles_of(ours)]
    assert len(triangles) == 3 * len(FACES) + 6 + 6

    def corners_in_order(soup):
        soup = np.round(np.sort(soup, axis=1), 4)  # for any order of corners
        return soup.reshape(len(soup), -1)

    mine, other = corners_in_order(triangles), corners_in_order(theirs(path))
    assert_allclose(mine[np.lexsort(mine.T)], other[np.lexsort(other.T)], atol=2e-4)


def test_a_mirrored_mesh_is_oriented_outward_again(tmp_path):
    document = octahedron(*OCTAHEDRON)
    document.head["nodes"][0]["scale"] = [-1, 1, 1]
    assert read_mesh(document.save(tmp_path / "a.glb")).n_faces == 8


def test_positions_may_be_integers_interleaved_and_partly_replaced(tmp_path):
    document = Gltf()
    rows = np.zeros(6, [("p", "<i2", 3), ("gap", "<i2"), ("t", "<f4", 2)])
    rows["p"] = OCTAHEDRON[0] * 32767
    rows["p"][5] = 0
    view = document.view(rows.tobytes(), byteStride=rows.itemsize)
    values = document.view((OCTAHEDRON[0][5:] * 32767).astype("<i2").tobytes())
    where = document.view(np.array([5], "<u2").tobytes())
    sparse = {
        "count": 1,
        "indices": {"bufferView": where, "componentType": 5123},
        "values": {"bufferView": values},
    }
    position = document.add(
        "accessors", bufferView=view, componentType=5122, type="VEC3", count=6, normalized=True,
        sparse=sparse,
    )  # fmt: skip
    indices = document.array(OCTAHEDRON[1].ravel(), "u1")
    primitive = {"attributes": {"POSITION": position}, "indices": indices}
    document.add("nodes", mesh=document.add("meshes", primitives=[primitive]))
    document.head["extensionsRequired"] = ["KHR_mesh_quantization", "KHR_materials_unlit"]
    mesh = read_mesh(document.save(tmp_path / "a.glb"))
    assert_allclose(mesh.vertices, OCTAHEDRON[0], atol=1e-12)


def external(folder, uri, place=None):
    """Write a model with a buffer at *uri*, and the buffer itself to *place* or to that URI."""
    folder.mkdir(exist_ok=True)
    document = octahedron(*OCTAHEDRON)
    document.head["buffers"][0]["uri"] = uri
    target = folder / (uri if place is None else place)
    target.parent.mkdir(exist_ok=True, parents=True)
    target.write_bytes(document.blob)
    return document.save(folder / "a.gltf")


@pytest.mark.parametrize("uri", ["a.bin", "data/a.bin", "./a.bin", "data/../a.bin", "ä b.bin"])
def test_a_buffer_in_the_folder_of_the_model_is_read(tmp_path, uri):
    (tmp_path / "model" / "data").mkdir(parents=True)
    for name in (uri, quote(uri)):
        path = external(tmp_path / "model", name, uri)
        assert read_mesh(path).n_faces == 8


@pytest.mark.parametrize(
    "kind", ["..", "absolute", "file", "coded", "twice", "link", "none", "http"]
)
def test_a_buffer_outside_the_folder_of_the_model_is_not_read(tmp_path, kind):
    place = tmp_path / "a.bin"
    uri = {
        "..": "../a.bin", "absolute": str(place), "file": place.as_uri(),
        "coded": "%2e%2e%2fa.bin", "twice": "data/../../a.bin", "link": "link.bin", "none": "b.bin",
        "http": "http://localhost/a.bin",
    }[kind]  # fmt: skip
    path = external(tmp_path / "model", uri, "../a.bin")
    if kind == "link":
        (tmp_path / "model" / "link.bin").symlink_to(tmp_path / "a.bin")
    with pytest.raises(MeshError, match=r"a\.gltf: buffer 0 .* not a file in the model's folder"):
        read_polydata(path)


def deep(levels):
    return [{"children": [k + 1]} for k in range(levels)] + [{"mesh": 0}]


HUGE = 10**12
INCONSISTENT = {  # path into the JSON, the value set there, and a part of the message
    "count beyond": ("accessors 0 count", 7, "ends at byte 84 of 72"),
    "huge count": ("accessors 0 count", HUGE, "ends at byte"),
    "negative count": ("accessors 0 count", -1, "count is -1"),
    "count of corners": ("accessors 1 count", 23, "not a multiple of 3"),
    "fraction": ("accessors 0 count", 5.5, "count is 5.5"),
    "truth": ("accessors 0 count", True, "count is True"),
    "word": ("accessors 0 count", "6", "count is '6'"),
    "no count": ("accessors 0 count", None, "count is missing"),
    "huge offset": ("accessors 0 byteOffset", 2**62, "ends at byte"),
    "negative offset": ("accessors 0 byteOffset", -12, "byteOffset is -12"),
    "component": ("accessors 0 componentType", 5124, "component type 5124"),
    "float corners": ("accessors 1 componentType", 5126, "ends at byte"),
    "signed corners": ("accessors 1 componentType", 5122, "not unsigned"),
    "type": ("accessors 0 type", "VEC4", "is of type 'VEC4'"),
    "no type": ("accessors 0 type", "VEC9", "is of type 'VEC9'"),
    "no view": ("accessors 0 bufferView", 9, "bufferViews: index is 9"),
    "negative view": ("accessors 0 bufferView", -1, "bufferViews: index is -1"),
    "huge view": ("bufferViews 0 byteLength", HUGE, "bufferView 0 ends at byte"),
    "view offset": ("bufferViews 0 byteOffset", HUGE, "bufferView 0 ends at byte"),
    "negative length": ("bufferViews 0 byteLength", -1, "byteLength is -1"),
    "stride": ("bufferViews 0 byteStride", 4, "byteStride is 4"),
    "wide stride": ("bufferViews 0 byteStride", 200, "ends at byte"),
    "negative stride": ("bufferViews 0 byteStride", -12, "byteStride is -12"),
    "other buffer": ("bufferViews 0 buffer", 1, "buffers: index is 1"),
    "long buffer": ("buffers 0 byteLength", HUGE, "buffer 0 declares"),
    "no mesh": ("nodes 0 mesh", 4, "meshes: index is 4"),
    "mesh of text": ("nodes 0 mesh", "0", "meshes: index is '0'"),
    "its own child": ("nodes 0 children", [0], "its own descendant"),
    "circle": ("nodes", [{"children": [1]}, {"children": [0], "mesh": 0}], "its own descendant"),
    "two parents": ("nodes", [{"children": [1]}, {"mesh": 0}, {"children": [1]}], "two parents"),
    "twice a child": ("nodes", [{"children": [1, 1]}, {"mesh": 0}], "two parents"),
    "no child": ("nodes 0 children", [7], "children is 7"),
    "children": ("nodes 0 children", 7, "children must be a list"),
    "nodes": ("nodes", {"0": {}}, "nodes must be a list"),
    "matrix": ("nodes 0 matrix", [1, 2, 3], "matrix must be 16 finite numbers"),
    "rotation": ("nodes 0 rotation", [float("nan"), 0, 0, 1], "rotation must be 4 finite"),
    "scale": ("nodes 0 scale", ["1", 1, 1], "scale must be 3 finite"),
    "scene": ("scene", 3, "scene is 3"),
    "scene of no node": ("scenes 0 nodes", [5], "nodes is 5"),
    "mode": ("meshes 0 primitives 0 mode", 7, "mode is 7"),
    "lines": ("meshes 0 primitives 0 mode", 1, "contains no triangles"),
    "position": ("meshes 0 primitives 0 attributes POSITION", 1, "is of type 'SCALAR'"),
    "skin": ("nodes 0 skin", 0, "has no skins"),
    "targets": ("meshes 0 primitives 0 targets", [{"POSITION": 8}], "weights"),
    "draco": ("extensionsRequired", ["KHR_draco_mesh_compression"], "KHR_draco_mesh_compression"),
    "meshopt": ("extensionsRequired", ["EXT_meshopt_compression"], "EXT_meshopt_compression"),
    "instances": ("extensionsRequired", ["EXT_mesh_gpu_instancing"], "not supported"),
    "version": ("asset version", "1.0", "is not glTF 2.0"),
    "asset": ("asset", [], "is not glTF 2.0"),
}  # fmt: skip


def changed(head, where, value):
    """Set *value* at a path in the JSON; None deletes it."""
    *way, last = where.split()
    for key in way:
        head = head[int(key)] if isinstance(head, list) else head[key]
    if value is None:
        del head[last]
    else:
        head[last] = value


@pytest.mark.parametrize("what", list(INCONSISTENT))
def test_inconsistent_files_are_errors_that_name_the_object(tmp_path, what):
    where, value, message = INCONSISTENT[what]
    document = octahedron(*OCTAHEDRON)
    changed(document.head, where, value)
    if what == "targets":
        document.head["meshes"][0]["weights"] = [1, 2]
    with pytest.raises(MeshError, match=message) as refusal:
        read_polydata(document.save(tmp_path / "a.glb"))
    assert "a.glb" in str(refusal.value)


def test_sparse_parts_that_do_not_fit_are_errors(tmp_path):
    for change, message in [
        ({"count": 7}, "count is 7"),
        ({"indices": {"bufferView": 2, "componentType": 5122}}, "not unsigned"),
        ({"indices": {"bufferView": 3, "componentType": 5123}}, "replaces element"),
        ({"values": {"bufferView": 2}}, "ends at byte"),
        ({"values": {}}, "index is missing"),
        ({"indices": []}, "must be an object"),
    ]:
        document = octahedron(*OCTAHEDRON)
        for data in (b"\0\0\1\0", b"\xff\xff\xff\xff", b"\0" * 24):
            document.view(data)
        sparse = {"count": 2, "indices": {"bufferView": 2, "componentType": 5123}}
        document.head["accessors"][0]["sparse"] = sparse | {"values": {"bufferView": 4}} | change
        with pytest.raises(MeshError, match=message):
            read_polydata(document.save(tmp_path / "a.glb"))


def test_an_accessor_without_a_buffer_cannot_allocate_more_than_the_file_size_allows(tmp_path):
    document = octahedron(*OCTAHEDRON)
    document.head["accessors"][0] |= {"count": HUGE}
    del document.head["accessors"][0]["bufferView"]
    with pytest.raises(MeshError, match="but has no buffer"):
        read_polydata(document.save(tmp_path / "a.glb"))


def test_a_compressed_primitive_is_an_error(tmp_path):
    document = octahedron(*OCTAHEDRON)
    del document.head["accessors"][0]["bufferView"]
    primitive = document.head["meshes"][0]["primitives"][0]
    primitive["extensions"] = {"KHR_draco_mesh_compression": {"bufferView": 0}}
    with pytest.raises(MeshError, match="is compressed"):
        read_polydata(document.save(tmp_path / "a.glb"))


def test_too_many_instances_of_primitives_are_an_error_at_once(tmp_path):
    document = octahedron(*OCTAHEDRON)
    document.head["meshes"][0]["primitives"] *= 7_800
    document.head["nodes"] = [{"mesh": 0} for _ in range(7_800)]
    document.head["scenes"][0]["nodes"] = list(range(7_800))
    changed(document.head, "accessors 1 count", 3)
    for primitive in document.head["meshes"][0]["primitives"]:
        primitive["mode"] = 1
    with pytest.raises(MeshError, match="more than 50000000 vertices"):
        read_polydata(document.save(tmp_path / "a.glb"))


@pytest.mark.parametrize("levels", [10, 5_000])
def test_a_deep_tree_of_nodes_is_read(tmp_path, levels):
    document = octahedron(*OCTAHEDRON)
    document.head["nodes"] = deep(levels)
    assert read_mesh(document.save(tmp_path / "a.glb")).n_faces == 8


def test_chunks_that_do_not_fit_the_file_are_errors(tmp_path):
    document = octahedron(*OCTAHEDRON)
    data = document.save(tmp_path / "a.glb").read_bytes()
    for harmed, message in [
        (data[:-1], "declares"),
        (data[:15], "truncated"),
        (struct.pack("<4sII", b"glTF", 1, len(data)) + data[12:], "glTF 1"),
        (data[:12] + struct.pack("<I", 2**31) + data[16:], "chunk"),
        (data[:16] + b"NOPE" + data[20:], "no JSON"),
        (glb(json.dumps(document.head).encode(), document.blob[:60]), "buffer 0 declares"),
    ]:
        (tmp_path / "b.glb").write_bytes(harmed)
        with pytest.raises(MeshError, match=message):
            read_polydata(tmp_path / "b.glb")


@pytest.mark.parametrize("uri", ["data:,", "data:;base64,AAAA", "data:x", "data:;base64,A"])
def test_a_data_uri_with_too_few_bytes_is_an_error(tmp_path, uri):
    document = octahedron(*OCTAHEDRON)
    document.head["buffers"][0]["uri"] = uri
    with pytest.raises(MeshError, match=r"a\.gltf: "):
        read_polydata(document.save(tmp_path / "a.gltf"))
