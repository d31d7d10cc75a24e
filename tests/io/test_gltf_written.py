"""glTF that is read, moved and written: only positions, normals and tangents differ."""

from __future__ import annotations

import copy
import json
import logging

import numpy as np
import pytest
import pyvista as pv
from gltf_files import Gltf, octahedron
from numpy.testing import assert_allclose, assert_array_equal
from solids import OCTAHEDRON, icosphere

import vtk_segdeform as sd
from vtk_segdeform.errors import MeshError
from vtk_segdeform.io.convert import read_polydata, to_polydata, with_vertices, write_mesh
from vtk_segdeform.io.gltf.buffers import Document
from vtk_segdeform.io.polygons import polygons_of

VERTICES, FACES = icosphere(2)
PNG = b"\x89PNG\r\n\x1a\n" + bytes(range(40))


def bent(points):
    points = np.asarray(points, dtype=float)
    return points + 0.2 * np.sin(2 * points[:, [1, 2, 0]])


def seamed():
    """Return a sphere cut along its faces, with everything a renderer wants."""
    document, rng = Gltf(), np.random.default_rng(7)
    points = VERTICES[FACES].reshape(-1, 3)
    tangents = np.cross([0.1, 0.2, 1.0], points)
    tangents /= np.linalg.norm(tangents, axis=1, keepdims=True)
    attributes = {
        "NORMAL": document.array(points),
        "TANGENT": document.array(np.column_stack([tangents, np.full(len(points), -1.0)])),
        "TEXCOORD_0": document.array(rng.random((len(points), 2))),
        "_HEAT": document.array(np.arange(len(points))),
    }
    faces = np.arange(len(points)).reshape(-1, 3)
    mesh = document.mesh(points, faces[:100], attributes=attributes, material=1)
    primitives = document.head["meshes"][mesh]["primitives"]
    rest = document.array(faces[100:].ravel(), "u2")
    primitives.append(primitives[0] | {"indices": rest, "material": 0})  # the same vertices
    document.head["meshes"][mesh]["extras"] = {"who": ["we", {"knows": None}]}
    document.head["materials"] = [
        {"name": "skin", "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}},
        {"name": "hair", "alphaMode": "MASK"},
    ]
    document.head["textures"] = [{"source": 0}]
    document.head["images"] = [{"bufferView": document.view(PNG), "mimeType": "image/png"}]
    document.add("nodes", mesh=mesh, name="body", rotation=[0, 0, 0.6, 0.8], translation=[1, 2, 3],
                 scale=[1, 2, 3])  # fmt: skip
    times = document.array(np.arange(3.0)[:, None])
    channel = {"sampler": 0, "target": {"node": 0, "path": "translation"}}
    sampler = {"input": times, "output": document.array(rng.random((3, 3)))}
    document.add("animations", samplers=[sampler], channels=[channel])
    document.head |= {"scene": 0, "scenes": [{"nodes": [0]}], "extras": {"any": "thing"}}
    return document


def moved_file(path, out, move=bent):
    """Read, move and write a file; return what was given and what was read again."""
    surface = sd.Surface.read(path)
    surface.write(out, move(surface.mesh.vertices))
    return surface.moved(move(surface.mesh.vertices)), read_polydata(out)


def require_moved(expected, found):
    assert_allclose(found.points, expected.points, atol=3e-6)
    for here, there in zip(polygons_of(expected), polygons_of(found), strict=True):
        assert_array_equal(here, there)
    assert list(found.point_data) == list(expected.point_data)
    assert list(found.cell_data) == list(expected.cell_data)
    for name in expected.point_data:
        atol = 3e-6 if name in ("NORMAL", "TANGENT") else 0
        assert_allclose(found.point_data[name], expected.point_data[name], atol=atol)
    for name in expected.cell_data:
        assert_array_equal(found.cell_data[name], expected.cell_data[name])


def test_only_positions_normals_and_tangents_differ(tmp_path):
    document = seamed()
    path, out = document.save(tmp_path / "a.glb"), tmp_path / "b.glb"
    expected, found = moved_file(path, out)
    require_moved(expected, found)
    old, new = (Document(each.read_bytes()) for each in (path, out))
    attributes = old.json["meshes"][0]["primitives"][0]["attributes"]
    allowed = {attributes[name] for name in ("POSITION", "NORMAL", "TANGENT")}
    for number, (before, after) in enumerate(
        zip(old.json["accessors"], new.json["accessors"], strict=True)
    ):
        if number in allowed:
            before, after = ({k: v for k, v in each.items() if k not in ("min", "max")}
                             for each in (before, after))  # fmt: skip
            values = new.array(number, "VEC3", "VEC4")
            assert_array_equal(new.json["accessors"][number]["min"], values.min(axis=0))
            assert_array_equal(new.json["accessors"][number]["max"], values.max(axis=0))
        else:
            assert_array_equal(*(d.array(number, "SCALAR", "VEC2", "VEC3") for d in (old, new)))
        assert before == after
    for each in (old, new):
        del each.json["accessors"]
    assert old.json == new.json
    assert out.stat().st_size <= path.stat().st_size + 600  # digits of min and max
    image = new.json["bufferViews"][new.json["images"][0]["bufferView"]]
    start = image["byteOffset"]
    assert new.buffer(0)[start : start + image["byteLength"]] == PNG
    names = list(expected.field_data["MaterialNames"])
    assert [names[k] for k in found.cell_data["Material"][[0, 99, 100]]] == ["hair"] * 2 + ["skin"]


def test_at_rest_the_file_is_the_same_byte_for_byte(tmp_path):
    path = seamed().save(tmp_path / "a.glb")
    moved_file(path, tmp_path / "b.glb", move=lambda vertices: vertices)
    assert (tmp_path / "b.glb").read_bytes() == path.read_bytes()


def test_nodes_that_share_a_mesh_get_their_own_where_they_differ(tmp_path):
    document = octahedron(*OCTAHEDRON)
    document.head["nodes"] = [
        {"mesh": 0, "name": str(k), "translation": [4.0 * k, 0, 0]} for k in range(4)
    ]
    document.head["nodes"][3]["scale"] = [-1, 2, 1]  # mirrored
    document.head["scenes"][0]["nodes"] = [0, 1, 2, 3]
    path = document.save(tmp_path / "a.glb")

    def move(vertices):
        moved = vertices.copy()
        moved[6:] = bent(vertices[6:])  # all but the first
        return moved

    require_moved(*moved_file(path, tmp_path / "b.glb", move))
    head = Document((tmp_path / "b.glb").read_bytes()).json
    assert [node["mesh"] for node in head["nodes"]] == [0, 1, 2, 3]
    lift = moved_file(path, tmp_path / "c.glb", lambda x: x + np.repeat([[0], [1]], 12, 0))
    require_moved(*lift)
    head = Document((tmp_path / "c.glb").read_bytes()).json
    assert head["nodes"][0]["mesh"] == head["nodes"][1]["mesh"] == 0
    assert 0 not in {node["mesh"] for node in head["nodes"][2:]}


def test_positions_that_are_interleaved_sparse_or_shared_are_moved(tmp_path, rng):
    document = Gltf()
    rows = np.zeros(6, [("p", "<f4", 3), ("n", "<f4", 3), ("t", "<f4", 2)])
    rows["p"], rows["n"], rows["t"] = OCTAHEDRON[0], OCTAHEDRON[0], rng.random((6, 2))
    view = document.view(rows.tobytes(), byteStride=rows.itemsize)
    common = {"bufferView": view, "componentType": 5126, "count": 6}
    bounds = {"min": [-1, -1, -1], "max": [1, 1, 1]}
    position = document.add("accessors", **common, type="VEC3", **bounds)
    normal = document.add("accessors", **common, type="VEC3", byteOffset=12)
    texture = document.add("accessors", **common, type="VEC2", byteOffset=24)
    where = document.view(np.array([5], "<u2").tobytes())
    values = document.view((1.5 * OCTAHEDRON[0][5:]).astype("<f4").tobytes())
    sparse = {"count": 1, "indices": {"bufferView": where, "componentType": 5123},
              "values": {"bufferView": values}}  # fmt: skip
    pointed = document.add("accessors", **common, type="VEC3", **bounds, sparse=sparse)
    indices = document.array(OCTAHEDRON[1].ravel(), "u1")
    for k, number in enumerate((position, pointed, position)):
        attributes = {"POSITION": number, "NORMAL": normal, "TEXCOORD_0": texture}
        primitive = {"attributes": attributes, "indices": indices}
        mesh = document.add("meshes", primitives=[primitive])
        document.add("nodes", mesh=mesh, translation=[5.0 * k, 0, 0])
    path = document.save(tmp_path / "a.glb")
    require_moved(*moved_file(path, tmp_path / "b.glb"))
    new = Document((tmp_path / "b.glb").read_bytes())
    assert_array_equal(new.array(texture, "VEC2"), rows["t"])


BALL, TRIANGLES = icosphere(1)
MARGIN = 16  # bytes before and after the positions


def animated(document, position, key="output"):
    """Let an animation use an accessor; return what gets it."""
    sampler = {"input": document.array(np.arange(3.0)), "output": document.array(np.ones((3, 3)))}
    channel = {"sampler": 0, "target": {"node": 0, "path": "translation"}}
    document.add("animations", samplers=[sampler | {key: position}], channels=[channel])
    return lambda new: new.array(
        new.json["animations"][0]["samplers"][0][key], "VEC3", "VEC2", "SCALAR"
    )


def part(document, position, first, count, type_="VEC3", **more):
    """Let an animation use numbers from byte *first* of the positions, by a view of their own."""
    view = document.head["bufferViews"][document.head["accessors"][position]["bufferView"]]
    width = {"VEC3": 12, "VEC2": 8, "SCALAR": 4}[type_]
    start = view["byteOffset"] + MARGIN + first
    stride = more.get("byteStride", width)
    of_part = document.add("bufferViews", buffer=0, byteOffset=start,
                           byteLength=(count - 1) * stride + width, **more)  # fmt: skip
    same = {"componentType": 5126, "count": count, "type": type_}
    return animated(document, document.add("accessors", bufferView=of_part, **same))


def skinned(document, position):
    """Let the matrices of a skin be bytes of the positions."""
    view = document.head["accessors"][position]["bufferView"]
    matrices = document.add("accessors", bufferView=view, byteOffset=MARGIN + 64, count=2,
                            componentType=5126, type="MAT4")  # fmt: skip
    document.add("skins", joints=[0], inverseBindMatrices=matrices)
    return lambda new: new.array(new.json["skins"][0]["inverseBindMatrices"], "MAT4")


def sparse(document, position):
    """Let the values that a sparse accessor replaces be bytes of the positions."""
    where = document.view(np.array([1, 4], "<u2").tobytes())
    values = {"bufferView": document.head["accessors"][position]["bufferView"], "byteOffset": 16}
    indices = {"bufferView": where, "componentType": 5123}
    replaced = {"count": 2, "indices": indices, "values": values}
    number = document.add("accessors", componentType=5126, count=9, type="VEC3", sparse=replaced)
    return animated(document, number)


def pictured(document, position):
    """Let an image be bytes of the positions."""
    document.add("images", bufferView=document.head["accessors"][position]["bufferView"],
                 mimeType="image/png")  # fmt: skip

    def image(new):
        view = new.json["bufferViews"][new.json["images"][0]["bufferView"]]
        start = view["byteOffset"]
        return np.frombuffer(new.buffer(0)[start : start + view["byteLength"]], "u1")

    return image


def compressed(document, position):
    """Let the compressed data of an unused view be bytes of the positions."""
    view = document.head["bufferViews"][document.head["accessors"][position]["bufferView"]]
    place = {key: view[key] for key in ("buffer", "byteOffset", "byteLength")}
    other = document.view(bytes(8), extensions={"EXT_meshopt_compression": place})

    def data(new):
        there = new.json["bufferViews"][other]["extensions"]["EXT_meshopt_compression"]
        start = there["byteOffset"]
        return np.frombuffer(new.buffer(0)[start : start + there["byteLength"]], "u1")

    return data


def attribute(document, position, name):
    document.head["meshes"][0]["primitives"][0]["attributes"][name] = position
    return lambda new: new.array(new.json["meshes"][0]["primitives"][0]["attributes"][name], "VEC3")


def morphed(document, position):
    primitive = document.head["meshes"][0]["primitives"][0]
    primitive["targets"] = [{"POSITION": document.array(0 * BALL)}, {"POSITION": position}]
    return lambda new: new.array(
        new.json["meshes"][0]["primitives"][0]["targets"][1]["POSITION"], "VEC3"
    )


def second_mesh(document, position):
    """Let a second mesh, which no node shows, have the same positions."""
    number = document.add("meshes", primitives=[{"attributes": {"POSITION": position}}])
    return lambda new: new.array(
        new.json["meshes"][number]["primitives"][0]["attributes"]["POSITION"], "VEC3"
    )


def instanced(document, position):
    """Let an extension of a node use the positions."""
    key = "EXT_mesh_gpu_instancing"
    document.head["nodes"][0]["extensions"] = {key: {"attributes": {"TRANSLATION": position}}}
    return lambda new: new.array(
        new.json["nodes"][0]["extensions"][key]["attributes"]["TRANSLATION"], "VEC3"
    )


LAST = 12 * (len(BALL) - 1)
SHARED = {
    "output of an animation": animated,
    "input of an animation": lambda document, position: animated(document, position, "input"),
    "all bytes": lambda *given: part(*given, 0, len(BALL)),
    "from the second row": lambda *given: part(*given, 12, 5),
    "the last row": lambda *given: part(*given, LAST, 1),
    "across the last row": lambda *given: part(*given, LAST + 8, 2),
    "across the first row": lambda *given: part(*given, -8, 1),
    "the last number": lambda *given: part(*given, LAST + 8, 1, "SCALAR"),
    "the first number": lambda *given: part(*given, 0, 1, "SCALAR"),
    "every second row": lambda *given: part(*given, 12, 9, byteStride=24),
    "x and y of rows": lambda *given: part(*given, 12, 9, "VEC2", byteStride=12),
    "a skin": skinned,
    "a sparse accessor": sparse,
    "an image": pictured,
    "compressed data": compressed,
    "a colour": lambda *given: attribute(*given, "COLOR_0"),
    "any attribute": lambda *given: attribute(*given, "_PLACE"),
    "a morph target": morphed,
    "another mesh": second_mesh,
    "an extension": instanced,
}


@pytest.mark.parametrize("how", list(SHARED))
def test_whatever_shares_bytes_with_positions_that_move_does_not_change(tmp_path, how):
    document = Gltf()
    data = np.arange(4.0, dtype="<f4").tobytes()  # of MARGIN bytes
    view = document.view(data + BALL.astype("<f4").tobytes() + data)
    position = document.add("accessors", bufferView=view, byteOffset=MARGIN, componentType=5126,
                            count=len(BALL), type="VEC3", min=[-1] * 3, max=[1] * 3)  # fmt: skip
    indices = document.array(TRIANGLES.ravel(), "u2")
    primitive = {"attributes": {"POSITION": position}, "indices": indices}
    document.add("nodes", mesh=document.add("meshes", primitives=[primitive]))
    got = SHARED[how](document, position)
    path, out = document.save(tmp_path / "a.glb"), tmp_path / "b.glb"
    expected, found = moved_file(path, out, lambda x: bent(x) + 0.3)  # each number of each vertex
    assert_allclose(found.points, expected.points, atol=3e-6)
    old, new = (Document(each.read_bytes()) for each in (path, out))
    assert_array_equal(got(new), got(old))
    assert len(new.json["accessors"]) - len(old.json["accessors"]) in (0, 1)
    before = old.buffer(0)
    place = document.head["bufferViews"][view]["byteOffset"]
    assert new.buffer(0)[place : place + MARGIN] == before[place : place + MARGIN]


def sparse_alone(document, common):
    where = document.view(np.array([5], "<u2").tobytes())
    values = document.view((1.5 * BALL[5:6]).astype("<f4").tobytes())
    common["sparse"] = {"count": 1, "values": {"bufferView": values},
                        "indices": {"bufferView": where, "componentType": 5123}}  # fmt: skip


def of_compressed_view(document, common):
    place = {"buffer": 0, "byteOffset": 0, "byteLength": 8}
    view = document.head["bufferViews"][common["bufferView"]]
    view["extensions"] = {"EXT_meshopt_compression": place}


def of_nothing(document, common):
    """Let all positions be zeros that are replaced one by one."""
    del common["bufferView"]
    common["sparse"] = {"count": len(BALL), "values": {"bufferView": 1},
                        "indices": {"bufferView": 2, "componentType": 5123}}  # fmt: skip


@pytest.mark.parametrize("change", [sparse_alone, of_compressed_view, of_nothing])
def test_positions_that_are_not_plain_bytes_become_new_ones(tmp_path, change):
    document = Gltf()
    document.view(bytes(8))
    view = document.view(BALL.astype("<f4").tobytes())
    document.view(np.arange(len(BALL), dtype="<u2").tobytes())
    common = {"bufferView": view, "componentType": 5126, "count": len(BALL), "type": "VEC3"}
    change(document, common)
    primitive = {"attributes": {"POSITION": document.add("accessors", **common)}}
    primitive["indices"] = document.array(TRIANGLES.ravel(), "u2")
    document.add("nodes", mesh=document.add("meshes", primitives=[primitive]))
    document.view(b"odd")
    path, out = document.save(tmp_path / "a.glb"), tmp_path / "b.glb"
    require_moved(*moved_file(path, out, lambda x: bent(x) + 0.3))
    old, new = (Document(each.read_bytes()) for each in (path, out))
    assert new.buffer(0)[: len(document.blob)] == old.buffer(0)[: len(document.blob)]
    assert len(new.json["bufferViews"]) == len(old.json["bufferViews"]) + 1
    assert new.json["bufferViews"][-1]["byteOffset"] % 4 == 0
    accessor = new.json["accessors"][0]
    assert "sparse" not in accessor
    assert "extensions" not in new.json["bufferViews"][accessor["bufferView"]]


def test_positions_that_are_zero_and_of_no_bytes_become_new_ones(tmp_path):
    document = Gltf()
    position = document.add("accessors", componentType=5126, count=len(BALL), type="VEC3")
    primitive = {"attributes": {"POSITION": position}}
    primitive["targets"] = [{"POSITION": document.array(BALL)}]
    primitive["indices"] = document.array(TRIANGLES.ravel(), "u2")
    document.add("nodes", mesh=document.add("meshes", primitives=[primitive], weights=[1.0]))
    path = document.save(tmp_path / "a.glb")
    require_moved(*moved_file(path, tmp_path / "b.glb"))


@pytest.mark.parametrize("suffix", [".glb", ".gltf"])
def test_skins_and_morph_targets_show_the_new_positions(tmp_path, suffix, caplog, rng):
    document = Gltf()
    weights = rng.random((len(VERTICES), 4))
    attributes = {
        "NORMAL": document.array(VERTICES),
        "JOINTS_0": document.array(rng.integers(0, 2, (len(VERTICES), 4)), "u1"),
        "WEIGHTS_0": document.array(weights / weights.sum(axis=1, keepdims=True)),
    }
    target = document.array(0.1 * rng.random((len(VERTICES), 3)))
    mesh = document.mesh(VERTICES, FACES, attributes=attributes, targets=[{"POSITION": target}])
    document.head["meshes"][mesh]["weights"] = [0.5]
    joints = [document.add("nodes", rotation=[0, 0, 0.1, 0.99], translation=[0, k, 0])
              for k in (0, 1)]  # fmt: skip
    document.add("skins", joints=joints)
    document.add("nodes", mesh=mesh, skin=0, translation=[9, 9, 9])
    path = document.save(tmp_path / f"a{suffix}")
    with caplog.at_level(logging.WARNING):
        expected, found = moved_file(path, tmp_path / f"b{suffix}")
    require_moved(expected, found)
    assert "has a skin" in caplog.text
    assert "has morph targets" in caplog.text


def test_a_gltf_with_other_files_becomes_one_file(tmp_path):
    document = seamed()
    head, blob = document.head, bytes(document.blob)
    half = head["bufferViews"][3]["byteOffset"]
    for view in head["bufferViews"]:
        if view["byteOffset"] >= half:
            view["buffer"], view["byteOffset"] = 1, view["byteOffset"] - half
    head["buffers"] = [{"uri": "a.bin", "byteLength": half},
                       {"uri": "b%20c.bin", "byteLength": len(blob) - half}]  # fmt: skip
    head["images"] += [{"uri": "skin.png"}, {"uri": "no.png"}, {"uri": "../a.png"}]
    (tmp_path / "in").mkdir()
    for name, data in (("a.bin", blob[:half]), ("b c.bin", blob[half:]), ("skin.png", PNG)):
        (tmp_path / "in" / name).write_bytes(data)
    path = tmp_path / "in" / "a.gltf"
    path.write_text(json.dumps(head))
    for out in (tmp_path / "b.glb", tmp_path / "b.gltf"):
        require_moved(*moved_file(path, out))
        new = Document(out.read_bytes())
        one, two, *missing = new.json["images"]
        assert [each["uri"] for each in missing] == ["no.png", "../a.png"]
        for image in (one, two):
            view = new.json["bufferViews"][image["bufferView"]]
            start = view["byteOffset"]
            assert new.buffer(0)[start : start + view["byteLength"]] == PNG
            assert image["mimeType"] == "image/png"
        assert len(new.json["buffers"]) == 1


def test_a_surface_with_other_faces_or_a_damaged_document_becomes_a_new_document(tmp_path, caplog):
    surface = read_polydata(seamed().save(tmp_path / "a.glb"))
    part = surface.copy()
    part.faces = surface.faces[: 4 * 50]
    write_mesh(tmp_path / "b.glb", part)
    assert "materials, textures and nodes are left out" in caplog.text
    assert read_polydata(tmp_path / "b.glb").n_cells == 50
    for damage in (b"", b"glTF", np.asarray(surface.field_data["glTF"]).tobytes()[:-40]):
        surface.field_data["glTF"] = np.frombuffer(damage + b"\0", "u1")
        write_mesh(tmp_path / "b.glb", surface)
        assert_allclose(read_polydata(tmp_path / "b.glb").points, surface.points, atol=1e-6)
    assert "is not used" in caplog.text
    surface.points[0] = np.nan
    with pytest.raises(MeshError, match=r"b\.glb: .*NaN"):
        write_mesh(tmp_path / "b.glb", surface)


def test_a_new_document_has_positions_normals_texture_and_colours(tmp_path, rng):
    ball = to_polydata(sd.Mesh(VERTICES, FACES))
    ball.point_data["Normals"] = VERTICES
    ball.point_data.active_normals_name = "Normals"
    ball.point_data["uv"] = rng.random((len(VERTICES), 2))
    ball.point_data.active_texture_coordinates_name = "uv"
    ball.point_data["RGB"] = rng.integers(0, 256, (len(VERTICES), 3)).astype("u1")
    ball.point_data["_heat"] = np.arange(len(VERTICES), dtype="f4")
    for suffix in (".glb", ".gltf"):
        write_mesh(tmp_path / f"a{suffix}", ball)
        found = read_polydata(tmp_path / f"a{suffix}")
        assert_array_equal(found.points, VERTICES.astype("f4"))
        assert_array_equal(found.regular_faces, FACES)
        assert_allclose(found.point_data["NORMAL"], VERTICES, atol=1e-6)
        assert_array_equal(found.point_data["RGB"], ball.point_data["RGB"])
        assert_array_equal(found.point_data["_heat"], ball.point_data["_heat"])
        flipped = ball.point_data["uv"] * [1, -1] + [0, 1]  # v begins at the top
        assert_allclose(found.active_texture_coordinates, flipped, atol=1e-6)
    theirs = pv.read(tmp_path / "a.glb").combine().extract_surface(algorithm=None)
    assert theirs.n_cells == len(FACES)


OBJ = """v 0 0 0
v 1 0 0
v 1 1 0
v 0 1 0
v 2 0 1
v 2 1 1
vt 0 0
vt 1 0
vt 1 1
vt 0 1
usemtl red
f 1/1 2/2 3/3 4/4
usemtl blue
f 2/1 5/2 6/3 3/4
"""


def test_polygons_seams_and_materials_of_other_formats_are_written(tmp_path, caplog):
    (tmp_path / "a.obj").write_text(OBJ)
    write_mesh(tmp_path / "a.glb", read_polydata(tmp_path / "a.obj"))
    assert "cut into triangles" in caplog.text
    found = read_polydata(tmp_path / "a.glb")
    assert found.n_cells == 4
    assert found.n_points == 8  # two on a seam
    assert list(found.field_data["MaterialNames"]) == ["red", "blue"]
    assert found.cell_data["Material"].tolist() == [0, 0, 1, 1]


def hostile(head, rng):
    """Change or delete one value anywhere in a document."""
    places = []
    pending = [head]
    while pending:
        item = pending.pop()
        keys = list(item) if isinstance(item, dict) else range(len(item))
        places += [(item, key) for key in keys]
        pending += [item[key] for key in keys if isinstance(item[key], dict | list)]
    item, key = places[rng.integers(len(places))]
    bad = [None, -1, 2**40, 0.5, "x", [], {}, True, 1e308, [[]], {"a": {}}, 3]
    item[key] = bad[rng.integers(len(bad))]


def test_hostile_documents_are_written_or_refused_by_name(tmp_path):
    document = seamed()
    document.head["skins"] = [{"joints": [0]}]
    document.head["meshes"].append(copy.deepcopy(document.head["meshes"][0]))  # shown by no node
    rng, written = np.random.default_rng(1), 0
    for _ in range(100):
        harmed = copy.deepcopy(document)
        hostile(harmed.head, rng)
        path = harmed.save(tmp_path / "a.glb")
        try:
            surface = read_polydata(path)
        except MeshError:
            continue
        moved = with_vertices(surface, bent(surface.points)) if written < 5 else surface.copy()
        moved.points = bent(surface.points)
        write_mesh(tmp_path / "b.glb", moved)
        assert_allclose(read_polydata(tmp_path / "b.glb").points, moved.points, atol=1e-5)
        written += 1
    assert written > 50
