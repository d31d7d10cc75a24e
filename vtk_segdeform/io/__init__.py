"""Meshes from and to files, pyvista and MeshLab.

The files, in reading order:

    convert            `read_mesh`, `write_mesh`, `from_polydata`, `to_polydata`
    off ply wavefront stl gltf
                       file formats with our own readers, every digit kept
    ply_tables gltf_buffers
                       the tables and buffers of two of them
    vtk_readers vtk_writers
                       other formats, by VTK
    isolated reading_child
                       native readers in a child process
    meshlab            PyMeshLab: conversion, simplification, its formats
    meshlab_layers     MeshLab's layers as PolyData
    meshlab_project    projects: a mesh and its cages
    repaired           repair of PolyData, arrays kept
    polygons           polygons in two flat arrays
    array_names        array names a format cannot hold
    neighbours         files named by other files
"""

from .convert import (
    from_polydata,
    is_mesh_file,
    read_mesh,
    read_polydata,
    require_writable,
    to_polydata,
    with_vertices,
    write_mesh,
)
from .meshlab import from_meshset, simplify, to_meshset
from .meshlab_project import read_project, write_project
from .polygons import polydata_of, triangles_of
from .repaired import repair_surface

__all__ = [
    "from_meshset",
    "from_polydata",
    "is_mesh_file",
    "polydata_of",
    "read_mesh",
    "read_polydata",
    "read_project",
    "repair_surface",
    "require_writable",
    "simplify",
    "to_meshset",
    "to_polydata",
    "triangles_of",
    "with_vertices",
    "write_mesh",
    "write_project",
]
