"""Panels side by side with a common camera, rendered off-screen and written as a PNG file.

The camera looks along the axis of least extent of the model in both poses, so that a bend is seen
from the side, tilted slightly sideways and up to show depth.  The projection is parallel, so all
panels have the same scale.  Pictures are rendered at twice the size and averaged, which smooths
edges with any renderer.
"""

from __future__ import annotations

import functools
import subprocess
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyvista as pv
from numpy.typing import NDArray
from vtkmodules.util.numpy_support import numpy_to_vtk, vtk_to_numpy
from vtkmodules.vtkCommonDataModel import vtkImageData
from vtkmodules.vtkIOImage import vtkPNGWriter

from ..arrays import FloatArray
from ..checks import as_path
from ..errors import MeshError, MissingDependencyError
from ..files import replacing, require_place
from ..interpreter import python_command, python_environment, python_program
from .palette import INK, PAPER

# In quotes: importing plotters, and matplotlib with them, takes most of a second.
Draw = Callable[["pv.Plotter"], None]

_HEIGHT = 800  # pixels of a picture
_TITLE, _MARGIN = 0.1, 0.04  # of the height: title, and margins
_SIDEWAYS, _UP = np.radians(14.0), np.radians(10.0)
_OFFSCREEN = ("vtkEGLRenderWindow", "vtkOSOpenGLRenderWindow")  # VTK's windows without a screen
_PROBE = """
import vtkmodules.vtkRenderingOpenGL2
from vtkmodules.vtkRenderingCore import vtkRenderer, vtkRenderWindow
window = vtkRenderWindow()
window.SetOffScreenRendering(True)
window.AddRenderer(vtkRenderer())
window.Render()
"""


@functools.lru_cache(maxsize=1)
def require_offscreen() -> None:
    """Check once, in a separate process, that pictures can be rendered.

    Without a GL library VTK ends the process at the first rendering, which no ``try`` can catch.
    An application that has no Python interpreter to start renders without this check.

    Raises
    ------
    MissingDependencyError
        If rendering fails; the message names the Debian packages that it needs.
    """
    if python_program() is None:
        return
    probe = subprocess.run(
        python_command(_PROBE), env=python_environment(), capture_output=True, check=False
    )
    if probe.returncode != 0:
        raise MissingDependencyError(
            "pictures cannot be rendered: VTK finds no OpenGL library. On Debian or Ubuntu: "
            "apt-get install --no-install-recommends libegl1 libgl1"
        )


def require_picture(path: str | Path) -> None:
    """Check that a picture can be rendered and written, before its data are computed.

    Raises
    ------
    MissingDependencyError
        If rendering is not possible.
    MeshError
        If the file is not a .png or cannot be written.
    """
    path = as_path(path)
    if path.suffix.lower() != ".png":
        raise MeshError(f"{path}: a picture must be a .png file")
    try:
        require_place(path)
    except OSError as fault:
        raise MeshError(f"{path}: {fault.strerror or fault}") from fault
    require_offscreen()


def require_screen() -> None:
    """Check that a window can be opened on a screen.

    Raises
    ------
    MissingDependencyError
        If not; the message says why.
    """
    if pv.OFF_SCREEN:
        raise MissingDependencyError(
            "no window can be opened: pyvista renders off-screen; unset PYVISTA_OFF_SCREEN"
        )
    probe = pv.Plotter(notebook=False)
    kind = probe.render_window.GetClassName()
    probe.close()
    if kind in _OFFSCREEN:
        raise MissingDependencyError(
            "no window can be opened: there is no screen; set DISPLAY, or log in with 'ssh -X'"
        )


def view_of(rest: FloatArray, deformed: FloatArray) -> FloatArray:
    """Return the axes of the camera (3, 3): rows to the right, up, and towards the viewer.

    Parameters
    ----------
    rest, deformed : (n, 3) float
        The poses to show.  z is up unless it is the axis of least extent.
    """
    extent = np.ptp(np.concatenate([rest, deformed]), axis=0)
    towards = -np.eye(3)[int(np.argmin(extent))]
    up = np.eye(3)[2] if towards[2] == 0.0 else np.eye(3)[1]
    towards = abs(towards) if towards[2] else towards
    right = np.cross(up, towards)
    towards = np.cos(_SIDEWAYS) * towards + np.sin(_SIDEWAYS) * right
    right = np.cross(up, towards)
    towards = np.cos(_UP) * towards + np.sin(_UP) * up
    return np.stack([right, np.cross(towards, right), towards])


