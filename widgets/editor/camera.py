"""The camera of the editor: navigation, views, the up axis and the orientation cube.

A session file keeps them in its header, with the mode and with the handles that are hidden or
locked; see `Camera.settings`.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from vtk_segdeform.arrays import FloatArray
from vtk_segdeform.geometry import guess_up_axis

from ..scene import Navigation, OrientationCube, View, Viewpoint
from .help_card import HelpCard
from .widget_set import Mode, WidgetSet

_Y_UP = (".glb", ".gltf")  # by the definition of the format


def has_y_up(path: Path) -> bool:
    """Return whether the format of a mesh file defines that y is up."""
    return path.suffix.lower() in _Y_UP


class Camera:
    """The camera over the widgets of an editor.

    Parameters
    ----------
    view : View
        The view with the camera.
    widgets : WidgetSet
        The widgets over the session; replaced by `follow`.
    help_card : HelpCard
        While it is shown, the cube is not, nor where a gizmo or marker is.

    Attributes
    ----------
    viewpoint : Viewpoint
        Named views, framing, projection and up axis.
    navigation : Navigation
        The camera by mouse.
    cube : OrientationCube
        The cube in the corner; hidden at first.
    is_up_unsure : bool
        Whether the up axis is a guess that may well be wrong.
    """

    def __init__(self, view: View, widgets: WidgetSet, help_card: HelpCard) -> None:
        self._widgets, self.is_up_unsure = widgets, False
        self.viewpoint = Viewpoint(
            view,
            lambda: self._widgets.session.vertices,
            lambda: self._widgets.session.mesh.diagonal,
        )
        self.navigation = Navigation(
            view,
            self.viewpoint,
            lambda pointer: self._widgets.point_at(pointer),
            lambda pointer: self._widgets.part_at(pointer),
            lambda: self._widgets.session.state,
            lambda pointer: self._widgets.dragger.reset_pivot_at(pointer),
        )
        self.cube = OrientationCube(
            view,
            self.navigation,
            lambda place: help_card.is_shown or self._widgets.reach(place),
        )

    def begin(self, *, is_aimed: bool) -> None:
        """Guess the up axis and show the model, or follow the camera if the host has aimed it."""
        if is_aimed:
            self.viewpoint.follow_camera()
        else:
            self.show_model()

    def follow(self, widgets: WidgetSet) -> None:
        """Continue with the widgets over another session."""
        self._widgets = widgets

    def show_model(self, path: Path | None = None) -> None:
        """Guess the up axis, of a file *path* if it is known, and show the model from there."""
        is_y_up = path is not None and has_y_up(path)
        guess = guess_up_axis(self._widgets.session.mesh.vertices)
        self.viewpoint.up = np.eye(3)[1 if is_y_up else guess.axis]
        self.is_up_unsure = not (is_y_up or guess.is_sure)
        self.viewpoint.home()

    def frame_selection(self, mode: Mode) -> None:
        """Frame the selected region or handle of *mode*, or else all."""
        self.viewpoint.frame(self._selection(mode))

    def _selection(self, mode: Mode) -> FloatArray | None:
        widgets, session = self._widgets, self._widgets.session
        if mode is Mode.REGIONS and widgets.selector.region < widgets.n_regions:
            assert session.regions is not None
            chosen = session.regions.members(widgets.selector.region)
        else:
            tool = widgets.selector if mode is Mode.HANDLES else widgets.dragger
            name = tool.handle if mode in (Mode.HANDLES, Mode.DEFORM) else None
            if name not in session.handles:
                return None
            chosen = session.handles[str(name)]
        points = session.vertices[chosen]
        return points if len(points) else None

    # State.

    def settings(self, mode: Mode) -> dict[str, Any]:
        """Return camera, *mode*, hidden and locked handles for the header of a session file."""
        dragger = self._widgets.dragger
        handles = {"hidden": sorted(dragger.hidden), "locked": sorted(dragger.locked)}
        return {"mode": mode.name, **handles, **self.viewpoint.settings()}

    def restore(self, settings: Mapping[str, Any]) -> Mode | None:
        """Restore all of `settings` but the mode; return that, or None if it is damaged."""
        self.viewpoint.restore(settings)
        self.is_up_unsure &= not settings
        dragger, handles = self._widgets.dragger, self._widgets.session.handles
        for key, change in (("hidden", dragger.set_hidden), ("locked", dragger.set_locked)):
            names: Any = settings.get(key)
            for handle in handles if isinstance(names, list) else ():
                change(handle, handle in names)
        name = settings.get("mode")
        return Mode[name] if isinstance(name, str) and name in Mode.__members__ else None

    def remove(self) -> None:
        """Remove the cube, and leave the camera to the interactor style."""
        self.cube.hide()
        self.viewpoint.remove()
        self.navigation.Off()
