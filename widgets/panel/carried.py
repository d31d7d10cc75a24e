"""The section with the files that the session carries along."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from weakref import WeakKeyDictionary

from vtk_segdeform.pictures import rgb
from vtk_segdeform.session import SessionLandmarks

from ..editor import Action, Controller, DeformEditor, actions
from ..scene import CARRIED_COLOUR
from .fields import Cell, Column, Field, Row, Section, Table, as_rgb

_FAULT = "cannot be read"
_chosen: WeakKeyDictionary[Controller, str] = WeakKeyDictionary()


def carried_section(editor: DeformEditor) -> Section:
    """Return the list of carried files, with what adds, removes and saves them."""
    carried, shown = editor.session.carried, editor.widgets.carried
    chosen = _chosen.get(editor.controller, "")
    chosen = chosen if chosen in carried else next(iter(carried), "")
    faults = {name for name in carried if shown.has_fault(name)}
    suffix = Path(chosen).suffix.lower()
    rows = tuple(
        Row(
            name,
            name,
            as_rgb(rgb(CARRIED_COLOUR)),
            (
                Cell(_FAULT if name in faults else f"{len(carried[name].follower.points):,}"),
                Cell(checked=None if name in faults else not shown.is_hidden(name)),
            ),
            name == chosen,
        )
        for name in carried
    )
    return Section(
        "carried",
        "Carried files",
        (
            Table(
                "carried.list",
                "File",
                (
                    Column("points", "Points"),
                    Column("show", "Show", "A hidden file follows as well"),
                ),
                rows,
                "Saved meshes get them beside, in the same pose",
                n_rows=3,
                visible=bool(rows),
                acts={
                    "select": lambda names: _choosing(next(iter(names), "")),
                    "show": lambda name, on: lambda c: c.widgets.carried.hide(name, not on),
                },
            ),
            (
                Field(
                    "carried.add",
                    "file",
                    "Carry files ...",
                    "Other surfaces, points, curves, grids and landmarks follow the mesh, and are "
                    "kept in the session",
                    several=True,
                    act=actions.carrying,
                ),
                Field(
                    "carried.save",
                    "file",
                    "Save selected ...",
                    "Writes the selected file in this pose",
                    visible=bool(rows),
                    enabled=chosen not in faults,
                    suffixes=(".csv" if suffix in SessionLandmarks.SUFFIXES else suffix,),
                    saves=True,
                    act=partial(actions.saving_carried, chosen),
                ),
                Field(
                    "carried.remove",
                    "button",
                    "Remove",
                    "Stops carrying the selected file",
                    visible=bool(rows),
                    act=lambda _: lambda c: c.session.carried.remove(chosen),
                ),
            ),
        ),
        advice="To move other files along with the mesh",
    )


def _choosing(name: str) -> Action:
    return lambda controller: _chosen.__setitem__(controller, name)
