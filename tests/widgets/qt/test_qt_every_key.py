"""Every key of the editor in mid-drag, while a pose converges, and during a job, in Qt.

The checks are those of `key_moments`; in addition, the panel must be enabled again.
"""

from __future__ import annotations

import pytest
from campaign import every
from key_moments import KEYS, slow_down, table
from qt_moments import QtStand

from vtk_segdeform.widgets import Mode
from vtk_segdeform.widgets.editor.keys import pressed_key


@pytest.fixture(
    scope="module", params=["seldom-drawn", pytest.param("drawn", marks=pytest.mark.campaign)]
)
def stand(request, tmp_path_factory):
    """Yield an editor that all tests share."""
    with pytest.MonkeyPatch.context() as patch:
        slow_down(patch)
        stand = QtStand(tmp_path_factory.mktemp("qt"), is_drawn=request.param == "drawn")
        yield stand
        stand.close()


# Keys that cancel, that are shortcuts, that open another session, or that edit a number.  That Qt
# names the others as the editor does is tested once, for all of them.
KEYS_OF_QT = {"escape", "ctrl+z", "ctrl+o", "backspace"}
# A key that Qt delivers in mid-drag it delivers at the other moments too.
DELIVERED = {"escape", "ctrl+z"}
MOMENTS = pytest.mark.parametrize("during", every(2, [True, False]))


def without_tab(moments):
    """Return the *moments* but those of Tab, with which Qt moves the focus."""
    return [each for each in moments if each.values[1] != "tab"]


def test_every_key_arrives_by_its_name(stand):
    typed, view = [], stand.editor.view
    stand.begin(Mode.REGIONS)

    def read():
        typed.append(pressed_key(view.interactor))
        return True  # so that nobody acts on it

    keys = [key for key in KEYS if key != "tab"]  # with which Qt moves the focus
    stop = view.observe("KeyPressEvent", read, 1e3)
    for key in keys:
        stand.hand.types(key)
    stop()
    modifiers = "control_l", "shift_l"  # which are pressed first
    assert [key for key in typed if not key.endswith(modifiers)] == keys


@pytest.mark.parametrize(
    ("mode", "key"), without_tab(table(Mode.PULL, Mode.DEFORM, daily=KEYS_OF_QT))
)
def test_in_mid_drag(stand, mode, key):
    stand.during(mode, key)


@pytest.mark.parametrize(("mode", "key"), table(Mode.DEFORM, daily=DELIVERED))
def test_while_the_pose_converges(stand, mode, key):
    stand.just_after(mode, key)


@pytest.mark.parametrize(("mode", "key"), table(Mode.DEFORM, daily=DELIVERED))
def test_during_a_job(stand, mode, key):
    stand.in_a_job(mode, key)


@MOMENTS
def test_showing_local_volumes_for_the_first_time(stand, during):
    stand.first_overlay(during=during)
