"""A monkey test of the editor: random events in every mode, each frame checked.

The events are drawn from named seeds.  A `SegDeformError`, shown on the status line, is not a
failure; any other exception is.
"""

from __future__ import annotations

import time
from weakref import WeakValueDictionary

import numpy as np
from hands import Hand, plain_view
from scenes import sausage

from vtk_segdeform.errors import SegDeformError
from vtk_segdeform.geometry.volume import signed_volume
from vtk_segdeform.widgets.editor.bindings import BINDINGS
from vtk_segdeform.widgets.editor.editor import DeformEditor

SIZE = (260, 200)
LONGEST = 120.0  # seconds that a job may take, on a busy machine
KEYS = sorted({key for binding in BINDINGS for key in binding.keys})
# Files are opened so rarely that there are unsaved changes to lose.
RARE = {"p": 0.3, "ctrl+o": 0.3, "ctrl+s": 0.2, "g": 0.1, "f": 1.5, "delete": 0.3, "backspace": 0.3}
OFTEN = {"0": 6.0, "1": 2.0, "2": 2.0, "3": 2.0, "4": 6.0, "escape": 3.0, "x": 2.0, "ctrl+z": 3.0,
         "r": 2.0, "return": 2.0}  # fmt: skip
ODDS = np.array([RARE.get(key, OFTEN.get(key, 1.0)) for key in KEYS])


