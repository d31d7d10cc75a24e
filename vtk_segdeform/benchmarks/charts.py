"""Plots of the report, by matplotlib without pyplot's global state.

Colours are those of `palette`.  Every line has its own marker, for printing in grey.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ..errors import MissingDependencyError
from ..files import replacing
from ..pictures import COLOURS

_MARKERS = "osD^vP*"
_ORDER = (5, 0, 2, 3, 1, 6, 4)  # indices of colours, dark ones first


def line_plot(
    path: Path,
    x: Sequence[float],
    panels: Mapping[str, Mapping[str, Sequence[float]]],
    *,
    across: str,
    logarithmic: bool = False,
) -> None:
    """Plot lines in panels side by side.

    Parameters
    ----------
    path : Path
        A PNG file to write.
    x : (k,) float
        Shared by all lines.
    panels : mapping
        For each panel, by the label of its y axis: the values (k,) of each line by its name.
    across : str
        Label of the x axis.
    logarithmic : bool
        Use logarithmic axes.
    """
    figure, axes = _figure(len(panels))
    for axis, (label, lines) in zip(axes, panels.items(), strict=True):
        for k, (name, values) in enumerate(lines.items()):
            colour = COLOURS[_ORDER[k % len(_ORDER)]]
            axis.plot(x, values, marker=_MARKERS[k % len(_MARKERS)], color=colour, label=name)
        axis.set_ylabel(label)
        axis.set_xlabel(across)
        if logarithmic:
            axis.set_xscale("log")
            axis.set_yscale("log")
            axis.yaxis.set_major_formatter("{x:g}")
            axis.yaxis.get_minor_locator().set_params(subs=(2.0, 5.0))
            axis.yaxis.set_minor_formatter("{x:g}")
            axis.set_xticks([], minor=True)
            axis.set_xticks(list(x), [_short(size) for size in x])
        else:
            axis.set_ylim(0.0, 1.1 * max(max(values) for values in lines.values()))
            axis.set_xticks(list(x))
        # The legend is beside or above the panel, where it hides no line.
        if len(panels) == 1:
            axis.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), frameon=False)
        elif len(lines) > 1:
            axis.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2, frameon=False)
    with replacing(path) as draft:
        figure.savefig(draft)


def _short(size: float) -> str:
    """Return *size* abbreviated, so that tick labels do not overlap."""
    unit, letter = (1e6, "M") if size >= 1e6 else (1e3, "k") if size >= 1e3 else (1.0, "")
    return f"{size / unit:.3g}{letter}"


def small_multiples(
    path: Path, labels: Sequence[str], panels: Mapping[str, Mapping[str, Sequence[float]]]
) -> None:
    """Plot each quantity in a panel over the same *labels*; NaN is omitted."""
    figure, axes = _figure(min(len(panels), 3), -(-len(panels) // 3))
    for axis in axes[len(panels) :]:
        axis.set_visible(False)
    for axis, (label, lines) in zip(axes, panels.items(), strict=False):
        for k, (name, values) in enumerate(lines.items()):
            there = [x for x, value in enumerate(values) if not math.isnan(value)]
            colour = COLOURS[_ORDER[k % len(_ORDER)]]
            axis.plot(
                there, [values[x] for x in there],
                marker=_MARKERS[k % len(_MARKERS)], color=colour, label=name,
            )  # fmt: skip
        axis.set_title(label, fontsize=7)
        known = [value for values in lines.values() for value in values if not math.isnan(value)]
        axis.set_ylim(0.0, 1.1 * max(known, default=0.0) or 1.0)
        axis.set_xticks(range(len(labels)), labels, rotation=90, fontsize=6)
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", frameon=False)
    with replacing(path) as draft:
        figure.savefig(draft)


def _figure(n_panels: int, n_rows: int = 1) -> tuple[Any, Any]:
    try:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
    except ImportError:
        raise MissingDependencyError(
            "plots need matplotlib: pip install 'vtk-segdeform[bench]'"
        ) from None
    figure = Figure(figsize=(max(4.2 * n_panels, 7.0), 3.8 * n_rows), dpi=150, layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(n_rows, n_panels, squeeze=False).ravel()
    for axis in axes:
        axis.spines[["top", "right"]].set_visible(False)
        axis.grid(color="#E5E5E5", linewidth=0.8)
        axis.set_axisbelow(True)
    return figure, axes
