"""The input of a page, its timers and its pictures, without a browser."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import pytest
from hands import plain_view

pytest.importorskip("trame")

from vtk_segdeform.errors import ArgumentError
from vtk_segdeform.widgets.editor import keys_of
from vtk_segdeform.widgets.editor.keys import event_key
from vtk_segdeform.widgets.scene import View
from vtk_segdeform.widgets.web import pictures
from vtk_segdeform.widgets.web import stream as stream_module
from vtk_segdeform.widgets.web.inputs import Inputs
from vtk_segdeform.widgets.web.key_names import vtk_key
from vtk_segdeform.widgets.web.stream import Stream
from vtk_segdeform.widgets.web.timers import Timers

IDLE: Any = SimpleNamespace(  # what a page draws that cannot
    is_dragging=False, is_possible=False, announce=lambda: None, note_picture=lambda: None
)
_MIDDLE = {"x": 0.5, "y": 0.25}
# What a browser calls the keys whose names in a table are words.
_BROWSER = {
    "escape": "Escape", "return": "Enter", "tab": "Tab", "delete": "Delete", "home": "Home",
    "backspace": "Backspace", "bracketleft": "[", "bracketright": "]", "plus": "+",
    "minus": "-", "equal": "=", "period": ".", "comma": ",", "backslash": "\\", "grave": "`",
    "question": "?", "f1": "F1", "slash": "/",
}  # fmt: skip


class Loop:
    """An event loop's clock, moved by hand."""

    def __init__(self) -> None:
        self.now, self.due = 0.0, []  # type: ignore[var-annotated]

    def time(self) -> float:
        return self.now

    def call_at(self, when: float, call: Callable[[], None]) -> Any:
        entry = [when, call]
        self.due.append(entry)

        class Handle:
            cancel = staticmethod(lambda: self.due.remove(entry) if entry in self.due else None)

            @staticmethod
            def when() -> float:
                return when

        return Handle

    def run(self, seconds: float) -> None:
        end = self.now + seconds
        while self.due and min(at for at, _ in self.due) <= end + 1e-9:
            entry = min(self.due, key=lambda each: each[0])
            self.due.remove(entry)
            self.now, call = entry
            call()
        self.now = max(self.now, end)


def started(view: View) -> tuple[Loop, Timers]:
    """Return a loop, and the timers of *view* that it fires."""
    loop, timers = Loop(), Timers(view.interactor)
    timers.start(loop)  # type: ignore[arg-type]
    return loop, timers


@pytest.fixture
def view() -> Any:
    view = plain_view((200, 100))
    view.interactor.SetInteractorStyle(None)
    view.window.Render()
    return view


def _received(view: View, *names: str) -> list[tuple[Any, ...]]:
    """Return the events that the view receives from now on, with their places."""
    found: list[tuple[Any, ...]] = []
    for name in names:
        view.interactor.AddObserver(
            f"{name}Event",
            lambda *_, name=name: found.append((name, *view.interactor.GetEventPosition())),
        )
    return found


def test_timers_fire_while_they_run_and_not_otherwise(view: View) -> None:
    loop, ticks, others = Loop(), [], []
    timers = Timers(view.interactor)
    stop = view.every(20, lambda: ticks.append(loop.now))
    timers.start(loop)  # type: ignore[arg-type]
    loop.run(0.1)
    assert ticks == pytest.approx([0.02, 0.04, 0.06, 0.08, 0.1])
    stop_other = view.every(5, lambda: others.append(loop.now))
    loop.run(0.02)
    assert len(others) == 4
    assert len(loop.due) == 1  # both share one timer
    stop()
    stop_other()
    assert loop.due == []
    view.interactor.CreateOneShotTimer(30)
    loop.run(1.0)
    assert loop.due == []
    view.every(20, lambda: None)
    timers.stop()
    assert loop.due == []


def test_timers_wait_for_input_but_not_for_long(view: View) -> None:
    loop, timers = started(view)
    ticks: list[float] = []
    view.every(40, lambda: ticks.append(loop.now))
    for _ in range(80):  # input every 0.03 seconds
        loop.run(0.03)
        timers.postpone()
    assert ticks == pytest.approx([1.0, 2.0])
    loop.run(0.1)
    assert ticks[2:] == pytest.approx([2.44, 2.48])
    view.interactor.CreateOneShotTimer(30)
    for _ in range(3):
        loop.run(0.02)
        timers.postpone()
    assert len(loop.due) == 1  # a timer that fires once does not wait
    timers.stop()


