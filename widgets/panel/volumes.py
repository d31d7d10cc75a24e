"""The sections with the volumes of the mesh by name, and with its bodies."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from weakref import WeakKeyDictionary

import numpy as np

from vtk_segdeform.arrays import BoolArray
from vtk_segdeform.geometry import FREE
from vtk_segdeform.pictures import BODY, of_region, rgb
from vtk_segdeform.session import Session, volume_label
from vtk_segdeform.solver import Bodies

from ..editor import Action, Controller, DeformEditor, actions
from ..volume_overlay import brief, in_tenths, percent
from .fields import Cell, Column, Field, Row, Section, Table, as_rgb, key_button, option

_LEAST, _MOST = -80.0, 200.0  # per cent, of the slider
_DEFAULT, _KEEP, _FREE, _SET = "default", "keep", "free", "set"
_GOALS = (("As by default", _DEFAULT), ("Kept", _KEEP), ("Free", _FREE), ("Set", _SET))
_OTHERS = ("area", "centroid x", "centroid y", "centroid z")  # of the whole
_MOST_BODIES, _AUTO, _NOTHING = 12, "auto", "Nothing"
_COLUMNS = (
    Column("volume", "Volume", "In the unit of the mesh, cubed"),
    Column("change", "Change"),
    Column("follows", "Follows"),
    Column("show", "Show", "A hidden body cannot be picked or painted"),
    Column("lock", "Lock", "A locked body stays where it is: its vertices are fixed"),
)
_SYMMETRY = (("None", "none"), ("X", "x"), ("Y", "y"), ("Z", "z"), ("Auto", "auto"))
_chosen: WeakKeyDictionary[Controller, str] = WeakKeyDictionary()
_bodies: WeakKeyDictionary[Session, Bodies] = WeakKeyDictionary()


def volumes_section(editor: DeformEditor) -> Section:
    """Return the volume that is chosen, with its goal, and the plane of symmetry."""
    session, controller = editor.session, editor.controller
    names = session.volume_names if session.has_volume else ()
    names = (*names, *_OTHERS) if names else ()
    name = _chosen.get(controller, "whole")
    name = name if name in names else next(iter(names), "")
    volume, change = session.volume(name) if name else (0.0, 0.0)
    goal = dict(session.options.volumes).get(name, _DEFAULT)
    kind = goal if goal in (_DEFAULT, _KEEP, _FREE) else _SET
    part = editor.widgets.part
    has_part, is_place = part in names, name.startswith("centroid")  # which is kept or free
    return Section(
        "volumes",
        "Volumes",
        (
            Field(
                "volumes.name",
                "choice",
                "Volume of",
                "The volume of the whole, a body, a cavity, a wall or a region; the area "
                "or a coordinate of the centroid",
                value=name or "-",
                enabled=len(names) > 1,
                choices=tuple((_label(session, each), each) for each in names) or (("-", "-"),),
                act=_choosing,
            ),
            Field(
                "volumes.value",
                "label",
                "Now",
                "In the mesh's unit, cubed for a volume, and how much it has changed; a centroid "
                "in diagonals",
                value=f"{volume:.5g} ({percent(change)})" if name else "-",
            ),
            Field(
                "volumes.change",
                "slider",
                "Change",
                "Changes the volume to more or less than at rest",
                value=min(max(round(100.0 * change), _LEAST), _MOST),
                enabled=bool(name) and not is_place,
                minimum=_LEAST,
                maximum=_MOST,
                unit="%",
                on_release=True,
                act=lambda share: actions.setting_volume(name, f"{share:+g}%", join=True),
            ),
            Field(
                "volumes.goal",
                "choice",
                "Goal",
                "Whether this volume is kept as at rest, set to its change, or free",
                value=kind,
                enabled=bool(name),
                choices=_GOALS[:-1] if is_place else _GOALS,
                act=lambda kind: _with_goal(name, kind, change),
            ),
            (
                Field(
                    "volumes.keep_part",
                    "toggle",
                    f"Keep {_short(session, part) if part else 'region'}",
                    "Keeps the volume of the region of the pulled point or active handle",
                    "keep_part",
                    value=has_part and editor.widgets.keeps(part),
                    enabled=has_part,
                    act=lambda _: actions.keeping(part),
                ),
                key_button(
                    editor.keys,
                    "volumes.grow_part",
                    "grow_part",
                    "Enlarge by 20 %",
                    enabled=has_part,
                    act=lambda _: actions.growing(part),
                ),
            ),
            Field(
                "volumes.symmetry",
                "choice",
                "Symmetry",
                "Mirrors motions on the other side of the plane with this normal",
                value=session.options.symmetry or "none",
                choices=_SYMMETRY,
                act=lambda axis: option("symmetry")(None if axis == "none" else axis),
            ),
        ),
        advice="To keep or set volumes, symmetry",
    )


def bodies_section(editor: DeformEditor) -> Section:
    """Return the largest bodies, if there are several, and what they follow."""
    session, name = editor.session, _chosen.get(editor.controller, "")
    if session.bodies is not None:
        _bodies[session] = session.bodies
    bodies = _bodies.get(session)  # they are the same while other cages are being bound
    count, shown = 0, dict[str, int | None]()
    if bodies is not None:
        count = int(np.count_nonzero(bodies.volumes > 0.0))
        largest = np.argsort(-bodies.volumes, kind="stable")[: min(count, _MOST_BODIES)]
        shown = {f"body {k}": _component(bodies, k) for k in largest.tolist()}
    name = name if name in shown else next(iter(shown), "")
    component = shown.get(name)
    attached = _AUTO
    choices = [("Automatic", _AUTO), (_NOTHING, FREE)]
    if bodies is not None and component is not None:
        attached = str(dict(session.options.attach).get(component, _AUTO))
        others = {str(c) for c in shown.values() if c is not None} | {attached}
        others -= {str(component), _AUTO, FREE}
        choices += [(_carrier(bodies, int(c)), c) for c in sorted(others, key=int)]
    return Section(
        "bodies",
        "Bodies",
        (
            Table(
                "bodies.list",
                "Body",
                _COLUMNS,
                tuple(_row(editor, each, c, is_chosen=each == name) for each, c in shown.items()),
                "The closed parts of the mesh, the largest first. "
                "The selected one is that of the section Volumes as well",
                n_rows=5,
                acts={
                    "select": lambda keys: _choosing(next(iter(keys), "")),
                    "show": lambda key, on: _to_body(key, actions.hiding, hidden=not on),
                    "lock": lambda key, on: _to_body(key, actions.locking, locked=on),
                },
            ),
            Field(
                "bodies.more",
                "label",
                "Not listed",
                "Bodies that are smaller than those in the list",
                value=f"{count - len(shown):,} smaller ones",
                visible=count > len(shown),
            ),
            Field(
                "bodies.follows",
                "choice",
                "Follows",
                "What the selected body moves with; it gets other regions and cages at once",
                value=attached,
                enabled=component is not None,
                choices=tuple(choices),
                act=partial(
                    _attaching,
                    volume_label(session.state.region_names, name),
                    component or 0,
                    tuple(choices),
                ),
            ),
        ),
        visible=count > 1,
    )


def _attaching(
    label: str, component: int, choices: tuple[tuple[str, str], ...], carrier: str
) -> Action:
    """Return the action that lets the body called *label* follow another one."""
    what = next(text for text, each in choices if each == carrier).lower()
    what = "automatically" if carrier == _AUTO else what
    return actions.attaching(component, carrier, f"{label} follows {what}")


def _component(bodies: Bodies, body: int) -> int | None:
    """Return the outer component of a *body*; None for a chamber, which has none of its own."""
    own = np.setdiff1d(np.flatnonzero(bodies.of_component == body), bodies.cavities)
    return int(own[0]) if len(own) else None


def _row(editor: DeformEditor, name: str, component: int | None, *, is_chosen: bool) -> Row:
    session = editor.session
    bodies, regions = _bodies[session], session.regions
    volume = change = follows = ""
    own, _ = _body(session, name)
    only = editor.widgets.surface.only
    shown = locked = None  # a chamber has no vertices of its own
    if component is not None:
        shown = only is None or bool(only[own].any())
        locked = actions.is_locked(session, own)
    if session.bodies is not None:
        share = editor.widgets.overlay.region_volumes.change(name)
        rest = float(bodies.volumes[int(name.rpartition(" ")[2])])
        volume, change = f"{rest * (1.0 + share):.4g}", in_tenths(share)
    colour = rgb(BODY)
    if component is not None and regions is not None:
        carrier = component if regions.carrier is None else int(regions.carrier[component])
        follows = _NOTHING if carrier == component else _carrier(bodies, carrier)
        colour = of_region(regions.label_at(int((session.mesh.components == component).argmax())))
    cells = Cell(volume), Cell(change), Cell(follows), Cell(checked=shown), Cell(checked=locked)
    return Row(name, _label(session, name), as_rgb(colour), cells, is_chosen)


def _body(session: Session, name: str) -> tuple[BoolArray, str]:
    """Return the vertices of a body, a mask (n,), and what it is called."""
    numbers = _bodies[session].of_component[session.mesh.components]
    return np.asarray(numbers == int(name.rpartition(" ")[2])), _label(session, name)


def _to_body(name: str, action: Callable[..., Action], **how: bool) -> Action:
    return lambda controller: action(*_body(controller.session, name), **how)(controller)


def _carrier(bodies: Bodies, component: int) -> str:
    body = int(bodies.of_component[component])
    return f"Body {body + 1}" if body >= 0 else f"Component {component + 1}"


def _label(session: Session, name: str) -> str:
    label = volume_label(session.state.region_names, name)
    return label[:1].upper() + label[1:]


def _short(session: Session, name: str) -> str:
    label = volume_label(session.state.region_names, name)
    return brief(label, label)


def _choosing(name: str) -> Action:
    def choose(controller: Controller) -> None:
        _chosen[controller] = name

    return choose


def _with_goal(name: str, kind: str, change: float) -> Action:
    goal = f"{100.0 * change:+.6g}%" if kind == _SET else kind
    return actions.setting_volume(name, None if kind == _DEFAULT else goal)
