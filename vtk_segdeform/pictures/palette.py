"""Colours of pictures and widgets.

Regions have the colours of Okabe and Ito, which are distinct for colour-blind people; fixed
vertices are grey and handles red, as in the figures of the paper.

Source
------
M. Okabe, K. Ito, "Color universal design", 2002, https://jfly.uni-koeln.de/color/.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

COLOURS = ("#E69F00", "#56B4E9", "#009E73", "#CC79A7", "#F0E442", "#0072B2", "#D55E00")
BODY, FIXED, HANDLE = "#BFD7EA", "#707070", "#D7261E"
INK, PAPER = "#333333", "#FFFFFF"


def rgb(colour: str) -> NDArray[np.uint8]:
    """Return red, green and blue, (3,), 0 to 255, of a "#RRGGBB" text.

    >>> rgb("#E69F00")
    array([230, 159,   0], dtype=uint8)
    """
    return np.frombuffer(bytes.fromhex(colour.removeprefix("#")), dtype=np.uint8)


def of_region(region: int) -> NDArray[np.uint8]:
    """Return red, green and blue, (3,), of a region; colours repeat after the last."""
    return rgb(COLOURS[region % len(COLOURS)])