def test_a_timer_may_be_postponed_by_less_than_its_period(view: View) -> None:
    loop, timers = started(view)
    ticks: list[float] = []
    view.every(40, lambda: ticks.append(loop.now))
    loop.run(0.02)
    timers.postpone(0.01)  # it is not due before that
    loop.run(0.015)
    timers.postpone(0.01)
    loop.run(0.02)
    assert ticks == pytest.approx([0.045])
    timers.stop()


def receive(stream: Stream, x: float, turns: int) -> None:
    """Let *stream* receive a move after some turns of the event loop."""
    if turns:
        asyncio.get_running_loop().call_soon(receive, stream, x, turns - 1)
    else:
        stream.put([{"name": "MouseMove", "x": x, "y": 0.5}])


def test_a_move_is_replaced_by_one_that_takes_two_more_turns_to_be_read(view: View) -> None:
    places: list[int] = []

    async def story() -> None:
        stream = Stream(view, Timers(view.interactor), lambda *_: None, lambda: None, IDLE)
        stream.start(asyncio.get_running_loop())
        place = view.interactor.GetEventPosition
        view.interactor.AddObserver("MouseMoveEvent", lambda *_: places.append(place()[0]))
        receive(stream, 0.2, turns=1)
        receive(stream, 0.4, turns=3)
        while not places:
            await asyncio.sleep(0.01)
        await stream.stop()

    asyncio.run(asyncio.wait_for(story(), 20.0))
    assert places == [80]


