"""Film files, written atomically: GIF or MP4.

GIFs have 256 colours, the same for all pictures to avoid flicker.  They are written by Pillow, a
dependency of pyvista.  MP4s require imageio[ffmpeg].
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from vtk_segdeform.arrays import is_number
from vtk_segdeform.checks import as_path, shown
from vtk_segdeform.errors import MissingDependencyError, SessionError
from vtk_segdeform.files import replacing, require_place
from vtk_segdeform.importing import imported
from vtk_segdeform.progress import Progress, tell

Picture = NDArray[np.uint8]  # (h, w, 3), upper row first, all of one size

_SAMPLES = 12  # pictures that determine the colours of a GIF
_LIBRARIES = {".gif": ("PIL.Image", "pillow"), ".mp4": ("imageio_ffmpeg", "'imageio[ffmpeg]'")}


class Pictures(Protocol):
    """A sequence of pictures."""

    def __len__(self) -> int: ...
    def __getitem__(self, number: int, /) -> Picture: ...


def write_film(
    path: str | os.PathLike[str], pictures: Pictures, fps: float, progress: Progress | None = None
) -> None:
    """Write *pictures*, *fps* per second, in the format of the suffix of *path*.

    *progress* is called before every picture.

    Raises
    ------
    SessionError, MissingDependencyError
        As `require_film`, or if there are no pictures.
    """
    path = as_path(path)
    require_film(path, fps)
    if not len(pictures):
        raise SessionError(f"{path}: a film without pictures cannot be written")
    write = {".gif": _write_gif, ".mp4": _write_mp4}[path.suffix.lower()]
    try:
        with replacing(path) as draft:
            write(draft, pictures, _reported(pictures, progress), fps)
    except OSError as fault:
        raise SessionError(f"{path}: cannot be written ({fault.strerror or fault})") from fault


def require_film(path: str | os.PathLike[str], fps: float = 20.0) -> None:
    """Raise the errors of `Film.save` in advance, before the film is made."""
    path = as_path(path)
    suffix = path.suffix.lower()
    if suffix not in _LIBRARIES:
        raise SessionError(f"{path}: a film is a .gif or an .mp4")
    if not (is_number(fps, 0.1) and fps <= 100.0):
        raise SessionError(f"fps must be 0.1 to 100 pictures per second; got {shown(fps)}")
    try:
        require_place(path)
    except OSError as fault:
        raise SessionError(f"{path}: {fault.strerror or fault}") from fault
    _library(suffix)


def _reported(pictures: Pictures, progress: Progress | None) -> Iterator[Picture]:
    for k in range(len(pictures)):
        tell(progress, k / len(pictures), f"picture {k + 1}")
        yield pictures[k]


def _write_gif(path: Path, pictures: Pictures, each: Iterator[Picture], fps: float) -> None:
    image = _library(".gif")
    some = np.unique(np.linspace(0, len(pictures) - 1, _SAMPLES).round().astype(int))
    sheet = image.fromarray(np.concatenate([pictures[int(k)] for k in some]))
    # Maximum coverage: by frequency, a white background would leave few colours for shades.
    colours = sheet.quantize(256, method=image.Quantize.MAXCOVERAGE)
    dither = image.Dither.FLOYDSTEINBERG
    first, *rest = (
        image.fromarray(picture).quantize(palette=colours, dither=dither) for picture in each
    )
    first.save(path, format="GIF", save_all=True, append_images=rest, duration=1000.0 / fps, loop=0)


def _write_mp4(path: Path, pictures: Pictures, each: Iterator[Picture], fps: float) -> None:
    height, width, _ = pictures[0].shape
    writer = _library(".mp4").write_frames(str(path), (width, height), fps=fps, macro_block_size=2)
    try:
        writer.send(None)  # starts the generator
        for picture in each:
            writer.send(picture.tobytes())
    finally:
        writer.close()


def _library(suffix: str) -> Any:
    name, package = _LIBRARIES[suffix]
    try:
        return imported(name)
    except ImportError as fault:
        raise MissingDependencyError(
            f"writing {suffix} files requires a library: pip install {package}"
        ) from fault
