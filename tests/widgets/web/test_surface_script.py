"""The page draws what the in-process view draws, in a real browser."""

from __future__ import annotations

import base64
import io
import json
from types import SimpleNamespace

import numpy as np
import pytest
from chromium import needs_chromium
from hands import plain_view
from PIL import Image
from posed_scenes import random_cages, sausage_session
from sheets import moebius
from solids import icosphere
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonDataModel import vtkPlane
from vtkmodules.vtkFiltersSources import vtkSphereSource
from vtkmodules.vtkRenderingCore import vtkActor, vtkPolyDataMapper, vtkWindowToImageFilter

from vtk_segdeform import Regions, fit_cages
from vtk_segdeform.errors import MissingDependencyError
from vtk_segdeform.mesh import Mesh
from vtk_segdeform.pictures.canvas import require_offscreen
from vtk_segdeform.session import Session, State
from vtk_segdeform.widgets.scene import SurfaceDisplay, Viewpoint, Wireframe, set_lights
from vtk_segdeform.widgets.web.drawing import SCRIPT, SurfaceStream, look_of, marks_of

pytestmark = needs_chromium

SIZE = 400
MOST_DIFFERENT, SELDOM_DIFFERENT = 0.5, 3.0  # of 255: mean and 99 % of the pixels of the body
HTML = f"data:text/html,<body style='margin:0'><canvas width={SIZE} height={SIZE}></canvas>"
START = """
window.surface = SegdeformSurface.create(document.querySelector('canvas'));
window.bytes = (text) => Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer;
surface !== null
"""


@pytest.fixture(scope="module")
def page(browser):
    try:
        require_offscreen()
    except MissingDependencyError as error:
        pytest.skip(str(error))
    page = browser.page(HTML, size=(SIZE, SIZE))
    assert page.evaluate(SCRIPT.read_text() + START)
    yield page
    # Lost on purpose, and what software rendering says of reading its pictures.
    known = "Context", "The page cannot draw the surface", "GPU stall"
    assert not [text for text in page.messages() if not any(map(text.__contains__, known))]
    page.close()


def send(page, messages) -> list[str]:
    """Give messages to the page, and return its answers."""
    texts = json.dumps([base64.b64encode(each).decode() for each in messages])
    return page.evaluate(f"{texts}.map((text) => surface.receive(bytes(text)))")


def drawn(page) -> np.ndarray:
    """Return the canvas, (h, w, 4) float."""
    url = page.evaluate("surface.draw(), surface.canvas.toDataURL()")
    data = base64.b64decode(url.partition(",")[2])
    return np.asarray(Image.open(io.BytesIO(data)).convert("RGBA"), dtype=float)


class InProcess:
    """A session in a view of this process, and a stream for the page."""

    def __init__(self, session: Session) -> None:
        self.session = session
        self.view = plain_view((SIZE, SIZE))
        set_lights(self.view.renderer)
        self.surface = SurfaceDisplay(self.view, session)
        points, diagonal = lambda: session.vertices, lambda: session.mesh.diagonal
        Viewpoint(self.view, points, diagonal).look_from("home", animate=False)
        self.stream = SurfaceStream(session)
        self.stream.encode()

    def picture(self) -> np.ndarray:
        """Return the picture of the view, (h, w, 3) float."""
        self.view.render()
        grabber = vtkWindowToImageFilter()
        grabber.SetInput(self.view.window)
        grabber.ReadFrontBufferOff()
        grabber.Update()
        pixels = vtk_to_numpy(grabber.GetOutput().GetPointData().GetScalars())
        return pixels.reshape(SIZE, SIZE, -1)[::-1, :, :3].astype(float)

    def due(self, **more) -> list[bytes]:
        """Return the messages for the page."""
        look = look_of(self.view.renderer, self.surface.actor.GetProperty())
        return self.stream.due(look, **more)


@pytest.fixture(scope="module")
def posed():
    """Return a sausage in a pose."""
    session = sausage_session()
    session.move_handle("end", session.targets["end"] + [-1.0, 1.0, 0.5])
    session.commit()
    return SimpleNamespace(session=session, here=InProcess(session))


@pytest.fixture
def scene(page, posed):
    """Give the page the sausage, whatever it has drawn before."""
    posed.here.stream.reset()
    assert set(send(page, posed.here.due())) == {""}
    return posed


def compare(page, scene: InProcess) -> None:
    """Compare the silhouettes and the shades of the page with those in process."""
    expected, got = scene.picture(), drawn(page)
    mine, theirs = got[..., 3] > 0, (expected < 255).any(axis=2)
    assert theirs.mean() > 0.05
    assert (mine & theirs).sum() > 0.99 * (mine | theirs).sum()
    difference = np.abs(got[..., :3] - expected)[mine & theirs]
    assert difference.mean() < MOST_DIFFERENT
    assert np.quantile(difference, 0.99) < SELDOM_DIFFERENT


