"""Background and light of a renderer whose window belongs to the editor."""

from __future__ import annotations

from typing import Any

from vtkmodules.vtkRenderingCore import vtkLight

from vtk_segdeform.pictures import BACKGROUND, DARK_BACKGROUND, rgb

# Position in the camera's coordinates, towards which the body is brighter, and intensity: a key
# light at the upper left, and a fill light, so that no side is black.
_LIGHTS = (((-0.7, 0.9, 1.0), 0.95), ((0.6, -0.2, 1.0), 0.35))


def set_background(renderer: Any, *, dark: bool = False) -> None:
    """Set the vertical gradient of the background of *renderer*, light or *dark*."""
    top, bottom = DARK_BACKGROUND if dark else BACKGROUND
    renderer.SetBackground(*(rgb(bottom) / 255.0))
    renderer.SetBackground2(*(rgb(top) / 255.0))
    renderer.GradientBackgroundOn()


def set_lights(renderer: Any) -> None:
    """Replace the lights of *renderer* by a soft light from the camera's upper left."""
    renderer.RemoveAllLights()
    renderer.AutomaticLightCreationOff()
    for position, intensity in _LIGHTS:
        light = vtkLight()
        light.SetLightTypeToCameraLight()
        light.SetPosition(*position)
        light.SetFocalPoint(0.0, 0.0, 0.0)
        light.SetIntensity(intensity)
        renderer.AddLight(light)
