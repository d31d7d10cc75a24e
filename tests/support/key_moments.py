"""Every key of the editor at critical moments: in mid-drag, while a pose converges, during a job.

The keys are those of the editor's own table.  After any key,

- the editor becomes idle: no job, no drag, no refinement, no timer;
- the drag is the first step of the history, unless Escape cancelled it; a drag that a key has
  finished ends where the pointer was at that moment, and no longer follows it;
- the other effects of the key are those of the key pressed long after the drag;
- undo restores the state before, redo the exact state at the end, and each state in between has
  the volume of rest.

During a job a key changes nothing; Escape cancels the job.
"""

from __future__ import annotations

import shutil
import threading
import time
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from hands import Hand, OneTimerHost, plain_view
from numpy.testing import assert_allclose, assert_array_equal
from soaking import NAME, slender

from vtk_segdeform import Session, save_session
from vtk_segdeform.session import Change
from vtk_segdeform.solver.solution import Status
from vtk_segdeform.widgets import DeformEditor, Mode, Paint, Tool
from vtk_segdeform.widgets.editor import finishing
from vtk_segdeform.widgets.editor.bindings import BINDINGS, DEFAULT_KEYS
from vtk_segdeform.widgets.handle_dragger import live_solve
from vtk_segdeform.widgets.scene import draft, viewpoint
from vtk_segdeform.widgets.scene.view import View

KEYS = sorted(
    {k for b in BINDINGS for k in b.keys if b.heading != "View" or k in ("kp_1", "period")}
)
SIZE = (260, 200)
LONGEST = 30.0  # seconds that any action may take, on a busy machine
# Of the diagonal: the pose of a handle that jumps in one event, after its few steps or converged.
SAME_POSE = 2e-2
STEPS = {Mode.REGIONS: "paint region 1", Mode.CAGES: "drag the cage of region 1",
         Mode.HANDLES: "set tip", Mode.DEFORM: "drag tip", Mode.PULL: "pull"}  # fmt: skip
# Typed during a pull or a drag they belong to the number.
NUMBER = {"0", "1", "2", "3", "4", "minus", "period", "kp_1"}


def table(first: Mode, *others: Mode, daily: Collection[str] = KEYS) -> list:
    """Return every mode with every key, as parameters of a test.

    Every day each entry of the editor's table is tested by one of its keys that are in *daily*, in
    the first of the modes that has it, and Escape in all of them.  All else is marked as campaign.
    """
    tested, parameters = set(), []
    for mode in (first, *others):
        for key in KEYS:
            entries = {k for k, b in enumerate(BINDINGS) if key in b.keys and mode in b.modes}
            is_new = key in daily and bool(entries - tested)
            tested |= entries if is_new else set()
            is_daily = is_new or (key == "escape" and key in daily)
            marks = [] if is_daily else [pytest.mark.campaign]
            parameters.append(pytest.param(mode, key, id=f"{mode.name}-{key}", marks=marks))
    return parameters


def belongs_to_the_drag(key: str, mode: Mode) -> bool:
    """Return whether *key* changes a drag in *mode*: its direction, its kind or its number."""
    axes = {"x", "y", "z"}
    own = {Mode.PULL: NUMBER | axes | {"r"}, Mode.DEFORM: NUMBER | axes}
    return key in own.get(mode, ())


def ends_the_drag(key: str, mode: Mode) -> bool:
    """Return whether *key* must end a drag in *mode*; Escape cancels it as well."""
    if belongs_to_the_drag(key, mode):
        return False
    if key == "return":
        return mode in (Mode.PULL, Mode.DEFORM)
    if any(b.action is None and key in b.keys and mode in b.modes for b in BINDINGS):
        return False  # the key belongs to the dragging widget
    binding = DEFAULT_KEYS.binding_of(key, mode)
    return key == "escape" or (binding is not None and not binding.while_busy)


def slow_down(monkeypatch) -> None:
    """Limit every move and every tick to one step, so that converging takes a while.

    What lasts a fixed time, drafts and turns of the camera, is shortened instead.
    """
    monkeypatch.setattr(live_solve, "STEPS", 1)
    for waits in (draft, finishing):
        monkeypatch.setattr(waits, "_REST", 0.0)
    monkeypatch.setattr(viewpoint, "_DURATION", 0.001)