def test_the_page_draws_what_the_view_draws(page, scene):
    compare(page, scene.here)


def test_colours_and_moves_reach_the_page(page, scene):
    here, session = scene.here, scene.session
    height = session.vertices[:, 2]
    colours = np.zeros((session.mesh.n_vertices, 3), np.uint8)
    colours[:, 0] = 255.0 * (height - height.min()) / np.ptp(height)
    colours[:, 1] = 80
    here.surface.set_colours("test", colours)
    session.move_cage(0, random_cages(session, 5, 0.04)[0])
    messages = here.due(colours=colours)
    assert len(messages) == 2
    assert send(page, messages) == ["", ""]
    compare(page, here)
    here.surface.set_colours("test", None)
    session.undo()
    assert set(send(page, here.due())) == {""}
    compare(page, here)


def test_a_finished_pose_is_drawn_with_its_offsets_while_it_has_them(page):
    session = sausage_session()
    here = InProcess(session)
    session.move_handle("end", session.targets["end"] + [-2.0, 1.5, 0.8])
    session.commit()
    session.finish()
    offsets = session.vertices - session.deformer.surface(session.cage_vertices)
    assert np.abs(offsets).max() > 0.015 * session.mesh.diagonal  # some 5 pixels
    for _ in range(2):  # and another page
        here.stream.reset()
        assert set(send(page, here.due())) == {""}
        compare(page, here)
    session.move_handle("end", session.targets["end"] + [0.0, 0.4, 0.3])
    assert set(send(page, here.due())) == {""}
    compare(page, here)
    session.revert()
    assert set(send(page, here.due())) == {""}
    compare(page, here)
    session.undo()
    assert set(send(page, here.due())) == {""}
    compare(page, here)


def test_a_surface_with_one_side_has_no_crease(page):
    mesh = Mesh(*moebius())
    regions = Regions.single(mesh)
    session = Session(mesh, state=State(regions, fit_cages(mesh, regions, 30)))
    here = InProcess(session)
    session.move_cage(0, random_cages(session, 1, 0.05)[0])
    assert set(send(page, here.due())) == {""}
    compare(page, here)


def test_marks_are_drawn_where_the_view_draws_them(page, scene):
    here, session = scene.here, scene.session
    here.stream.reset()
    frame = Wireframe(
        session.cages[0].vertices, np.array([[0, 1], [2, 40], [7, 30]]), np.array([5, 9])
    )
    frame.set_style(np.array([255, 0, 0]), line_width=6.0, sphere_size=14.0)
    frame.actor.GetProperty().LightingOff()
    here.view.foreground.AddActor(frame.actor)
    marks = marks_of(here.view, [here.surface.actor])
    assert set(send(page, here.due(marks=marks))) == {""}
    expected, got = here.picture(), drawn(page)
    red = [(p[..., 0] > 200) & (p[..., 1] < 60) for p in (expected, got)]
    here.view.remove_foreground()
    assert red[0].sum() > 500
    assert (red[0] & red[1]).sum() > 0.8 * (red[0] | red[1]).sum()
    assert send(page, here.due()) == [""]
    compare(page, here)


def test_a_mark_that_moves_is_culled_and_clipped_as_in_the_view(page, scene):
    here, session = scene.here, scene.session
    here.stream.reset()
    source, mapper, actor, plane = vtkSphereSource(), vtkPolyDataMapper(), vtkActor(), vtkPlane()
    source.SetThetaResolution(24)
    source.SetPhiResolution(24)
    mapper.SetInputConnection(source.GetOutputPort())
    mapper.AddClippingPlane(plane)
    actor.SetMapper(mapper)
    style = actor.GetProperty()
    style.SetColor(1.0, 0.0, 0.0)
    style.SetAmbient(1.0)
    style.SetDiffuse(0.0)
    actor.SetScale(0.3 * session.mesh.diagonal)
    here.view.foreground.AddActor(actor)
    low, high = session.vertices.min(axis=0), session.vertices.max(axis=0)
    toward = -here.view.view_direction
    counts = []
    for share, normal, culls in (
        (0.2, [1.0, 0.0, 0.0], False),
        (0.7, [0.6, 0.0, 0.8], False),
        (0.7, toward, True),  # of the half towards the viewer no back is visible
        (0.7, -toward, True),
    ):
        place = low + share * (high - low)
        actor.SetPosition(*place)
        plane.SetOrigin(*place)
        plane.SetNormal(*normal)
        style.SetFrontfaceCulling(culls)
        marks = marks_of(here.view, [here.surface.actor])
        assert set(send(page, here.due(marks=marks))) == {""}
        expected, got = here.picture(), drawn(page)
        red = [(p[..., 0] > 200) & (p[..., 1] < 60) for p in (expected, got)]
        assert (red[0] ^ red[1]).sum() <= 0.05 * (red[0] | red[1]).sum()  # at edges
        counts.append(int(red[0].sum()))
    here.view.remove_foreground()
    assert min(counts[0], counts[1], counts[3]) > 2000
    assert counts[2] < 0.03 * counts[3]  # the rim
    assert send(page, here.due()) == [""]
    compare(page, here)


