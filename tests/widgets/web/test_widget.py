"""The widget of a notebook: the page of the editor in its frame, over the widget's channel."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("trame")
pytest.importorskip("anywidget", reason="pip install anywidget")
from chromium import CTRL, Chromium, Page, needs_chromium
from limbed import torso
from notebook_page import InFrame, InNotebook
from web_hands import line, only_file, rested

from vtk_segdeform.io import read_mesh, write_mesh

pytestmark = [needs_chromium, pytest.mark.filterwarnings("ignore::DeprecationWarning")]
_TEXT = "document.querySelector('#output').innerText"


@pytest.fixture(scope="module")
def shown() -> Iterator[InNotebook]:
    with InNotebook(torso(2), name="small.ply") as shown:
        yield shown


@pytest.fixture(scope="module")
def page(shown: InNotebook, browser: Chromium) -> Iterator[Page]:
    page = shown.page(browser, size=(700, 680))
    yield page
    assert [m for m in page.messages() if m.startswith("error")] == []
    page.close()


def test_a_drag_in_the_frame_bends_the_surface_and_a_key_takes_it_back(
    shown: InNotebook, page: Page
) -> None:
    frame, session = InFrame(page), shown.web.session
    before, position = session.vertices, session.history.position
    x, y = frame.place(frame.centre(".sd-canvas"))
    page.drag(line((x, y), (x + 90, y - 30), 8), pause=0.02)
    shown.wait(lambda: session.history.position > position)
    rested(frame)
    assert abs(session.volume_change) < 1e-12
    assert np.abs(session.vertices - before).max() > 0.02 * session.mesh.diagonal
    page.key("z", modifiers=CTRL)
    shown.wait(lambda: session.history.position == position)
    assert np.array_equal(session.vertices, before)


def test_the_page_takes_the_place_of_the_picture(page: Page) -> None:
    assert page.evaluate("document.querySelector('.picture').hidden") is True
    assert page.evaluate(_TEXT) == ""


def test_a_file_is_uploaded_in_parts_and_the_surface_downloaded(
    shown: InNotebook, page: Page, tmp_path: Path
) -> None:
    frame = InFrame(page)
    page.save_downloads(tmp_path)
    write_mesh(tmp_path / "given.off", shown.web.session.mesh)
    text = json.dumps((tmp_path / "given.off").read_text())
    comment, before = "'#' + 'x'.repeat(1500000)", shown.web.session  # two parts
    frame.evaluate(
        "(() => { const files = new window.DataTransfer();"
        f" const text = [{text}, {comment}];"
        " files.items.add(new window.File(text, 'a.off'));"
        " const input = document.querySelector('.sd-file'); input.files = files.files;"
        " input.dispatchEvent(new window.Event('change')); })()"
    )
    frame.wait("!document.querySelector('[data-name=discard]')?.click() && document"
               ".querySelector('.sd-name').innerText.startsWith('a.off')", 60.0)  # fmt: skip
    assert shown.web.session is not before
    rested(frame)
    frame.evaluate("document.querySelector('[data-name=download]').click()")
    frame.wait("[...document.querySelectorAll('[role=menuitem]')].length > 1")
    frame.evaluate("document.querySelectorAll('[role=menuitem]')[1].click()")
    mesh = read_mesh(only_file(tmp_path, "a.ply"))
    assert np.array_equal(mesh.vertices, shown.web.session.mesh.vertices)


def test_another_output_shows_the_same_editor_and_says_that_it_has_ended(
    shown: InNotebook, page: Page, browser: Chromium
) -> None:
    other = shown.page(browser, size=(700, 680))
    shown.wait(lambda: len(shown.web.endpoint.connections) == 2)
    other.evaluate(
        "window.timer = window.setTimeout,"
        "window.setTimeout = (call, time) => window.timer(call, time / 100), 0"
    )
    name, receive = [*shown.tunnel._connections][-1], shown.tunnel.receive

    def to_others(content: Any, buffers: Any) -> None:
        if content["page"] != name:
            receive(content, buffers)

    shown.tunnel.receive = to_others
    other.move(InFrame(other).place((300.0, 200.0)))
    other.wait(f"{_TEXT}.startsWith('The kernel does not answer.')")
    shown.tunnel.receive = receive
    other.move(InFrame(other).place((310.0, 210.0)))
    other.wait(f"{_TEXT} === ''")
    shown.call(lambda: shown.widget.send({"kind": "ended", "page": name}))
    other.wait(f"{_TEXT} === 'This editor is closed. Run the cell again to edit.'")
    assert other.evaluate("document.querySelector('iframe')") is None
    other.evaluate("window.end()")  # as if the output was removed
    shown.wait(lambda: len(shown.web.endpoint.connections) == 1)
    other.close()
