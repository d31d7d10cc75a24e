"""Cages as wireframes: their colours, the pose, dragging vertices."""

from __future__ import annotations

import functools

import numpy as np
import pytest
import vtkmodules.vtkRenderingOpenGL2  # noqa: F401 - a plain window needs it
from hands import Hand, draw_seldom, look_from, picture, plain_view
from scenes import Scene, sausage

from vtk_segdeform import Session
from vtk_segdeform.pictures.palette import HANDLE, of_region, rgb
from vtk_segdeform.session.state import State
from vtk_segdeform.widgets.cage_display.cage_display import CageDisplay
from vtk_segdeform.widgets.scene.surface_display import SurfaceDisplay
from vtk_segdeform.widgets.scene.view import View

pytestmark = pytest.mark.usefixtures("bound_once")


@functools.lru_cache(maxsize=1)
def fitted() -> tuple[Scene, State]:
    scene = sausage(3)
    session = Session(scene.mesh)
    session.set_regions(scene.regions)
    session.fit_cages()
    session.set_fixed(scene.fixed)
    session.handles.add(scene.handle)
    session.change_options(preserve_volume=False)
    return scene, session.state


@pytest.fixture
def surface():
    """Return a sausage along x, in a plain window, seen from -y and a little from above."""
    scene, state = fitted()
    view = plain_view((500, 400))
    surface = SurfaceDisplay(view, Session(scene.mesh, state=state))
    look_from(view, 0.0, -10.0, 2.0)
    draw_seldom(view)
    yield surface
    surface.remove()


@pytest.fixture
def cages(surface):
    """Return a display of its three cages, switched on; the volume is not preserved."""
    display = CageDisplay(surface.view, surface.session)
    display.On()
    yield display
    display.remove()


@pytest.fixture
def hand(cages):
    return Hand(cages.view)


def top_of(display, region: int) -> int:
    """Return the vertex of a cage that is highest in the display: outside the mesh."""
    return int(np.argmax(display.view.to_display(display.session.cage_vertices[region])[:, 1]))


def count(display, colour, image=None) -> int:
    """Return the number of pixels with *colour*, possibly shaded, in its *image* or a new one."""
    hue = np.asarray(colour, float) / np.linalg.norm(colour)
    image = (picture(display.view) if image is None else image).astype(float)
    bright = np.linalg.norm(image, axis=2)
    alike = image @ hue > 0.995 * bright
    return int((alike & (bright > 0.4 * np.linalg.norm(colour))).sum())


def near(display, point, colour, image=None) -> bool:
    """Return whether a pixel within two pixels of a world *point* has *colour*."""
    image = picture(display.view) if image is None else image
    x, y = (round(float(p)) for p in display.view.to_display(np.array([point]))[0, :2])
    image = image[::-1][y - 2 : y + 3, x - 2 : x + 3].reshape(-1, 3).astype(float)
    hue = np.asarray(colour, float) / np.linalg.norm(colour)
    return bool((image @ hue > 0.995 * np.linalg.norm(image, axis=1)).any())


def test_each_cage_has_the_colour_of_its_region(cages):
    image = picture(cages.view)
    for region in range(3):
        assert count(cages, of_region(region), image) > 500
        vertex = cages.session.cage_vertices[region][top_of(cages, region)]
        assert near(cages, vertex, of_region(region), image)


def test_one_cage_or_all_cages_can_be_hidden(cages):
    cages.set_visible(1, False)
    assert not cages.is_visible(1)
    assert count(cages, of_region(1)) < 20
    assert count(cages, of_region(0)) > 500
    cages.set_visible(1, True)
    cages.hide()
    assert not cages.is_shown
    image = picture(cages.view)
    assert all(count(cages, of_region(region), image) < 20 for region in range(3))
    cages.show()
    image = picture(cages.view)
    assert all(count(cages, of_region(region), image) > 500 for region in range(3))


