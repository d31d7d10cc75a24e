"""Recording and replay: the same input gives the same camera and the same session."""

from __future__ import annotations

import itertools
from types import SimpleNamespace

import numpy as np
import pytest
import pyvista as pv
from hands import Hand, draw_seldom, picture, plain_view
from scenes import sausage
from soaking import slender

from vtk_segdeform import Session
from vtk_segdeform.errors import ArgumentError, SessionError
from vtk_segdeform.widgets.handle_dragger.handle_dragger import HandleDragger
from vtk_segdeform.widgets.puller.puller import Puller as SurfacePuller
from vtk_segdeform.widgets.recording.recording import Recorder, replay
from vtk_segdeform.widgets.scene.gestures import Gesture, Phase, Pointer
from vtk_segdeform.widgets.scene.step_budget import StepBudget, prescribe_steps
from vtk_segdeform.widgets.scene.surface_display import SurfaceDisplay
from vtk_segdeform.widgets.scene.view import View
from vtk_segdeform.widgets.scene.widget import Widget

pytestmark = pytest.mark.usefixtures("bound_once")
SCENE = sausage(is_coarse=True)
TITLE = "vtk_segdeform recording 1"


class Puller(Widget):
    """Drags the handle in the view plane; Ctrl+Z undoes, and a timer rotates the handle."""

    ticks = 0

    def on_press(self, press: Pointer) -> Gesture | None:
        middle = self.session.vertices[SCENE.handle].mean(axis=0)
        there = self.view.to_display(middle[None])[0]
        return self._pull(there) if np.linalg.norm(there[:2] - press.position) < 25 else None

    def on_key(self, key, pointer):
        return key == "z" and pointer.control and self.session.undo() is not None

    def tick(self):
        self.ticks += 1
        turned = SCENE.turned(5.0 * self.ticks, axis=(1, 0, 0))
        self.session.drag(turned, max_steps=1)
        self.session.commit()

    def remove(self):
        self.Off()

    def _pull(self, there):
        start = self.view.to_world(there[None])[0]
        while (pointer := (yield)).phase is Phase.MOVE:
            here = self.view.to_world(np.array([[pointer.x, pointer.y, there[2]]]))[0]
            shift = np.eye(4)
            shift[:3, 3] = here - start
            self.session.move_handle("handle 1", shift, max_steps=2)
        self.session.commit()


def ready_session() -> Session:
    session = Session(SCENE.mesh)
    session.set_regions(SCENE.regions)
    session.set_cages(SCENE.cages)
    session.set_fixed(SCENE.fixed)
    session.handles.add(SCENE.handle)
    return session


class Desk:
    """A view with a session, something to drag, and a camera."""

    def __init__(self, view: View) -> None:
        self.view = view
        self.session = ready_session()
        SurfaceDisplay(view, self.session)
        self.puller = Puller(view, self.session)
        self.puller.On()
        view.every(50, self.puller.tick)
        view.renderer.ResetCamera()
        view.render()
        draw_seldom(view)
        self.hand = Hand(view)

    def work(self) -> None:
        """Turn the camera, pull the handle, zoom, pull again, undo, wait for two ticks."""
        hand, handle = self.hand, SCENE.mesh.vertices[SCENE.handle].mean(axis=0)
        hand.drag([(60, 340), (75, 330), (90, 315)])
        x, y = hand.at(handle)
        hand.drag([(x, y), (x + 4, y + 12), (x + 9, y + 31)])
        hand.wheel(-2, (200, 200))
        x, y = hand.at(self.session.vertices[SCENE.handle].mean(axis=0))
        hand.drag([(x, y), (x + 6, y - 8), (x + 20, y - 9)])
        hand.key("z", control=True)
        hand.tick(2)
        hand.event("MiddleButtonPressEvent", (30, 30))
        hand.move((40, 45))
        hand.event("MiddleButtonReleaseEvent", (40, 45))

    def state(self) -> list[np.ndarray]:
        camera = self.view.camera
        return [
            self.session.vertices, camera.GetPosition(), camera.GetFocalPoint(), camera.GetViewUp()
        ]  # fmt: skip


def same(one: Desk, other: Desk) -> bool:
    pairs = zip(one.state(), other.state(), strict=True)
    return all(np.array_equal(a, b) for a, b in pairs)


@pytest.fixture(scope="module")
def recorded():
    """Return a desk after some work, and the recorded lines."""
    desk = Desk(plain_view())
    recorder = Recorder(desk.view)
    desk.work()
    recorder.stop()
    assert not desk.hand.failures
    return desk, recorder.lines


