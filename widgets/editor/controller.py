"""The controller of the editor: one session, its widgets, the mode, the running job and the file.

What runs in the background, and later, is in its `queue`.  The widgets are off during a job: a
session must not be used while another thread binds it.  Every error, in a callback or in a task, is
shown in the status line until the next action succeeds.

Long because every widget, job and file meets here.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TypeVar

import numpy as np

from vtk_segdeform.arrays import FloatArray
from vtk_segdeform.errors import SessionError
from vtk_segdeform.kernels import advice, is_compiling, load_early, load_for, load_late
from vtk_segdeform.progress import Progress, part
from vtk_segdeform.session import Change, Preparation, Session, pulls, saved_view

from ..scene import Draft, Pointer, View, Widget
from .camera import Camera, has_y_up
from .finishing import Finishing
from .help_card import HelpCard
from .hints import hint
from .keys import Keys
from .messages import Messages
from .notices import Notices
from .preparing import Preparing
from .queue import Kind, Queue, Task
from .session_file import SessionFile, WrittenMesh, is_mesh, pose_remark, read_session
from .session_history import SessionHistory
from .widget_set import Mode, Spot, WidgetSet

_FIRST_RUN = "First run: compiling in the background, once"
_CLICK = 0.3  # seconds, beside those of a picture; a longer press holds a button
_REST = 1.0  # seconds without a gesture before kernels are loaded: a press would wait for it
T = TypeVar("T")


class Controller:
    """The object that every action of the editor receives.

    Parameters
    ----------
    view : View
        Where everything is drawn.
    session : Session
        The first session to edit.
    keys : Keys
        The keys that start actions; set by the editor.

    Attributes
    ----------
    file : SessionFile
        The file to save to and open from.
    history : SessionHistory
        The steps of `session`, and of those that it was repaired from.
    widgets : WidgetSet
        The widgets over `session`; replaced when another session is opened.
    help : HelpCard
        The card with the keys.
    show_keys : callable
        Shows the keys or hides them: on the card, unless a toolkit has something better.
    show_menu : callable
        ``show_menu(pointer)`` shows the menu of what is at `spot`; by default nothing.
    spot : Spot or None
        What the last right click was on; None beside the mesh.
    messages : Messages
        The status line.
    displacement : str or None
        The name of a point array that saved meshes get: how far each point has moved.
    notices : Notices
        How the mesh differs from what was given, and where; above the status line.
    camera : Camera
        Navigation, views and the orientation cube.
    queue : Queue
        What runs in the background, and what comes next.
    finishing : Finishing
        Finishes the pose on the mesh after each drag of a handle.
    """

    def __init__(self, view: View, session: Session, keys: Keys) -> None:
        load_late()
        self.view, self.keys = view, keys
        self.help = HelpCard(view, keys.sections(), keys.sections(Mode.PULL))
        self.show_keys: Callable[[], object] = self.help.toggle
        self.show_menu: Callable[[Pointer], object] = lambda _: None
        self.spot: Spot | None = None
        self.messages = Messages(view)
        self.messages.note(advice() or (_FIRST_RUN if is_compiling() else ""))
        self.notices = Notices(view, lambda: self.messages.height)
        self.displacement: str | None = None
        self._mode = Mode.PULL
        self._is_on = self._was_busy = False
        self._interrupted = False, False  # by turning off: settling, and finishing
        self._text_instead = self._unmoved = ""
        self._held_at = -math.inf  # when the button that shows the mesh at rest was pressed
        self._began_at = 0  # the position in the history when the last gesture began
        self.queue = Queue(view, self._queue_changed)
        self._preparing = Preparing(self.queue, self._may_accept, self._accept, self._prepare_pulls)
        self.finishing = Finishing(
            view,
            self.queue,
            lambda: self.session,
            lambda: self.widgets.surface,
            self.is_free,
        )
        self.widgets = WidgetSet(view, session)
        self.camera = Camera(view, self.widgets, self.help)
        self.camera.navigation.right_clicked = self._open_menu
        self.camera.navigation.middle_orbits = keys.middle_orbits
        self._listen()
        self.notices.follow(session)
        self.file = SessionFile(Path("session.segdeform"), session)
        self.history = SessionHistory(session, self._enter)
        self._files: dict[Session, SessionFile] = {}  # of the other sessions in the history
        self._is_intact = True  # the mesh file that was saved last, as far as is known
        self._has_failed = False  # since the last move of a gesture
        self._stop_failures = view.on_failure(self._show_error)

    @property
    def session(self) -> Session:
        """The session being edited; another one after `open`."""
        return self.widgets.session

    @property
    def mode(self) -> Mode:
        """The current mode; may be set even if the session is not ready for it."""
        return self._mode

    @mode.setter
    def mode(self, mode: Mode) -> None:
        self.widgets.finish()
        is_lost = mode is not Mode.PULL and self.widgets.puller.cancel()
        if self._mode is Mode.HANDLES and self.widgets.selector.handle in self.session.handles:
            self.widgets.dragger.handle = self.widgets.selector.handle
        self._mode = mode
        self.list_keys()
        self.messages.clear()
        if is_lost:
            self.messages.note("Pull cancelled: the mesh was not ready yet")
        self._prepare_pulls(again=True)
        self._apply_mode()

    def list_keys(self) -> None:
        """List the current keys on the help card, in a small window those of the mode."""
        keys = self.keys
        self.camera.navigation.middle_orbits = keys.middle_orbits
        self.help.list_keys(keys.sections(), keys.sections(self._mode))

    @property
    def is_on(self) -> bool:
        """Whether the widgets respond to events, except while a job is running."""
        return self._is_on

    @is_on.setter
    def is_on(self, on: bool) -> None:
        was_on, self._is_on = self._is_on, on
        with self.view.drawing_once():
            self.camera.navigation.SetEnabled(on)
            try:
                if not on:
                    self.widgets.finish()  # a drag that ends now is completed as any other
                    if was_on:
                        self._interrupted = self.widgets.is_settling, self.finishing.is_pending
                    self.help.hide()
                    self.queue.hurry(Kind.SAVE)
                    self._preparing.stop()
                    self.finishing.interrupt()
                    self.queue.cancel(Kind.JOB, Kind.LOAD)
                    self.queue.wait(Kind.JOB)
            finally:
                self._apply_mode()

    def complete(self, progress: Progress | None = None) -> None:
        """Settle and finish the pose now, as it would have been soon, had the editor stayed on.

        The part that is done when *progress* cancels remains.
        """
        settles, finishes = self._interrupted
        if self._is_on:
            settles, finishes = self.widgets.is_settling, self.finishing.is_pending
        self._interrupted = False, False
        session = self.session
        if settles:
            session.refine(progress=part(progress, 0.0, 0.5))
        if finishes and session.can_finish and not session.is_unsettled:
            session.finish(progress=part(progress, 0.5, 1.0))

    def remove(self) -> None:
        """Remove everything from the view, permanently."""
        self.is_on = False
        self.queue.stop()
        self._stop_listening()
        self._stop_failures()
        self.finishing.interrupt()
        self.camera.remove()
        self.widgets.remove()
        self.help.remove()
        self.notices.remove()
        self.messages.remove()
        self.view.remove_foreground()

    # Messages.

    @property
    def hint(self) -> str:
        """The next step, or what is shown."""
        if self.widgets.surface.instead is not None:
            return self._text_instead
        text, session = hint(self.widgets, self._mode, self.keys), self.session
        is_first = self._mode is Mode.PULL and not session.history.can_undo
        if not (self.camera.is_up_unsure and is_first) or session.is_dragging:
            return text
        up = "XYZ"[int(self.camera.viewpoint.up.argmax())]
        return f"{up} is up by a guess. {self.keys.cap('next_up_axis')}: next axis · {text}"

    def say(self, text: str) -> None:
        """Show the result of an action, before the hint for the next step."""
        self.messages.note(text)
        self.refresh()

    def refresh(self) -> None:
        """Update the status line."""
        mode = f"{self._mode.value} {self._mode.name}"
        job = self.queue.job
        if self.widgets.is_settling and self.queue.task(Kind.SETTLE) is None:
            task = Task(
                kind=Kind.SETTLE,
                begin=self.refresh,
                may_begin=lambda: not self.widgets.is_settling,
            )
            self.queue.add(task)
        if job is not None:
            self.messages.show_progress(
                mode, self.queue.text, job.fraction, is_cancelled=job.is_cancelled
            )
        elif self._is_on:
            work, fraction = self.queue.aside
            self.messages.show(mode, self.hint, fraction, work=work)
        else:
            self.messages.hide()
        self.notices.enable(self._is_on)

    @contextmanager
    def clean_view(self) -> Iterator[None]:
        """Draw the view without status line, notices, cube and gizmos inside a ``with`` block."""
        cube = self.camera.cube
        has_cube = cube.is_shown
        self.widgets.switch_off()
        self.messages.hide()
        self.notices.enable(False)
        cube.hide()
        self.view.render()
        try:
            yield
        finally:
            if has_cube:
                cube.show()
            self._apply_mode()

    @property
    def shows_rest(self) -> bool:
        """Whether the mesh at rest is shown instead of the current pose."""
        return self.widgets.surface.instead is self.session.mesh.vertices

    def hold_rest(self, held: bool) -> None:
        """Show the mesh at rest while a button is *held*; a click keeps it until the next one."""
        if held:
            self._held_at = -math.inf if self.shows_rest else time.monotonic()
            self.show_instead(self.session.mesh.vertices, "The mesh at rest, while held")
        elif time.monotonic() - self._held_at > _CLICK + Draft.of(self.view).seconds:
            self.show_instead(None)
        else:
            text = "The mesh at rest. Press on it, or Before/After again, to see the pose"
            self.show_instead(self.session.mesh.vertices, text)

    def show_instead(self, vertices: FloatArray | None, text: str = "") -> None:
        """Show *vertices* (n, 3) without widgets, and *text*; or None for the current pose."""
        surface, self._text_instead = self.widgets.surface, text
        if vertices is not None:
            self.widgets.show_instead(vertices)
        elif surface.instead is None:
            return
        else:
            surface.instead = None
            self._switch_widgets()
            self.widgets.show(self._mode)
        self.refresh()

    def _show_error(self, error: Exception) -> None:
        self.messages.report_error(error)
        self._has_failed = True
        self.refresh()

    def _gesture_moved(self, *_: object) -> None:
        """Clear the error of an earlier move once a move succeeds."""
        if self.messages.error and not self._has_failed:
            self.messages.clear()
            self.refresh()
        self._has_failed = False

    def _listen(self) -> None:
        session = self.session
        self._stop_listening = session.on_change(self._session_changed)
        waiting = self.widgets.puller.waiting
        waiting.stand_in = lambda: self._preparing.stand_in(session)
        waiting.is_coming = lambda: self.is_busy or self.queue.task(Kind.PREPARE) is not None
        for widget in self.widgets.interactive:
            widget.AddObserver("StartInteractionEvent", self._gesture_began)
            widget.AddObserver("InteractionEvent", self._gesture_moved)
            widget.AddObserver("EndInteractionEvent", self._gesture_ended)
        self.widgets.puller.says = self.say
        for widget in (self.widgets.puller, self.widgets.dragger, self.widgets.landmarks):
            widget.AddObserver("ModifiedEvent", lambda *_: self.refresh())

    def _gesture_ended(self, widget: Widget, _: str) -> None:
        if widget.remark:
            self.messages.note(widget.remark)
        self._load_later()
        is_pull = widget is self.widgets.puller  # smooth, while a finish may end in a step
        pulled = pulls.last_pulled(self.session.mesh, self.session.state)
        if (
            is_pull
            and self.session.history.position != self._began_at
            and pulled in self.session.handles
        ):
            self.widgets.dragger.handle = pulled  # as in `_gesture_began`
        if widget is self.widgets.dragger:  # name the parts that no handle moves, once
            solution, mesh = self.session.solution, self.session.mesh
            text = "" if solution is None else solution.unmoved_summary(mesh)
            if text and text != self._unmoved:
                self.messages.note(text[:1].upper() + text[1:])
            self._unmoved = text
        if widget is self.widgets.dragger or (is_pull and self.session.options.avoid_contact):
            self.finishing.rest()
        self.refresh()

    def _gesture_began(self, *_: object) -> None:
        self._began_at = self.session.history.position
        marker = self.widgets.puller.marker_under_pointer() if self._mode is Mode.PULL else None
        if marker is not None:
            self.widgets.dragger.handle = marker  # which the panel selects
        self.queue.hurry(Kind.SAVE)
        self.finishing.interrupt()
        self.messages.clear()  # an error would hide the amount and the keys of the drag
        if is_compiling():
            self.messages.note(_FIRST_RUN)  # again, as frames take longer
        if self._mode is Mode.PULL:
            self._prepare_pulls(again=True)
        self.refresh()

    def _session_changed(self, change: Change) -> None:
        if change & Change.HISTORY:
            self.messages.clear()
            self.show_instead(None)
        self.finishing.follow(change)
        self.notices.changed(change)
        replaced = change & Change.POSE and change & (Change.REGIONS | Change.CAGES)
        if replaced and self.session.state.pose is None:
            self.messages.note("Pose reset: the regions or cages have changed")
        if change & Change.REGIONS:
            self.widgets.choose_region(self.widgets.selector.region)
        self._prepare_pulls()
        self.refresh()

    # Jobs.

    @property
    def is_busy(self) -> bool:
        """Whether a job is running."""
        return self.queue.job is not None

    def start(
        self, name: str, work: Callable[[Progress], T], done: Callable[[T], str | None]
    ) -> None:
        """Run *work* in another thread, then *done* here; show the outcome it returns.

        An ongoing drag or stroke is finished before the work starts.

        Raises
        ------
        SessionError
            If another job is running.
        """

        def deliver(result: T) -> None:
            outcome = done(result)
            if outcome:
                self.messages.note(outcome)
            self._apply_mode()

        n_vertices = self.session.mesh.n_vertices

        def with_kernels(progress: Progress) -> T:
            load_for(n_vertices)
            return work(progress)

        with self.view.drawing_once():
            self.widgets.finish()  # before the job starts, because it may fail
            self.queue.hurry(Kind.SAVE)
            self._preparing.interrupt()
            self.finishing.interrupt()
            task = Task(kind=Kind.JOB, name=name, begin=lambda: with_kernels, done=deliver)
            self.queue.add(task)
            self.widgets.switch_off()
            self.refresh()

    @property
    def is_modified(self) -> bool:
        """Whether there are unsaved changes, or a released pull that will be one."""
        return self.file.is_modified(self.session) or self.widgets.puller.waiting.has_pull

    def cancel(self) -> None:
        """Cancel the job, or else the ongoing drag or stroke, or the preparation; or close help."""
        if self.is_busy:
            self.queue.cancel(Kind.JOB)
            self.refresh()
        elif self.widgets.cancel():
            self.refresh()
        elif self.help.is_shown:
            self.help.hide()
        elif self.widgets.is_settling:
            self.finishing.interrupt()
            self.widgets.stop_refining()
            self.queue.cancel(Kind.SETTLE)
            self.messages.note("Stopped. The pose has not settled")
            self.queue.hurry(Kind.SAVE)
            self.refresh()
        elif self.finishing.interrupt():
            self.say("The pose is not finished on the mesh")
        elif self._preparing.cancel():
            self.say("Preparation cancelled. Drag the surface to start it again")

    def prepare(self) -> None:
        """Precompute the data of the first drag, or of the overlay, in the background."""
        widgets, session = self.widgets, self.session
        if not self._is_on or self.is_busy:
            return
        self._prepare_pulls()
        if self._mode is Mode.DEFORM and session.state.is_ready and not session.is_bound:
            self.start("Binding mesh to cages", widgets.bind, lambda _: None)
        elif widgets.wants_overlay(self._mode) and not widgets.overlay.is_prepared:
            self.start("Computing local volume change", widgets.measure, lambda _: None)

    def _prepare_pulls(self, *, again: bool = False) -> None:
        """Prepare the session if the mode needs it; *again* even after an error or Escape.

        Another mode continues a preparation, but its result waits for one that does.
        """
        if self._is_on and not self.is_busy:
            self._preparing.update(self.session, start=self._needs_binding, again=again)
            if self._mode is Mode.PULL and self._preparing.fraction is not None:
                Draft.of(self.view).begin(if_slow=True)

    def _may_accept(self) -> bool:
        """Return whether the session may be prepared now: nothing is being pulled or painted."""
        session = self.session
        is_pulling = session.is_bound and any(w.is_grabbing for w in self.widgets.interactive)
        return self._needs_binding and not (self.is_busy or session.is_dragging or is_pulling)

    @property
    def _needs_binding(self) -> bool:
        """Whether the mode is PULL, or DEFORM with cages, whose stiffness may have changed."""
        return self._mode is Mode.PULL or (self._mode is Mode.DEFORM and bool(self.session.cages))

    def is_free(self) -> bool:
        """Return whether nothing is being dragged, refined or computed."""
        widgets = self.widgets
        is_used = self.session.is_dragging or any(w.is_grabbing for w in widgets.interactive)
        is_used |= widgets.puller.waiting.is_active
        is_refined = widgets.dragger.is_refining or widgets.puller.is_refining
        return self._is_on and not (self.is_busy or is_used or is_refined)

    def _load_later(self) -> None:
        """Load kernels once the hand has rested: a press would wait for it."""
        self.queue.cancel(Kind.LOAD)

        def load() -> None:
            load_early()

        def is_at_rest() -> bool:
            return self.is_free() and self.queue.task(Kind.PREPARE) is None

        self.queue.add(Task(kind=Kind.LOAD, begin=load, may_begin=is_at_rest, rest=_REST))

    def _accept(self, session: Session, preparation: Preparation) -> None:
        was_modified = self.file.is_modified(session)
        session.accept(preparation)
        self.widgets.overlay.region_volumes.prepare()  # so that the first frame need not
        self._load_later()
        self.file.prepared(session, was_modified=was_modified)
        self.refresh()

    def _queue_changed(self) -> None:
        if self._was_busy and not self.is_busy:
            self._switch_widgets()
        self._was_busy = self.is_busy
        self.refresh()

    def _apply_mode(self) -> None:
        """Apply the current mode."""
        self._switch_widgets()
        self.prepare()
        self.refresh()

    def _switch_widgets(self) -> None:
        if self._is_on and not self.is_busy:
            self.widgets.enter(self._mode)
        else:
            self.widgets.switch_off()

    # Files.

    def once_settled(self, act: Callable[[], None]) -> None:
        """Call *act* once the pose has settled: what is saved is the pose that is to come.

        What would change the pose meanwhile, such as a press, lets *act* be called first, and so
        does Escape, at which the pose remains as it is.
        """
        if not self.widgets.is_pose_to_come:
            act()
            return
        task = Task(
            kind=Kind.SAVE,
            begin=act,
            may_begin=lambda: not self.widgets.is_pose_to_come,
        )
        self.queue.add(task)
        self.say("Saving once the pose has settled")

    def settle(self) -> None:
        """Settle the pose now, which may take seconds, and save what waits; for scripts."""
        if self.widgets.is_settling:
            self.session.refine()
            self.queue.cancel(Kind.SETTLE)
        if not self.widgets.is_pose_to_come:
            self.queue.hurry(Kind.SAVE)

    def save(self) -> None:
        """Write the session to the file, in the pose that is shown."""
        self.finishing.interrupt()
        self.file.write(self.session, self.camera.settings(self._mode))
        self.say(f"Saved to {self.file.path}{pose_remark(self.session)}")

    def read_again(self, written: WrittenMesh) -> None:
        """Read a mesh again in another thread, and say what the file has lost, if anything.

        It is said once nothing is dragged or computed, which would replace the message.
        """

        def read(_: Progress) -> str | SessionError:
            try:
                return written.loss()
            except SessionError as error:
                return error

        def tell(loss: str | SessionError) -> None:
            self._is_intact = not loss
            if isinstance(loss, SessionError):
                self._show_error(loss)
            elif loss:
                self.say(". ".join([f"Mesh saved to {written.path}", loss, *written.remarks]))

        self.queue.cancel(Kind.CHECK)
        self._is_intact = True
        task = Task(kind=Kind.CHECK, begin=lambda: read, done=tell, may_end=self.is_free)
        self.queue.add(task)

    def saved_intact(self) -> bool:
        """Wait until the mesh that was saved last is read again; return whether nothing is lost."""
        self.queue.wait(Kind.CHECK)
        return self._is_intact

    def open(self, path: Path) -> None:
        """Read the session or the mesh in *path* as a job, and then edit that."""

        def replace(session: Session) -> str:
            is_other = not np.array_equal(self.session.mesh.vertices, session.mesh.vertices)
            self._edit(session)
            self.history.begin(session)
            self._files.clear()
            self.file.opened(path, session)
            if is_other:
                self.camera.show_model()
            self.restore_view(path)
            self.view.render()  # before anything else is computed
            return f"Opened {path}"

        self.start(f"Opening {path}", lambda progress: read_session(path, progress), replace)

    def open_repaired(self, session: Session, file: SessionFile) -> None:
        """Edit *session*, a repaired copy of the current one, with a *file* of its own.

        It is a step of the history: undo returns to the original.
        """
        self._files[session] = file
        self.history.repaired(session)
        self.say("Repaired")

    def _enter(self, session: Session) -> None:
        """Edit another session of the history, seen from the same side."""
        self._preparing.interrupt()
        self.finishing.interrupt()
        self._files[self.session], self.file = self.file, self._files[session]
        self._edit(session)
        self._apply_mode()

    def _open_menu(self, pointer: Pointer) -> None:
        if not self.is_busy:
            self.spot = self.widgets.spot_at(pointer)
            self.show_menu(pointer)

    def _edit(self, session: Session) -> None:
        self.spot = None
        self.widgets = self.widgets.replaced_by(session)
        self.camera.follow(self.widgets)
        self._stop_listening()
        self._listen()
        self.notices.follow(session)

    def restore_view(self, path: Path) -> None:
        """Restore camera and mode from a session file; set the up axis that a mesh file has."""
        if is_mesh(path):
            if has_y_up(path):
                self.camera.show_model(path)
            return
        mode = self.camera.restore(saved_view(path))
        if mode is not None:
            self.mode = mode