def test_opacity_makes_wireframes_fainter(cages):
    solid = picture(cages.view).astype(int)
    cages.opacity = 0.3
    faint = picture(cages.view).astype(int)
    assert (255 - faint).sum() < (255 - solid).sum()
    for wrong in (0.0, 1.5, float("nan")):
        with pytest.raises(ValueError, match="opacity must be"):
            cages.opacity = wrong


def test_cages_follow_the_pose(cages):
    session, (scene, _) = cages.session, fitted()
    session.drag(scene.turned(40.0), max_steps=3)
    assert np.abs(session.cage_vertices[2] - session.cages[2].vertices).max() > 1.0
    for _ in range(2):
        image = picture(cages.view)
        for region in range(3):
            vertex = session.cage_vertices[region][top_of(cages, region)]
            assert near(cages, vertex, of_region(region), image)
        session.undo()
    assert session.state.pose is None


def test_a_change_of_regions_replaces_the_wireframes(cages):
    session = cages.session
    session.painting.merge([1, 2])
    image = picture(cages.view)
    assert all(count(cages, of_region(region), image) < 20 for region in range(3))
    session.undo()
    image = picture(cages.view)
    assert all(count(cages, of_region(region), image) > 500 for region in range(3))


def test_the_vertex_under_the_pointer_is_highlighted(cages, hand):
    before = picture(cages.view)
    vertex = cages.session.cage_vertices[1][top_of(cages, 1)]
    x, y = hand.at(vertex)
    hand.hover((x + 5, y - 3))
    assert near(cages, vertex, rgb(HANDLE))
    hand.hover((x, y + 40))
    assert (picture(cages.view) == before).all()
    hand.hover((x, y))
    cages.Off()
    assert (picture(cages.view) == before).all()
    assert not hand.failures


def test_a_dragged_vertex_follows_the_pointer_at_constant_depth(cages, hand):
    session, view = cages.session, cages.view
    k = top_of(cages, 1)
    start, rest = session.cage_vertices[1][k], session.vertices
    camera = view.camera.GetPosition()
    x, y = hand.at(start)
    hand.press((x + 4, y))  # the offset from the pointer is kept
    for step in range(1, 5):
        hand.move((x + 4 + 8 * step, y + 6 * step))
        now = session.cage_vertices[1]
        seen = view.to_display(now[k : k + 1])[0]
        # Positions of events are whole pixels.
        assert np.abs(seen[:2] - [x + 8 * step, y + 6 * step]).max() <= 1.0
        assert (now[k] - start) @ view.view_direction == pytest.approx(0.0, abs=1e-9)
        assert near(cages, now[k], rgb(HANDLE))
    others = np.delete(np.arange(len(now)), k)
    assert np.array_equal(now[others], session.cages[1].vertices[others])
    assert np.abs(session.vertices - rest).max() > 0.01
    hand.release()
    assert view.camera.GetPosition() == camera
    assert session.history.undo_label == "drag the cage of region 2"
    assert not session.is_dragging
    session.undo()
    assert np.array_equal(session.vertices, rest)
    assert session.history.undo_label != "drag the cage of region 2"
    assert not hand.failures


def test_escape_and_the_right_button_cancel_the_drag(cages, hand):
    session = cages.session
    before, step = picture(cages.view), session.history.undo_label
    x, y = hand.at(session.cage_vertices[1][top_of(cages, 1)])
    for cancel in (lambda: hand.key("Escape"), lambda: hand.event("RightButtonPressEvent")):
        hand.press((x, y))
        hand.move((x + 20, y + 20))
        assert session.state.pose is not None
        cancel()
        assert session.state.pose is None
        assert not cages.is_grabbing
        hand.release((x + 20, y + 20))
        hand.event("RightButtonReleaseEvent")
        hand.hover((5, 5))
        assert (picture(cages.view) == before).all()
    assert session.history.undo_label == step
    assert not hand.failures


