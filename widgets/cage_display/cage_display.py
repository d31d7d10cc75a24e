"""The cages of a session as wireframes in the colours of their regions, with vertices to drag.

Cages follow the pose.  While the widget is on, the vertex under the pointer is highlighted.
Dragging moves it in the view plane, and the mesh follows at every move, x = W~ p.  The release
records one undo step; Escape cancels the drag.

Vertices hidden by the mesh can only be dragged if `CageDisplay.through` is set.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from vtk_segdeform.arrays import FloatArray, IntArray, is_number, is_whole
from vtk_segdeform.checks import as_flag, shown
from vtk_segdeform.errors import ArgumentError
from vtk_segdeform.mesh import face_edges
from vtk_segdeform.pictures import HANDLE, of_region, rgb
from vtk_segdeform.session import Change, Session

from ..picking import is_seen
from ..scene import Gesture, Phase, Pointer, Projection, Widget, Wireframe

_NO_EDGES = np.empty((0, 2), dtype=np.int64)
_PICK_RADIUS = 8.0  # pixels
_DEPTH_PENALTY = 0.1  # pixels of distance for each pixel of additional depth

CageVertex = tuple[int, int]
"""A region, and a vertex of its cage."""


class CageDisplay(Widget):
    """One wireframe per region, visible at once; `On` lets vertices be dragged.

    Parameters
    ----------
    view : View, pyvista.Plotter or (vtkRenderer, vtkRenderWindowInteractor)
        The view to work in.  Call `remove` before its window closes.
    session : Session
        The session whose cages are shown and edited.

    Attributes
    ----------
    through : bool
        Whether vertices hidden by the mesh can be dragged too (X-ray).
    """

    def __init__(self, view: Any, session: Session) -> None:
        super().__init__(view, session)
        self.through = False
        self._opacity = 1.0
        self._hidden: set[int] = set()
        self._wireframes: list[Wireframe] = []
        self._highlighted: CageVertex | None = None
        self._marker = Wireframe(np.zeros((1, 3)), _NO_EDGES, np.zeros(1, dtype=np.int64))
        self._foreground: Any = None  # the renderer of the marker
        self._is_shown = False
        self._stops_showing = [
            session.on_change(self._changed),
            self.view.before_render(self._set_sizes),
        ]
        self.show()

    # Showing.
    @property
    def is_shown(self) -> bool:
        """Whether cages are shown."""
        return self._is_shown

    def show(self) -> None:
        """Show the cages of all regions except those hidden by `set_visible`."""
        if not self._is_shown:
            self._is_shown = True
            self._rebuild()

    def hide(self) -> None:
        """Hide all cages; finish an ongoing drag."""
        self.finish()
        self._is_shown, self._highlighted = False, None
        self._rebuild()

    def is_visible(self, region: int) -> bool:
        """Return whether the cage of *region* is visible while cages are shown."""
        return _checked_region(region) not in self._hidden

    def set_visible(self, region: int, visible: bool) -> None:
        """Show or hide the cage of one region, which need not exist yet."""
        number = _checked_region(region)
        (self._hidden.discard if as_flag(visible, "visible") else self._hidden.add)(number)
        self._refresh()

    @property
    def opacity(self) -> float:
        """The opacity of the wireframes, above 0 and at most 1."""
        return self._opacity

    @opacity.setter
    def opacity(self, opacity: float) -> None:
        if not (is_number(opacity) and 0.0 < opacity <= 1.0):
            raise ArgumentError(f"opacity must be above 0 and at most 1; got {shown(opacity)}")
        self._opacity = opacity
        self._refresh()

    def remove(self) -> None:
        """Remove the widget from the view permanently."""
        self.Off()
        for stop in self._stops_showing:
            stop()
        self.hide()
        if self._foreground is not None:
            self._foreground.RemoveActor(self._marker.actor)

    # Dragging.

    def leave(self) -> None:
        """Remove the highlight."""
        self._highlight(None)

    def on_press(self, press: Pointer) -> Gesture | None:
        """Drag the vertex under the pointer, if there is one."""
        vertex = self._vertex_at(press)
        self._highlight(vertex)
        return None if vertex is None else _drag_vertex(self.view, self.session, vertex, press)

    def on_hover(self, pointer: Pointer) -> None:
        """Highlight the vertex under the pointer."""
        self._highlight(self._vertex_at(pointer))

    def _vertex_at(self, pointer: Pointer) -> CageVertex | None:
        """Return the visible cage vertex under the pointer."""
        session, vertices = self.session, self.session.cage_vertices
        visible = [r for r, each in enumerate(self._wireframes) if each.actor.GetVisibility()]
        if not visible:
            return None
        numbers = [(r, v) for r in visible for v in range(len(vertices[r]))]
        points = np.concatenate([vertices[r] for r in visible])
        for k in _points_at_pointer(self.view, pointer, points):
            if self.through or is_seen(self.view, points[k], session.vertices, session.mesh.faces):
                return numbers[int(k)]
        return None

    # Drawing.

    def _changed(self, change: Change) -> None:
        if change & (Change.CAGES | Change.REGIONS):
            self.cancel()
            self._highlighted = None
            self._rebuild()
        elif change & Change.POSE:
            pairs = zip(self._wireframes, self.session.cage_vertices, strict=False)
            for wireframe, vertices in pairs:
                wireframe.move(vertices)
            self._refresh()

    def _rebuild(self) -> None:
        for wireframe in self._wireframes:
            self.view.renderer.RemoveActor(wireframe.actor)
        self._wireframes = []
        if self._is_shown:
            for vertices, cage in zip(self.session.cage_vertices, self.session.cages, strict=True):
                edges, _ = face_edges(cage.faces)
                self._wireframes.append(Wireframe(vertices, edges, np.arange(cage.n_vertices)))
                self.view.renderer.AddActor(self._wireframes[-1].actor)
        self._refresh()

    def _highlight(self, vertex: CageVertex | None) -> None:
        if vertex != self._highlighted:
            self._highlighted = vertex
            self._refresh()

    def _refresh(self) -> None:
        """Update visibility, opacity and the highlight."""
        marker_visible = False
        for region, wireframe in enumerate(self._wireframes):
            wireframe.actor.SetVisibility(self.is_visible(region))
            wireframe.actor.GetProperty().SetOpacity(self._opacity)
        if self._highlighted is not None:
            region, vertex = self._highlighted
            self._marker.move(self.session.cage_vertices[region][vertex : vertex + 1])
            self._foreground = self.view.foreground
            self._foreground.AddActor(self._marker.actor)  # VTK adds an actor only once
            marker_visible = self._wireframes[region].actor.GetVisibility()
        self._marker.actor.SetVisibility(marker_visible)
        self.view.request_render()

    def _set_sizes(self) -> None:
        """Scale lines and spheres with the window."""
        scale = self.view.scale
        for region, wireframe in enumerate(self._wireframes):
            colour = of_region(region)
            wireframe.set_style(colour, line_width=1.8 * scale, sphere_size=8.0 * scale)
        self._marker.set_style(rgb(HANDLE), line_width=1.0, sphere_size=13.0 * scale)


def _checked_region(region: int) -> int:
    if not is_whole(region, 0):
        raise ArgumentError(f"region must be a whole number, 0 or more; got {shown(region)}")
    return int(region)


def _drag_vertex(
    projection: Projection, session: Session, cage_vertex: CageVertex, press: Pointer
) -> Gesture:
    """Move a cage vertex in the view plane until the release, which records one undo step.

    The vertex keeps its offset from the pointer.  If the gesture is cancelled or a move fails, the
    state is as before the press.
    """
    session.commit()  # keeps an unfinished drag from elsewhere out of our undo step
    region, vertex = cage_vertex
    start = session.cage_vertices[region]
    position = start[vertex : vertex + 1]
    offset = projection.to_display(position)[0, :2] - press.position
    committed = False
    try:
        while (pointer := (yield)).phase is Phase.MOVE:
            depth = projection.to_display(position)[0, 2]
            target = np.array([[*(pointer.position + offset), depth]])
            moved = start.copy()
            moved[vertex] = projection.to_world(target)[0]
            session.move_cage(region, moved)
        if pointer.phase is Phase.RELEASE:
            session.commit()
            committed = True
    finally:
        if not committed:
            session.revert()


def _points_at_pointer(projection: Projection, pointer: Pointer, points: FloatArray) -> IntArray:
    """Return the indices of those of *points* (k, 3) that are under *pointer*, the best first.

    The nearest to the pointer is best, with a penalty for points farther from the camera.
    """
    distance = np.linalg.norm(projection.to_display(points)[:, :2] - pointer.position, axis=1)
    near = np.flatnonzero(distance <= _PICK_RADIUS)  # excludes NaN: points behind the camera
    if not len(near):
        return near
    depth = (points[near] - projection.camera.GetPosition()) @ projection.view_direction
    behind = (depth - depth.min()) / projection.pixel_at(points[near[depth.argmin()]])
    return np.asarray(near[np.argsort(distance[near] + _DEPTH_PENALTY * behind)])
