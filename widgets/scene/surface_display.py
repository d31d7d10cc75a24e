"""The mesh of a session in its current pose, as one actor shared by all widgets.

Positions and normals are updated in place when the pose changes.  Colours come in layers, and the
newest layer is visible; a tint lies over it.  The body is matte clay, drawn shaded, shaded with its
edges, or as a wireframe.

A surface with one side has a seam, where neighbouring faces differ in orientation and light needs
opposite normals.  The vertices there are drawn twice: the second ones, with opposite normals, are
the corners that `VertexNormals.turned` lists.

While something moves, a mesh that takes longer to draw than smooth motion allows is drawn
decimated, by vertices that still follow; all normals are computed when it has come to rest.
"""

from __future__ import annotations

import enum
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray
from vtkmodules.util.numpy_support import numpy_to_vtk, vtk_to_numpy
from vtkmodules.vtkRenderingCore import vtkActor, vtkPolyDataMapper

from vtk_segdeform import sizes
from vtk_segdeform.arrays import BoolArray, FloatArray, IntArray, as_numbers, as_points, plain
from vtk_segdeform.checks import require, shown
from vtk_segdeform.errors import ArgumentError
from vtk_segdeform.freezing import read_only
from vtk_segdeform.geometry import VertexNormals
from vtk_segdeform.io import polydata_of
from vtk_segdeform.mesh import Mesh
from vtk_segdeform.pictures import BODY, COLOURS, INK, rgb
from vtk_segdeform.session import Change, Session

from .decimated_surface import DecimatedSurface, cells_soon
from .draft import SLOW, Draft, observe_drafts
from .view import View

_NOTHING = np.arange(0)
_TINT, _OPACITY = COLOURS[1], 0.6  # sky blue: colour-blind people tell it from clay
_all_triangles: WeakKeyDictionary[Mesh, tuple[Any, IntArray]] = WeakKeyDictionary()


def drawn_triangles(mesh: Mesh) -> tuple[Any, IntArray]:
    """Return the triangles as a vtkCellArray, and the vertices (k,) that are drawn twice.

    They are kept as long as the mesh, so another thread can make them before it is drawn.
    """
    known = _all_triangles.get(mesh)
    if known is None:
        faces, turned = mesh.faces.ravel(), VertexNormals(mesh).turned
        twice, second = np.unique(faces[turned], return_inverse=True)
        if len(turned):
            faces = faces.copy()
            faces[turned] = mesh.n_vertices + second
        points = np.empty((mesh.n_vertices + len(twice), 3))
        surface = polydata_of(points, np.full(mesh.n_faces, 3), faces)
        known = _all_triangles[mesh] = surface.GetPolys(), twice
    return known


def some_triangles(mesh: Mesh, own: BoolArray | IntArray) -> Any:
    """Return `drawn_triangles` of the faces *own*, a mask (m,) or numbers (f,), likewise."""
    triangles, _ = drawn_triangles(mesh)
    corners = vtk_to_numpy(triangles.GetConnectivityArray()).reshape(-1, 3)[own]
    points = np.empty((corners.max(initial=-1) + 1, 3))
    return polydata_of(points, np.full(len(corners), 3), corners.ravel()).GetPolys()


class SurfaceStyle(enum.Enum):
    """How a surface is drawn."""

    SHADED = "Shaded"
    EDGES = "Shaded with edges"
    WIREFRAME = "Wireframe"


