"""Colours of pictures and widgets.

The body is neutral clay and fixed vertices are dark grey.  The first seven colours of regions are
those of Okabe and Ito; the others differ from them and from each other in hue or lightness.  The
colours of handles are never used for regions.

All of them stay distinct for colour-blind people.  The distance of two colours is the smallest in
CIELAB among normal vision and the dichromacies of Machado, Oliveira and Fernandes.  It is at least
16 among the first seven regions, 11 among all, 31 between neighbours from the seventh on, 21 among
handles, and 10 between a handle and a region.  Widgets also show the number of a region.

Sources
-------
M. Okabe, K. Ito, "Color universal design", 2002, https://jfly.uni-koeln.de/color/.
G. M. Machado, M. M. Oliveira, L. A. F. Fernandes, "A physiologically-based model for simulation of
color vision deficiency", IEEE TVCG 15, 2009.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

COLOURS = (
    "#E69F00", "#56B4E9", "#009E73", "#CC79A7", "#F0E442", "#0072B2", "#D55E00", "#B4B478",
    "#783C0F", "#D2F0D2", "#F078D2", "#5A961E", "#FF5A87", "#96FF96", "#960F4B", "#A5874B",
    "#78F0FF", "#695A78", "#F0C369", "#C35A5A", "#873C96", "#E1B4D2", "#3C692D", "#96E1A5",
)  # fmt: skip
HANDLES = (
    "#C3002D", "#8700F0", "#C3964B", "#001EA5", "#D200B4", "#69001E", "#8796FF", "#690F69",
)  # fmt: skip
BODY, FIXED, HANDLE = "#C9C5BD", "#5E6268", HANDLES[0]
INK, PAPER = "#333333", "#FFFFFF"
_BLACK = "#111111"
# Of a window, at its upper and at its lower edge.
BACKGROUND, DARK_BACKGROUND = ("#F7F7F5", "#E4E4E0"), ("#2B2D31", "#1D1E21")


def rgb(colour: str) -> NDArray[np.uint8]:
    """Return red, green and blue, (3,), 0 to 255, of a "#RRGGBB" text.

    >>> rgb("#E69F00")
    array([230, 159,   0], dtype=uint8)
    """
    return np.frombuffer(bytes.fromhex(colour.removeprefix("#")), dtype=np.uint8)


def of_region(region: int) -> NDArray[np.uint8]:
    """Return red, green and blue, (3,), of a region; colours repeat after the last."""
    return rgb(COLOURS[region % len(COLOURS)])


def of_handle(handle: int) -> NDArray[np.uint8]:
    """Return red, green and blue, (3,), of the n-th handle; colours repeat after the last."""
    return rgb(HANDLES[handle % len(HANDLES)])


def ink_on(colour: ArrayLike) -> str:
    """Return the colour of text on a *colour* (3,), dark or white, whichever contrasts more.

    >>> ink_on(rgb("#F0E442")), ink_on(rgb("#0072B2"))
    ('#111111', '#FFFFFF')
    """
    return _BLACK if np.dot(np.asarray(colour), [0.2126, 0.7152, 0.0722]) >= 0.45 * 255.0 else PAPER
