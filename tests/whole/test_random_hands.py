"""Hands that do anything at all, in every mode: nothing breaks, nothing sticks, volume stays.

The events are drawn from named seeds.  What a person is told, a `SegDeformError` on the status
line, is no failure; any other exception is.
"""

from __future__ import annotations

import gc
import resource
import sys
import time
from weakref import WeakValueDictionary

import numpy as np
import pytest
from hands import Hand, plain_view
from scenes import sausage

from vtk_segdeform import Session
from vtk_segdeform.errors import SegDeformError
from vtk_segdeform.geometry.volume import signed_volume
from vtk_segdeform.widgets.editor.bindings import BINDINGS
from vtk_segdeform.widgets.editor.editor import DeformEditor

SIZE = (260, 200)
LONGEST = 120.0  # seconds of a job, also where others are at work
# Another file is opened rarely enough to have something to lose.
KEYS = sorted({key for binding in BINDINGS for key in binding.keys})
RARE = {"p": 0.3, "ctrl+o": 0.3, "ctrl+s": 0.2, "g": 0.1, "f": 1.5, "delete": 0.3, "backspace": 0.3}
OFTEN = {"1": 2.0, "2": 2.0, "3": 2.0, "4": 6.0, "escape": 3.0, "x": 2.0, "z": 3.0}
ODDS = np.array([RARE.get(key, OFTEN.get(key, 1.0)) for key in KEYS])


