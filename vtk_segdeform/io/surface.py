"""`Surface`: a surface as it was given, and the mesh that is deformed in its place.

    file, PolyData  -->  Surface  --mesh-->  Mesh
    PolyData, file  <--moved, write--  Surface  <--  vertices of a pose (n, 3)

What is given may have polygons, seams of doubled points, holes, faces of any orientation, lines and
arrays.  All of it is kept: `moved` changes nothing but coordinates, and normals where there are
some.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pyvista as pv
from numpy.typing import ArrayLike

from ..arrays import FloatArray, IntArray, as_points, plain
from ..checks import Described, as_text, require
from ..errors import ArgumentError, MeshError
from ..geometry import lids_of
from ..mesh import Mesh, Soup, Workaround, mesh_of
from ..solver import Bodies, total_volume
from .convert import as_polydata, read_polydata, write_mesh
from .fields import follow
from .moving import MovingSurface
from .polygons import cells_of, cut_into_triangles, polygons_of, triangles_of


def read_mesh(path: str | Path) -> Mesh:
    """Read the mesh of a file: ``Surface.read(path).mesh``.

    Parameters
    ----------
    path : str or Path
        Of any format that `read_polydata` reads.

    Returns
    -------
    mesh : Mesh
        Vertices and faces in the order of the file, where these can be a mesh; seams are welded
        and polygons cut into triangles.

    Raises
    ------
    MeshError
        If the file does not exist or cannot be read, or has no face that can be deformed.
    MissingDependencyError
        If only PyMeshLab reads this format and it is not installed.
    """
    return Surface.read(path).mesh


class Surface(Described):
    """A surface as it was given, and its mesh.

    Parameters
    ----------
    polydata : pyvista.PolyData
        Not changed.  It needs one face that is not flat, and finite coordinates of its faces.
        Polygons may have any shape; lines and vertex cells follow the faces.  An UnstructuredGrid
        of such cells and a MultiBlock of such surfaces become one PolyData; the names of blocks
        become the groups of its cells.

    Raises
    ------
    ArgumentError
        If it is something else; the message has the line that converts it, if there is one.
    MeshError
        If it has no faces, only flat ones, or points of faces that are not finite, do not exist,
        or are too far or too near for computing volumes.

    Examples
    --------
    >>> import pyvista as pv
    >>> cube = Surface(pv.Cube(clean=False))  # 24 points, since normals differ at its edges
    >>> cube.mesh.n_vertices, cube.mesh.is_closed
    (8, True)
    >>> cube.moved(cube.mesh.vertices + [0, 0, 1]).n_points
    24
    """

    def __init__(self, polydata: pv.PolyData | pv.UnstructuredGrid | pv.MultiBlock) -> None:
        self._given = as_polydata(polydata, "polydata").copy(deep=False)
        points = np.asarray(self._given.points, dtype=np.float64)
        self._soup = mesh_of(points, triangles_of(self._given))

    @classmethod
    def read(cls, path: str | Path) -> Surface:
        """Read a surface from a file of any format of `read_mesh`, and make its mesh.

        Raises
        ------
        MeshError
            As `read_mesh`, but only if no mesh can be made of it; the message names the file.
        """
        polydata = read_polydata(path)
        try:
            return cls(polydata)
        except MeshError as fault:
            raise MeshError(f"{path}: {fault}") from None

    @classmethod
    def of(cls, polydata: pv.PolyData, soup: Soup) -> Surface:
        """Return the surface *polydata* with the mesh of *soup*, which was made of it before.

        MeshError if the numbers of their points differ.
        """
        require(polydata, pv.PolyData, "polydata")
        require(soup, Soup, "soup")
        if len(soup.points) != polydata.n_points:
            raise MeshError(
                f"the mesh of {len(soup.points)} points is not one of {polydata.n_points} points"
            )
        surface = object.__new__(cls)
        surface._given = polydata.copy(deep=False)
        surface._soup = soup
        return surface

    def facts(self) -> dict[str, str]:
        """Return its numbers as texts, by what they are."""
        given = {"points": f"{self._given.n_points:,}", "cells": f"{self._given.n_cells:,}"}
        return given | self.mesh.facts()

    @property
    def given(self) -> pv.PolyData:
        """What was given; a shallow copy, not to be changed."""
        return self._given

    @property
    def mesh(self) -> Mesh:
        """The mesh that is deformed."""
        return self._soup.mesh

    @property
    def vertex_of(self) -> IntArray:
        """(p,) int: the vertex of the mesh that each given point follows."""
        return self._soup.vertex_of

    @property
    def loose(self) -> IntArray:
        """(k,) int: the given points that are in no face of the mesh."""
        return self._soup.loose

    @property
    def workarounds(self) -> tuple[Workaround, ...]:
        """What the mesh has differently, as sentences with the given points concerned."""
        return self._soup.workarounds

    def labels(self, name: str = "boundary_labels") -> dict[int, tuple[str, ...]]:
        """Return the names of the volumes, for `Deformer`, that each label of an image has.

        Parameters
        ----------
        name : str
            A cell array (m, 2) of the labels on both sides of each face, of which 0 is outside, as
            of `pyvista.ImageData.contour_labels`; without it there are no labels.

        Returns
        -------
        labels : dict of int to tuple of str
            The body of each label, or its bodies if it has several parts, or the cavity if it is
            inside of another label, as ``{1: ("body 0",), 2: ("body 1", "body 2")}``.
        """
        sides = np.asarray(self._given.cell_data.get(as_text(name, "name"), ()))
        if sides.ndim != 2 or sides.shape[1] != 2 or sides.dtype.kind not in "iu":
            return {}
        triangles, polygon = cut_into_triangles(self._soup.points, *polygons_of(self._given))
        of_face: dict[tuple[int, ...], set[int]] = {}
        pairs = sides[cells_of(self._given)[polygon]].tolist()
        corners = np.sort(self.vertex_of[triangles], axis=1).tolist()
        for face, pair in zip(corners, pairs, strict=True):
            of_face[tuple(face)] = set(pair) - {0}
        lids = lids_of(self.mesh)
        bodies = Bodies(self.mesh, total_volume(self.mesh, lids), lids)
        own_volumes = np.flatnonzero(bodies.volumes > 0.0).tolist()
        around = {f"body {k}": bodies.body(k) for k in own_volumes}
        around |= {f"cavity {k}": bodies.component(c) for k, c in enumerate(bodies.cavities)}
        found: dict[int, tuple[str, ...]] = {}
        for volume, constraint in around.items():
            faces = np.sort(constraint.faces, axis=1).tolist()
            common = set.intersection(*(of_face.get(tuple(face), set()) for face in faces))
            own = common - found.keys() if len(common) > 1 else common
            for label in own if len(own) == 1 else ():
                found[label] = (*found.get(label, ()), volume)
        return found

    def vertices_at(self, points: ArrayLike) -> IntArray:
        """Return the vertices (k,) of the mesh that given *points* (mask or ids) are, sorted.

        Points in no face are no vertices.
        """
        return self._soup.vertices_at(points)

    def at_points(self, values: ArrayLike) -> Any:
        """Return *values* (n, ...) of the vertices of the mesh at the given points (p, ...)."""
        return self._of(values, self.mesh.n_vertices, "vertex of the mesh")[self.vertex_of]

    def at_vertices(self, values: ArrayLike) -> Any:
        """Return *values* (p, ...) of the given points at the vertices (n, ...).

        Of several points that follow a vertex, the first one counts.
        """
        return self._soup.at_vertices(self._of(values, self._given.n_points, "given point"))

    @staticmethod
    def _of(values: ArrayLike, count: int, what: str) -> Any:
        array = plain(values, "values")
        if array.ndim < 1 or len(array) != count:
            raise ArgumentError(
                f"values must have one row for each {what}, {count}; got shape {array.shape}"
            )
        return array

    def targets_at(self, points: ArrayLike, targets: ArrayLike) -> tuple[IntArray, FloatArray]:
        """Return the vertices (k,) that given points are, and their targets (k, 3).

        Parameters
        ----------
        points : (q,) int or (p,) bool
            Given points.
        targets : (q, 3) float
            Their targets.  A vertex that is several points, at a seam, goes to the mean.
        """
        return self._soup.targets_at(points, targets)

    def moved(
        self,
        vertices: ArrayLike,
        *,
        turn: Sequence[str] = (),
        push: Sequence[str] = (),
        displacement: str | None = None,
    ) -> pv.PolyData:
        """Return what was given for the mesh at *vertices* (n, 3): coordinates and normals differ.

        Points, cells and arrays are the same, in the same order.

        Parameters
        ----------
        vertices : (n, 3) float
            The pose.
        turn, push : sequence of str
            Arrays of vectors or tensors that turn with the surface, such as fibres, or are pushed
            forward with it, such as velocities; see `fields`.
        displacement : str, optional
            The name of a point array to add: how far each point has moved, (p, 3).
        """
        x = as_points(vertices, "vertices", self.mesh.n_vertices)
        moved = self._moving.at(self._soup.moved(x))
        follow(moved, self._given, turn=turn, push=push)
        if displacement is not None:
            moved.point_data[as_text(displacement, "displacement")] = moved.points - np.asarray(
                self._given.points
            )
        return moved

    def write(self, path: str | Path, vertices: ArrayLike, **fields: Any) -> None:
        """Write `moved`, with its options *fields*, to a file, as `write_mesh` does."""
        write_mesh(path, self.moved(vertices, **fields))

    @cached_property
    def _moving(self) -> MovingSurface:
        return MovingSurface(self._given)