def test_a_replay_gives_the_same_pose_bit_by_bit_and_the_same_picture(recorded, tmp_path):
    desk, lines = recorded
    path = tmp_path / "work.txt"
    path.write_text("\n".join(lines))
    again = Desk(plain_view())
    assert not same(desk, again)
    replay(again.view, path)
    assert not again.hand.failures
    assert same(desk, again)
    assert np.array_equal(picture(again.view), picture(desk.view))
    for step in ("drag handle 1", "drag handle 1", "drag handle 1", "set handle 1"):
        assert again.session.undo() == step


def test_camera_drags_are_replayed_from_their_events_alone(recorded):
    desk, lines = recorded
    again = Desk(plain_view())
    replay(again.view, [line for line in lines if " Camera " not in line])
    assert same(desk, again)


def test_a_camera_moved_by_a_program_is_recorded_before_the_next_press():
    desk, again = (Desk(plain_view()) for _ in range(2))
    recorder = Recorder(desk.view)
    desk.hand.hover((10, 10))
    desk.view.camera.Azimuth(20)
    desk.work()
    desk.view.camera.Elevation(5)
    recorder.stop()
    replay(again.view, recorder.lines)
    assert same(desk, again)


@pytest.mark.campaign
def test_the_size_of_the_window_is_recorded():
    desk, again = Desk(plain_view((300, 260))), Desk(plain_view((500, 500)))
    recorder = Recorder(desk.view)
    desk.view.window.SetSize(320, 280)
    desk.work()
    recorder.stop()
    replay(again.view, recorder.lines)
    assert tuple(again.view.window.GetSize()) == (320, 280)
    assert same(desk, again)


@pytest.mark.parametrize(
    "keys",
    [{"undo": None}, {"undo": "u"}, {3: ["u"]}, {"undo": [3]}, {"undo": ["u v"]}, {"un do": ["u"]}],
)
def test_keys_that_a_recording_cannot_store_are_refused(keys):
    recorder = Recorder(plain_view())
    lines = [*recorder.lines]
    with pytest.raises(ArgumentError, match="keys"):
        recorder.assign(keys)
    assert recorder.lines == lines
    recorder.assign({"undo": ("ctrl+z", "u"), "redo": ()})
    recorder.stop()
    assert any(line.endswith("Keys undo=ctrl+z,u redo=") for line in recorder.lines)


def test_each_line_is_written_at_once(tmp_path):
    path = tmp_path / "work.txt"
    view = plain_view()
    recorder = Recorder(view, path)
    hand = Hand(view)
    hand.press((5, 7), shift=True)
    hand.key("Escape")
    hand.event("CharEvent", key="z", control=True)
    lines = path.read_text().splitlines()
    assert lines[0] == TITLE
    events = [line.split(" ", 1)[1] for line in lines if "# " not in line]
    assert events[-6:] == [
        "MouseMove 5 7 shift",
        "LeftButtonPress 5 7 shift",
        "KeyPress 5 7 key=Escape",
        "Char 5 7 key=Escape",
        "KeyRelease 5 7 key=Escape",
        "Char 5 7 control key=z code=122",
    ]
    recorder.stop()
    recorder.stop()
    hand.click((1, 1))
    assert path.read_text().splitlines() == recorder.lines == lines
    assert not hand.failures


def test_a_recording_of_a_replay_equals_the_recording(recorded):
    _, lines = recorded
    again = Desk(plain_view())
    recorder = Recorder(again.view)
    replay(again.view, lines)
    recorder.stop()

    def untimed(lines):
        return [line.partition(" ")[2] for line in lines if not line.startswith("#")]

    assert untimed(recorder.lines) == untimed(lines)


def test_a_plotter_is_recorded_and_replayed_with_the_keys_of_pyvista():
    ends = []
    lines: list[str] = []
    for _ in range(2):
        plotter = pv.Plotter(off_screen=True, window_size=(300, 300))
        plotter.add_mesh(pv.Sphere())
        plotter.show(auto_close=False, interactive=False)
        if lines:
            replay(plotter, lines)
        else:
            hand = Hand(View.of(plotter))
            recorder = Recorder(plotter)
            hand.drag([(20, 20), (40, 60)])
            hand.key("Up")
            recorder.stop()
            lines += recorder.lines
        ends.append(np.array([*plotter.camera.position, plotter.camera.parallel_scale]))
        plotter.close()
    assert np.array_equal(*ends)


