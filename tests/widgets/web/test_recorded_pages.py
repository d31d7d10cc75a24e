"""The recorded input of a real page, replayed in views of other hosts of the same size."""

from __future__ import annotations

import functools
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from typing import Any

import numpy as np
import pytest

pytest.importorskip("trame")
from chromium import CTRL, SHIFT, Chromium, needs_chromium
from hands import plain_view
from recorder import Recorder, steady
from web_hands import Served, line

from vtk_segdeform import Mesh, Session, models
from vtk_segdeform.kernels import compiled_kernels
from vtk_segdeform.widgets import DeformEditor

pytestmark = [
    pytest.mark.campaign,
    needs_chromium,
    pytest.mark.filterwarnings("ignore::DeprecationWarning"),
]
Size = tuple[int, int]


@functools.cache
def body() -> Mesh:
    return models.cactus(2000)


@pytest.fixture(scope="module")
def recorded(browser: Chromium) -> Iterator[tuple[Recorder, Size, list[Any]]]:
    """Yield the recorded events of a story in a page, the size of its view, and its poses."""
    compiled_kernels()  # before that, an editor sums small arrays in another order
    with pytest.MonkeyPatch.context() as patch, Served(body(), name="cactus.ply") as served:
        steady(patch)
        page, web = served.page(browser, size=(900, 640)), served.web
        size = served.call(lambda: web.editor.view.window.GetSize())
        served.call(lambda: without_finishes(web.editor))
        recorder = served.call(lambda: Recorder(web.editor.view))
        tell(served, page)
        served.call(recorder.stop)
        poses = served.call(lambda: poses_of(web.session))
        page.close()
        yield recorder, size, poses


def without_finishes(editor: DeformEditor) -> None:
    """Finish no pose in the background."""
    editor.controller.finishing.is_wanted = False


def tell(served: Served, page: Any) -> None:
    """Pull, turn the camera, zoom, change the radius, pull along an axis, undo, pull again."""
    web = served.web

    def rest(position: int) -> None:
        finishing = web.editor.controller.finishing
        served.wait(
            lambda: web.session.history.position == position and served.is_at_rest
            and not finishing.is_pending
        )  # fmt: skip

    left, top, width, height = page.box(".sd-canvas")
    x, y = left + 0.5 * width, top + 0.3 * height
    page.drag(line((x, y), (x + 70, y - 15), 12), pause=0.03)
    rest(1)
    page.drag(line((left + 20, top + 20), (left + 80, top + 35), 8), pause=0.03)
    page.wheel((x, y), -120)
    page.wheel((x, y), 100, modifiers=SHIFT)
    x, y = left + 0.5 * width, top + 0.45 * height
    page.drag(line((x, y), (x - 40, y - 20), 8), pause=0.03, release=False)
    page.key("x")
    page.move((x - 60, y - 20))
    page.release((x - 60, y - 20))
    rest(2)
    page.key("z", modifiers=CTRL)
    rest(1)
    page.drag(line((x, y), (x + 10, y + 50), 8), pause=0.03)
    rest(2)


def poses_of(session: Session) -> list[Any]:
    """Return the vertices after each step, the last one first."""
    poses = [session.vertices]
    while session.undo() is not None:
        poses.append(session.vertices)
    return poses


@contextmanager
def plain(size: Size) -> Iterator[DeformEditor]:
    editor = DeformEditor(plain_view(size), Session(body()))
    editor.On()
    ready(editor, editor.view.interactor.InvokeEvent)
    yield editor
    editor.remove()


@contextmanager
def in_pyvista(size: Size) -> Iterator[DeformEditor]:
    import pyvista as pv

    plotter = pv.Plotter(off_screen=True, window_size=[*size])
    editor = plotter.segdeform.edit(Session(body()))
    plotter.show(interactive=False, auto_close=False)
    ready(editor, editor.view.interactor.InvokeEvent)
    yield editor
    plotter.close()


@contextmanager
def in_qt(size: Size) -> Iterator[DeformEditor]:
    from qt_hands import application

    from vtk_segdeform.widgets.qt.widget import DeformWidget

    app = application()
    widget = DeformWidget(Session(body()))
    widget.resize(size[0] + 300, size[1] + 100)
    widget.show()
    app.processEvents()
    editor = widget.editor
    found = editor.view.window.GetSize()
    widget.resize(widget.width() + size[0] - found[0], widget.height() + size[1] - found[1])
    ready(editor, lambda _: app.processEvents())
    assert editor.view.window.GetSize() == size
    yield editor
    widget.close()


def ready(editor: DeformEditor, tick: Callable[[str], object]) -> None:
    """Let timers fire until nothing is prepared, refined or computed."""
    widgets = editor.widgets
    deadline = time.monotonic() + 60
    while (
        editor.is_busy or editor.is_preparing or editor.controller.finishing.is_pending
        or widgets.puller.is_refining or widgets.dragger.is_refining
    ):  # fmt: skip
        assert time.monotonic() < deadline, editor.status
        tick("TimerEvent")
        time.sleep(0.002)


@pytest.mark.parametrize("host", [plain, in_pyvista, in_qt])
def test_the_input_of_a_page_gives_the_same_poses_to_the_bit(
    recorded: tuple[Recorder, Size, list[Any]],
    host: Callable[[Size], AbstractContextManager[DeformEditor]],
) -> None:
    recorder, size, poses = recorded
    with host(size) as editor:
        without_finishes(editor)
        recorder.replay(editor.view, lambda: editor.is_busy)
        again = poses_of(editor.session)
    differ = [
        float(np.abs(a - b).max() / body().diagonal) for a, b in zip(again, poses, strict=True)
    ]
    print(f"{host.__name__}: {len(poses)} poses differ by {differ}, {len(recorder.events)} events")
    np.testing.assert_array_equal(again, poses)
