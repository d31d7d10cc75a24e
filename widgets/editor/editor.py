"""The editor: regions, cages, handles and poses of one session in one view, in five modes.

    editor = DeformEditor(view, mesh)
    editor.On()

The status line shows the next step; H shows the keys, which `bindings` lists and `actions`
implements; `keys` assigns other ones.  Long operations (segmentation, fitting cages, binding) are
jobs in another thread: meanwhile only the camera works, and Escape cancels the job.  In mode PULL
all of them run together in the background, and everything else works meanwhile.

An action during a drag or a stroke first finishes it, as if the button had been released, as one
undo step.  Only Escape cancels it; the help card does not interrupt it.

The camera moves alike in every host; see `Camera`.  The editor receives keys after its
widgets, so that x, y, z constrain a drag, but before VTK and pyvista, from which it withholds its
own keys.  With several editors in one window, keys go to the one under the pointer.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

from vtk_segdeform.checks import as_callable, as_flag, as_path, as_switch, shown
from vtk_segdeform.errors import ArgumentError, MeshError, SessionError
from vtk_segdeform.mesh import Mesh
from vtk_segdeform.progress import Progress
from vtk_segdeform.session import Session

from ..scene import Phase, Stop, View
from .actions import Action, show_rest
from .bindings import KeyChoice, keys_of
from .controller import Controller
from .keys import Keys, key_cap, pressed_key
from .queue import Kind
from .widget_set import Mode, WidgetSet

if TYPE_CHECKING:
    from vtk_segdeform.io import Surface

_REPEAT = 50  # milliseconds between release and press of a key that is held and repeats, at most
_BEFORE_CAMERA = 0.5  # priority: that of the camera is 0.25
_AFTER_WIDGETS = 0.75  # priority: our widgets have 1, VTK's own 0.5, pyvista and camera styles 0


def _new_session(mesh: Any) -> Session:
    try:
        return Session(mesh)
    except MeshError as error:
        expected = "session must be a Session, a Surface or a Mesh"
        raise ArgumentError(f"{expected}; got {shown(mesh)}: {error}") from None


class DeformEditor:
    """The whole editor in one view; off until `On`.

    Parameters
    ----------
    view : View, pyvista.Plotter or (vtkRenderer, vtkRenderWindowInteractor)
        Where it is drawn.  Call `remove` before its window closes.
    session : Session, Surface or Mesh
        What to edit; a new session is created for a surface or a mesh.
    keys : str or mapping of str to str or sequence of str
        "pyvista", "Blender" or the keys of some actions; see `keys_of`.
    """

    def __init__(
        self, view: Any, session: Session | Surface | Mesh, *, keys: KeyChoice | Keys = "pyvista"
    ) -> None:
        session = session if isinstance(session, Session) else _new_session(session)
        table = keys_of(keys)
        self.view = View.of(view)
        has_camera = _is_aimed(self.view.renderer)
        self._controller = Controller(self.view, session, table)
        self._controller.camera.begin(is_aimed=has_camera)
        self._took_key = False
        self._is_removed = False
        self._stops: list[Stop] = []
        self._stop_waiting: Stop = lambda: None  # for a key to be pressed again

    @property
    def session(self) -> Session:
        """The session being edited; another one after `load`."""
        return self._controller.session

    @property
    def widgets(self) -> WidgetSet:
        """The widgets over `session`; others after `load`."""
        return self._controller.widgets

    @property
    def controller(self) -> Controller:
        """The object that actions receive; see `do`."""
        return self._controller

    @property
    def mode(self) -> Mode:
        """The current mode; may be set even if the session is not ready for it."""
        return self._controller.mode

    @mode.setter
    def mode(self, mode: Mode) -> None:
        if not isinstance(mode, Mode):
            raise ArgumentError(
                f"mode must be one of {', '.join(map(str, Mode))}; got {shown(mode)}"
            )
        self._controller.mode = mode

    @property
    def keys(self) -> Keys:
        """The keys that start actions; may be set to anything that `keys_of` accepts."""
        return self._controller.keys

    @keys.setter
    def keys(self, keys: KeyChoice | Keys) -> None:
        controller = self._controller
        controller.keys = keys_of(keys)
        controller.list_keys()
        controller.refresh()

    @property
    def show_cube(self) -> bool:
        """Whether the orientation cube is shown."""
        return self._controller.camera.cube.is_shown

    @show_cube.setter
    def show_cube(self, shown: bool) -> None:
        cube = self._controller.camera.cube
        if as_flag(shown, "show_cube"):
            cube.show()
        else:
            cube.hide()

    @property
    def path(self) -> Path:
        """The file that keys save and open; initially "session.segdeform" in the working folder."""
        return self._controller.file.path

    @path.setter
    def path(self, path: str | os.PathLike[str]) -> None:
        self._controller.file.path = as_path(path)

    @property
    def status(self) -> str:
        """Text of the status line."""
        return self._controller.messages.text

    @property
    def is_busy(self) -> bool:
        """Whether a job is running."""
        return self._controller.is_busy

    @property
    def is_preparing(self) -> bool:
        """Whether pulls are being prepared in the background; nothing else waits for that."""
        return self.mode is Mode.PULL and self._controller.queue.fraction(Kind.PREPARE) is not None

    def wait(self) -> None:
        """Block until no job is running; raise the error of a failed job.  For scripts."""
        self._controller.queue.wait(Kind.JOB)

    def do(self, action: Action, *, while_busy: bool = False) -> Exception | None:
        """Run an action as if its key had been pressed; an error is shown in the status line.

        Parameters
        ----------
        action : callable
            ``action(controller)``.
        while_busy : bool
            Whether the action may run during a job, a drag or a stroke.  Otherwise it is refused
            during a job, with a message, and a drag or stroke is finished first.

        Returns
        -------
        error : Exception or None
            Why the action failed or was refused; None if it succeeded.
        """
        as_callable(action, "action")
        as_flag(while_busy, "while_busy")
        error: Exception | None = None
        with self.view.guarded(), self.view.drawing_once():
            try:
                error = self._do(action, while_busy)
            except Exception as raised:  # any of an action; `guarded` shows it and decides
                error = raised
                raise
        return error

    def run(self, name: str) -> Exception | None:
        """Run the action *name* of `keys` as if its key had been pressed; see `do`."""
        binding = self.keys[name]
        return self.do(binding.action, while_busy=binding.while_busy)  # type: ignore[arg-type]

    def save(self, path: str | os.PathLike[str] | None = None) -> None:
        """Write the session to `path`, after setting it to *path* if given; see `save_session`.

        A pose that still converges after its release is converged first.
        """
        if path is not None:
            self.path = path
        self._controller.settle()
        self._controller.save()

    def complete(self, progress: Progress | None = None) -> None:
        """Settle and finish the pose, which otherwise happens while the hand rests after a drag.

        Also after `Off` and `remove`, which interrupt that.  Nothing happens if the pose has been
        finished, or shall not be: see `finishing`.

        Parameters
        ----------
        progress : Progress, optional
            May raise `Cancelled`; then the pose has converged at most, and is not finished.
        """
        self._controller.complete(progress)

    def load(self, path: str | os.PathLike[str]) -> None:
        """Edit the session or the mesh in a file; see `load_session`, `read_mesh`."""
        self._controller.open(as_path(path))
        self.wait()

    # Switching.

    def On(self) -> None:  # noqa: N802 - VTK's name
        """Respond to events of the view.

        Raises
        ------
        RuntimeError
            After `remove`.
        """
        if self._is_removed:
            raise RuntimeError("this editor was removed; create another one over its session")
        if not self._stops:
            self._stops = [
                self.view.complete_events(),
                self.view.observe("KeyPressEvent", self._key, _AFTER_WIDGETS),
                self.view.observe("CharEvent", lambda: self._took_key, _AFTER_WIDGETS),
                self.view.observe("KeyReleaseEvent", self._release, _AFTER_WIDGETS),
                self.view.observe("LeftButtonPressEvent", self._press, _BEFORE_CAMERA),
            ]
            self._controller.is_on = True

    def Off(self) -> None:  # noqa: N802
        """Ignore events; a job is cancelled, a drag is finished, and the display is unchanged."""
        for stop in self._stops:
            stop()
        self._stops = []
        self._show_pose()
        self._controller.is_on = False

    def SetEnabled(self, enabled: bool) -> None:  # noqa: N802
        """Switch the editor on or off."""
        if as_switch(enabled, "enabled"):
            self.On()
        else:
            self.Off()

    def GetEnabled(self) -> bool:  # noqa: N802
        """Return whether the editor is on."""
        return bool(self._stops)

    def remove(self) -> None:
        """Remove everything from the view, permanently; the session is unchanged."""
        with self.view.drawing_once():
            self.Off()
            self._is_removed = True
            self._controller.remove()

    # Keys.

    def _key(self) -> bool:
        key = pressed_key(self.view.interactor)
        # Even if the action fails.
        self._took_key = self.view.is_addressed and bool(self.keys.modes_of(key))
        if self._took_key:
            self._type(key)
        return self._took_key

    def _release(self) -> None:
        """Show the pose again, unless the release is followed by a press: a key that repeats."""
        held = {key.rpartition("+")[2] for key in self.keys["before_after"].keys}
        if pressed_key(self.view.interactor).rpartition("+")[2] in held:
            self._stop_waiting()
            self._stop_waiting = self.view.every(_REPEAT, self._show_pose)

    def _press(self) -> bool:
        """Show the pose again at a press on the mesh, which does nothing else then."""
        controller, pointer = self._controller, self.view.pointer(Phase.PRESS)
        if controller.widgets.surface.instead is None or pointer.alt:
            return False
        if controller.widgets.point_at(pointer) is None:
            return False
        self._show_pose()
        controller.say("The pose is shown again; the next drag moves it")
        return True

    def _show_pose(self) -> None:
        self._stop_waiting()
        self._controller.show_instead(None)

    def _type(self, key: str) -> None:
        if self._controller.camera.navigation.is_dragging and key not in self.keys["cancel"].keys:
            # Keys of a drag, after a press that has missed: they would undo, or change the mode.
            self._controller.say("Nothing is grabbed: the drag moves the camera, and keys wait")
            return
        binding = self.keys.binding_of(key, self.mode)
        if binding is not None and binding.action is not None:
            self._do(binding.action, binding.while_busy)
            return
        modes = ", ".join(f"{mode.value} ({label})" for mode, label in self.keys.modes_of(key))
        if self.is_busy:
            self._controller.queue.refuse()
        else:  # no action, so a drag continues
            self._controller.messages.clear()
            self._controller.say(f"{key_cap(key)} works in mode {modes}")

    def _do(self, action: Action, while_busy: bool) -> SessionError | None:
        controller = self._controller
        if not while_busy:
            if controller.is_busy:
                controller.queue.refuse()
                return SessionError(controller.queue.refusal)
            controller.widgets.finish()
        controller.messages.clear()
        if not while_busy:
            controller.queue.hurry(Kind.SAVE)
        if action is show_rest:
            self._stop_waiting()  # its key repeats
        is_edit = not while_busy and action is not show_rest
        if is_edit:  # the camera may move around the mesh at rest
            controller.show_instead(None)
        else:
            controller.widgets.leave()
        action(controller)
        if is_edit:  # otherwise Escape would restart the job it has just cancelled
            controller.prepare()
        controller.refresh()
        return None


def _is_aimed(renderer: Any) -> bool:
    """Return whether the camera was set; an empty window that was drawn has a default camera."""
    if not renderer.IsActiveCameraCreated():
        return False
    camera = renderer.GetActiveCamera()
    default = (0.0, 0.0, 1.0), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0)
    now = camera.GetPosition(), camera.GetFocalPoint(), camera.GetViewUp()
    return bool(now != default or renderer.VisibleActorCount())
