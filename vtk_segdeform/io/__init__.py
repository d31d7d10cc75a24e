"""Meshes from and to files, pyvista and MeshLab.

The files, in reading order:

    surface            `Surface`: what is given, and the mesh that is deformed
    kinds              what was given, of its own type
    stored             what a file has lost, as it is read again
    convert            `read_polydata`, `write_mesh`, `from_polydata`, `to_polydata`
    polygons           polygons as two flat arrays
    moving             a PolyData at other positions, with its normals and tangents
    fields             vectors and tensors that follow the surface
    number_lines       lines of numbers, parsed at once
    off                OFF
    ply ply_tables     PLY, and the tables of its elements
    wavefront          OBJ
    stl                STL
    gltf               glTF: a folder with its own contents
    vtk_formats        other formats, by VTK
    vtk_arrays         data sets from plain arrays
    grids              unstructured grids as PolyData, and back
    confined reading_child
                       VTK's and PyMeshLab's readers, in a process that can open one file only
    groups             named groups of cells
    array_names        names, arrays and digits that a format cannot store
    repaired           repair of PolyData with its polygons and arrays
    meshlab            PyMeshLab: conversion, simplification, file formats
    meshlab_layers     MeshLab's layers as PolyData
    meshlab_project    MeshLab projects: a mesh and its cages, coloured and as wires
"""

from .array_names import IS_ROUNDING
from .convert import (
    as_polydata,
    from_polydata,
    is_mesh_file,
    read_points,
    read_polydata,
    require_writable,
    to_polydata,
    with_vertices,
    writable_suffixes,
    write_mesh,
    write_points,
)
from .fields import follow, means_at
from .gltf import write_gltf_motion
from .kinds import of_its_kind, surface_of
from .meshlab import from_meshset, simplify, to_meshset
from .meshlab_project import read_project, write_project
from .moving import with_points
from .polygons import drawn_cells, polydata_of, triangles_of
from .repaired import repair_surface
from .stored import loss_of, stored_vertices, volume_change
from .surface import Surface, read_mesh
from .vtk_formats import read_data_set, write_with_vtk

__all__ = [
    "IS_ROUNDING",
    "Surface",
    "as_polydata",
    "drawn_cells",
    "follow",
    "from_meshset",
    "from_polydata",
    "is_mesh_file",
    "loss_of",
    "means_at",
    "of_its_kind",
    "polydata_of",
    "read_data_set",
    "read_mesh",
    "read_points",
    "read_polydata",
    "read_project",
    "repair_surface",
    "require_writable",
    "simplify",
    "stored_vertices",
    "surface_of",
    "to_meshset",
    "to_polydata",
    "triangles_of",
    "volume_change",
    "with_points",
    "with_vertices",
    "writable_suffixes",
    "write_gltf_motion",
    "write_mesh",
    "write_points",
    "write_project",
    "write_with_vtk",
]
