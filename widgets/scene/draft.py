"""Drawing without anti-aliasing while something moves.

In software, multi-sampling takes three quarters of the time of a picture; in motion nobody sees it.
"""

from __future__ import annotations

from collections.abc import Callable

from vtkmodules.vtkRenderingOpenGL2 import vtkSSAAPass

from .view import View


class Draft:
    """Turns the anti-aliasing of a view off and on again.

    Parameters
    ----------
    view : View
        Its window is changed only between `begin` and `end`.
    """

    def __init__(self, view: View) -> None:
        self._view = view
        self._restore: list[Callable[[], object]] = []  # what `end` calls

    def begin(self) -> None:
        """Draw without anti-aliasing until `end`."""
        window, renderer = self._view.window, self._view.renderer
        if self._restore or window is None:
            return
        if samples := window.GetMultiSamples():
            window.SetMultiSamples(0)
            self._restore.append(lambda: window.SetMultiSamples(samples))
        if renderer.GetUseFXAA():
            renderer.SetUseFXAA(False)
            self._restore.append(lambda: renderer.SetUseFXAA(True))
        if isinstance(supersampling := renderer.GetPass(), vtkSSAAPass):
            renderer.SetPass(None)
            self._restore.append(lambda: renderer.SetPass(supersampling))

    def end(self) -> None:
        """Draw as before `begin`, and once now if that makes a difference."""
        if not self._restore:
            return
        is_open = self._view.window is not None
        while self._restore:
            restore = self._restore.pop()
            if is_open:
                restore()
        self._view.request_render()
