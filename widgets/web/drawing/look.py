"""Camera, light and material of a VTK renderer, as numbers for a page."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from vtk_segdeform.arrays import FloatArray

from .encoding import EncodedSurface
from .messages import Kind, message


@dataclass(frozen=True)
class Look:
    """How a body is seen.

    Parameters
    ----------
    view, projection : (4, 4) float
        From the scene to the camera, and from there to the clip space of OpenGL.
    colour : (3,) float
        Of the body, 0 to 1.
    ambient, diffuse : float
        Shares of ambient and of diffuse light.
    lights : (k, 6) float
        For each light its direction from the body, in the camera's coordinates and of length 1,
        and the strengths of its red, green and blue.
    """

    view: FloatArray
    projection: FloatArray
    colour: FloatArray
    ambient: float
    diffuse: float
    lights: FloatArray

    def message(self, serial: int, surface: EncodedSurface) -> bytes:
        """Return the message of this look at *surface*."""
        to_scene = np.diag([surface.scale] * 3 + [1.0])
        to_scene[:3, 3] = surface.centre
        projection = self.projection.copy()
        projection[2] = 0.0  # the page chooses its own range of depths
        numbers: list[ArrayLike] = [
            (self.view @ to_scene).T.ravel(),
            projection.T.ravel(),
            self.colour,
            [self.ambient, self.diffuse],
            self.lights.ravel(),
        ]
        return message(
            Kind.LOOK,
            serial,
            np.concatenate([np.asarray(each) for each in numbers]).astype(np.float32),
        )


def look_of(renderer: Any, material: Any) -> Look:
    """Return how *renderer* shows a body.

    Parameters
    ----------
    renderer : vtkRenderer
        In a window.
    material : vtkProperty
        Of the body.
    """
    camera = renderer.GetActiveCamera()
    view = matrix_of(camera.GetViewTransformMatrix())
    aspect = renderer.GetTiledAspectRatio()
    projection = matrix_of(camera.GetProjectionTransformMatrix(aspect, -1, 1))
    lights = [_light(light, view) for light in renderer.GetLights() if light.GetSwitch()]
    return Look(
        view,
        projection,
        np.array(material.GetDiffuseColor()),
        material.GetAmbient(),
        material.GetDiffuse(),
        np.array(lights).reshape(-1, 6),
    )


def _light(light: Any, view: FloatArray) -> FloatArray:
    if light.LightTypeIsHeadlight():
        away = np.array([0.0, 0.0, 1.0])
    else:
        away = np.subtract(light.GetPosition(), light.GetFocalPoint())
        if not light.LightTypeIsCameraLight():
            away = view[:3, :3] @ away
    strength = light.GetIntensity() * np.array(light.GetDiffuseColor())
    return np.concatenate([away / np.linalg.norm(away), strength])


def matrix_of(matrix: Any) -> FloatArray:
    """Return a vtkMatrix4x4 as (4, 4) float."""
    return np.array([[matrix.GetElement(i, j) for j in range(4)] for i in range(4)])
