"""The actions that move the camera.  They work during a job and during a drag, too."""

from __future__ import annotations

import numpy as np

from .actions import Action
from .controller import Controller


def looking_from(name: str) -> Action:
    """Return the action that shows the model from a view: "front", "top" or another of `VIEWS`."""
    return lambda controller: controller.camera.viewpoint.look_from(name)


def with_up(axis: int) -> Action:
    """Return the action that makes an axis, 0 to 2, the up axis, and shows the model upright."""

    def turn_up(controller: Controller) -> None:
        controller.camera.viewpoint.up = np.eye(3)[axis]
        controller.camera.viewpoint.look_from("home")
        controller.say(f"Up: {'XYZ'[axis]}")

    return turn_up


def toggle_projection(controller: Controller) -> None:
    """Switch between perspective and orthographic projection."""
    is_orthographic = controller.camera.viewpoint.toggle_projection()
    controller.say("Orthographic" if is_orthographic else "Perspective")


def toggle_cube(controller: Controller) -> None:
    """Show or hide the orientation cube."""
    cube = controller.camera.cube
    if cube.is_shown:
        cube.hide()
    else:
        cube.show()


def frame_selection(controller: Controller) -> None:
    """Frame the selected region or handle, or else all."""
    controller.camera.frame_selection(controller.mode)


def frame_all(controller: Controller) -> None:
    """Frame the model."""
    controller.camera.viewpoint.frame()
