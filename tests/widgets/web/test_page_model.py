"""What the page shows to fingers, and what a page cannot do to its server."""

from __future__ import annotations

import asyncio
import time
from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("trame")

from vtk_segdeform import Regions, Session, fit_cages, models
from vtk_segdeform.kernels import compiled_kernels
from vtk_segdeform.session import State, load_session
from vtk_segdeform.widgets.editor import Mode, keys_of
from vtk_segdeform.widgets.editor.hints import hint
from vtk_segdeform.widgets.panel.status import words_of
from vtk_segdeform.widgets.web.touch import for_fingers

pytestmark = pytest.mark.usefixtures("bound_once")
KEYS = keys_of("pyvista")


@pytest.mark.parametrize(
    ("sentence", "mode", "text", "actions"),
    [
        ("Drag a cage vertex · Next: 4, deform", Mode.CAGES,
         "Drag a cage vertex · Next: deform", ["deform"]),
        ("No regions yet. Press G to detect them, or paint one", Mode.REGIONS,
         "No regions yet. Detect them, or paint one", ["segment"]),
        ("No regions yet. Press G to detect them, or 1 to paint one", Mode.CAGES,
         "No regions yet. Detect them, or paint one", ["segment", "regions"]),
        ("Drag the surface. Shift-click pins. Ctrl+Z: undo", Mode.PULL,
         "Drag the surface. Choose Pin, then tap: the point stays. Undo", ["undo"]),
        ("Drag the surface · Volume preservation off (P to turn on)", Mode.PULL,
         "Drag the surface · Volume preservation off (turn on)", ["preserve_volume"]),
        ("Brush: paint fixed vertices. Ctrl: erase · Next: D, paint a handle", Mode.HANDLES,
         "Brush: paint fixed vertices · Next: paint a handle", ["paint_handle"]),
        ("Move or rotate a handle · Shift+F: finish further", Mode.DEFORM,
         "Move or rotate a handle · finish further", ["finish"]),
    ],
)  # fmt: skip
def test_hints_name_what_to_tap(sentence, mode, text, actions):
    words = for_fingers(words_of(sentence, KEYS, mode))
    assert "".join(word.text for word in words) == text
    assert [word.action for word in words if word.action] == actions


@pytest.mark.parametrize("mode", list(Mode))
def test_no_hint_names_a_key_or_a_modifier_to_fingers(mode, bare_widgets):
    words = for_fingers(words_of(hint(bare_widgets, mode, KEYS), KEYS, mode))
    text = "".join(word.text for word in words)
    for name in ("Shift", "Ctrl", "Press", "wheel"):
        assert name not in text


@pytest.fixture(scope="module")
def web(bound_once):
    from vtk_segdeform.widgets.web import WebEditor

    compiled_kernels()  # before that, an editor sums small arrays in another order
    mesh = models.cactus(500)
    regions = Regions.single(mesh)
    state = State(regions, fit_cages(mesh, regions, 60))  # which is soon bound and solved
    web = WebEditor(Session(mesh, state=state), name="cactus.ply")
    yield web
    web.close()


@pytest.fixture(scope="module")
def bare_widgets(web):
    return web.editor.widgets


def test_a_page_cannot_end_its_process(web):
    root = SimpleNamespace(registerLinkProtocol=lambda _: None, exit=print, exitLater=print)
    web._configure(root)
    assert (root.exit, root.exitLater) == (None, None)


def test_a_page_that_leaves_is_no_error_but_all_else_is():
    from vtk_segdeform.widgets.web.web_editor import _ignore_lost_pages

    def task(name):
        return SimpleNamespace(get_coro=lambda: SimpleNamespace(__qualname__=name))

    loop, seen = asyncio.new_event_loop(), []
    loop.default_exception_handler = seen.append
    sending, theirs = task("WslinkHandler.sendWrappedMessage"), task("their_own")
    _ignore_lost_pages(loop, {"exception": ConnectionResetError(), "future": sending})
    others = [
        {"exception": ValueError(), "future": sending},
        {"exception": ConnectionResetError(), "future": theirs},
        {"exception": ConnectionResetError(), "message": ""},
    ]
    for context in others:
        _ignore_lost_pages(loop, context)
    loop.close()
    assert seen == others


def settle(editor):
    """Let the timers of an editor fire until nothing is prepared, refined or computed."""
    live = editor.widgets.puller, editor.widgets.dragger
    for _ in range(20_000):
        editor.view.interactor.InvokeEvent("TimerEvent")
        if not (editor.is_busy or editor.is_preparing or any(each.is_refining for each in live)):
            return
        time.sleep(0.005)
    raise AssertionError(editor.status)


def test_a_download_waits_until_the_pose_has_settled(web, tmp_path):
    editor, session = web.editor, web.session
    settle(editor)
    top = int(session.vertices[:, 2].argmax())
    session.pull(top, session.vertices[top] + [0.0, 0.3, 0.0], max_steps=1)
    session.commit()
    editor.mode = Mode.REGIONS
    editor.mode = Mode.PULL  # which refines the pose
    assert editor.widgets.is_settling

    async def downloaded():
        request = SimpleNamespace(
            match_info={"suffix": "segdeform"}, query={}, headers={"X-Segdeform": "1"}
        )
        download = asyncio.create_task(web.transfer.download(request))
        await asyncio.sleep(0.1)
        assert not download.done()
        settle(editor)
        return await download

    (tmp_path / "a.segdeform").write_bytes(asyncio.run(downloaded()).body)
    saved = load_session(tmp_path / "a.segdeform")
    np.testing.assert_array_equal(saved.vertices, session.vertices)