class Dragging:
    """A view with a handle to drag; each step of the solver appears to take *seconds*."""

    def __init__(self, monkeypatch, seconds: float) -> None:
        clock = itertools.count()
        own = SimpleNamespace(perf_counter=lambda: seconds * next(clock))
        monkeypatch.setattr("vtk_segdeform.widgets.handle_dragger.live_solve.time", own)
        self.session = ready_session()
        self.view = plain_view()
        self.dragger = HandleDragger(self.view, self.session)
        self.dragger.On()
        self.view.renderer.ResetCamera()
        self.view.render()

    def work(self, hand: Hand) -> None:
        """Drag, refine during and after the drag, and move the camera."""
        x, y = hand.at(self.session.vertices[SCENE.handle].mean(axis=0))
        hand.press((x, y))
        for k in range(1, 5):
            hand.move((x - 16 * k, y + 24 * k))
        hand.tick(3)
        hand.move((x - 30, y + 130))
        hand.release((x - 30, y + 130))
        hand.tick(2)
        hand.drag([(20, 380), (35, 370)])
        hand.tick(2)


@pytest.mark.campaign
def test_a_drag_is_replayed_bit_by_bit_on_a_slower_machine(monkeypatch):
    fast = Dragging(monkeypatch, 0.001)
    hand, recorder = Hand(fast.view), Recorder(fast.view)
    fast.work(hand)
    recorder.stop()
    assert hand.failures == []
    given = {line.split()[-1] for line in recorder.lines if " Steps " in line}
    assert len(given) > 1  # the first solve has no measurement yet
    ends = []
    for lines in (recorder.lines, [line for line in recorder.lines if " Steps " not in line]):
        slow = Dragging(monkeypatch, 0.5)
        replay(slow.view, lines)
        ends.append(np.array_equal(slow.session.vertices, fast.session.vertices))
    assert ends == [True, False]  # without the recorded steps the pose differs


class Pulling:
    """A puller over a small session without handles; on a fast machine or on a slow one."""

    def __init__(self, monkeypatch, seconds: float) -> None:
        clock = itertools.count()
        own = SimpleNamespace(perf_counter=lambda: seconds * next(clock))
        monkeypatch.setattr("vtk_segdeform.widgets.handle_dragger.live_solve.time", own)
        scene, self.view = slender(), plain_view((300, 200))
        self.session = Session(scene.mesh)
        self.session.set_regions(scene.regions)
        self.session.set_cages(scene.cages)
        self.puller = SurfacePuller(self.view, self.session)
        self.view.camera.SetPosition(0.0, -12.0, 0.0)
        self.view.camera.SetViewUp(0.0, 0.0, 1.0)
        self.view.renderer.ResetCamera()
        self.view.render()
        draw_seldom(self.view)
        self.puller.On()

    def work(self, hand: Hand) -> None:
        """Pin, change the radius, pull along an axis, turn, and pull by a number."""
        x, y = np.round(hand.at([-2.0, -0.5, 0.0]))
        hand.click((x, y), shift=True)
        vertex = np.linalg.norm(self.session.vertices - [2.0, -0.6, 0.0], axis=1).argmin()
        x, y = np.round(hand.at(self.session.vertices[vertex]))
        hand.wheel(1, (x, y), shift=True)
        for keys in (("z",), ("r",), ("x", "1", "period", "5", "Return")):
            hand.press((x, y))
            hand.move((x, y + 6))
            for key in keys:
                hand.key(key)
            hand.move((x + 9, y + 12))
            hand.release((x + 9, y + 12))
            hand.tick(2)
            x, y = np.round(hand.at(self.session.vertices[vertex]))


def test_pulls_pins_turns_and_numbers_are_replayed_bit_by_bit(monkeypatch):
    fast = Pulling(monkeypatch, 0.001)
    hand, recorder = Hand(fast.view), Recorder(fast.view)
    fast.work(hand)
    recorder.stop()
    assert hand.failures == []
    slow = Pulling(monkeypatch, 0.5)
    replay(slow.view, recorder.lines)
    assert list(slow.session.handles) == list(fast.session.handles)
    assert np.array_equal(slow.session.vertices, fast.session.vertices)
    steps = []
    while (step := slow.session.undo()) is not None:
        steps.append(step)
    assert steps[:4] == ["pull", "pull", "pull", "pin"]


def test_two_widgets_of_one_window_share_the_prescribed_steps():
    view = plain_view((50, 50))
    one, other = StepBudget(view.interactor), StepBudget(view.interactor)
    prescribe_steps(view.interactor, (3, 4))
    assert [one.steps(8), other.steps(8), one.steps(8)] == [3, 4, 8]
    prescribe_steps(view.interactor, (3, 4))
    prescribe_steps(view.interactor, ())
    assert other.steps(7) == 7
    other.stop()
    prescribe_steps(view.interactor, (2,))
    assert [other.steps(7), one.steps(7)] == [7, 7]


def test_the_next_event_waits_for_background_work():
    view = plain_view((50, 50))
    said = []
    view.observe("TimerEvent", lambda: said.append("tick"))
    view.observe("MouseMoveEvent", lambda: said.append("move"))
    work = iter([True, True, False, False])
    replay(view, [TITLE, "0 MouseMove 1 1", "0 MouseMove 2 2"], busy=lambda: next(work))
    assert said == ["tick", "tick", "move", "move"]


