"""The single timer of an interactor: shared, and running only while a subscriber needs it.

The host of most tests stops all timers when one is destroyed, as pyvistaqt does.
"""

from __future__ import annotations

import gc
import weakref

import pytest
import pyvista as pv
from hands import OneTimerHost, plain_view
from vtkmodules.vtkRenderingCore import vtkRenderer

from vtk_segdeform.widgets.scene.view import View


@pytest.fixture
def view():
    return plain_view((60, 60))


@pytest.fixture
def host(view):
    """Return the event loop of *view*; no timer may be left at the end of a test."""
    host = OneTimerHost(view.interactor)
    yield host
    assert not host.is_running


def test_stopping_one_callback_leaves_the_others_running(view, host):
    heard = []
    stops = [view.every(40, lambda k=k: heard.append(k)) for k in range(3)]
    host.tick()
    assert heard == [0, 1, 2]
    stops[1]()
    stops[1]()  # the second call does nothing
    host.tick()
    assert heard == [0, 1, 2, 0, 2]
    stops[0]()
    host.tick()
    assert heard[5:] == [2]
    stops[2]()
    assert not host.is_running


def test_the_timer_has_the_shortest_required_period(view, host):
    stops = [view.every(period, list) for period in (40, 20, 30, 20)]
    assert host.made == [40, 20]
    stops[1]()
    assert host.made == [40, 20]
    stops[3]()
    assert host.made == [40, 20, 30]
    stops[2]()
    assert host.made == [40, 20, 30, 40]
    stops[0]()
    view.every(40, list)()
    assert host.made == [40, 20, 30, 40, 40]


def test_a_callback_may_stop_itself_and_others_and_start_others(view, host):
    heard, stops = [], {}

    def first():
        heard.append("first")
        for name in ("first", "last"):
            stops[name]()
        stops["new"] = view.every(10, lambda: heard.append("new"))

    stops["first"] = view.every(20, first)
    stops["middle"] = view.every(20, lambda: heard.append("middle"))
    stops["last"] = view.every(20, lambda: heard.append("last"))
    host.tick()
    assert heard == ["first", "middle"]
    host.tick()
    assert heard == ["first", "middle", "middle", "new"]
    stops["middle"]()
    stops["new"]()


@pytest.mark.parametrize("is_heard", [True, False])
def test_a_callback_that_raises_does_not_stop_the_others(view, host, capfd, is_heard):
    heard, failures = [], []
    if is_heard:
        view.on_failure(failures.append)

    def fails():
        raise RuntimeError("out of order")

    stops = [view.every(20, fails), view.every(20, lambda: heard.append("tick"))]
    host.tick(3)
    assert heard == ["tick"] * 3
    assert [str(failure) for failure in failures] == ["out of order"] * 3 * is_heard
    assert (
        "out of order" in capfd.readouterr().err
    ) is not is_heard  # VTK prints unhandled exceptions
    for stop in stops:
        stop()


def test_views_of_one_interactor_share_it(view, host):
    renderer = vtkRenderer()
    view.window.AddRenderer(renderer)
    other, heard = View(renderer, view.interactor), []
    stops = [each.every(20, lambda k=k: heard.append(k)) for k, each in enumerate((view, other))]
    assert host.made == [20]
    stops[0]()
    host.tick()
    assert heard == [1]
    stops[1]()


@pytest.mark.parametrize("kind", ["CreateRepeatingTimer", "CreateOneShotTimer"])
def test_it_keeps_running_when_a_foreign_timer_ends(view, host, kind):
    heard = []
    stop = view.every(20, lambda: heard.append("tick"))
    host.tick()
    theirs = getattr(view.interactor, kind)(50)
    host.tick()
    view.interactor.DestroyTimer(theirs)
    host.tick(2)
    assert heard == ["tick"] * 4
    stop()
    view.interactor.DestroyTimer(getattr(view.interactor, kind)(50))  # ours has no subscribers now
    assert not host.is_running


def test_stopping_after_the_window_is_closed_is_harmless():
    plotter = pv.Plotter(off_screen=True)
    view = View.of(plotter)
    stop = view.every(20, list)
    plotter.close()
    stop()
    gone = weakref.ref(view)
    del view, stop
    gc.collect()
    assert gone() is None


def test_a_timer_that_was_not_stopped_keeps_nothing_alive():
    view = plain_view((60, 60), is_own=True)
    OneTimerHost(view.interactor)
    view.every(20, view.request_render)
    gone = weakref.ref(view), weakref.ref(view.interactor)
    del view
    gc.collect()
    assert [each() for each in gone] == [None, None]