class Monkey:
    """A hand that does what a random number says."""

    def __init__(self, seed: int, folder):
        self.rng = np.random.default_rng(seed)
        scene = sausage()
        session = Session(scene.mesh)
        session.set_regions(scene.regions)
        session.set_cages(scene.cages)
        session.set_fixed(scene.fixed)
        session.add_handle(scene.handle)
        self.view = plain_view(SIZE)
        self.editor = DeformEditor(self.view, session)
        self.editor.path = folder / "monkey.segdeform"
        self.view.camera.SetPosition(0.0, -9.0, 2.0)
        self.view.renderer.ResetCamera()
        self.view.render()
        self.hand = Hand(self.view)
        self.editor.On()
        self.place = np.array(SIZE) / 2.0
        self.frames = self.posed = self.free = self.refused = 0
        self.worst = 0.0
        # Of poses made while the volume was free, or of a file: where their cages are, which they
        # share with the poses that marking handles makes of them; while the session has them.
        self.loose: WeakValueDictionary[int, np.ndarray] = WeakValueDictionary()
        self.met = session
        self.view.renderer.AddObserver("EndEvent", self.sees)

    def sees(self, *_):
        """Have `looks` hear of what is wrong in a frame: VTK would print it, and go on."""
        try:
            self.drawn()
        except AssertionError as wrong:
            self.hand.failures.append(wrong)

    def drawn(self):
        """Look at what every frame shows."""
        if self.editor.is_busy:  # another thread is at work: nobody may ask
            return
        session = self.editor.session
        self.frames += 1
        assert np.isfinite(session.vertices).all()
        assert np.array_equal(self.editor.widgets.surface.points, session.vertices)
        self.posed += session.vertices is not session.mesh.vertices
        pose = session.state.pose
        is_free = not session.options.preserve_volume or session is not self.met
        self.met = session
        self.free += is_free
        cage = None if pose is None else pose.cage_vertices[0]
        if is_free and cage is not None:
            self.loose[id(cage)] = cage
        if cage is not None and self.loose.get(id(cage)) is cage:
            faces, rest = session.mesh.faces, session.mesh.vertices
            change = signed_volume(session.vertices, faces) / signed_volume(rest, faces) - 1.0
            assert abs(session.volume_change - change) < 1e-12
        else:
            self.worst = max(self.worst, abs(session.volume_change))

    def acts(self):
        """Do one thing."""
        held = {"control": self.rng.random() < 0.15, "shift": self.rng.random() < 0.15}
        kind = self.rng.choice(7, p=[0.12, 0.4, 0.12, 0.16, 0.04, 0.06, 0.1])
        if kind == 0:
            self.aims()
            self.hand.press(self.place, **held)
        elif kind == 1:
            self.place = np.clip(self.place + self.rng.normal(0, 12, 2), -20, np.add(SIZE, 20))
            self.hand.move(self.place, **held)
        elif kind == 2:
            self.hand.release(self.place, **held)
        elif kind == 3:
            self.types(str(self.rng.choice(KEYS, p=ODDS / ODDS.sum())))
        elif kind == 4:
            self.hand.wheel(int(self.rng.choice([-1, 1])), self.place, **held)
        elif kind == 5:
            self.hand.event("RightButtonPressEvent", self.place)
            self.hand.event("RightButtonReleaseEvent", self.place)
        else:
            self.hand.tick()
        if not self.editor.session.options.preserve_volume and self.rng.random() < 0.15:
            self.types("p")  # free for a short time only
        if self.rng.random() < 0.02:  # else the right button zooms it out of sight
            self.view.renderer.ResetCamera()
        self.looks()

    def aims(self):
        """Go somewhere: to the gizmo, to the mesh, or anywhere."""
        centre = self.editor.widgets.dragger.gizmo.centre
        where = self.rng.random()
        if where < 0.5 and centre is not None:
            self.place = np.array(self.hand.at(centre)) + self.rng.normal(0, 15, 2)
        elif where < 0.9 and not self.editor.is_busy:
            self.place = np.array(self.hand.at(self.rng.choice(self.editor.session.vertices)))
        else:
            self.place = self.rng.uniform(0, SIZE, 2)
        if not np.isfinite(self.place).all():
            self.place = np.array(SIZE) / 2.0

    def types(self, key):
        self.hand.types(key, self.place)
        if self.rng.random() < 0.7:  # else what it has begun is met by other hands
            self.waits()

    def waits(self):
        if self.editor.is_busy:  # a camera that is held keeps the timer from everybody
            self.hand.release(self.place)
        end = time.monotonic() + LONGEST
        while self.editor.is_busy:
            assert time.monotonic() < end, f"a job does not end: {self.editor.status}"
            self.hand.tick()
            time.sleep(0.001)

    def looks(self):
        for failure in self.hand.failures:
            if not isinstance(failure, SegDeformError):
                raise failure
        self.refused += len(self.hand.failures)
        self.hand.failures.clear()

    def rests(self):
        """Let go of everything, and see that nothing holds on."""
        for _ in range(2):  # twice pressed, once for the camera and once for a widget
            self.hand.release(self.place)
        self.hand.key("Escape")
        self.waits()
        for _ in range(200):
            self.hand.tick()
            if not self.editor.widgets.dragger.is_refining:
                break
        self.looks()
        widgets = self.editor.widgets
        for widget in (widgets.selector, widgets.cages, widgets.dragger):
            assert not widget.is_grabbing
        assert not widgets.dragger.is_refining
        assert not self.editor.session.is_dragging
        camera = self.view.camera.GetPosition()
        self.hand.move(self.place + 5)
        assert self.view.camera.GetPosition() == camera  # the camera has let go as well


@pytest.mark.parametrize(
    ("seed", "count"),
    [
        (1, 300),
        (9, 300),
        pytest.param(3, 10_000, marks=pytest.mark.campaign),
    ],
)
def test_any_hands_leave_a_mesh_of_the_same_volume(seed, count, tmp_path):
    monkey = Monkey(seed, tmp_path)
    unit = 1024 if sys.platform == "linux" else 1
    half = 0
    for k in range(count):
        monkey.acts()
        if k == count // 2:
            gc.collect()
            half = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit
    monkey.rests()
    grown = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit - half
    print(
        f"seed {seed}: {count} events, {monkey.frames} frames, {monkey.posed} of them deformed, "
        f"{monkey.refused} actions refused, {monkey.free} frames of free volume, "
        f"|dV|/V at most {monkey.worst:.1e}, {grown / 1e6:.0f} MB more in the second half"
    )
    assert monkey.frames > count / 10
    assert monkey.posed > count / 50
    assert monkey.worst <= 1e-12
    assert grown < 100e6
    monkey.editor.remove()
