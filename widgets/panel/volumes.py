"""The section with the volumes of the mesh by name, and the plane of symmetry."""

from __future__ import annotations

from weakref import WeakKeyDictionary

from vtk_segdeform.session import Session

from ..editor import Action, Controller, DeformEditor, actions
from ..volume_overlay import brief, percent
from .fields import Field, Section, key_button, option

_LEAST, _MOST = -80.0, 200.0  # per cent, of the slider
_LIVE = 20_000  # vertices up to which a volume follows the slider; of more, when it is released
_DEFAULT, _KEEP, _FREE, _SET = "default", "keep", "free", "set"
_GOALS = (("As by default", _DEFAULT), ("Kept", _KEEP), ("Free", _FREE), ("Set", _SET))
_SYMMETRY = (("None", "none"), ("X", "x"), ("Y", "y"), ("Z", "z"), ("Auto", "auto"))
_chosen: WeakKeyDictionary[Controller, str] = WeakKeyDictionary()


def volumes_section(editor: DeformEditor) -> Section:
    """Return the volume that is chosen, with its goal, and the plane of symmetry."""
    session, controller = editor.session, editor.controller
    is_ready = session.is_bound and session.has_volume
    names = session.deformer.volume_names if is_ready else ()
    name = _chosen.get(controller, "whole")
    name = name if name in names else next(iter(names), "")
    volume, change = session.volume(name) if name else (0.0, 0.0)
    goal = dict(session.options.volumes).get(name, _DEFAULT)
    kind = goal if goal in (_DEFAULT, _KEEP, _FREE) else _SET
    part = editor.widgets.part
    has_part = part in names
    return Section(
        "volumes",
        "Volumes",
        (
            Field(
                "volumes.name",
                "choice",
                "Volume of",
                "A volume of the mesh: of the whole, a body, a cavity, a wall or a region",
                value=name or "-",
                enabled=len(names) > 1,
                choices=tuple((_label(session, each), each) for each in names) or (("-", "-"),),
                act=_choosing,
            ),
            Field(
                "volumes.value",
                "label",
                "Now",
                "Its volume, in the unit of the mesh cubed, and how much it has changed",
                value=f"{volume:.5g} ({percent(change)})" if name else "-",
            ),
            Field(
                "volumes.change",
                "slider",
                "Change",
                "Changes the volume to more or less than at rest",
                value=min(max(round(100.0 * change), _LEAST), _MOST),
                enabled=bool(name),
                minimum=_LEAST,
                maximum=_MOST,
                unit="%",
                on_release=session.mesh.n_vertices > _LIVE,
                act=lambda share: actions.setting_volume(name, f"{share:+g}%", join=True),
            ),
            Field(
                "volumes.goal",
                "choice",
                "Goal",
                "Whether this volume is kept as at rest, set to its change, or free",
                value=kind,
                enabled=bool(name),
                choices=_GOALS,
                act=lambda kind: _with_goal(name, kind, change),
            ),
            (
                Field(
                    "volumes.keep_part",
                    "toggle",
                    f"Keep {_short(session, part) if part else 'region'}",
                    "Keeps the volume of the region of the pulled point or active handle",
                    "keep_part",
                    value=has_part and editor.widgets.keeps_part,
                    enabled=has_part,
                    act=lambda _: actions.keep_part,
                ),
                key_button(
                    editor.keys,
                    "volumes.grow_part",
                    "grow_part",
                    "Enlarge by 20 %",
                    enabled=has_part,
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
    )


def _label(session: Session, name: str) -> str:
    label = session.volume_label(name)
    return label[:1].upper() + label[1:]


def _short(session: Session, name: str) -> str:
    label = session.volume_label(name)
    return brief(label, label)


def _choosing(name: str) -> Action:
    def choose(controller: Controller) -> None:
        _chosen[controller] = name

    return choose


def _with_goal(name: str, kind: str, change: float) -> Action:
    if kind == _DEFAULT:
        return lambda controller: controller.session.forget_volume(name)
    return actions.setting_volume(name, f"{100.0 * change:+.6g}%" if kind == _SET else kind)
