"""A diverging colour scale for signed values: blue below zero, pale grey at zero, orange above.

Lightness decreases linearly with the absolute value, alike on both sides, so lightness shows the
size and hue the sign.  Blue and orange remain distinguishable with all common kinds of colour
blindness, and zero has exactly one colour.

    -half_range        0        +half_range
    deep blue       pale grey      deep brown        values beyond are clamped

`half_range_for` chooses half_range without flicker from frame to frame.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from vtkmodules.vtkCommonCore import vtkLookupTable

from vtk_segdeform.arrays import FloatArray
from vtk_segdeform.pictures import rgb

# From zero outwards: CIELAB lightness 90, 79, 68, 57, 46, 35, within the gamut of sRGB.
_BELOW = ("#E2E2E2", "#AAC7E0", "#6DACDC", "#2090D3", "#0073C1", "#0055A6")
_ABOVE = ("#E2E2E2", "#E3BD96", "#D79958", "#C67520", "#AE5400", "#8A3A02")
_N = 255  # odd: the middle colour is that of zero

HALF_RANGES = (0.05, 0.1, 0.2, 0.5, 1.0)  # at -1 the local volume turns inside-out
_PERCENTILE = 99.0  # of the absolute values, to be within the range
_HYSTERESIS = 0.7  # a smaller range must leave this margin before it is used


def _table() -> NDArray[np.uint8]:
    anchors = np.array([rgb(colour) for colour in (*_BELOW[:0:-1], *_ABOVE)], dtype=float)
    positions = np.linspace(0.0, len(anchors) - 1.0, _N)
    columns = [np.interp(positions, np.arange(len(anchors)), column) for column in anchors.T]
    return np.round(np.stack(columns, axis=1)).astype(np.uint8)


_COLOURS = _table()
NEUTRAL = _COLOURS[_N // 2]


def colours_of(shares: FloatArray, half_range: float) -> NDArray[np.uint8]:
    """Return the colours (n, 3) uint8 of signed *shares* (n,).

    Parameters
    ----------
    shares : (n,) float
        Relative changes: 0.1 is ten per cent more.
    half_range : float
        The share of the last colour, above 0.

    Examples
    --------
    >>> colours_of(np.array([-1.0, 0.0, 0.1]), 0.1)
    array([[  0,  85, 166],
           [226, 226, 226],
           [138,  58,   2]], dtype=uint8)
    """
    place = (shares / half_range + 1.0) * (0.5 * _N)
    return np.take(_COLOURS, place.clip(0, _N - 1, out=place).astype(np.intp), axis=0)


def lookup_table(half_range: float) -> Any:
    """Return a vtkLookupTable with the colours of `colours_of`."""
    table = vtkLookupTable()
    table.SetNumberOfTableValues(_N)
    table.SetTableRange(-half_range, half_range)
    for k, colour in enumerate(_COLOURS / 255.0):
        table.SetTableValue(k, *colour)
    return table


def half_range_for(shares: FloatArray, before: float | None = None) -> float:
    """Return one of `HALF_RANGES` that contains all but one per cent of *shares*.

    Parameters
    ----------
    shares : (n,) float
        The values to show; a few outliers make no difference.
    before : float, optional
        The range of the last frame.  A smaller one replaces it only with a margin, so that values
        close to the limit of a range do not make the colours flicker.

    Examples
    --------
    >>> half_range_for(np.array([0.0, -0.12])), half_range_for(np.array([0.09]), before=0.2)
    (0.2, 0.2)
    """
    size = float(np.percentile(np.abs(shares), _PERCENTILE)) if len(shares) else 0.0
    wide_enough = [step for step in HALF_RANGES if size <= step] or [HALF_RANGES[-1]]
    if before is None or before <= wide_enough[0]:
        return wide_enough[0]
    with_margin = [step for step in HALF_RANGES if size <= _HYSTERESIS * step] or [HALF_RANGES[-1]]
    return min(before, with_margin[0])