def test_a_large_surface_is_left_to_the_server_without_a_graphics_processor(page, scene):
    scene.here.stream.reset()
    surface = scene.here.due()[0]
    large = surface[:16] + np.uint32(20_001).astype("<u4").tobytes() + surface[20:]
    for is_software, reason in ((True, "without a graphics processor"), (False, "too short")):
        page.evaluate(f"surface.isSoftware = {str(is_software).lower()}")
        (answer,) = send(page, [large])
        assert reason in answer


def test_damaged_messages_are_refused_and_change_nothing(page):
    mesh = Mesh(*icosphere(1))
    regions = Regions.single(mesh)
    here = InProcess(Session(mesh, state=State(regions, fit_cages(mesh, regions, 20))))
    messages = here.due()
    assert set(send(page, messages)) == {""}
    before = drawn(page)
    rng = np.random.default_rng(1)
    surface, _, cages = messages
    damaged = [b"", b"SDFM", b"no message at all, but long enough", surface[:-4], surface + b"0000"]
    damaged += [cages[:4] + b"\x09\0" + cages[6:], cages[:12] + b"\x63\0\0\0" + cages[16:]]
    damaged += [cages[:20] + np.full(len(cages) // 4 - 5, np.nan, "<f4").tobytes()]
    for at in range(16, 44, 4):  # each count of the surface
        for value in (0, 7, 1 << 20, (1 << 32) - 1):
            count = np.uint32(value).astype("<u4").tobytes()
            if count != surface[at : at + 4]:
                damaged.append(surface[:at] + count + surface[at + 4 :])
    n, faces = np.frombuffer(surface, "<u4", 3, 16)[[0, 2]]
    damaged.append(surface[: -12 * int(faces)] + b"\xff" * (12 * int(faces)))
    answers = send(page, damaged)
    assert all(answers), [k for k, answer in enumerate(answers) if not answer]
    np.testing.assert_array_equal(drawn(page), before)
    # Wrong bytes anywhere may mean another surface, but nothing is thrown.
    for _ in range(20):
        data = bytearray(surface)
        for at in rng.integers(0, len(data), 5):
            data[at] = rng.integers(0, 256)
        (answer,) = send(page, [bytes(data)])
        assert isinstance(answer, str)
    here.stream.reset()
    assert set(send(page, here.due())) == {""}
    np.testing.assert_array_equal(drawn(page), before)
    assert n == mesh.n_vertices


@pytest.mark.parametrize("when", ["at first", "again"])
def test_a_driver_that_compiles_no_shader_is_no_error_of_the_page(page, when):
    """Neither is graphics memory that is lost meanwhile: an error would end the whole page."""
    page.evaluate(
        "window.other = document.createElement('canvas'), window.begun = 0,"
        "window.linked = WebGL2RenderingContext.prototype.getProgramParameter"
    )
    refuse = "WebGL2RenderingContext.prototype.getProgramParameter = () => null"
    create = "window.made = SegdeformSurface.create(other)"
    try:
        if when == "at first":
            assert page.evaluate(f"{refuse}, {create} === null")
            return
        page.evaluate(f"{create}, made.onlost = () => begun++")
        page.evaluate(
            "window.lost = made.gl.getExtension('WEBGL_lose_context'), lost.loseContext()"
        )
        page.wait("made.gl.isContextLost() && made._isLost")
        page.evaluate(f"{refuse}, lost.restoreContext()")
        page.wait("!made.gl.isContextLost()")
        page.wait("new Promise((done) => setTimeout(() => done(true)))")  # the event is handled
        assert page.evaluate("begun === 0 && made.receive(new ArrayBuffer(16)) !== ''")
    finally:
        page.evaluate("WebGL2RenderingContext.prototype.getProgramParameter = linked")


def test_after_its_graphics_memory_was_lost_the_page_is_sent_everything_again(page, scene):
    here = scene.here
    page.evaluate(
        "window.losses = 0, surface.onlost = () => losses++,"
        "window.memory = surface.gl.getExtension('WEBGL_lose_context'), memory.loseContext()"
    )
    page.wait("surface.gl.isContextLost()")
    page.wait("surface.serial === null")
    here.stream.reset()
    assert "" not in send(page, here.due())
    page.evaluate("memory.restoreContext()")
    page.wait("losses === 1")
    here.stream.reset()
    assert set(send(page, here.due())) == {""}
    compare(page, here)