@dataclass(frozen=True)
class Story:
    """The history of a session: the steps, how many are done, the states and their poses."""

    labels: list[str]
    done: int
    states: list
    vertices: list

    @classmethod
    def of(cls, session: Session) -> Story:
        """Walk through the whole history of *session*, and leave it where it was."""
        now, done = session.state, 0
        while session.undo() is not None:
            done += 1
        labels, states, vertices = [], [session.state], [session.vertices]
        check_volume(session)
        while (label := session.redo()) is not None:
            labels.append(label)
            states.append(session.state)
            vertices.append(session.vertices)
            check_volume(session)
        for _ in range(len(labels) - done):
            session.undo()
        assert session.state is now
        return cls(labels, done, states, vertices)


def check_volume(session: Session) -> None:
    """Check that the volume of rest is preserved, where that is enabled."""
    assert np.isfinite(session.vertices).all()
    if session.options.preserve_volume:
        assert abs(session.volume_change) < 1e-12


def outline(state) -> tuple:
    """Return everything of a state except positions."""
    regions = 0 if state.regions is None else state.regions.n_regions
    handles = {name: len(ids) for name, ids in state.handles.items()}
    cages = [cage.n_vertices for cage in state.cages]
    return regions, cages, len(state.fixed), handles, state.options, state.pose is not None