class SurfaceDisplay:
    """The deformed mesh in a view.

    Parameters
    ----------
    view : View, pyvista.Plotter or (vtkRenderer, vtkRenderWindowInteractor)
        The view to draw in.
    session : Session
        The session whose mesh is shown.
    """

    def __init__(self, view: Any, session: Session) -> None:
        self.view = View.of(view)
        self.session = require(session, Session, "session")
        self._layers: dict[str, NDArray[np.uint8]] = {}
        self._tint: FloatArray | None = None
        self._style = SurfaceStyle.SHADED
        self._instead: FloatArray | None = None
        self._only: BoolArray | None = None
        self.shown_faces: IntArray | None = None
        """The numbers of the faces that are shown, (f,); None shows all."""
        mesh = session.mesh
        self._vertex_normals = VertexNormals(mesh)
        triangles, self._twice = drawn_triangles(mesh)
        x = self._shown = session.vertices
        self.polydata = polydata_of(np.vstack([x, x[self._twice]]), _NOTHING, _NOTHING)
        self.polydata.SetPolys(triangles)
        self._drawn: NDArray[np.float64] = vtk_to_numpy(self.polydata.GetPoints().GetData())
        self._points = self._drawn[: mesh.n_vertices]
        self._read_only_points: NDArray[np.float64] = read_only(self._points)
        self._normals = np.empty(self._drawn.shape, dtype=np.float32)
        self._normal_array = numpy_to_vtk(self._normals)
        self._normal_array.SetName("Normals")
        self.polydata.GetPointData().SetNormals(self._normal_array)
        self.update_normals()
        self._mapper = vtkPolyDataMapper()
        self._mapper.SetInputData(self.polydata)
        self._mapper.SetScalarVisibility(False)
        self._mapper.SetResolveCoincidentTopologyToPolygonOffset()  # keeps edges on it visible
        self.actor = vtkActor()
        self.actor.SetMapper(self._mapper)
        surface = self.actor.GetProperty()
        surface.SetInterpolationToPhong()
        surface.SetColor(*(rgb(BODY) / 255.0))
        surface.SetAmbient(0.25)
        surface.SetDiffuse(0.8)
        surface.SetSpecular(0.0)
        surface.SetEdgeColor(*(rgb(INK) / 255.0))
        surface.SetEdgeOpacity(0.4)
        self.view.renderer.AddActor(self.actor)
        self._decimated: DecimatedSurface | None = None
        self._drafts, self._is_draft = Draft.of(self.view), False
        self._stops = [
            session.on_change(self._changed),
            observe_drafts(self.view.interactor, self._set_draft),
        ]

    @property
    def points(self) -> NDArray[np.float64]:
        """(n, 3) float: the displayed vertices; a read-only view, not a copy."""
        return self._read_only_points

    @property
    def actors(self) -> tuple[Any, ...]:
        """The vtkActors that show the mesh, completely or decimated."""
        return (self.actor,) if self._decimated is None else (self.actor, self._decimated.actor)

    @property
    def colours(self) -> NDArray[np.uint8] | None:
        """(n, 3) uint8: the colours of the vertices, tinted; None without layers and a tint."""
        top = next(reversed(self._layers.values()), None)
        if self._tint is None:
            return top
        shares = _OPACITY * self._tint.astype(np.float32)[:, None]
        below = rgb(BODY) if top is None else top
        return np.asarray(
            np.rint(below + shares * (rgb(_TINT) - below.astype(np.float32))), np.uint8
        )

    @property
    def style(self) -> SurfaceStyle:
        """How the surface is drawn."""
        return self._style

    @style.setter
    def style(self, style: SurfaceStyle) -> None:
        self._style = require(style, SurfaceStyle, "style")
        surface = self.actor.GetProperty()
        surface.SetEdgeVisibility(style is SurfaceStyle.EDGES)
        if style is SurfaceStyle.WIREFRAME:
            surface.SetRepresentationToWireframe()
        else:
            surface.SetRepresentationToSurface()
        self.view.request_render()

    @property
    def instead(self) -> FloatArray | None:
        """(n, 3) float: vertices shown instead of the current pose; None to show that."""
        return self._instead

    @instead.setter
    def instead(self, vertices: FloatArray | None) -> None:
        if vertices is not None:
            as_points(vertices, "instead", len(self._points))
        if vertices is not self._instead:
            self._instead = vertices
            self.update()

    @property
    def only(self) -> BoolArray | None:
        """(n,) bool: the vertices that are shown and can be picked; None shows all."""
        return self._only

    @only.setter
    def only(self, vertices: BoolArray | None) -> None:
        mesh = self.session.mesh
        if vertices is not None:
            vertices = plain(vertices, "only")
            if vertices.shape != (mesh.n_vertices,) or vertices.dtype != np.bool_:
                raise ArgumentError(
                    f"only must be a mask of {mesh.n_vertices} vertices or None; "
                    f"got {shown(vertices)}"
                )
        own = None if vertices is None else vertices[mesh.faces].all(axis=1)
        self._only = vertices
        self.shown_faces = None if own is None else np.flatnonzero(own)
        if self._is_draft:
            self._set_draft(False)
        self.polydata.SetPolys(self.triangles)
        self.view.request_render()

    @property
    def triangles(self) -> Any:
        """The triangles that are shown, as a vtkCellArray."""
        mesh, ids = self.session.mesh, self.shown_faces
        if ids is None:
            return drawn_triangles(mesh)[0]
        return some_triangles(mesh, ids)

    def set_colours(self, layer: str, colours: NDArray[np.uint8] | None) -> None:
        """Set the vertex *colours* (n, 3) uint8 of a layer, or remove the layer with None.

        The newest layer is visible; new colours of an existing layer do not change the order.
        """
        require(layer, str, "layer")
        if colours is None:
            self._layers.pop(layer, None)
        else:
            self._layers[layer] = self._checked(colours)
        self._draw_colours()

    def tint(self, shares: FloatArray | None) -> None:
        """Tint the vertices, each by a share (n,) from 0 to 1; None removes the tint."""
        if shares is not None:
            shares = as_numbers(shares, "shares")
            if shares.shape != (len(self._points),):
                raise ArgumentError(f"shares must be one for each vertex; got {shares.shape}")
        self._tint = shares
        self._draw_colours()

    def _draw_colours(self) -> None:
        top = self.colours
        self._mapper.SetScalarVisibility(top is not None)
        if top is not None:
            colours_drawn = np.concatenate([top, top[self._twice]])
            array = numpy_to_vtk(np.ascontiguousarray(colours_drawn, dtype=np.uint8), deep=True)
            array.SetName("colours")
            self.polydata.GetPointData().SetScalars(array)
        if self._decimated is not None:
            self._decimated.set_colours(top)
        self.view.request_render()

    def update(self) -> None:
        """Show the session's current pose; called automatically when it changes."""
        self._draw(self.session.vertices if self._instead is None else self._instead)

    def draw(self, vertices: FloatArray) -> None:
        """Draw *vertices* (n, 3) until the pose changes, for a picture between two poses."""
        self._draw(as_points(vertices, "vertices", len(self._points)))

    def _draw(self, vertices: FloatArray) -> None:
        self._shown = vertices
        self._points[:] = vertices
        self._drawn[len(self._points) :] = self._points[self._twice]
        self.polydata.GetPoints().GetData().Modified()
        self.polydata.GetPoints().Modified()
        if self._is_draft and self._decimated is not None:
            self._decimated.update(self._points)
        else:
            self.update_normals()
        self.view.request_render()

    def update_normals(self) -> None:
        """Compute the normals of the shown pose; called automatically when it changes."""
        n = len(self._points)
        self._vertex_normals.of(self._points, self._normals[:n])
        self._normals[n:] = -self._normals[self._twice]
        self._normal_array.Modified()

    def remove(self) -> None:
        """Remove the mesh from the view permanently."""
        for stop in self._stops:
            stop()
        self.view.renderer.RemoveActor(self.actor)
        if self._decimated is not None:
            self.view.renderer.RemoveActor(self._decimated.actor)

    def _set_draft(self, begins: bool) -> None:
        """Draw the mesh decimated if it is large and slow to draw, or completely again."""
        if begins == self._is_draft:
            return
        if not begins:
            self._is_draft = False
            assert self._decimated is not None
            self._decimated.actor.VisibilityOff()
            self.actor.VisibilityOn()
            self.update_normals()
            self.view.request_render()
            return
        is_plain = self._style is SurfaceStyle.SHADED and bool(self.actor.GetVisibility())
        is_plain &= self._only is None
        is_plain &= not len(self._twice)  # its cells have one normal each, those at a seam two
        is_slow = self._drafts.seconds > SLOW
        if self.session.mesh.n_vertices <= sizes.DRAFT or not (is_slow and is_plain):
            return
        if self._decimated is None:
            mesh = self.session.mesh
            if (cells := cells_soon(mesh)) is None:
                return
            self._decimated = DecimatedSurface(mesh, cells, self.actor.GetProperty())
            self.view.renderer.AddActor(self._decimated.actor)
            self._decimated.set_colours(self.colours)
        self._is_draft = True
        self._decimated.update(self._points)
        self._decimated.actor.VisibilityOn()
        self.actor.VisibilityOff()

    def _checked(self, colours: NDArray[np.uint8]) -> NDArray[np.uint8]:
        array = plain(colours, "colours")
        expected = len(self._points), 3
        if array.shape != expected or array.dtype != np.uint8:
            raise ArgumentError(
                f"colours must be uint8 of shape {expected}; got {array.dtype}, {array.shape}"
            )
        return array

    def _changed(self, change: Change) -> None:
        if change & Change.POSE and self.session.vertices is not self._shown:
            self.update()  # otherwise only targets have moved