def test_a_hidden_vertex_can_only_be_dragged_with_through(cages, hand):
    session, view = cages.session, cages.view
    for region in (0, 2):
        cages.set_visible(region, False)
    p = session.cage_vertices[1]
    seen = view.to_display(p)[:, :2]
    alone = [
        k
        for k in np.flatnonzero((p[:, 1] > 0.5) & (np.abs(p[:, 2]) < 0.4))
        if np.partition(np.linalg.norm(seen - seen[k], axis=1), 1)[1] > 10
    ]
    assert alone
    before = session.cage_vertices[1]
    x, y = seen[alone[0]]
    hand.drag([(x, y), (x + 10, y)])
    assert session.cage_vertices[1] is before  # the camera moved instead
    cages.through = True
    x, y = hand.at(p[alone[0]])
    hand.drag([(x, y), (x + 10, y)])
    moved = np.flatnonzero((session.cage_vertices[1] != before).any(axis=1))
    assert moved.tolist() == [alone[0]]
    assert not hand.failures


def test_of_two_vertices_at_the_pointer_the_nearer_is_dragged(cages, hand):
    session, view = cages.session, cages.view
    session.set_cages(fitted()[0].cages)  # symmetrical: y and -y in line
    view.camera.SetPosition(0.0, -10.0, 0.0)
    view.camera.SetParallelProjection(True)
    view.camera.Azimuth(2.0)
    view.renderer.ResetCamera()
    View.render(view)
    p = session.cage_vertices[1]
    above = np.flatnonzero((p[:, 1] < -0.4) & (p[:, 2] > 1.0))  # above the mesh
    front = above[0]
    back = int(np.argmin(np.linalg.norm(p - p[front] * [1, -1, 1], axis=1)))
    x, y = hand.at(p[back])
    assert 2.0 < abs(hand.at(p[front])[0] - x) < 7.0
    hand.drag([(x, y), (x, y + 20)])
    assert np.flatnonzero((session.cage_vertices[1] != p).any(axis=1)).tolist() == [front]


def test_only_visible_cages_can_be_dragged_and_only_while_on(cages, hand):
    session = cages.session
    path = [hand.at(session.cage_vertices[1][top_of(cages, 1)]), (10, 10)]
    camera = cages.view.camera.GetPosition()

    def turns_the_camera():
        hand.drag(path)
        turned = cages.view.camera.GetPosition() != camera
        cages.view.camera.SetPosition(*camera)
        cages.view.camera.SetViewUp(0.0, 0.0, 1.0)
        return turned and session.state.pose is None

    cages.set_visible(1, False)
    assert turns_the_camera()
    cages.set_visible(1, True)
    cages.hide()
    assert turns_the_camera()
    cages.show()
    cages.Off()
    assert turns_the_camera()
    cages.On()
    assert not turns_the_camera()


def test_a_move_that_is_refused_is_reported_and_the_drag_cancelled(cages, hand):
    session = cages.session
    x, y = hand.at(session.cage_vertices[1][top_of(cages, 1)])
    hand.press((x, y))
    hand.move((x + 10, y))
    hand.move((1_000_000, y))
    assert ["mesh diagonals away" in str(failure) for failure in hand.failures] == [True]
    assert session.state.pose is None
    assert not session.is_dragging
    assert not cages.is_grabbing
    hand.release((x, y))
    hand.drag([(x, y), (x + 10, y)])
    assert session.history.undo_label == "drag the cage of region 2"
    assert len(hand.failures) == 1


def test_remove_restores_the_view(cages, hand):
    view = cages.view
    hand.hover(hand.at(cages.session.cage_vertices[1][top_of(cages, 1)]))
    cages.remove()
    assert view.renderer.GetViewProps().GetNumberOfItems() == 1  # the surface
    assert view.foreground.GetViewProps().GetNumberOfItems() == 0
    cages.session.move_cage(1, cages.session.cage_vertices[1] * 1.1)
    assert not hand.failures
