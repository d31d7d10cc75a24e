"""The cages of a session as wires in the colours of their regions, to be dragged by the vertex.

Cages move with the pose.  While the widget is on, the vertex under the pointer is marked; press
and drag moves it in the plane of the view, and the mesh follows at every move, x = W~ p.  Release
makes one undo step of it, Escape takes it back.

A vertex that the body hides is not under the pointer, unless `CageDisplay.through` says so.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from vtk_segdeform.arrays import is_number, is_whole
from vtk_segdeform.checks import as_flag, as_text, shown
from vtk_segdeform.errors import ArgumentError, CageError
from vtk_segdeform.mesh import face_edges
from vtk_segdeform.pictures import HANDLE, of_region, rgb
from vtk_segdeform.session import Change, Session

from ..scene import Gesture, Pointer, Widget, Wires
from .cage_drag import Grip, drag_vertex
from .reach import under_pointer
from .rejected_cage import RejectedCage

_DESIGNED_FOR = 600  # pixels of height; wires are thicker in a higher window
_NO_EDGES = np.empty((0, 2), dtype=np.int64)


class CageDisplay(Widget):
    """One wireframe for each region; shown from the beginning, to be dragged once it is on.

    Parameters
    ----------
    view : View, pyvista.Plotter or (vtkRenderer, vtkRenderWindowInteractor)
        Where it lives.  Call `remove` before its window closes.
    session : Session
        Whose cages.

    Attributes
    ----------
    through : bool
        Whether vertices behind the body can be dragged too, as where it is drawn see-through.
    """

    def __init__(self, view: Any, session: Session) -> None:
        super().__init__(view, session)
        self.through = False
        self._opacity = 1.0
        self._hidden: set[int] = set()
        self._wires: list[Wires] = []
        self._rejected: RejectedCage | None = None
        self._replaced: int | None = None  # the region it was refused for
        self._grip: Grip | None = None
        self._mark = Wires(np.zeros((1, 3)), _NO_EDGES, np.zeros(1, dtype=np.int64))
        self._front: Any = None  # where the mark is
        self._is_shown = False
        self._stops_showing = [
            session.on_change(self._changed),
            self.view.before_render(self._size),
        ]
        self.show()

    # What is shown.

    @property
    def is_shown(self) -> bool:
        """Whether cages are to be seen."""
        return self._is_shown

    def show(self) -> None:
        """Show the cages, but for those of single regions that are not visible."""
        if not self._is_shown:
            self._is_shown = True
            self._rebuild()

    def hide(self) -> None:
        """Hide all cages; an ongoing drag is finished."""
        self.finish()
        self._is_shown, self._grip = False, None
        self._rebuild()

    def is_visible(self, region: int) -> bool:
        """Tell whether the cage of *region* is seen while cages are shown."""
        return _checked_region(region) not in self._hidden

    def set_visible(self, region: int, visible: bool) -> None:
        """Show or hide the cage of one region, also one that is still to come."""
        place = _checked_region(region)
        (self._hidden.discard if as_flag(visible, "visible") else self._hidden.add)(place)
        self._refresh()

    @property
    def opacity(self) -> float:
        """How opaque the wires are, above 0 up to 1."""
        return self._opacity

    @opacity.setter
    def opacity(self, opacity: float) -> None:
        if not (is_number(opacity) and 0.0 < opacity <= 1.0):
            raise ArgumentError(f"opacity must be above 0 and at most 1; got {shown(opacity)}")
        self._opacity = opacity
        self._refresh()

    def show_faults(
        self,
        vertices: ArrayLike,
        faces: ArrayLike,
        region: int | None = None,
        *,
        message: str | None = None,
    ) -> str:
        """Show a surface that was refused as a cage, marked where it fails.

        It stays, instead of the cage of *region*, until `clear_faults` or other cages come.

        Parameters
        ----------
        vertices : (m, 3) float
            At rest.
        faces : (k, 3) int
            Triangles.
        region : int, optional
            The region it should enclose; what of it is outside is marked.
        message : str, optional
            The words beside the marks, such as the text of the `CageError`.

        Returns
        -------
        message : str
            What is shown: the words given, or what is found to be wrong; "" if nothing is.
        """
        mesh, regions = self.session.mesh, self.session.regions
        enclosed = mesh.vertices[:0]
        if region is not None:
            if regions is None or not is_whole(region, 0, regions.n_regions - 1):
                raise CageError(f"there is no region {shown(region)} to enclose with a cage")
            enclosed = mesh.vertices[regions.members(region)]
        if message is not None:
            as_text(message, "message")
        self.clear_faults()
        self._rejected = RejectedCage(
            self.view, vertices, faces, enclosed=enclosed, message=message
        )
        self._replaced = region
        self._refresh()
        return self._rejected.message

    def clear_faults(self) -> None:
        """Take away what `show_faults` has shown."""
        if self._rejected is not None:
            self._rejected.remove()
            self._rejected = self._replaced = None
            self._refresh()

    def remove(self) -> None:
        """Take everything out of the view, for good."""
        self.Off()
        for stop in self._stops_showing:
            stop()
        self.clear_faults()
        self.hide()
        if self._front is not None:
            self._front.RemoveActor(self._mark.actor)

    # Dragging.

    def Off(self) -> None:  # noqa: N802 - VTK's word
        """Stop listening; an ongoing drag is finished, and nothing is highlighted."""
        super().Off()
        self._point_at(None)

    def begins(self, press: Pointer) -> Gesture | None:
        """Drag the vertex under the pointer, if there is one."""
        grip = self._under(press)
        self._point_at(grip)
        return None if grip is None else drag_vertex(self.view, self.session, grip, press)

    def hovers(self, pointer: Pointer) -> None:
        """Mark the vertex under the pointer."""
        self._point_at(self._under(pointer))

    def _under(self, pointer: Pointer) -> Grip | None:
        """Return the vertex that is seen at the pointer."""
        session, places = self.session, self.session.cage_vertices
        seen = [r for r, wires in enumerate(self._wires) if wires.actor.GetVisibility()]
        if not seen:
            return None
        body = None if self.through else (session.vertices, session.mesh.faces)
        points = np.concatenate([places[r] for r in seen])
        k = under_pointer(self.view, pointer, points, body=body)
        if k is None:
            return None
        grips = [(r, v) for r in seen for v in range(len(places[r]))]
        return grips[k]

    # Drawing.

    def _changed(self, change: Change) -> None:
        if change & (Change.CAGES | Change.REGIONS):
            self.cancel()
            self._grip = None
            self.clear_faults()
            self._rebuild()
        elif change & Change.POSE:
            for wires, vertices in zip(self._wires, self.session.cage_vertices, strict=False):
                wires.move(vertices)
            self._refresh()

    def _rebuild(self) -> None:
        for wires in self._wires:
            self.view.renderer.RemoveActor(wires.actor)
        self._wires = []
        if self._is_shown:
            for vertices, cage in zip(self.session.cage_vertices, self.session.cages, strict=True):
                edges, _ = face_edges(cage.faces)
                self._wires.append(Wires(vertices, edges, np.arange(cage.n_vertices)))
                self.view.renderer.AddActor(self._wires[-1].actor)
        self._refresh()

    def _point_at(self, grip: Grip | None) -> None:
        if grip != self._grip:
            self._grip = grip
            self._refresh()

    def _refresh(self) -> None:
        """Show what is to be seen, and mark what is pointed at."""
        seen = False
        for region, wires in enumerate(self._wires):
            wires.actor.SetVisibility(self.is_visible(region) and region != self._replaced)
            wires.actor.GetProperty().SetOpacity(self._opacity)
        if self._grip is not None:
            region, vertex = self._grip
            self._mark.move(self.session.cage_vertices[region][vertex : vertex + 1])
            self._front = self.view.front
            self._front.AddActor(self._mark.actor)  # once, however often
            seen = self._wires[region].actor.GetVisibility()
        self._mark.actor.SetVisibility(seen)
        self.view.touch()

    def _size(self) -> None:
        """Let wires and balls follow the size of the window."""
        scale = float(np.clip(self.view.renderer.GetSize()[1] / _DESIGNED_FOR, 0.7, 3.0))
        for region, wires in enumerate(self._wires):
            wires.draw(of_region(region), line_width=1.8 * scale, ball_size=8.0 * scale)
        self._mark.draw(rgb(HANDLE), line_width=1.0, ball_size=13.0 * scale)
        if self._rejected is not None:
            self._rejected.draw(scale)


def _checked_region(region: int) -> int:
    if not is_whole(region, 0):
        raise ArgumentError(f"region must be a whole number, 0 or more; got {shown(region)}")
    return int(region)
