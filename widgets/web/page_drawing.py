"""Pictures of a drag, drawn by the page from the cages alone.

    at rest, once the cages are bound    the page fetches the surface: `announce`, `piece`, `hold`
    a press                              the first `update`: what the page shows already
    until the view rests                 an `update` for each picture; the server draws none
    at rest                              a picture of the server

A page that cannot draw, has lost its graphics memory or has refused a message says so with `want`;
the server draws again from then on.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from ..editor import DeformEditor
from ..scene import Draft, SurfaceStyle
from .drawing import Mark, SurfaceStream, label_actors, labels_of, look_of, marks_of

_PIECE = 1 << 18  # bytes; pictures are sent between two pieces


@dataclass(frozen=True)
class Surface:
    """A surface that the page can fetch."""

    version: int
    size: int
    """In bytes."""


@dataclass(frozen=True)
class Update:
    """What the page needs for the next picture that it draws."""

    messages: tuple[bytes, ...]
    labels: tuple[dict[str, Any], ...]
    """Texts that have appeared since the first update; see `labels_of`."""
    width: int
    """Pixels of the view."""
    height: int
    is_first: bool
    """Whether it shows what the last picture of the server shows."""
    time: float = 0.0
    """As of `Picture`."""


class PageDrawing:
    """What the page of *editor* draws itself."""

    def __init__(self, editor: DeformEditor) -> None:
        self._editor = editor
        self._stream = SurfaceStream(editor.session)
        self._is_wanted = self._is_held = False
        self._version = 0
        self._data = b""  # the surface that the page fetches
        self._is_announced = False
        self._drawn: tuple[object, ...] = None, ()  # by the server: vertices and camera
        self._labels: list[Any] = []  # that the last picture of the server shows

    def want(self, wanted: bool) -> None:
        """Let the page draw, which has nothing yet; or let the server draw."""
        self._is_wanted = wanted
        self._is_held = self._is_announced = False
        self._data = b""

    # The surface.

    def announce(self) -> Surface | None:
        """Encode the surface if the page lacks it and nothing moves; None otherwise."""
        editor = self._editor
        if not self._is_wanted or editor.is_busy or self.is_dragging:
            return None
        if self._stream.session is not editor.session:
            self._stream = SurfaceStream(editor.session)
        stream = self._stream
        if not stream.is_possible or (self._is_announced and stream.is_encoded):
            return None
        if stream.is_encoded:
            stream.reset()
        else:
            stream.encode()
        self._data = b"".join(self._due())
        self._is_announced, self._is_held = True, False
        self._version += 1
        return Surface(self._version, len(self._data))

    def piece(self, version: int, start: int) -> bytes:
        """Return the next bytes of a surface; none if there is a newer one."""
        return self._data[start : start + _PIECE] if version == self._version else b""

    def hold(self, version: int) -> None:
        """Draw from now on: the page has all of the surface."""
        if version == self._version and self._data:
            self._is_held, self._data = True, b""

    # Pictures.

    @property
    def is_dragging(self) -> bool:
        """Whether the hand moves the surface or the camera."""
        widgets = self._editor.widgets
        moving = widgets.puller, widgets.dragger, widgets.cages
        navigation = self._editor.controller.camera.navigation
        return navigation.is_dragging or any(widget.is_grabbing for widget in moving)

    @property
    def is_moving(self) -> bool:
        """Whether something is dragged, or has not come to rest since."""
        widgets, view = self._editor.widgets, self._editor.view
        is_refining = widgets.puller.is_refining or widgets.dragger.is_refining
        return self.is_dragging or is_refining or Draft.of(view).is_active

    @property
    def is_possible(self) -> bool:
        """Whether the page has all that it needs, and can draw everything that is visible."""
        editor, surface = self._editor, self._editor.widgets.surface
        has_surface = self._is_held and self._stream.session is editor.session
        is_plain = surface.style is SurfaceStyle.SHADED and surface.instead is None
        is_plain &= surface.only is None
        if not (has_surface and is_plain and not editor.is_busy and self._stream.is_encoded):
            return False
        renderer = editor.view.renderer
        others = (actor for actor in renderer.GetActors() if actor not in surface.actors)
        # Actors of the host can be picked; they may have lights, textures and colours.
        has_others = any(actor.GetVisibility() and actor.GetPickable() for actor in others)
        return not has_others and not renderer.GetVolumes().GetNumberOfItems()

    def note_picture(self) -> None:
        """Remember what the server has just drawn."""
        self._drawn = self._editor.session.vertices, self._camera

    @property
    def is_current(self) -> bool:
        """Whether the last picture of the server shows the current surface from the camera."""
        vertices, camera = self._drawn
        return vertices is self._editor.session.vertices and camera == self._camera

    @property
    def _camera(self) -> tuple[object, ...]:
        camera, size = self._editor.view.camera, self._editor.view.window.GetSize()
        places = camera.GetPosition(), camera.GetFocalPoint(), camera.GetViewUp()
        return *size, *places, camera.GetViewAngle(), camera.GetParallelScale()

    def update(self, *, is_first: bool = False) -> Update:
        """Return the update for the current state; *is_first*: as drawn by the server already."""
        if is_first:
            self._labels = label_actors(self._editor.view)
        messages, view = self._due(), self._editor.view
        added = [actor for actor in label_actors(view) if actor not in self._labels]
        labels = tuple(labels_of(added, view))
        width, height = view.window.GetSize()
        return Update(tuple(messages), labels, width, height, is_first)

    @property
    def _marks(self) -> list[Mark]:
        view = self._editor.view
        view.lay_out()
        return marks_of(view, self._editor.widgets.surface.actors)

    def _due(self) -> list[bytes]:
        editor, surface = self._editor, self._editor.widgets.surface
        marks = self._marks  # first, because this lays out
        look = look_of(editor.view.renderer, surface.actor.GetProperty())
        return self._stream.due(look, colours=surface.colours, marks=marks)