def test_what_arrives_during_a_drawing_comes_before_timers_and_after_its_picture(
    view: View, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen: list[object] = []
    encoded = pictures._encoded

    def slowly(*words: Any, **more: Any) -> pictures.Picture:
        time.sleep(0.02)
        return encoded(*words, **more)

    monkeypatch.setattr(pictures, "_encoded", slowly)
    monkeypatch.setattr(stream_module, "_RECEIVING", 0.2)
    monkeypatch.setattr(stream_module, "_EXCHANGE", 20.0)
    monkeypatch.setattr(stream_module, "_REST", 20.0)

    async def story() -> None:
        loop = asyncio.get_running_loop()
        timers = Timers(view.interactor)
        stream = Stream(view, timers, lambda _, number: seen.append(number), lambda: None, IDLE)
        stream.start(loop)
        stream.open(200, 100)
        while seen != [1]:
            await asyncio.sleep(0.01)
        stream.shown(1)

        def draw_slowly(*_: object) -> None:
            time.sleep(0.25)  # more than the period of the timer
            receive(stream, 0.2, turns=3)
            receive(stream, 0.4, turns=5)

        tag = view.window.AddObserver("EndEvent", draw_slowly)
        place = view.interactor.GetEventPosition
        view.interactor.AddObserver("MouseMoveEvent", lambda *_: seen.append(place()[0]))
        view.every(200, lambda: seen.append("tick"))
        stream.want()
        while len(seen) < 4:
            await asyncio.sleep(0.01)
            view.window.RemoveObserver(tag)
        await stream.stop()

    asyncio.run(asyncio.wait_for(story(), 20.0))
    assert seen == [1, 2, 80, "tick"]


def test_a_picture_names_the_last_event_that_it_shows(view: View) -> None:
    sent: list[Any] = []

    async def story() -> None:
        stream = Stream(
            view,
            Timers(view.interactor),
            lambda picture, _: sent.append(picture),
            lambda: None,
            IDLE,
        )
        stream.start(asyncio.get_running_loop())
        stream.open(200, 100)
        while len(sent) < 1:
            await asyncio.sleep(0.01)
        moves = [{"name": "MouseMove", **_MIDDLE, "time": time} for time in (7.5, 8.5)]
        stream.put([*moves])
        view.render()
        while len(sent) < 2:
            await asyncio.sleep(0.01)
        await stream.stop()

    asyncio.run(asyncio.wait_for(story(), 20.0))
    assert [picture.time for picture in sent] == [0.0, 8.5]
    with pytest.raises(ArgumentError, match="time must be a number"):
        Inputs(view).put({"name": "MouseMove", **_MIDDLE, "time": "now"})


@pytest.mark.parametrize("preset", ["pyvista", "Blender"])
def test_every_key_of_the_editor_can_be_typed_in_a_browser(preset: str) -> None:
    for binding in keys_of(preset).bindings:
        for name in binding.keys:
            *held, word = name.split("+")
            key, place = _BROWSER.get(word, word), ""
            if word.startswith("kp_"):
                key, place = word[-1], f"Numpad{word[-1]}"
            elif "shift" in held:
                key = key.upper()
            named = vtk_key(key, place)
            assert named is not None, name
            typed = event_key(
                named[0], control="ctrl" in held, alt="alt" in held, shift="shift" in held
            )
            assert typed == name


def test_an_arrow_and_a_modifier_have_vtks_names_and_foreign_letters_none() -> None:
    assert vtk_key("ArrowLeft") == ("Left", 0)
    assert vtk_key("Shift") == ("Shift_L", 0)
    assert vtk_key("Enter", "NumpadEnter") == ("Return", 13)
    assert vtk_key("é") is None
    assert vtk_key("Unidentified") is None


def test_only_the_latest_of_moves_in_a_row_is_handled(view: View) -> None:
    inputs = Inputs(view)
    seen = _received(view, "MouseMove", "LeftButtonPress")
    for x in (0.1, 0.2, 0.3):
        inputs.put({"name": "MouseMove", "x": x, "y": 0.0})
    inputs.put({"name": "LeftButtonPress", "x": 0.3, "y": 0.0})
    inputs.put({"name": "MouseMove", "x": 0.5, "y": 0.0})
    inputs.put({"name": "MouseMove", "x": 0.5, "y": 1.0, "shift": True})
    inputs.put({"name": "MouseMove", "x": 1.0, "y": 1.0, "shift": True})
    while inputs:
        inputs.send_next()
    assert seen == [
        ("MouseMove", 60, 99),
        ("LeftButtonPress", 60, 99),
        ("MouseMove", 100, 99),
        ("MouseMove", 200, -1),
    ]


def test_one_key_is_one_key_press(view: View) -> None:
    inputs = Inputs(view)
    seen = _received(view, "KeyPress", "Char", "KeyRelease")
    inputs.put({**_MIDDLE, "name": "KeyPress", "key": "z", "code": "KeyZ"})
    inputs.put({**_MIDDLE, "name": "KeyRelease", "key": "z", "code": "KeyZ"})
    while inputs:
        inputs.send_next()
    assert [name for name, *_ in seen] == ["KeyPress", "KeyRelease"]


@pytest.mark.parametrize(
    "message",
    [
        None,
        [],
        {"name": "ExitEvent", **_MIDDLE},
        {"name": "MouseMove"},
        {"name": "MouseMove", "x": float("nan"), "y": 0.5},
        {"name": "MouseMove", "x": 1e9, "y": 0.5},
        {"name": "KeyPress", **_MIDDLE, "key": "z" * 100},
        {"name": "KeyPress", **_MIDDLE, "key": ["z"]},
    ],
)
def test_a_forged_message_is_refused(view: View, message: object) -> None:
    inputs = Inputs(view)
    with pytest.raises(ArgumentError):
        inputs.put(message)
    assert not len(inputs)


def test_a_flood_of_events_is_refused_by_name(view: View) -> None:
    inputs = Inputs(view)
    for _ in range(500):
        inputs.put({"name": "LeftButtonPress", **_MIDDLE})
    with pytest.raises(ArgumentError, match="More than 500 events"):
        inputs.put({"name": "LeftButtonPress", **_MIDDLE})
    assert len(inputs) == 500


def test_many_requests_make_one_picture_and_none_is_drawn_ahead_of_the_page(view: View) -> None:
    drawn: list[int] = []
    sent: list[int] = []
    view.window.AddObserver("EndEvent", lambda *_: drawn.append(1))

    async def story() -> None:
        stream = Stream(
            view, Timers(view.interactor), lambda _, number: sent.append(number), lambda: None, IDLE
        )
        stream.start(asyncio.get_running_loop())

        async def settle() -> None:
            for _ in range(4):
                await asyncio.sleep(0.01)

        view.render()
        await settle()
        assert drawn == []  # nobody looks
        stream.open(200, 100)
        for _ in range(10):
            view.render()
        await settle()
        assert (len(drawn), sent) == (1, [1])
        for _ in range(5):
            view.render()
            await settle()
        assert (len(drawn), sent) == (2, [1, 2])  # the page has shown neither
        stream.shown(2)
        await settle()
        assert (len(drawn), sent) == (3, [1, 2, 3])
        stream.close()
        view.render()
        await settle()
        assert len(drawn) == 3
        await stream.stop()
        view.render()
        assert len(drawn) == 4  # by the view itself again

    asyncio.run(story())


def test_a_page_that_goes_releases_the_buttons(view: View) -> None:
    inputs = Inputs(view)
    seen = _received(view, "LeftButtonPress", "LeftButtonRelease")
    inputs.put({"name": "LeftButtonPress", **_MIDDLE})
    inputs.send_next()
    inputs.put({"name": "LeftButtonPress", **_MIDDLE})
    inputs.release_all()
    assert [name for name, *_ in seen] == ["LeftButtonPress", "LeftButtonRelease"]