class Stand:
    """An editor over a small session in some host, and a hand that operates it; reusable.

    Parameters
    ----------
    editor : DeformEditor
        Over a session of `ready`.
    hand : Hand or QtHand
        In its view.
    folder : Path
        For the files that keys write.
    """

    def __init__(self, editor: DeformEditor, hand, folder: Path):
        self.editor, self.hand, self.folder = editor, hand, folder
        save_session(folder / "start.segdeform", editor.session)
        self.session_before, self.start = editor.session, editor.session.state
        editor.controller.finishing.is_wanted = False  # stories compare the poses of cages
        self.references: dict[tuple, Story] = {}
        self.camera = editor.controller.camera.viewpoint.settings()  # some keys move it

    # What differs from host to host.

    def loop(self) -> None:
        """Let the host's event loop run for a moment."""
        raise NotImplementedError

    def has_timers(self) -> bool:
        """Whether any timer is running."""
        raise NotImplementedError

    def draw(self) -> None:
        """Render, so that drags start at the displayed positions."""
        self.editor.view.render()

    def close(self) -> None:
        """Close the host."""
        raise NotImplementedError

    # Actions of the hand.

    @property
    def session(self) -> Session:
        return self.editor.session

    @property
    def refining(self) -> tuple:
        """The widgets that refine a pose after a drag."""
        return self.editor.widgets.dragger, self.editor.widgets.puller

    def until(self, seen, what: str) -> None:
        """Let the event loop run until *seen* returns something true."""
        end = time.monotonic() + LONGEST
        while not seen():
            assert time.monotonic() < end, f"waited in vain for {what}: {self.editor.status}"
            self.loop()

    def settle(self) -> None:
        """Wait until the editor is idle, and check that it stays so."""
        self.until(lambda: not self.editor.is_busy, "the job")
        self.until(lambda: not any(widget.is_refining for widget in self.refining), "the pose")
        self.until(lambda: not self.has_timers(), "the timers")
        assert not any(widget.is_grabbing for widget in self.editor.widgets.interactive)
        assert not self.session.is_dragging
        assert self.hand.failures == [], self.hand.failures

    def begin(self, mode: Mode) -> None:
        """Reset everything, and start in *mode*."""
        controller, widgets = self.editor.controller, self.editor.widgets
        while self.session.undo() is not None:
            pass
        self.session.change_options(preserve_volume=True)  # a setting, which undo leaves as it is
        self.session_before, self.start = self.session, self.session.state
        self.hand.failures.clear()  # of a failed test
        controller.help.hide()
        controller.messages.clear()
        widgets.cages_wanted = widgets.overlay_wanted = False
        widgets.selector.tool, widgets.selector.through = Tool.BRUSH, False
        widgets.puller.locality, widgets.landmarks.adds = None, False
        shutil.copy(self.folder / "start.segdeform", self.folder / "work.segdeform")
        self.editor.path = self.folder / "work.segdeform"
        self.editor.mode = mode
        self.settle()
        selector = widgets.selector
        selector.region, selector.handle = 0, "tip"
        selector.paints = Paint.REGION if mode is Mode.REGIONS else Paint.HANDLE
        widgets.dragger.handle = "tip"
        self.hand.failures.clear()

    def way(self, mode: Mode) -> list[np.ndarray]:
        """Return places along which to drag in *mode*: a handle, a vertex of a cage, a brush."""
        session = self.session
        if mode is Mode.CAGES:
            corners = session.cages[0].vertices
            at = corners[corners[:, 2].argmax()]
        else:
            x = session.mesh.vertices[:, 0]
            at = {Mode.REGIONS: [0.9, -0.7, 0.0], Mode.HANDLES: [-1.6, -0.6, 0.0]}.get(
                mode, session.mesh.vertices[x > 2.2].mean(axis=0)
            )
        shift = np.array(
            [6.0, 24.0] if mode in (Mode.PULL, Mode.CAGES, Mode.DEFORM) else [4.0, 2.0]
        )
        return [np.round(self.hand.at(at) + share * shift) for share in (0.0, 0.6, 1.0)]

    def drag(self, mode: Mode) -> np.ndarray:
        """Press and drag, and return the place without releasing the button."""
        assert self.editor.controller.camera.viewpoint.restore(self.camera)
        self.draw()
        first, *others = self.way(mode)
        self.hand.press(first)
        for place in others:
            self.hand.move(place)
        assert any(widget.is_grabbing for widget in self.editor.widgets.interactive)
        return others[-1]

    # The moments.

    def long_after(self, mode: Mode, *keys: str) -> Story:
        """Return the story of a drag and of keys that are typed after it has converged."""
        if (mode, keys) not in self.references:
            self.begin(mode)
            self.hand.release(self.drag(mode))
            self.settle()
            for key in keys:
                self.hand.types(key)
            self.hand.failures.clear()  # failures are reported, but not tested here
            self.settle()
            self.references[mode, keys] = Story.of(self.session)
        return self.references[mode, keys]

    def during(self, mode: Mode, key: str) -> None:
        """Type *key* in mid-drag, move on and release."""
        dragged = self.long_after(mode)
        expected = self.long_after(mode, key) if ends_the_drag(key, mode) else dragged
        assert dragged.labels == [STEPS[mode]]
        self.begin(mode)
        place = self.drag(mode)
        self.hand.types(key)
        if ends_the_drag(key, mode):
            place = place + [-40.0, -30.0]
            self.hand.move(place)  # no longer drags anything
        else:
            assert any(widget.is_grabbing for widget in self.editor.widgets.interactive)
        self.hand.release(place)
        self._ends_as(mode, key, expected, dragged)

    def just_after(self, mode: Mode, *keys: str) -> None:
        """Type *keys* after a drag, while the pose still converges."""
        dragged = self.long_after(mode)
        bindings = [DEFAULT_KEYS.binding_of(key, mode) for key in keys]
        if all(binding is not None and binding.while_busy for binding in bindings):
            expected = dragged  # which is what keys must leave that are allowed in a job
        else:
            expected = self.long_after(mode, *keys)
        self.begin(mode)
        self.hand.release(self.drag(mode))
        assert any(widget.is_refining for widget in self.refining)
        for key in keys:
            self.hand.types(key)
        self._ends_as(mode, None, expected, dragged)

    def _ends_as(self, mode: Mode, key: str | None, expected: Story, dragged: Story) -> None:
        """Check that all is as *expected*; *key* was typed in mid-drag, if it is not None."""
        told = [str(failure) for failure in self.hand.failures]
        self.hand.failures.clear()
        self.settle()
        self.editor.mode = mode  # where a pose that has not converged does so
        self.settle()
        story = Story.of(self.session)
        if self.session is self.session_before:  # it opens another one
            assert not story.states[0].changes(self.start) & ~Change.OPTIONS  # settings
        if key == "escape":
            assert (story.done, told) == (0, [])
            return
        assert (story.labels, story.done) == (expected.labels, expected.done), told
        mine, its = (list(map(outline, each.states)) for each in (story, expected))
        assert mine == its, (mine, its)
        if story.labels == dragged.labels and not belongs_to_the_drag(key or "", mode):
            same_places(story, dragged, self.session.mesh.diagonal)

    @contextmanager
    def job(self) -> Iterator[list[str]]:
        """Run a job in another thread; yield the list of results that it will deliver."""
        go_on, delivered = threading.Event(), []

        def work(progress):
            assert go_on.wait(LONGEST)
            progress(1.0, "counted")
            return "counted"

        self.editor.do(lambda controller: controller.start("counting", work, delivered.append))
        assert self.editor.is_busy
        try:
            yield delivered
            assert self.editor.is_busy
            assert delivered == []
        finally:
            go_on.set()
        self.settle()

    def first_overlay(self, *, during: bool) -> None:
        """Type O before volumes were ever shown: a job measures them, during a drag."""
        self.begin(Mode.REGIONS)
        self.editor.load(self.folder / "start.segdeform")
        self.session.bind()  # otherwise binding would measure them already
        self.begin(Mode.DEFORM)
        overlay, place = self.editor.widgets.overlay, self.drag(Mode.DEFORM)
        assert not overlay.is_prepared
        released, prepare = threading.Event(), overlay.prepare

        def prepare_after_release():  # otherwise the job could end while the key is handled
            assert released.wait(LONGEST)
            prepare()

        overlay.prepare = prepare_after_release
        self._meanwhile("o", place, during=during, released=released)
        assert overlay.is_shown

    def _meanwhile(
        self, key: str, place: np.ndarray, *, during: bool, released: threading.Event | None = None
    ) -> None:
        """Start a job by *key* before or after the release at *place*; nothing must be lost.

        *released* is set once the button is up, so that the job may end.
        """
        if not during:
            self.hand.release(place)
            assert self.editor.widgets.dragger.is_refining
        self.hand.types(key)
        assert self.editor.is_busy
        if during:
            self.hand.release(place)
        if released is not None:
            released.set()
        self.settle()
        assert self.session.solution.status is Status.CONVERGED
        assert Story.of(self.session).labels == [STEPS[Mode.DEFORM]]

    def in_a_job(self, mode: Mode, key: str) -> None:
        """Type *key* while another thread works; then let it end."""
        self.begin(mode)
        session = self.session
        before = session.state, session.history.undo_label, session.history.redo_label
        with self.job() as delivered:
            self.hand.types(key)
            self.loop()
        assert delivered == ["counted"] * (key != "escape")
        assert "Cancelled" in self.editor.status or key != "escape"
        assert self.session is session
        assert (
            session.state,
            session.history.undo_label,
            session.history.redo_label,
        ) == before


