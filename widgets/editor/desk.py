"""Where the editor works: one session on its stage, in a mode, with jobs, a file and a voice.

One job runs at a time, and meanwhile the widgets are off: a session may not be asked for anything
else while another thread binds it.  Whatever goes wrong, in a callback or in a job, is said in
the line at the bottom and stays there until something succeeds.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from vtk_segdeform.kernels import advice
from vtk_segdeform.progress import Progress
from vtk_segdeform.session import Change, Session

from ..recording import confined_path
from ..scene import View, Widget
from .help_card import HelpCard, Section
from .hints import hint
from .log import Log
from .session_file import SessionFile, read_all
from .stage import Mode, Stage
from .takes import Takes
from .voice import Voice
from .work import Work


class Desk:
    """What the actions of the editor work on.

    Parameters
    ----------
    view : View
        Where everything is drawn.
    session : Session
        What is edited first.
    keys : sequence of sections
        For the help card.

    Attributes
    ----------
    file : SessionFile
        Where to save to and open from.
    stage : Stage
        The widgets, over `session`; others after another session was opened.
    help : HelpCard
        The card of keys.
    voice : Voice
        What is said in the line at the bottom.
    log : Log
        What was done, and what it took.
    takes : Takes
        The recording and the film that are going on.
    """

    def __init__(self, view: View, session: Session, keys: list[Section]) -> None:
        self.view = view
        self.help = HelpCard(view, keys)
        self.voice = Voice(view)
        self.voice.note(advice())
        self.takes = Takes(view)
        self._mode = Mode.REGIONS
        self._is_on = False
        self.log = Log()
        self._work = Work(view, self.voice, self.log, self._got_on)
        self.stage = Stage(view, session)
        self._listen()
        self.file = SessionFile(Path("session.segdeform"), session)
        self._stop_failures = view.on_failure(self._failed)

    @property
    def session(self) -> Session:
        """What is edited; another one after `open`."""
        return self.stage.session

    @property
    def mode(self) -> Mode:
        """What the mouse does; may be set, also to one that still lacks something."""
        return self._mode

    @mode.setter
    def mode(self, mode: Mode) -> None:
        self.stage.finish()
        self._mode = mode
        self.voice.forget()
        self._settle()

    @property
    def is_on(self) -> bool:
        """Whether the widgets listen, whenever there is no job."""
        return self._is_on

    @is_on.setter
    def is_on(self, on: bool) -> None:
        self._is_on = on
        try:
            if not on:
                self.help.hide()
                self._work.cancel()
                self.wait()
        finally:
            self._settle()

    def remove(self) -> None:
        """Take everything out of the view, for good."""
        self.is_on = False
        self._stop_hearing()
        self._stop_failures()
        self.log.rest()
        self.takes.remove()
        self.stage.remove()
        self.help.remove()
        self.voice.remove()
        self.view.remove_foreground()

    # Telling.

    @property
    def status(self) -> str:
        """What the line at the bottom says."""
        return self.voice.text

    def say(self, text: str) -> None:
        """Tell what was done, before the hint of what to do next."""
        self.voice.note(text)
        self.refresh()

    def refresh(self) -> None:
        """Say what there is to say now."""
        mode = " · ".join([f"{self._mode.value} {self._mode.name}", *self.takes.words])
        if self._work.job is not None:
            self.voice.tell_of(self._work.job, mode, self._work.doing)
        elif self._is_on:
            self.voice.speak(mode, hint(self.stage, self._mode))
        else:
            self.voice.be_silent()

    def _failed(self, error: Exception) -> None:
        self.voice.complain(error)
        self.refresh()

    def _listen(self) -> None:
        self.log.follow(self.session)
        self._stop_hearing = self.session.on_change(self._changed)
        for widget in self.stage.widgets:
            widget.AddObserver("EndInteractionEvent", self._ended)

    def _ended(self, widget: Widget, _: str) -> None:
        if widget.remark:
            self.voice.note(widget.remark)
        self.refresh()

    def _changed(self, change: Change) -> None:
        if change & Change.HISTORY:
            self.voice.forget()
        remade = change & Change.POSE and change & (Change.REGIONS | Change.CAGES)
        if remade and self.session.state.pose is None:
            self.voice.note("at rest again: the pose was of other regions")
        if change & Change.REGIONS:
            self.stage.choose_region(self.stage.selector.region)
        self.refresh()

    # Jobs.

    @property
    def is_busy(self) -> bool:
        """Whether a job is running."""
        return self._work.job is not None

    def start(
        self, doing: str, work: Callable[[Progress], Any], done: Callable[[Any], object]
    ) -> None:
        """Run *work* in another thread, then *done* here with its result; see `Work.start`.

        An ongoing drag or stroke is finished before the work starts.
        """

        def deliver(result: Any) -> None:
            done(result)
            self._settle()

        self.stage.finish()  # before the job starts, because it may fail
        self._work.start(doing, work, deliver)
        self.stage.rest()
        self.refresh()

    def wait(self) -> None:
        """Stand still until there is no job any more; for scripts."""
        self._work.wait()

    def cancel(self) -> None:
        """Cancel the job, or else the ongoing drag or stroke, or else close the key card."""
        if self.is_busy:
            self._work.cancel()
            self.refresh()
        elif not self.stage.cancel():
            self.help.hide()

    def insist(self) -> None:
        """Say that nothing else can be done while the job is running."""
        self._work.insist()
        self.refresh()

    def bind_if_ready(self) -> None:
        """Do as a job what the first move of a handle, or a look at volumes, had to wait for."""
        stage, session = self.stage, self.session
        if not self._is_on or self.is_busy:
            return
        if self._mode is Mode.DEFORM and session.is_ready and not session.is_bound:
            self.start("binding the mesh to its cages", stage.bind, lambda _: None)
        elif stage.wants_overlay(self._mode) and not stage.overlay.is_prepared:
            self.start("measuring local volumes", stage.measure, lambda _: None)

    def _got_on(self) -> None:
        if not self.is_busy:
            self._enter()
        self.refresh()

    def _settle(self) -> None:
        """Be in the mode of now, with all that goes with it."""
        self._enter()
        self.bind_if_ready()
        self.refresh()

    def _enter(self) -> None:
        if self._is_on and not self.is_busy:
            self.stage.enter(self._mode)
        else:
            self.stage.rest()

    # Files.

    @property
    def place(self) -> Path:
        """The path of `file`, or its counterpart in a replay; see `confined_path`."""
        return confined_path(self.view.interactor, self.file.path)

    def save(self) -> None:
        """Write the session to the file."""
        place = self.place
        self.file.write(self.session, place)
        self.say(f"saved to {place}")

    def open(self, path: Path) -> None:
        """Go on, when the job is done, with the session or the mesh in *path*."""

        def take(opened: tuple[Session, Any]) -> None:
            session, surface = opened
            self.stage = self.stage.succeeded_by(session)
            self._stop_hearing()
            self._listen()
            self.file.took(path, session, surface)
            self.say(f"opened {path}")

        self.start(f"opening {path}", lambda progress: read_all(path, progress), take)
