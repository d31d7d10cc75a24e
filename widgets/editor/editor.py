"""Regions, cages, handles and poses of one session in one window: four modes, and keys for all.

    editor = DeformEditor(view, mesh)
    editor.On()

The line at the bottom says what to do next; H shows the keys, which `bindings` lists and
`actions` tells.  What takes long, finding regions, fitting cages and binding, is a job in another
thread: the camera works meanwhile, nothing else does, and Escape stops it.

An action in the middle of a drag or a stroke finishes that first, as if the button had been
released, as one undo step.  Only Escape cancels it; the key card does not interrupt it.

The camera style and pyvista's own keys are not touched.  The editor hears of keys after its
widgets, so that x, y, z constrain a drag, but before VTK and pyvista, and keeps from them what
means something to it.  With several editors in one window they go to the one the pointer is over.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from vtk_segdeform.checks import as_callable, as_flag, as_path, as_switch, require, shown
from vtk_segdeform.errors import ArgumentError
from vtk_segdeform.mesh import Mesh
from vtk_segdeform.session import Session

from ..scene import Stop, View
from .actions import Action
from .bindings import binding_of, help_sections, key_cap, modes_of, pressed_key
from .desk import Desk
from .stage import Mode, Stage

_AFTER_WIDGETS = 0.75  # priority: our widgets have 1, VTK's own 0.5, pyvista and camera styles 0


class DeformEditor:
    """The whole editor in one view; off until `On`.

    Parameters
    ----------
    view : View, pyvista.Plotter or (vtkRenderer, vtkRenderWindowInteractor)
        Where it lives.  Call `remove` before its window closes.
    session : Session or Mesh
        What to edit; a mesh begins a session of its own.
    """

    def __init__(self, view: Any, session: Session | Mesh) -> None:
        require(session, (Session, Mesh), "session")
        self.view = View.of(view)
        has_camera = _is_aimed(self.view.renderer)
        session = session if isinstance(session, Session) else Session(session)
        self._desk = Desk(self.view, session, help_sections())
        if not has_camera:
            self.view.renderer.ResetCamera()
        self._took_key = False
        self._is_removed = False
        self._stops: list[Stop] = []

    @property
    def session(self) -> Session:
        """What is edited; another one after `load`."""
        return self._desk.session

    @property
    def stage(self) -> Stage:
        """The widgets, over `session`; others after `load`."""
        return self._desk.stage

    @property
    def desk(self) -> Desk:
        """What the actions of `editing.actions` work on, for `do`."""
        return self._desk

    @property
    def mode(self) -> Mode:
        """What the mouse does; may be set, also to one that still lacks something."""
        return self._desk.mode

    @mode.setter
    def mode(self, mode: Mode) -> None:
        if not isinstance(mode, Mode):
            raise ArgumentError(
                f"mode must be one of {', '.join(map(str, Mode))}; got {shown(mode)}"
            )
        self._desk.mode = mode

    @property
    def path(self) -> Path:
        """Where the keys save to and open from; "session.segdeform" in the working folder."""
        return self._desk.file.path

    @path.setter
    def path(self, path: str | os.PathLike[str]) -> None:
        self._desk.file.path = as_path(path)

    @property
    def status(self) -> str:
        """What the line at the bottom says."""
        return self._desk.status

    @property
    def is_busy(self) -> bool:
        """Whether a job is running."""
        return self._desk.is_busy

    def wait(self) -> None:
        """Stand still until no job is running; what one raises comes out.  For scripts."""
        self._desk.wait()

    def do(self, action: Action, *, while_busy: bool = False) -> None:
        """Do one of `editing.actions` as if its key were typed; what goes wrong is said.

        Parameters
        ----------
        action : callable
            ``action(desk)``.
        while_busy : bool
            Whether the action may run during a job, a drag or a stroke.  Otherwise it is refused
            during a job, with a message, and a drag or stroke is finished first.
        """
        as_callable(action, "action")
        as_flag(while_busy, "while_busy")
        with self.view.guarded():
            self._do(action, while_busy)

    def save(self, path: str | os.PathLike[str] | None = None) -> None:
        """Write the session to *path*, which becomes `path`, or to that; see `save_session`."""
        if path is not None:
            self.path = path
        self._desk.save()

    def load(self, path: str | os.PathLike[str]) -> None:
        """Go on with the session in a file, or its mesh; see `load_session`, `read_mesh`."""
        self._desk.open(as_path(path))
        self.wait()

    # Switching.

    def On(self) -> None:  # noqa: N802 - VTK's word
        """Listen to the view.

        Raises
        ------
        RuntimeError
            After `remove`.
        """
        if self._is_removed:
            raise RuntimeError("this editor was removed; make another one over its session")
        if not self._stops:
            self._stops = [
                self.view.observe("KeyPressEvent", self._key, _AFTER_WIDGETS),
                self.view.observe("CharEvent", lambda: self._took_key, _AFTER_WIDGETS),
            ]
            self._desk.is_on = True

    def Off(self) -> None:  # noqa: N802
        """Stop listening; a job is cancelled, a drag finished, and the display is unchanged."""
        for stop in self._stops:
            stop()
        self._stops = []
        self._desk.is_on = False

    def SetEnabled(self, enabled: bool) -> None:  # noqa: N802
        """Switch on or off."""
        if as_switch(enabled, "enabled"):
            self.On()
        else:
            self.Off()

    def GetEnabled(self) -> bool:  # noqa: N802
        """Tell whether it is on."""
        return bool(self._stops)

    def remove(self) -> None:
        """Take everything out of the view, for good; the session stays as it is."""
        self.Off()
        self._is_removed = True
        self._desk.remove()

    # Keys.

    def _key(self) -> bool:
        key = pressed_key(self.view.interactor)
        meant = self.view.is_addressed
        self._took_key = meant and bool(modes_of(key))  # also where it fails
        if self._took_key:
            self._type(key)
        return self._took_key

    def _type(self, key: str) -> None:
        binding = binding_of(key, self.mode)
        if binding is not None and binding.action is not None:
            self._do(binding.action, binding.while_busy)
            return
        places = ", ".join(f"{mode.value} ({what})" for mode, what in modes_of(key))
        if self.is_busy:
            self._desk.insist()
        else:  # no action, so a drag continues
            self._desk.voice.forget()
            self._desk.say(f"{key_cap(key)} is a key of {places}")

    def _do(self, action: Action, while_busy: bool) -> None:
        desk = self._desk
        if not while_busy:
            if desk.is_busy:
                desk.insist()
                return
            desk.stage.finish()
        desk.voice.forget()
        action(desk)
        if not while_busy:  # otherwise Escape would restart the job it has just cancelled
            desk.bind_if_ready()
        desk.refresh()


def _is_aimed(renderer: Any) -> bool:
    """Tell whether somebody has set the camera; an empty window, once drawn, has one as made."""
    if not renderer.IsActiveCameraCreated():
        return False
    camera = renderer.GetActiveCamera()
    as_made = (0.0, 0.0, 1.0), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0)
    now = camera.GetPosition(), camera.GetFocalPoint(), camera.GetViewUp()
    return bool(now != as_made or renderer.VisibleActorCount())
