"""Settling: a pose that still converges after its release, and what waits for its end.

A far drag converges for seconds after its release, above all one that avoids contact; see
`LiveSolve`.  The status line says so.  Saving waits until then, so that a file contains
the settled pose, and so it does for a pull that was released before its session was ready.  What
would change the pose meanwhile, a press or another action, lets the file be written first, and so
does Escape, at which the pose remains as it is.
"""

from __future__ import annotations

import time
from collections.abc import Callable

from ..scene import Stop, View
from .widget_set import WidgetSet

_PERIOD = 100  # milliseconds between two checks
_SHOWN_AFTER = 0.5  # seconds; a pose often settles sooner


class Settling:
    """Whether the pose is settling, and what to do afterwards.

    Parameters
    ----------
    view : View
        Provides the timer.
    widgets : callable
        Returns the widgets that refine the pose.
    changed : callable
        Called when it has ended.
    """

    def __init__(
        self, view: View, widgets: Callable[[], WidgetSet], changed: Callable[[], object]
    ) -> None:
        self._view, self._widgets, self._changed = view, widgets, changed
        self._stop_checking: Stop | None = None
        self._since = 0.0
        self._waiting: list[Callable[[], object]] = []

    @property
    def is_active(self) -> bool:
        """Whether a released pose is converging."""
        widgets = self._widgets()
        is_refined = widgets.puller.is_refining or widgets.dragger.is_refining
        return is_refined and not widgets.session.is_dragging and widgets.session.is_unsettled

    @property
    def is_pending(self) -> bool:
        """Whether a released pose is converging, or a released pull waits for its session."""
        return self.is_active or self._widgets().puller.waiting.has_pull

    @property
    def fraction(self) -> float | None:
        """0, as nothing tells how far it is; None if nothing settles, or has only just begun."""
        if self._stop_checking is None or not self.is_active:
            return None
        if time.monotonic() < self._since + _SHOWN_AFTER:
            return None
        return 0.0

    @property
    def is_awaited(self) -> bool:
        """Whether something, such as saving, waits until the pose has settled."""
        return bool(self._waiting)

    @property
    def work(self) -> str:
        """What `fraction` is about."""
        return "Saving" if self._waiting else "Settling"

    def follow(self) -> None:
        """Notice that it has begun."""
        if self._stop_checking is None and self.is_pending:
            self._since = time.monotonic()
            self._stop_checking = self._view.every(_PERIOD, self._check)

    def then(self, act: Callable[[], object]) -> bool:
        """Call *act* once the pose has settled; False if that is now, and it was called."""
        self.follow()
        if self.is_pending:
            self._waiting.append(act)
            return True
        act()
        return False

    def flush(self) -> None:
        """Wait no longer: the pose is about to change."""
        waiting, self._waiting = self._waiting, []
        for act in waiting:
            with self._view.guarded():
                act()

    def stop(self) -> bool:
        """Stop at the present pose; False if nothing was settling."""
        if not self.is_active:
            return False
        for widget in (self._widgets().puller, self._widgets().dragger):
            widget.stop_refining()
        self._check()
        return True

    def complete(self) -> None:
        """Settle the pose now, which may take seconds; for scripts."""
        if self.is_active:
            self._widgets().session.refine()
        self._check()

    def remove(self) -> None:
        """Stop checking."""
        if self._stop_checking is not None:
            self._stop_checking()
            self._stop_checking = None

    def _check(self) -> None:
        if not self.is_pending:
            self.remove()
            self.flush()
            self._changed()
