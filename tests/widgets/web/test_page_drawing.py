"""During a drag the page draws the surface, and the server draws nothing."""

from __future__ import annotations

import base64
import io
from collections.abc import Iterator

import numpy as np
import pytest

pytest.importorskip("trame")
from chromium import ALT, CTRL, Chromium, Page, needs_chromium
from PIL import Image
from scipy.ndimage import binary_fill_holes
from web_hands import Served, line

from vtk_segdeform import Mesh, Regions, Session, fit_cages
from vtk_segdeform.session import State
from vtk_segdeform.widgets.web.page_drawing import Update
from vtk_segdeform.widgets.web.pictures import Picture

pytestmark = [needs_chromium, pytest.mark.filterwarnings("ignore::DeprecationWarning")]

LIVE = "document.querySelector('.sd-live').classList.contains('on')"
WORDS = """(() => { const all = document.querySelectorAll('.sd-live canvas')[2];
  const pixels = all.getContext('2d').getImageData(0, 0, all.width, all.height).data;
  return pixels.some((value) => value > 0); })()"""
SIZE = 700, 480
HALF = 40  # of 255, from the background: a pixel at the edge that is about half covered
BACKDROP, BODY = (f"document.querySelectorAll('.sd-live canvas')[{k}]" for k in (0, 1))


class Drawn:
    """A page that draws, and a count of what the server draws during drags."""

    def __init__(self, served: Served, browser: Chromium) -> None:
        self.served, self.browser, self.web, self.renders = served, browser, served.web, 0
        self.stream, self.drawing = self.web.stream, self.web.stream._drawing
        self.web.editor.controller.finishing.is_wanted = False  # which moves the pose at rest
        self.page: Page = served.page(browser, size=SIZE)
        self.await_surface()
        window = self.web.plotter.render_window
        served.call(lambda: window.AddObserver("StartEvent", self._count))

    def _count(self, *_: object) -> None:
        self.renders += self.drawing.is_dragging

    def await_surface(self) -> None:
        """Wait until the page has the surface."""
        self.served.wait(lambda: self.drawing.is_possible)

    def rest(self) -> None:
        """Wait until the view rests and the page shows the server's last picture."""
        stream = self.stream
        self.served.wait(
            lambda: (
                self.served.is_at_rest
                and not (stream._is_live or self.drawing.is_moving or stream._is_wanted)
                and stream._shown == stream._sent
                and stream._pictures.still() is not None
            )
        )
        is_clear = f"!{LIVE} && getComputedStyle({BODY}.parentNode).opacity == '0'"
        self.page.wait(f"{is_clear} && !document.querySelector('.sd-progress')")

    def top(self) -> tuple[float, float]:
        """Return where the page shows a point of the upper side."""
        vertices = self.web.session.vertices
        near = vertices[vertices[:, 2] > np.quantile(vertices[:, 2], 0.9)]
        return self.served.seen(self.page, near[np.argmin(near[:, 1])])

    def drag(self, way: tuple[float, float], modifiers: int = 0) -> tuple[float, float]:
        """Drag the top by *way*; return where the button is still held."""
        self.rest()
        (x, y), self.renders = self.top(), 0
        end = x + way[0], y + way[1]
        points = line((x, y), end, 6)
        self.page.drag(points, pause=0.02, release=False, modifiers=modifiers)
        return end

    def hold(self, end: tuple[float, float]) -> None:
        """Wait until the page shows the pose for the pointer at *end*."""
        stream, view = self.stream, self.web.editor.view
        widget = self.web.editor.widgets.puller
        left, top, width, height = self.page.box(".sd-canvas")
        columns, rows = view.window.GetSize()
        place = columns * (end[0] - left) / width, rows * (1.0 - (end[1] - top) / height)
        self.served.wait(
            lambda: (
                np.abs(np.subtract(view.interactor.GetEventPosition(), place)).max() < 2.0
                and not (stream.inputs or widget.is_refining or stream._is_wanted)
                and stream._shown == stream._sent
            )
        )

    def body(self) -> np.ndarray:
        """Return where the page shows the surface, (h, w) bool, without the amount of a pull."""
        self.page.evaluate(f"{BODY}.nextElementSibling.style.visibility = 'hidden'")
        left, top, width, height = self.page.box(".sd-canvas")
        clip = {"x": left, "y": top, "width": width, "height": height, "scale": 1}
        data = self.page.call("Page.captureScreenshot", format="png", clip=clip)["data"]
        image = Image.open(io.BytesIO(base64.b64decode(data))).convert("RGB")
        pixels = np.asarray(image, dtype=int)
        # Where a light shines on it, the body is about as bright as the background.
        return binary_fill_holes(np.abs(pixels - pixels[:, :1]).max(axis=2) > HALF)