def write_panels(
    path: str | Path,
    panels: Sequence[tuple[str, Draw]],
    points: FloatArray,
    view: FloatArray,
    *,
    foot: float = 0.0,
) -> None:
    """Render *panels* side by side and write them to a file.

    Parameters
    ----------
    path : str or Path
        A PNG file, replaced atomically.
    panels : sequence of (title, draw)
        Each ``draw(plotter)`` adds the actors of a panel; the camera is set before.
    points : (k, 3) float
        Points that are visible in every panel.
    view : (3, 3) float
        From `view_of`.
    foot : float
        Fraction of the height that is free at the bottom.

    Raises
    ------
    MissingDependencyError
        If rendering is not possible.
    MeshError
        If the file is not a .png or cannot be written.
    """
    require_picture(path)
    seen = points @ view.T
    low, high = seen.min(axis=0), seen.max(axis=0)
    width, height, _ = np.maximum(high - low, 1e-9 * np.ptp(seen))
    head = _TITLE if any(title for title, _ in panels) else _MARGIN
    room = 1.0 - head - max(foot, _MARGIN)  # fraction of the height for the model
    aspect = float(np.clip(room * width / height + 2 * _MARGIN, 0.6, 2.0))
    visible = max(height / room, width / (aspect - 2 * _MARGIN))  # height of a panel in model units
    middle = 0.5 * (low + high)
    middle[1] += 0.5 * visible * (head - max(foot, _MARGIN))
    size = (int(2 * _HEIGHT * aspect) // 2 * 2 * len(panels), 2 * _HEIGHT)
    plotter = pv.Plotter(off_screen=True, shape=(1, len(panels)), window_size=size, border=False)
    try:
        plotter.disable_anti_aliasing()
        plotter.set_background(PAPER)
        for k, (title, draw) in enumerate(panels):
            plotter.subplot(0, k)
            plotter.disable_anti_aliasing()
            centre = middle @ view
            away = float(np.ptp(seen, axis=0).max()) * 3.0
            plotter.camera.position = centre + away * view[2]
            plotter.camera.focal_point = centre
            plotter.camera.up = view[1]
            plotter.enable_parallel_projection()
            plotter.camera.parallel_scale = 0.5 * visible
            draw(plotter)
            plotter.reset_camera_clipping_range()
            if title:
                position = (0.5, 1.0 - 0.5 * _TITLE)
                text = plotter.add_text(
                    title, position=position, viewport=True, color=INK, font_size=20
                )
                text.prop.justification_horizontal = "center"
                text.prop.justification_vertical = "center"
        image = np.asarray(plotter.screenshot(return_img=True))
    finally:
        plotter.close()
    try:
        with replacing(path) as draft:
            draft.write_bytes(png_of(_averaged(image)))
    except OSError as fault:
        raise MeshError(f"{path}: cannot be written ({fault.strerror or fault})") from fault


def add_surface(plotter: pv.Plotter, surface: pv.PolyData, **colouring: Any) -> Any:
    """Add a smoothly shaded surface with its silhouette; returns its actor.

    Parameters
    ----------
    plotter : pyvista.Plotter
        Its camera must be set, since the silhouette depends on it.
    surface : pyvista.PolyData
        Triangles.
    **colouring
        Options of pyvista's ``add_mesh``: color, scalars, cmap, ...
    """
    actor = plotter.add_mesh(
        surface,
        smooth_shading=True,
        split_sharp_edges=True,
        feature_angle=50.0,
        ambient=0.35,
        diffuse=0.8,
        specular=0.05,
        show_scalar_bar=False,
        **colouring,
    )
    plotter.add_silhouette(surface, color=INK, line_width=3.0, feature_angle=None)
    return actor


def png_of(pixels: NDArray[np.uint8]) -> bytes:
    """Return pixels (h, w, 3), top row first, as the bytes of a PNG file."""
    height, width, _ = pixels.shape
    image = vtkImageData()
    image.SetDimensions(width, height, 1)
    rows = np.ascontiguousarray(pixels[::-1]).reshape(-1, 3)
    image.GetPointData().SetScalars(numpy_to_vtk(rows))
    writer = vtkPNGWriter()  # to memory, since it does not report a full disk
    writer.WriteToMemoryOn()
    writer.SetInputData(image)
    writer.Write()
    return bytes(vtk_to_numpy(writer.GetResult()))


def _averaged(image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return *image* (h, w, 3) at half the size, averaged over 2 by 2 pixels."""
    h, w = (side // 2 for side in image.shape[:2])
    small = image[: 2 * h, : 2 * w].reshape(h, 2, w, 2, 3).mean(axis=(1, 3))
    return np.asarray(np.round(small), dtype=np.uint8)
