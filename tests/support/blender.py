"""Run inside Blender's Python: make a body and export it, or import a file and describe it.

python blender.py make FOLDER        body.glb, body.obj, body.ply
python blender.py describe FILE      one line of JSON
"""

from __future__ import annotations

import json
import math
import sys
from pathlib import Path

import bpy


def make(folder):
    """Export a smooth cylinder of quadrangles with two hard rims, UV seams and two materials."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    n, rings = 16, 6
    points = [
        (math.cos(2 * math.pi * k / n), math.sin(2 * math.pi * k / n), 2.0 * j / (rings - 1))
        for j in range(rings) for k in range(n)
    ]  # fmt: skip
    faces = [
        (j * n + k, j * n + (k + 1) % n, (j + 1) * n + (k + 1) % n, (j + 1) * n + k)
        for j in range(rings - 1) for k in range(n)
    ]  # fmt: skip
    faces += [tuple(range(n))[::-1], tuple(range((rings - 1) * n, rings * n))]
    mesh = bpy.data.meshes.new("body")
    mesh.from_pydata(points, [], faces)
    for name in ("skin", "paint"):
        material = bpy.data.materials.new(name)
        mesh.materials.append(material)
    uv = mesh.uv_layers.new(name="UVMap")
    for polygon in mesh.polygons:
        polygon.use_smooth = True
        polygon.material_index = int(polygon.index % n < n // 2)
        for loop in polygon.loop_indices:
            vertex = mesh.loops[loop].vertex_index
            column, row = vertex % n, vertex // n
            if column == 0 and polygon.index % n == n - 1:
                column = n  # the seam
            uv.data[loop].uv = (column / n, row / rings)
    rims = {0, rings - 1}
    for edge in mesh.edges:
        a, b = (vertex // n for vertex in edge.vertices)
        edge.use_edge_sharp = a == b and a in rims
    thing = bpy.data.objects.new("body", mesh)
    bpy.context.collection.objects.link(thing)
    thing.location, thing.rotation_euler = (1.0, 2.0, 3.0), (0.3, 0.2, 0.1)
    bpy.ops.export_scene.gltf(filepath=str(folder / "body.glb"), export_tangents=True)
    bpy.ops.wm.obj_export(filepath=str(folder / "body.obj"))
    bpy.ops.wm.ply_export(filepath=str(folder / "body.ply"), export_normals=True)


def describe(path):
    """Print what Blender reads from a file."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    if path.suffix == ".glb":
        bpy.ops.import_scene.gltf(filepath=str(path))
    else:
        getattr(bpy.ops.wm, f"{path.suffix[1:]}_import")(filepath=str(path))
    things = [each for each in bpy.data.objects if each.type == "MESH"]
    described = []
    for thing in things:
        mesh = thing.data
        uv = mesh.uv_layers.active
        described.append({
            "name": thing.name,
            "counts": [len(polygon.vertices) for polygon in mesh.polygons],
            "smooth": [bool(polygon.use_smooth) for polygon in mesh.polygons],
            "materials": [mesh.materials[p.material_index].name if mesh.materials else ""
                          for p in mesh.polygons],
            "uv": [list(each.uv) for each in uv.data] if uv else [],
            "points": [list(thing.matrix_world @ mesh.vertices[loop.vertex_index].co)
                       for loop in mesh.loops],
            "normals": [list(thing.matrix_world.to_3x3() @ each.vector)
                        for each in mesh.corner_normals],
        })  # fmt: skip
    print("described " + json.dumps(described))


if __name__ == "__main__":
    {"make": make, "describe": describe}[sys.argv[1]](Path(sys.argv[2]))