def same_places(story: Story, dragged: Story, diagonal: float) -> None:
    """Check that handles are exactly where the drag left them, and the mesh nearly, if it is shown.

    A pose that is undone does not converge further.
    """
    state, expected = story.states[1], dragged.states[1]
    if expected.pose is None:
        return
    for name, places in expected.pose.targets.items():
        assert_allclose(state.pose.targets[name], places, atol=1e-9)
    if story.done == dragged.done and state.pose.finished is None:
        away = np.abs(story.vertices[1] - dragged.vertices[1]).max() / diagonal
        assert away < SAME_POSE, away
    for mine, others in ((state.fixed, expected.fixed), *zip(
        state.handles.values(), expected.handles.values(), strict=True
    )):  # fmt: skip
        assert_array_equal(mine, others)
    assert_array_equal(state.regions.membership, expected.regions.membership)


class SeldomDrawn(View):
    """A view that renders only in `draw`: rendering would take nine tenths of the time."""

    def render(self):
        pass


class HandStand(Stand):
    """In a host with a single timer fired by hand."""

    def __init__(self, view: View, folder: Path):
        self._host = OneTimerHost(view.interactor)
        session, view = ready(), SeldomDrawn(view.renderer, view.interactor)
        editor = DeformEditor(view, session)
        aim(view)
        editor.On()
        super().__init__(editor, Hand(view), folder)

    def loop(self):
        self._host.tick()
        if self.editor.is_busy:
            time.sleep(0.001)  # leave the interpreter to the thread of the job

    def has_timers(self):
        return self._host.is_running

    def draw(self):
        self.editor.view.draw()

    def close(self):
        self.editor.remove()
        assert not self._host.is_running


def ready() -> Session:
    """Return a small session, complete except for a pose, and bound."""
    session = slender().session(NAME)
    session.change_options(n_cage_vertices=40)
    session = Session(session.mesh, state=session.state)  # without a history
    session.bind()
    return session


def aim(view: View) -> None:
    """Frame the whole mesh from the front, z up."""
    view.camera.SetPosition(0.0, -9.0, 0.0)
    view.camera.SetFocalPoint(0.0, 0.0, 0.0)
    view.camera.SetViewUp(0.0, 0.0, 1.0)
    view.renderer.ResetCamera()
    view.window.Render()


def plain_stand(folder: Path) -> HandStand:
    """Return an editor in a window of VTK alone."""
    return HandStand(plain_view(SIZE), folder)
