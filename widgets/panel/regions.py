"""The section with the regions: colour, name, cage and volume change."""

from __future__ import annotations

import numpy as np

from vtk_segdeform.arrays import BoolArray
from vtk_segdeform.errors import RegionError
from vtk_segdeform.pictures import of_region
from vtk_segdeform.session import Session

from ..editor import Action, Controller, DeformEditor, Mode, actions
from ..volume_overlay import in_tenths
from .fields import Cell, Column, Field, Row, Section, Table, as_rgb, key_button

_MOST_REGIONS = 20  # regions of a segmentation
STIFFNESS = (
    ("Soft (0.3)", "0.3"),
    ("Usual", "1"),
    ("3 times", "3"),
    ("10 times", "10"),
    ("Rigid", "inf"),
)
"""The choices of a stiffness."""
_COLUMNS = (
    Column("cage", "Cage", "Number of cage vertices. Tick: show the cage"),
    Column("volume", "Volume"),
)


def regions_section(editor: DeformEditor) -> Section:
    """Return the list of regions, and what can be done with them."""
    widgets, keys = editor.widgets, editor.keys
    painting = editor.mode is Mode.REGIONS
    existing = [region for region in widgets.chosen_regions if region < widgets.n_regions]
    return Section(
        "regions",
        "Regions",
        (
            key_button(keys, "regions.segment", "segment", visible=painting),
            Field(
                "regions.count",
                "slider",
                "Number",
                "Number of regions: release to segment again, which resets the pose",
                value=min(max(1, widgets.n_regions), _MOST_REGIONS),
                visible=painting,
                minimum=1,
                maximum=_MOST_REGIONS,
                on_release=True,
                act=lambda n: lambda controller: actions.segment(controller, n),
            ),
            Table(
                "regions.list",
                "Region",
                _COLUMNS,
                _rows(editor),
                "The selected region is painted in mode 1. Tick: show its cage. F2: rename",
                n_rows=7,
                multiple=True,
                acts={
                    "select": lambda keys: lambda c: c.widgets.choose_regions([*map(int, keys)]),
                    "rename": _renaming,
                    "cage": lambda key, on: lambda c: c.widgets.cages.set_visible(int(key), on),
                },
            ),
            Field(
                "regions.stiffness",
                "choice",
                "Stiffness",
                "How much stiffer the selected regions are; rigid ones keep their shape",
                value=stiffness_of(editor.session, existing),
                enabled=bool(existing),
                choices=STIFFNESS,
                act=lambda times: stiffening(existing, times),
            ),
            (
                key_button(keys, "regions.new", "new_region", "New", visible=painting),
                Field(
                    "regions.merge",
                    "button",
                    "Merge",
                    "Merge the selected regions",
                    enabled=len(existing) > 1,
                    visible=painting,
                    act=lambda _: actions.merging(existing),
                ),
                Field(
                    "regions.split",
                    "button",
                    "Split",
                    "Split the selected region",
                    "split_region",
                    enabled=len(existing) == 1,
                    visible=painting,
                    act=lambda _: actions.split_region,
                ),
            ),
        ),
    )


def stiffness_of(session: Session, chosen: list[int]) -> str:
    """Return the choice that fits the stiffness of the *chosen* regions best."""
    stiffness = session.state.stiffness
    if stiffness is None or not chosen:
        return "1"
    own = _own_vertices(session, chosen)
    median = float(np.median(stiffness[own])) if own.any() else 1.0
    return min(
        (times for _, times in STIFFNESS),
        key=lambda times: 0.0 if float(times) == median else abs(float(times) - median),
    )


def stiffening(chosen: list[int], times: str) -> Action:
    """Return the action that makes the *chosen* regions so many *times* as stiff as others."""

    def stiffen(controller: Controller) -> None:
        session = controller.session
        before, own = session.state.stiffness, _own_vertices(session, chosen)
        if not own.any():
            name = session.painting.name(chosen[0])
            raise RegionError(f"{name} is covered by other regions. Erase these there first")
        stiffness = np.ones(session.mesh.n_vertices) if before is None else before.copy()
        stiffness[own] = float(times)
        session.set_stiffness(None if (stiffness == 1.0).all() else stiffness)
        controller.say("Stiffness counts from the next move")

    return stiffen


def _own_vertices(session: Session, chosen: list[int]) -> BoolArray:
    """Return where one of the *chosen* regions has the largest weight, (n,); may be nowhere."""
    assert session.regions is not None
    return np.isin(session.regions.labels, chosen)


def _renaming(key: str, name: str) -> Action:
    """Return the action that renames a region; "" restores its default name."""

    def rename(controller: Controller) -> None:
        session, region = controller.session, int(key)
        before = session.painting.name(region)
        session.painting.rename(region, name)
        controller.say(f"Renamed {before} to {session.painting.name(region)}")

    return rename


def _rows(editor: DeformEditor) -> tuple[Row, ...]:
    session, widgets = editor.session, editor.widgets
    volumes = dict(widgets.overlay.region_volumes.changes())
    if widgets.n_regions == 1 and session.has_volume:
        volumes = {0: session.volume_change}
    shown = [*range(widgets.n_regions)]
    new = widgets.selector.region
    if editor.mode is Mode.REGIONS and new >= widgets.n_regions:
        shown.append(new)
    return tuple(_row(editor, region, volumes.get(region)) for region in shown)


def _row(editor: DeformEditor, region: int, volume: float | None) -> Row:
    widgets, cages = editor.widgets, editor.session.cages
    name, exists = editor.session.painting.name(region), region < widgets.n_regions
    cage = Cell("None" if exists else "")
    if exists and cages:
        cage = Cell(str(cages[region].n_vertices), widgets.cages.is_visible(region))
    return Row(
        str(region),
        name if exists else f"{name} (new)",
        as_rgb(of_region(region)),
        (cage, Cell("" if volume is None else in_tenths(volume))),
        selected=region in widgets.chosen_regions,
        renamable=exists,
    )
