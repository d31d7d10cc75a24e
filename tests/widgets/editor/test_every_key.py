"""Every key of the editor in mid-drag, while a pose converges, and during a job."""

from __future__ import annotations

import pytest
from key_moments import plain_stand, slow_down, table

from vtk_segdeform.widgets import Mode


def stand_of(make, folder):
    """Yield an editor that all tests share."""
    with pytest.MonkeyPatch.context() as patch:
        slow_down(patch)
        stand = make(folder)
        yield stand
        stand.close()


PAINTING_FIRST = (Mode.REGIONS, Mode.HANDLES, Mode.CAGES, Mode.PULL, Mode.DEFORM)
pytestmark = pytest.mark.usefixtures("bound_once")

# What a key does is tested elsewhere; whether the drag ends before it depends on its kind alone.
IN_MID_DRAG = {
    *("escape", "ctrl+z", "ctrl+s", "4", "backslash", "g", "kp_1", "r", "return", "x"),
}
WHILE_PULLING = {"g", "ctrl+z"}  # where a drag needs the solver, as well as while painting


def mid_drags():
    """Return every mode with every key."""
    parameters = []
    for each in table(*PAINTING_FIRST, daily=IN_MID_DRAG):
        (mode, key), marks = each.values, each.marks
        marks = [] if mode is Mode.PULL and key in WHILE_PULLING else marks
        parameters.append(pytest.param(mode, key, id=each.id, marks=marks))
    return parameters


@pytest.fixture(scope="module")
def plain(tmp_path_factory):
    yield from stand_of(plain_stand, tmp_path_factory.mktemp("plain"))


@pytest.mark.parametrize(("mode", "key"), mid_drags())
def test_in_mid_drag(plain, mode, key):
    plain.during(mode, key)


# One key of each kind: which entries of the table interrupt, the other two moments test.
KINDS = {"escape", "ctrl+z", "4", "g", "x", "ctrl+s", "shift+f"}


@pytest.mark.parametrize("times", [1, pytest.param(2, marks=pytest.mark.campaign)])
@pytest.mark.parametrize(("mode", "key"), table(Mode.DEFORM, Mode.PULL, daily=KINDS))
def test_while_the_pose_converges(plain, mode, key, times):
    plain.just_after(mode, *[key] * times)


@pytest.mark.parametrize(("mode", "key"), table(Mode.DEFORM, Mode.REGIONS, Mode.PULL))
def test_during_a_job(plain, mode, key):
    plain.in_a_job(mode, key)


@pytest.mark.parametrize("during", [True, False])
def test_showing_local_volumes_for_the_first_time(plain, during):
    plain.first_overlay(during=during)