@pytest.fixture(scope="module")
def drawn(browser: Chromium, cactus: Mesh) -> Iterator[Drawn]:
    regions = Regions.single(cactus)
    state = State(regions, fit_cages(cactus, regions, 60))  # which is soon bound and solved
    with Served(Session(cactus, state=state), name="cactus.ply") as served:
        drawn = Drawn(served, browser)
        yield drawn
        drawn.page.close()


def overlap(a: np.ndarray, b: np.ndarray) -> float:
    return float((a & b).sum() / (a | b).sum())


def test_a_pull_is_drawn_by_the_page_and_agrees_with_the_picture_at_rest(drawn: Drawn) -> None:
    page, session = drawn.page, drawn.web.session
    drawn.rest()
    before = drawn.body()
    end = drawn.drag((70.0, 20.0))
    drawn.hold(end)
    assert page.evaluate(LIVE)
    held = drawn.body()
    x, y = page.box(".sd-canvas")[:2]
    assert held[round(end[1] - y), round(end[0] - x)]
    assert overlap(before, held) < 0.93
    page.key("x")
    page.wait(WORDS)  # the amount, along an axis
    page.key("Escape")
    page.release(end)
    drawn.rest()
    assert drawn.renders == 0
    assert overlap(before, drawn.body()) > 0.99
    end = drawn.drag((70.0, 20.0))
    drawn.hold(end)
    held = drawn.body()
    page.release(end)
    drawn.rest()
    assert drawn.renders == 0
    assert session.history.position == 1
    assert abs(session.volume_change) < 1e-12
    assert overlap(held, drawn.body()) > 0.99
    page.key("z", modifiers=CTRL)
    drawn.served.wait(lambda: session.history.position == 0)
    drawn.rest()
    assert overlap(before, drawn.body()) > 0.99


def test_messages_reach_the_page_as_array_buffers(drawn: Drawn) -> None:
    page = drawn.page
    page.evaluate("""(({ prototype }) => {
        const { send } = prototype;
        prototype.send = function (...data) {
            prototype.send = send;
            window.socket = this;
            return send.apply(this, data);
        };
    })(WebSocket)""")
    page.move((5.0, 300.0))
    page.move((400.0, 300.0))
    page.wait("Boolean(window.socket)")
    assert page.evaluate("socket.binaryType") == "arraybuffer"


def test_the_camera_turns_around_the_surface_that_the_page_draws(drawn: Drawn) -> None:
    drawn.rest()
    before = drawn.body()
    end = drawn.drag((120.0, -30.0), ALT)
    drawn.hold(end)
    assert drawn.page.evaluate(LIVE)
    held = drawn.body()
    assert overlap(before, held) < 0.9
    drawn.page.release(end)
    drawn.rest()
    assert drawn.renders == 0
    assert overlap(held, drawn.body()) > 0.99


