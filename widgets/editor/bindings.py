"""The keys of the editor: one table for the key handler, the help card and the documentation.

Each action has a name, by which `keys_of` assigns other keys to it; a preset is such an assignment.
A key of another mode is not passed on to VTK, whose own commands would surprise the user.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from vtk_segdeform.checks import require_sequence, shown
from vtk_segdeform.errors import ArgumentError

from ..region_selector import Paint
from . import actions
from .hints import TOOLS
from .keys import VIEW, Binding, Keys
from .widget_set import Mode

KeyChoice = str | Mapping[str, str | Sequence[str]]
"""A preset, "pyvista" or "Blender", or the keys of some actions by name; see `keys_of`."""

ALL = frozenset(Mode)
P, R, C, H, D = (frozenset({mode}) for mode in Mode)
PAINTING, DRAGGING = R | H, P | D

BINDINGS = (
    *(
        Binding(mode.name.lower(), (str(mode.value),), ALL, label, actions.to_mode(mode))
        for mode, label in (
            (Mode.PULL, "Pull the surface"),
            (Mode.REGIONS, "Regions: paint"),
            (Mode.CAGES, "Cages: drag vertices"),
            (Mode.HANDLES, "Handles: paint"),
            (Mode.DEFORM, "Deform: drag handles"),
        )
    ),
    Binding("segment", ("g",), ALL, "Auto-segment", actions.segment),
    Binding("fit_cages", ("f",), ALL, "Fit cages", actions.fit_cages),
    Binding("undo", ("ctrl+z",), ALL, "Undo", actions.undo),
    Binding("redo", ("ctrl+y", "ctrl+shift+z"), ALL, "Redo", actions.redo),
    Binding("reset_pose", ("home",), ALL, "Reset pose", actions.reset),
    Binding("finish", ("shift+f",), ALL, "Finish pose on the mesh", actions.finish),
    Binding("show_cages", ("c",), ALL, "Show cages in all modes", actions.toggle_cages),
    Binding("preserve_volume", ("p",), ALL, "Preserve volume", actions.toggle_volume),
    Binding(
        "show_holes",
        ("i",),
        ALL,
        "Show holes and changed places",
        actions.toggle_notices,
        while_busy=True,
    ),
    Binding("save", ("ctrl+s",), ALL, "Save", actions.save),
    Binding("open", ("ctrl+o",), ALL, "Open", actions.open_file),
    Binding(
        "help", ("h", "f1", "question"), ALL, "Show keys", lambda c: c.show_keys(), while_busy=True
    ),
    Binding("cancel", ("escape",), ALL, "Cancel", actions.cancel, while_busy=True),
    *(
        Binding(
            TOOLS[tool],
            (key,),
            PAINTING,
            TOOLS[tool].replace("_", " ").capitalize(),
            actions.assigning(actions.selector_of, "tool", tool),
        )
        for tool, key in zip(TOOLS, "bltkr", strict=True)
    ),
    Binding(
        "",
        ("bracketleft", "bracketright"),
        PAINTING,
        "Smaller, larger brush",
        None,
        is_reserved=True,
    ),
    Binding("smaller_limb", ("bracketleft",), P, "Smaller limb", actions.changing_limb(-1)),
    Binding(
        "larger_limb", ("bracketright",), P, "Larger limb, whole body", actions.changing_limb(1)
    ),
    Binding("more_local", ("plus", "equal"), P, "More local", actions.changing_locality(0.1)),
    Binding("less_local", ("minus",), P, "Less local", actions.changing_locality(-0.1)),
    Binding("auto_locality", ("a",), P, "Automatic locality", actions.auto_locality),
    Binding("hinge", ("b",), P, "Bend limbs at the joint: 0, 50, 100 %", actions.next_hinge),
    Binding("remove_pins", ("u",), P, "Remove all points", actions.unpin_all),
    Binding("", ("r",), DRAGGING, "While dragging: turn the limb, turn in the view, move", None),
    Binding("select_through", ("v",), PAINTING, "Select through (X-ray)", actions.toggle_through),
    Binding(
        "grow", ("plus", "equal"), PAINTING, "Grow by one ring", lambda c: c.widgets.selector.grow()
    ),
    Binding(
        "shrink", ("minus",), PAINTING, "Shrink by one ring", lambda c: c.widgets.selector.shrink()
    ),
    Binding("select_all", ("ctrl+a",), PAINTING, "Select all", actions.select_all),
    Binding(
        "select_none",
        ("ctrl+shift+a",),
        H,
        "Select none",
        lambda c: c.widgets.selector.select_none(),
    ),
    Binding("invert", ("ctrl+i",), H, "Invert selection", lambda c: c.widgets.selector.invert()),
    Binding("next_region", ("n", "tab"), R, "Next region", actions.next_region),
    Binding("new_region", ("a",), R, "New region", actions.new_region),
    Binding("merge_region", ("m",), R, "Merge with region under pointer", actions.merge_region),
    Binding("split_region", ("x",), R, "Split region", actions.split_region),
    Binding("paint_stiffness", ("s",), R, "Paint stiffness or regions", actions.toggle_stiffness),
    Binding("paint_fixed", ("s",), H, "Paint fixed vertices", actions.painting(Paint.FIXED)),
    Binding("paint_handle", ("d",), H, "Paint handle", actions.painting(Paint.HANDLE)),
    Binding("new_handle", ("a",), H, "New handle", actions.new_handle),
    Binding("next_handle", ("n", "tab"), H | D, "Next handle", actions.next_handle),
    Binding("remove_handle", ("delete",), H | D, "Remove handle", actions.remove_handle),
    Binding(
        "convert_handle", ("m",), DRAGGING, "Convert pin to handle, or back", actions.convert_handle
    ),
    Binding("local_axes", ("l",), D, "Local or global axes", actions.toggle_local_axes),
    Binding("pivot", ("v",), D, "Move pivot to the pointer, or reset it", actions.move_pivot),
    Binding(
        "show_volume_change", ("o",), P | C | D, "Show local volume change", actions.toggle_overlay
    ),
    Binding(
        "add_landmarks",
        ("shift+k",),
        DRAGGING,
        "Add landmarks by clicks, or stop",
        actions.toggle_landmarks,
    ),
    Binding("keep_part", ("shift+p",), DRAGGING, "Keep volume of part", actions.keep_part),
    Binding("grow_part", ("e",), DRAGGING, "Enlarge part by 20 %", actions.grow_part),
    Binding("", ("x", "y", "z"), DRAGGING, "While dragging: constrain to axis", None),
    Binding("", ("return",), DRAGGING, "After a number: drag by that amount", None),
    # How the mesh is shown.
    Binding("style", ("w",), ALL, "Shaded, with edges, wireframe", actions.next_style),
    Binding("show_regions", ("shift+g",), ALL, "Show regions", actions.toggle_regions),
    Binding("isolate", ("slash",), ALL, "Isolate part, or show everything", actions.isolate),
    Binding("hide_body", ("shift+h",), ALL, "Hide body under pointer", actions.hide_body),
    Binding("lock_body", ("shift+l",), ALL, "Lock or unlock body", actions.lock_body),
    Binding("before_after", ("backslash",), ALL, "Hold: show the mesh at rest", actions.show_rest),
    *(
        Binding(name, (key,), ALL, label, action, while_busy=True, heading=VIEW)
        for name, key, label, action in (
            *(
                (f"view_{name}", key, label, actions.looking_from(name))
                for name, key, label in (
                    ("front", "kp_1", "Front"),
                    ("back", "ctrl+kp_1", "Back"),
                    ("right", "kp_3", "Right"),
                    ("left", "ctrl+kp_3", "Left"),
                    ("top", "kp_7", "Top"),
                    ("bottom", "ctrl+kp_7", "Bottom"),
                    ("home", "kp_0", "Three-quarter view"),
                )
            ),
            ("next_up_axis", "shift+u", "Next up axis", actions.next_up_axis),
            ("projection", "kp_5", "Orthographic or perspective", actions.toggle_projection),
            ("frame_selection", "period", "Frame selection", actions.frame_selection),
            ("frame_all", "comma", "Frame all", actions.frame_all),
        )
    ),
)

# For users of Blender; the other actions have the same keys.
_BLENDER: dict[str, tuple[str, ...]] = {
    "redo": ("ctrl+shift+z", "ctrl+y"),
    "reset_pose": ("alt+g", "alt+r"),
    "show_cages": ("k",),
    "help": ("f1", "question"),
    "style": ("shift+z",),
    "hide_body": ("h",),
    "before_after": ("grave",),
    "brush": ("c",),
    "lasso": ("w",),
    "rectangle": ("b",),
    "connected_part": ("l",),
    "select_through": ("alt+z",),
    "select_all": ("a",),
    "select_none": ("alt+a",),
    "grow": ("ctrl+plus", "plus", "equal"),
    "shrink": ("ctrl+minus", "minus"),
    "new_region": ("shift+a",),
    "new_handle": ("shift+a",),
    "split_region": ("y",),
    "remove_handle": ("x", "delete", "backspace"),
    "frame_all": ("home", "comma"),
}
PRESETS: dict[str, dict[str, tuple[str, ...]]] = {"pyvista": {}, "Blender": _BLENDER}
DEFAULT_KEYS = Keys(BINDINGS)


def keys_of(choice: KeyChoice | Keys) -> Keys:
    """Return the table of keys of a user's *choice*.

    Parameters
    ----------
    choice : str, mapping of str to str or sequence of str, or Keys
        "pyvista" or "Blender", in any case, or the keys of some actions: ``{"undo": "Ctrl+Z"}``.
        The other actions keep the keys of "pyvista"; begin with ``PRESETS["Blender"]`` for others.

    Raises
    ------
    ArgumentError
        If there is no such preset, action or key, or two actions have the same key in one mode.
    """
    if isinstance(choice, Keys):
        return choice
    if isinstance(choice, str):
        found = [changes for name, changes in PRESETS.items() if name.lower() == choice.lower()]
        if not found:
            names = " or ".join(map(repr, PRESETS))
            raise ArgumentError(f"keys must be {names}, or a mapping; got {shown(choice)}")
        return Keys(BINDINGS, found[0], blenders=_BLENDER)
    if not isinstance(choice, Mapping):
        raise ArgumentError(f"keys must be a preset or a mapping; got {shown(choice)}")
    changes = {name: (keys,) if isinstance(keys, str) else keys for name, keys in choice.items()}
    for keys in changes.values():
        require_sequence(keys, "keys")
    return Keys(BINDINGS, changes, blenders=_BLENDER)
