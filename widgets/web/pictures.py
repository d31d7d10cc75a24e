"""Pictures of a view as JPEG: small while it moves, complete once it rests."""

from __future__ import annotations

import io
import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from ..scene import View

_MOVING, _STILL = 65, 92  # quality, of 100
_MOST_MOVING = 1_200_000  # pixels of a picture that moves


@dataclass(frozen=True)
class Picture:
    """An encoded picture."""

    data: bytes
    width: int
    """Pixels of the encoded picture, which may be fewer than those of the view."""
    height: int
    is_still: bool
    time: float = 0.0
    """Of the last event that it shows, by the clock of the page; see `Inputs.put`."""


Encode = Callable[[], Picture]
"""Encodes a picture that was drawn; called in another thread."""


class Pictures:
    """Draws a view, and encodes the result."""

    def __init__(self, view: View) -> None:
        self._view = view
        self._pixels: NDArray[np.uint8] | None = None

    def draw(self) -> Encode:
        """Draw the view now; return what encodes the picture for a view that moves."""
        self._view.draw()
        self._pixels = pixels = self._view.pixels()
        return lambda: _encoded(pixels, is_still=False)

    def still(self) -> Encode | None:
        """Return what encodes the last picture completely, if there is one."""
        pixels = self._pixels
        return None if pixels is None else (lambda: _encoded(pixels, is_still=True))


def _encoded(pixels: NDArray[np.uint8], *, is_still: bool) -> Picture:
    height, width, _ = pixels.shape
    image = Image.frombuffer("RGB", (width, height), pixels, "raw", "RGB", 0, -1)
    if not is_still and width * height > _MOST_MOVING:
        image = image.reduce(math.ceil(math.sqrt(width * height / _MOST_MOVING)))
    file = io.BytesIO()
    # 4:4:4 keeps thin coloured lines; 4:2:0 takes half the bytes.
    image.save(file, "JPEG", quality=_STILL if is_still else _MOVING, subsampling=2 - 2 * is_still)
    return Picture(file.getvalue(), *image.size, is_still)