def test_a_picture_older_than_what_the_page_draws_is_dropped(drawn: Drawn) -> None:
    end = drawn.drag((60.0, 0.0))
    drawn.hold(end)
    file = io.BytesIO()
    Image.new("RGB", (50, 40), (255, 0, 0)).save(file, "JPEG")
    old = Picture(file.getvalue(), 50, 40, True)
    drawn.served.call(lambda: drawn.web._protocol.send(old, drawn.stream._sent - 2))
    drawn.page.evaluate("new Promise((done) => setTimeout(done, 200))")
    assert drawn.page.evaluate(LIVE)
    assert drawn.page.evaluate("document.querySelector('.sd-canvas canvas').width") != 50
    drawn.page.release(end)
    drawn.rest()
    drawn.page.key("z", modifiers=CTRL)
    drawn.rest()


@pytest.mark.parametrize("cause", ["lost", pytest.param("refused", marks=pytest.mark.campaign)])
def test_when_the_page_cannot_draw_the_server_does(drawn: Drawn, cause: str) -> None:
    page, served = drawn.page, drawn.served
    end = drawn.drag((60.0, 0.0))
    drawn.hold(end)
    assert page.evaluate(LIVE)
    if cause == "lost":
        page.evaluate(
            f"window.memory = {BODY}.getContext('webgl2').getExtension('WEBGL_lose_context'),"
            "memory.loseContext()"
        )
    else:
        damaged = Update((b"SDFM, and no more",), (), 400, 300, False)
        served.call(lambda: drawn.web._protocol.send(damaged, drawn.stream._sent))
    page.wait(f"!{LIVE}")
    served.wait(lambda: drawn.renders > 0)
    assert drawn.web.editor.widgets.puller.is_grabbing
    page.move((end[0] + 15.0, end[1]))
    drawn.hold((end[0] + 15.0, end[1]))
    page.release((end[0] + 15.0, end[1]))
    drawn.rest()
    assert drawn.web.session.history.position == 1
    page.evaluate("memory.restoreContext()" if cause == "lost" else "location.reload()")
    drawn.await_surface()
    page.wait("Number(document.querySelector('canvas')?.dataset.number) > 0")
    page.key("z", modifiers=CTRL)
    drawn.rest()
    end = drawn.drag((40.0, 0.0))
    drawn.hold(end)
    assert page.evaluate(LIVE)
    page.release(end)
    drawn.rest()
    page.key("z", modifiers=CTRL)
    drawn.rest()


@pytest.mark.campaign
def test_the_view_menu_decides_who_draws_and_the_browser_remembers(drawn: Drawn) -> None:
    page, entry = drawn.page, "[...document.querySelectorAll('.sd-menu button')].at(-1)"
    remembered = "localStorage.getItem('segdeform drawing')"
    for choice in ("no", "yes"):
        page.click("[data-name=view]")
        page.wait(f"{entry}?.textContent.includes('Draw in the browser')")
        page.evaluate(f"{entry}.click()")
        page.wait(f"{remembered} == '{choice}'")
        page.key("Escape")
        drawn.served.wait(lambda: drawn.drawing.is_possible is (choice == "yes"))  # noqa: B023
        end = drawn.drag((50.0, 0.0))
        drawn.hold(end)
        assert page.evaluate(LIVE) is (choice == "yes")
        assert (drawn.renders == 0) is (choice == "yes")
        page.release(end)
        drawn.rest()
        page.key("z", modifiers=CTRL)
        drawn.rest()


@pytest.mark.campaign
def test_of_two_pages_none_draws(drawn: Drawn) -> None:
    other = drawn.served.page(drawn.browser, size=SIZE, beside=drawn.page)
    assert not drawn.served.call(lambda: drawn.drawing.is_possible)
    end = drawn.drag((50.0, 0.0))
    drawn.hold(end)
    assert not drawn.page.evaluate(LIVE)
    drawn.page.release(end)
    drawn.rest()
    drawn.page.key("z", modifiers=CTRL)
    drawn.rest()
    other.close()
    drawn.await_surface()


def test_the_page_has_reported_no_error(drawn: Drawn) -> None:
    assert [m for m in drawn.page.messages() if m.startswith("error")] == []
