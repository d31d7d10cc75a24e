"""Films of a deformation: a GIF or an MP4.

    film("bend.gif", session, targets)             a drag, one picture for each of its targets
    film("turn.mp4", view, [turn_camera] * 90)     one picture after each call: a turntable
    jumps = [partial(session.history.jump, k) for k in range(len(session.history.labels))]
    film("work.gif", session, jumps)               the history, one picture for each state
    film = Film(view); stop = film.watch()         every picture drawn from now on
    ...; stop(); film.save("work.gif")

Pictures are kept compressed in memory until the film is saved; see `film_files` for the formats.
"""

from __future__ import annotations

import os
import zlib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vtk_segdeform.arrays import as_points, is_whole
from vtk_segdeform.checks import require_sequence, shown
from vtk_segdeform.errors import ArgumentError
from vtk_segdeform.progress import Progress
from vtk_segdeform.session import Session

from ..scene import Stop, View
from .film_files import Picture, require_film, write_film
from .off_screen import off_screen

_LARGEST_SIDE = 16_384  # pixels, width or height

Targets = Mapping[str, ArrayLike] | ArrayLike
Frame = Callable[[], object] | Targets | None


class Film:
    """Pictures of a view, in the order they were taken.

    Parameters
    ----------
    view : View, pyvista.Plotter or (vtkRenderer, vtkRenderWindowInteractor)
        The pictures show its whole window.
    """

    def __init__(self, view: Any) -> None:
        self.view = View.of(view)
        self._pictures: list[bytes] = []
        self._shape = (0, 0, 3)

    def __len__(self) -> int:
        return len(self._pictures)

    def __getitem__(self, number: int) -> Picture:
        """Return a picture, (h, w, 3) uint8, upper row first."""
        packed = self._pictures[number]
        return np.frombuffer(zlib.decompress(packed), np.uint8).reshape(self._shape)

    def snap(self) -> None:
        """Draw the view and take a picture."""
        self.view.render()
        self._take()

    def watch(self) -> Stop:
        """Take a picture after each rendering of the window, until the result is called."""

        def called(*_: object) -> None:
            with self.view.guarded():
                self._take()

        window = self.view.window
        tag = window.AddObserver("EndEvent", called)
        return lambda: window.RemoveObserver(tag)

    def save(
        self,
        path: str | os.PathLike[str],
        *,
        fps: float = 20.0,
        progress: Progress | None = None,
    ) -> None:
        """Write the pictures; an existing file is replaced.

        Parameters
        ----------
        path : path
            A .gif or an .mp4.
        fps : float
            Pictures per second.
        progress : Progress, optional
            Called before every picture; may raise `Cancelled`, in which case nothing is written.

        Raises
        ------
        SessionError
            If there are no pictures, or the file cannot be written.
        MissingDependencyError
            If the library for the format is not installed.
        """
        write_film(path, self, fps, progress)

    def _take(self) -> None:
        picture = self.view.pixels()[::-1]
        height, width, _ = picture.shape
        if not self._pictures:  # the first picture sets the size; videos require even numbers
            self._shape = (height - height % 2, width - width % 2, 3)
        whole = np.full(self._shape, 255, dtype=np.uint8)
        h, w = min(height, self._shape[0]), min(width, self._shape[1])
        whole[:h, :w] = picture[:h, :w]
        self._pictures.append(zlib.compress(whole.tobytes(), 1))


def film(
    path: str | os.PathLike[str],
    scene: Any,
    frames: Sequence[Frame] | Iterator[Frame],
    *,
    fps: float = 20.0,
    size: tuple[int, int] = (800, 600),
) -> None:
    """Make a film with one picture for each of *frames*.

    Parameters
    ----------
    path : path
        A .gif or an .mp4.
    scene : Session, View, pyvista.Plotter or (vtkRenderer, vtkRenderWindowInteractor)
        A view is filmed as it is.  The mesh of a session is shown with fixed vertices in grey and
        handles in red.
    frames : sequence or iterator of callable, targets or None
        One item per picture.  A callable is called.  Targets, (k, 3) or by the name of the handle,
        are passed to `Session.drag`.  None changes nothing.  All targets together are one undo step
        of the session; if an error occurs the pose is restored.
    fps : float
        Pictures per second.
    size : (width, height)
        Size in pixels of the film of a session; the film of a view has the size of its window.

    Raises
    ------
    SessionError
        If the file cannot be written; checked before the first frame.
    MissingDependencyError
        If the library for the format is not installed, or off-screen rendering is unavailable.
    """
    require_film(path, fps)
    require_sequence(size, "size")
    if len(size) != 2 or not all(is_whole(n, 2, _LARGEST_SIDE) for n in size):
        raise ArgumentError(
            f"size must be (width, height), 2 to {_LARGEST_SIDE} pixels each; got {shown(size)}"
        )
    session = scene if isinstance(scene, Session) else None
    known: Sequence[Frame] = []  # an iterator's frames are not known in advance
    if not isinstance(frames, Iterator):
        require_sequence(frames, "frames")
        known = frames
    if session is None:
        made = Film(scene)
        _shoot(made, None, frames)
    else:
        with off_screen(session, size, in_view=_targets(known)) as view:
            made = Film(view)
            try:
                _shoot(made, session, frames)
            except BaseException:  # Ctrl+C as well: no half a drag may remain
                session.revert()
                raise
            session.commit()
    made.save(path, fps=fps)


def _shoot(made: Film, session: Session | None, frames: Iterable[Frame]) -> None:
    for frame in frames:
        if callable(frame):
            frame()
        elif frame is not None:
            if session is None:
                raise ArgumentError("targets require a session; to film a view, pass callables")
            session.drag(frame)
        made.snap()


def _targets(frames: Sequence[Frame]) -> list[NDArray[np.float64]]:
    """Return the targets among *frames*, each (k, 3)."""
    found: list[NDArray[np.float64]] = []
    for frame in frames:
        if isinstance(frame, Mapping):
            found += [as_points(targets, "frames") for targets in frame.values()]
        elif frame is not None and not callable(frame):
            found.append(as_points(frame, "frames"))
    return found