def test_a_replay_ends_when_the_window_closes():
    plotter = pv.Plotter(off_screen=True, window_size=(50, 50))
    plotter.show(auto_close=False, interactive=False)
    view = View.of(plotter)
    said = []
    view.observe("MouseMoveEvent", lambda: said.append("move"))
    view.observe("KeyPressEvent", plotter.close)
    replay(view, [TITLE, "0 MouseMove 1 1", "0 KeyPress 1 1 key=x", "0 MouseMove 2 2"])
    assert said == ["move"]


GOOD_CAMERA = "0 Camera position 0 0 5 focus 0 0 0 up 0 1 0 angle 30 parallel 0 scale 1 range 1 9"


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ("0.1 LeftButtonPress 10", "expected 2 words"),
        ("0.1 LeftButtonPress ten 10", "expected a whole number"),
        ("0.1 LeftButtonPress 10 9999999", "expected a whole number from -100000 to 100000"),
        ("0.1 LeftButtonPress 10 10 __import__('os')", "is not shift, control, alt, key=NAME"),
        ("0.1 KeyPress 10 10 key=z code=-1", "from 0 to 127"),
        ("0.1 DeleteEvent 1 1", "'DeleteEvent' is not an event of a recording"),
        ("0.1 ExitEvent", "not an event"),
        ("soon MouseMove 1 1", "expected a number; got 'soon'"),
        ("nan MouseMove 1 1", "expected a number"),
        ("0.1", "expected a time and an event"),
        ("0.1 Timer 99999999", "whole number from 1 to 100000"),
        ("0.1 Steps 0", "whole number from 1 to 100"),
        ("0.1 Window 99999 99999", "whole number from 1 to 16384"),
        (GOOD_CAMERA.replace("focus 0 0 0", "focus 0 0 5"), "position and focus must differ"),
        (GOOD_CAMERA.replace("up 0 1 0", "up 0 0 0"), "up and scale must not be 0"),
        (GOOD_CAMERA.replace("scale 1", "scale 0"), "up and scale must not be 0"),
        (GOOD_CAMERA.replace("angle 30", "angle 180"), "angle must be between 0 and 180"),
        (GOOD_CAMERA.replace("range 1 9", "range 9 1"), "positive and increasing"),
        (GOOD_CAMERA.replace("angle 30", "angle inf"), "expected a number"),
        (GOOD_CAMERA.replace("up 0 1 0", "0 1 0"), "expected 'up' and 3 numbers; got '0 1 0 angle"),
        (GOOD_CAMERA + " more", "expected 0 words"),
    ],
)
def test_a_damaged_line_is_reported_before_any_event(line, says):
    view = plain_view((50, 50))
    moved = []
    view.observe("MouseMoveEvent", lambda: moved.append("moved"))
    lines = [TITLE, "0 Window 50 50", "", "# a word", GOOD_CAMERA, "0 MouseMove 1 1", line]
    with pytest.raises(SessionError, match=r"^recording, line 7: ") as error:
        replay(view, lines)
    assert says in str(error.value)
    assert moved == []


def test_a_file_that_is_not_a_recording_is_refused(tmp_path):
    view = plain_view((50, 50))
    path = tmp_path / "x.txt"
    with pytest.raises(SessionError, match=r"x.txt: cannot be read"):
        replay(view, path)
    path.write_bytes(b"")
    with pytest.raises(SessionError, match=r"x.txt: is empty"):
        replay(view, path)
    path.write_bytes(b"\x89PNG\r\n\x1a\n")
    with pytest.raises(SessionError, match=r"x.txt, line 1: "):
        replay(view, path)
    path.write_text("vtk_segdeform recording 2\n")
    with pytest.raises(SessionError, match=r"x.txt, line 1: a recording begins with"):
        replay(view, str(path))
    with pytest.raises(SessionError, match="cannot be written"):
        Recorder(view, tmp_path / "no" / "x.txt")


def test_random_damage_leads_to_an_error_or_a_replay(recorded):
    _, lines = recorded
    random = np.random.default_rng(5)
    text = "\n".join(lines[:14]).encode()
    view = plain_view((50, 50))
    outcomes = set()
    for _ in range(150):
        damaged = bytearray(text)
        for place in random.integers(0, len(text), size=2):
            damaged[place] = text[random.integers(len(text))]
        if "Window" in damaged.decode() and b"Window 400 400" not in damaged:
            continue  # it may be a very large window
        try:
            replay(view, damaged.decode().splitlines())
            outcomes.add("replayed")
        except SessionError as error:
            outcomes.add(str(error).split()[1])
    assert outcomes == {"replayed", "line"}
