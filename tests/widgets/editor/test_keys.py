"""Keys by choice: presets, conflicts, and what an editor shows and does with them."""

from __future__ import annotations

import pytest
from hands import Hand, plain_view
from scenes import sausage

from vtk_segdeform import Session
from vtk_segdeform.errors import ArgumentError
from vtk_segdeform.widgets.editor.bindings import BINDINGS, PRESETS, keys_of
from vtk_segdeform.widgets.editor.editor import DeformEditor, Mode
from vtk_segdeform.widgets.editor.hints import hint
from vtk_segdeform.widgets.editor.keys import event_key, key_cap, key_name

pytestmark = pytest.mark.usefixtures("unprepared")


@pytest.fixture
def editor():
    """Yield an editor of a session without regions, in mode 3, and a hand."""
    view = plain_view()
    made = DeformEditor(view, Session(sausage(is_coarse=True).mesh))
    made.mode = Mode.HANDLES
    made.On()
    view.render()
    hand = Hand(view)
    yield made, hand
    made.remove()


def test_every_action_has_a_name_and_every_preset_is_without_conflicts():
    names = [b.name for b in BINDINGS if b.action]
    assert "" not in names
    assert len(names) == len(set(names))
    assert not any(b.name for b in BINDINGS if b.action is None)
    for preset in PRESETS:
        keys = keys_of(preset.upper())
        assert all(keys[name].keys for name in names)
        for b in keys.bindings:
            assert [key_name(key_cap(key)) for key in b.keys] == [*b.keys]


KNOWN = """
pull 0, regions 1, cages 2, handles 3, deform 4, segment g, fit_cages f, undo ctrl+z,
redo ctrl+y ctrl+shift+z, reset_pose home, finish shift+f, show_cages c, preserve_volume p,
show_holes i, save ctrl+s, open ctrl+o, help h f1 question, cancel escape, brush b, lasso l,
rectangle t, connected_part k, whole_region r, more_local plus equal, less_local minus,
auto_locality a, remove_pins u, select_through v, grow plus equal, shrink minus,
select_all ctrl+a, select_none ctrl+shift+a, invert ctrl+i, next_region n tab, new_region a,
merge_region m, split_region x, paint_fixed s, paint_handle d, new_handle a, next_handle n tab,
remove_handle delete, convert_handle m, local_axes l, pivot v, show_volume_change o,
style w, show_regions shift+g, before_after backslash, view_front kp_1, view_back ctrl+kp_1,
view_right kp_3, view_left ctrl+kp_3, view_top kp_7, view_bottom ctrl+kp_7, view_home kp_0,
projection kp_5, frame_selection period, frame_all comma, keep_part shift+p, grow_part e,
paint_stiffness s, smaller_limb bracketleft, larger_limb bracketright,
hinge b,
isolate slash, next_up_axis shift+u, add_landmarks shift+k, hide_body shift+h, lock_body shift+l
"""


def test_names_that_settings_and_scripts_contain_and_keys_that_hands_know_remain():
    known = {name: tuple(keys) for name, *keys in map(str.split, KNOWN.split(","))}
    assert {b.name: b.keys for b in keys_of("pyvista").bindings if b.name} == known


def test_caps_of_keys_that_have_names_of_their_own():
    marks = {
        "question": "?", "bracketleft": "[", "bracketright": "]", "plus": "+", "minus": "-",
        "backslash": "\\", "period": ".", "comma": ",", "equal": "=", "semicolon": ";",
        "apostrophe": "'", "grave": "`", "slash": "/",
    }  # fmt: skip
    words = {
        "page_up": "PgUp", "page_down": "PgDown", "insert": "Ins", "delete": "Del",
        "escape": "Esc", "return": "Enter", "ctrl+shift+a": "Ctrl+Shift+A", "kp_1": "Num 1",
    }  # fmt: skip
    for name, cap in (marks | words).items():
        assert key_cap(name) == cap
        assert key_name(cap) == name
    symbols = {
        "Prior": "page_up", "Next": "page_down", "quoteright": "apostrophe", "quoteleft": "grave",
        "KP_Add": "plus", "KP_Subtract": "minus", "KP_Decimal": "period", "ISO_Left_Tab": "tab",
        "KP_Home": "kp_7", "KP_Insert": "kp_0", "KP_Begin": "kp_5",
    }  # fmt: skip
    for symbol, name in symbols.items():
        assert event_key(symbol, control=False, alt=False, shift=False) == name


class Nameless:
    """Has no text."""

    def __repr__(self) -> str:
        raise RuntimeError


@pytest.mark.parametrize(
    ("choice", "message"),
    [
        ({"undo": "ctrl+y"}, "Ctrl.Y is assigned to both 'Undo' and 'Redo'"),
        ({"grow": "["}, r"\[ is assigned to both 'Grow by one ring' and 'Smaller, larger brush'"),
        ({"und": "k"}, "no action 'und'; did you mean 'undo'"),
        ({"undo": "Ctrl+Foo Bar"}, "no such key as 'Ctrl.Foo Bar'"),
        ({"undo": 3}, "must be a sequence"),
        ({"undo": [3]}, "a key must be a text"),
        ("emacs", "'pyvista' or 'Blender'"),
        (3, "a preset or a mapping"),
        ({Nameless(): "u"}, "keys: there is no action"),
    ],
)
def test_an_invalid_choice_is_named(choice, message):
    with pytest.raises(ArgumentError, match=message):
        keys_of(choice)


def test_shift_counts_with_letters_only_and_modifiers_have_one_order():
    assert key_name("shift+ctrl+Z") == "ctrl+shift+z"
    assert key_name("Shift+?") == event_key("question", control=False, alt=False, shift=True)
    assert key_name("Ctrl++") == event_key("KP_Add", control=True, alt=False, shift=False)


@pytest.mark.parametrize(
    ("symbol", "digit"),
    [("KP_Insert", 0), ("KP_End", 1), ("KP_Next", 3), ("KP_Page_Down", 3), ("KP_Begin", 5),
     ("KP_Home", 7)],
)  # fmt: skip
def test_the_keypad_is_the_same_without_num_lock(symbol, digit):
    plain = {"control": False, "alt": False, "shift": False}
    assert event_key(symbol, **plain) == event_key(f"KP_{digit}", **plain) == f"kp_{digit}"
    assert event_key(str(digit), **plain) == str(digit)


def test_the_chosen_keys_act_and_are_named_in_hints_errors_and_help(editor):
    editor, hand = editor
    editor.keys = {"undo": "j", "next_handle": "Ctrl+J", "paint_handle": "f5", "finish": []}
    session = editor.session
    session.set_fixed([1, 2])
    hand.key("z", control=True)
    assert len(session.fixed) == 2
    hand.key("j")
    assert len(session.fixed) == 0
    editor.widgets.selector.paints = editor.widgets.selector.paints.FIXED
    assert "Next: F5, paint a handle" in hint(editor.widgets, Mode.HANDLES, editor.keys)
    hand.key("j", control=True)
    assert "In mode 3, press F5 and paint one" in editor.status
    hand.failures.clear()
    rows = [row for _, rows in editor.controller.help.sections for row in rows]
    assert ("J", "Undo") in rows
    assert not any(label == "Finish pose on the mesh" for _, label in rows)
    with pytest.raises(ArgumentError):
        editor.keys = {"undo": "ctrl+y"}
    assert editor.keys.cap("undo") == "J"
    assert editor.keys.cap("finish") == "Finish pose on the mesh"
