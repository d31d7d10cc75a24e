"""Listeners that come, go, raise and cause changes while they are being notified."""

from __future__ import annotations

import pytest

from vtk_segdeform.session.listeners import Change, Listeners


def test_a_listener_may_remove_itself():
    listeners, heard = Listeners(), []

    def once(change):
        heard.append(change)
        remove()

    remove = listeners.add(once)
    listeners.notify(Change.POSE)
    listeners.notify(Change.POSE)
    assert heard == [Change.POSE]


def test_a_change_caused_by_a_listener_is_notified_after_the_present_one():
    listeners, heard = Listeners(), []

    def cause(change):
        if change == Change.POSE:
            listeners.notify(Change.HISTORY)

    listeners.add(cause)
    listeners.add(heard.append)
    listeners.notify(Change.POSE)
    assert heard == [Change.POSE, Change.HISTORY]


def test_no_change_is_not_notified():
    listeners, heard = Listeners(), []
    listeners.add(heard.append)
    listeners.notify(Change(0))
    assert heard == []


def test_after_an_exception_the_others_have_heard_and_the_next_change_is_notified():
    listeners, heard = Listeners(), []

    def fail(change):
        raise ZeroDivisionError

    remove = listeners.add(fail)
    listeners.add(heard.append)
    with pytest.raises(ZeroDivisionError):
        listeners.notify(Change.POSE)
    remove()
    listeners.notify(Change.HISTORY)
    assert heard == [Change.POSE, Change.HISTORY]
