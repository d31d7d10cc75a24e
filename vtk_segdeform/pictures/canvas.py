"""Panels side by side, one camera for all, rendered without a window and written as a PNG file.

The camera looks along the direction in which the model extends and moves least, so that a bend is
seen from its side; then a little from aside and above, for depth.  It projects in parallel, so
all panels have one scale.  Everything is drawn at twice the size and averaged down, which smooths
edges on any renderer.
"""

from __future__ import annotations

import functools
import subprocess
import sys
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
from .palette import INK, PAPER

Draw = Callable[[pv.Plotter], None]

_HEIGHT = 800  # pixels of a picture
_TITLE, _MARGIN = 0.1, 0.04  # shares of the height: for the words on top, and around
_ASIDE, _ABOVE = np.radians(14.0), np.radians(10.0)
_UNSEEN = ("vtkEGLRenderWindow", "vtkOSOpenGLRenderWindow")  # what VTK opens without a screen
_PROBE = "import pyvista; pyvista.Plotter(off_screen=True).show()"


@functools.lru_cache(maxsize=1)
def require_offscreen() -> None:
    """Make sure that pictures can be rendered here; tried once, in a process of its own.

    Without a GL library VTK ends the whole process on its first picture, which no ``try`` can
    catch.

    Raises
    ------
    MissingDependencyError
        If rendering fails; names the Debian packages that make it work.
    """
    tried = subprocess.run([sys.executable, "-c", _PROBE], capture_output=True, check=False)
    if tried.returncode != 0:
        raise MissingDependencyError(
            "cannot render pictures here: VTK finds no OpenGL to draw with. On Debian or Ubuntu: "
            "apt-get install --no-install-recommends libegl1 libgl1"
        )


def require_picture(path: str | Path) -> None:
    """Check that a picture can be rendered and written, before the computation that it shows.

    Raises
    ------
    MissingDependencyError
        If nothing can be rendered here.
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
    """Make sure that a window can be opened where somebody sees it.

    Raises
    ------
    MissingDependencyError
        If not; the text says why.
    """
    if pv.OFF_SCREEN:
        raise MissingDependencyError(
            "there is no window to edit in: pyvista draws off-screen; unset PYVISTA_OFF_SCREEN"
        )
    probe = pv.Plotter(notebook=False)
    kind = probe.render_window.GetClassName()
    probe.close()
    if kind in _UNSEEN:
        raise MissingDependencyError(
            "there is no screen to open a window on; set DISPLAY, or log in with 'ssh -X'"
        )


def view_of(rest: FloatArray, deformed: FloatArray) -> FloatArray:
    """Return the camera's (3, 3) axes: rows to the right, up, and towards the viewer.

    Parameters
    ----------
    rest, deformed : (n, 3) float
        What is to be seen.  z stays up, unless that is where it extends least.
    """
    extent = np.ptp(np.concatenate([rest, deformed]), axis=0)
    towards = -np.eye(3)[int(np.argmin(extent))]
    up = np.eye(3)[2] if towards[2] == 0.0 else np.eye(3)[1]
    towards = abs(towards) if towards[2] else towards
    right = np.cross(up, towards)
    towards = np.cos(_ASIDE) * towards + np.sin(_ASIDE) * right
    right = np.cross(up, towards)
    towards = np.cos(_ABOVE) * towards + np.sin(_ABOVE) * up
    return np.stack([right, np.cross(towards, right), towards])


def write_panels(
    path: str | Path,
    panels: Sequence[tuple[str, Draw]],
    points: FloatArray,
    view: FloatArray,
    *,
    foot: float = 0.0,
) -> None:
    """Render *panels* and write them side by side.

    Parameters
    ----------
    path : str or Path
        A PNG file, which appears whole or not at all.
    panels : sequence of (title, draw)
        Each ``draw(plotter)`` adds what is to be seen; the camera stands already.
    points : (k, 3) float
        What every panel has room for.
    view : (3, 3) float
        From `view_of`.
    foot : float
        Share of the height kept free at the bottom.

    Raises
    ------
    MissingDependencyError
        If nothing can be rendered here.
    MeshError
        If the file is no .png or cannot be written.
    """
    require_picture(path)
    seen = points @ view.T
    low, high = seen.min(axis=0), seen.max(axis=0)
    width, height, _ = np.maximum(high - low, 1e-9 * np.ptp(seen))
    head = _TITLE if any(title for title, _ in panels) else _MARGIN
    room = 1.0 - head - max(foot, _MARGIN)  # of the panel's height, for the model
    aspect = float(np.clip(room * width / height + 2 * _MARGIN, 0.6, 2.0))
    visible = max(height / room, width / (aspect - 2 * _MARGIN))  # height of a panel, model units
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
                place = (0.5, 1.0 - 0.5 * _TITLE)
                words = plotter.add_text(
                    title, position=place, viewport=True, color=INK, font_size=20
                )
                words.prop.justification_horizontal = "center"
                words.prop.justification_vertical = "center"
        image = np.asarray(plotter.screenshot(return_img=True))
    finally:
        plotter.close()
    try:
        with replacing(path) as draft:
            draft.write_bytes(png_of(_averaged(image)))
    except OSError as fault:
        raise MeshError(f"{path}: cannot be written ({fault.strerror or fault})") from fault


def add_surface(plotter: pv.Plotter, surface: pv.PolyData, **colouring: Any) -> Any:
    """Add a surface, softly shaded, with its outline; returns its actor.

    Parameters
    ----------
    plotter : pyvista.Plotter
        Its camera stands already; the outline depends on it.
    surface : pyvista.PolyData
        Triangles.
    **colouring
        Of pyvista's ``add_mesh``: color, scalars, cmap, ...
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
    """Return a picture, (h, w, 3), upper row first, as the content of a PNG file."""
    height, width, _ = pixels.shape
    image = vtkImageData()
    image.SetDimensions(width, height, 1)
    rows = np.ascontiguousarray(pixels[::-1]).reshape(-1, 3)
    image.GetPointData().SetScalars(numpy_to_vtk(rows))
    writer = vtkPNGWriter()  # into memory: it does not report a full disk
    writer.WriteToMemoryOn()
    writer.SetInputData(image)
    writer.Write()
    return bytes(vtk_to_numpy(writer.GetResult()))


def _averaged(image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return *image* (h, w, 3) at half its size, a mean of 2 by 2 pixels each."""
    h, w = (side // 2 for side in image.shape[:2])
    small = image[: 2 * h, : 2 * w].reshape(h, 2, w, 2, 3).mean(axis=(1, 3))
    return np.asarray(np.round(small), dtype=np.uint8)