class Monkey:
    """A hand that draws its actions at random.

    Attributes
    ----------
    frames, posed, pulled, free : int
        Rendered frames; of these, frames with a pose, with a pull, and with free volume.
    pinned, turned : int
        Frames with a pin, and events after which a pull was turning.
    refused : int
        Actions that raised a `SegDeformError`.
    worst : float
        The largest |dV|/V of any frame whose volume must be preserved.
    """

    def __init__(self, seed: int, folder):
        self.rng = np.random.default_rng(seed)
        scene = sausage()
        session = scene.session()
        self.view = plain_view(SIZE)
        self.editor = DeformEditor(self.view, session)
        self.editor.path = folder / "monkey.segdeform"
        self.view.camera.SetPosition(0.0, -9.0, 2.0)
        self.view.renderer.ResetCamera()
        self.view.render()
        self.hand = Hand(self.view)
        self.editor.On()
        self.place = np.array(SIZE) / 2.0
        self.frames = self.posed = self.pulled = self.free = self.refused = 0
        self.pinned = self.turned = 0
        self.worst = 0.0
        # Cage vertices of poses without exact volume: made while volumes were free, or read from a
        # file.  Poses derived by marking handles share the array, so it identifies them as well.
        self.free_cages: WeakValueDictionary[int, np.ndarray] = WeakValueDictionary()
        self.follow(session)
        self.view.renderer.AddObserver("EndEvent", self.on_frame)
        self.type("4")  # most events of a few hundred would otherwise come before the first pose
        self.wait()

    def follow(self, session):
        """Note the free poses of *session* from now on, also those that are never drawn."""
        self.last_session = session
        session.on_change(lambda _: session.options.preserve_volume or self.note_free(session))

    def note_free(self, session):
        """Note that the volume of the current pose need not be exact."""
        if session.state.pose is not None:
            cage = session.state.pose.cage_vertices[0]
            self.free_cages[id(cage)] = cage

    def on_frame(self, *_):
        """Keep failed checks for `raise_failures`; VTK would print the exception and continue."""
        try:
            self.check_frame()
        except AssertionError as wrong:
            self.hand.failures.append(wrong)

    def check_frame(self):
        """Check that the surface on the screen is the pose of the session, with its volume."""
        if self.editor.is_busy:  # the session belongs to another thread
            return
        session = self.editor.session
        self.frames += 1
        assert np.isfinite(session.vertices).all()
        surface = self.editor.widgets.surface
        shown = session.vertices if surface.instead is None else surface.instead
        is_between = self.editor.controller.finishing.glide.is_running  # two poses
        assert is_between or np.array_equal(surface.points, shown)
        self.posed += session.vertices is not session.mesh.vertices
        self.pulled += bool(session.state.pulls)
        self.pinned += any(name.startswith("pin ") for name in session.handles)
        pose = session.state.pose
        is_free = not session.options.preserve_volume or session is not self.last_session
        self.free += is_free
        if is_free:
            self.note_free(session)
        if session is not self.last_session:
            self.follow(session)
        cage = None if pose is None else pose.cage_vertices[0]
        if cage is not None and self.free_cages.get(id(cage)) is cage:
            faces, rest = session.mesh.faces, session.mesh.vertices
            change = signed_volume(session.vertices, faces) / signed_volume(rest, faces) - 1.0
            assert abs(session.volume_change - change) < 1e-12
        else:
            self.worst = max(self.worst, abs(session.volume_change))

    def act(self):
        """Send one random event."""
        modifiers = {"control": self.rng.random() < 0.15, "shift": self.rng.random() < 0.15}
        kind = self.rng.choice(7, p=[0.12, 0.4, 0.12, 0.16, 0.04, 0.06, 0.1])
        if kind == 0:
            self.aim()
            self.hand.press(self.place, **modifiers)
        elif kind == 1:
            self.place = np.clip(self.place + self.rng.normal(0, 12, 2), -20, np.add(SIZE, 20))
            self.hand.move(self.place, **modifiers)
        elif kind == 2:
            self.hand.release(self.place, **modifiers)
        elif kind == 3:
            self.type(str(self.rng.choice(KEYS, p=ODDS / ODDS.sum())))
        elif kind == 4:
            self.hand.wheel(int(self.rng.choice([-1, 1])), self.place, **modifiers)
        elif kind == 5:
            self.hand.event("RightButtonPressEvent", self.place)
            self.hand.event("RightButtonReleaseEvent", self.place)
        else:
            self.hand.tick()
        motion = self.editor.widgets.puller._motion
        self.turned += motion is not None and motion.has_turned
        if not self.editor.session.options.preserve_volume and self.rng.random() < 0.15:
            self.type("p")  # preserve volumes again soon
        if self.rng.random() < 0.02:  # otherwise the right button zooms the mesh out of sight
            self.view.renderer.ResetCamera()
        self.raise_failures()

    def aim(self):
        """Move near the gizmo, to a vertex, or to any place."""
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

    def type(self, key):
        """Type *key*; then usually wait, and otherwise continue while its job runs."""
        self.hand.types(key, self.place)
        if self.rng.random() < 0.7:
            self.wait()

    def wait(self):
        """Wait until the editor has no job."""
        if self.editor.is_busy:  # while the camera turns, no timer fires
            self.hand.release(self.place)
        end = time.monotonic() + LONGEST
        while self.editor.is_busy:
            assert time.monotonic() < end, f"a job does not end: {self.editor.status}"
            self.hand.tick()
            time.sleep(0.001)

    def raise_failures(self):
        """Raise the first failure that is not a `SegDeformError`; count the others."""
        for failure in self.hand.failures:
            if not isinstance(failure, SegDeformError):
                raise failure
        self.refused += len(self.hand.failures)
        self.hand.failures.clear()

    def release_all(self):
        """Release the buttons, and check that no widget and no camera follows the pointer."""
        for _ in range(2):  # the camera and a widget may each have seen a press
            self.hand.release(self.place)
        self.hand.key("Escape")
        self.wait()
        for _ in range(200):
            self.hand.tick()
            widgets = self.editor.widgets
            refining = widgets.dragger.is_refining, widgets.puller.is_refining
            if not any(refining):
                break
        self.raise_failures()
        assert not any(widget.is_grabbing for widget in widgets.interactive)
        assert not any(refining)
        assert not self.editor.session.is_dragging
        camera = self.view.camera.GetPosition()
        self.hand.move(self.place + 5)
        assert self.view.camera.GetPosition() == camera
