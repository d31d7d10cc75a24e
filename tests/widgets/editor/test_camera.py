"""The camera of the editor: by mouse in every mode, named views, framing, and its saved state."""

from __future__ import annotations

import numpy as np
import pytest
from campaign import every
from hands import Hand, draw_seldom, picture, plain_view
from vtkmodules.vtkInteractionStyle import (
    vtkInteractorStyleJoystickCamera,
    vtkInteractorStyleTerrain,
    vtkInteractorStyleTrackballCamera,
)

from vtk_segdeform import Mesh, models
from vtk_segdeform.session import saved_view
from vtk_segdeform.widgets import DeformEditor, Mode
from vtk_segdeform.widgets.editor import PRESETS
from vtk_segdeform.widgets.editor.actions import show_rest
from vtk_segdeform.widgets.scene.view import View

pytestmark = pytest.mark.usefixtures("unprepared")

STYLES = {
    each.__name__: each
    for each in (
        vtkInteractorStyleTrackballCamera,
        vtkInteractorStyleTerrain,
        vtkInteractorStyleJoystickCamera,
    )
}


class Bench:
    """An editor over a slender bar in plain VTK, and a hand."""

    def __init__(self, scale=1.0, shift=0.0):
        mesh = models.bar(divisions=(2, 2, 8))
        self.mesh = Mesh(mesh.vertices * scale + shift, mesh.faces)
        self.view = plain_view()
        self.editor = DeformEditor(self.view, self.mesh)
        self.editor.On()
        self.view.render()
        draw_seldom(self.view)
        self.hand = Hand(self.view)

    @property
    def camera(self):
        camera = self.view.camera
        return np.array([camera.GetPosition(), camera.GetFocalPoint(), camera.GetViewUp()])

    @property
    def middle(self):
        return np.round(self.hand.at(self.mesh.vertices.mean(axis=0)))

    def drag(self, button, start, *, alt=False):
        """Drag, and return how position, focus and view-up of the camera have moved."""
        before = self.camera
        self.view.interactor.SetAltKey(alt)
        self.hand.hover(start)
        self.hand.event(f"{button}ButtonPressEvent", start)
        for by in ((10, 4), (20, 8)):
            self.hand.move(np.add(start, by))
        self.hand.event(f"{button}ButtonReleaseEvent", np.add(start, (20, 8)))
        self.view.interactor.SetAltKey(0)
        after = self.camera
        self.hand.move(start)
        assert np.array_equal(self.camera, after)  # it does not follow the pointer any more
        return np.abs(after - before).max(axis=1) / self.mesh.diagonal


@pytest.fixture(
    scope="module",
    params=every(4, [((1.0, 1e6),), ((1e-7, 0.0),), ((1.0, 0.0),), ((1e6, 0.0),)]),
)
def shared(request):
    """Yield a bench over a mesh of some size at some place, with its style and its mode."""
    bench = Bench(*request.param)
    yield bench, bench.view.interactor.GetInteractorStyle(), bench.editor.mode
    bench.editor.remove()


@pytest.fixture
def bench(shared):
    """Yield the shared bench with the style, mode, projection and view that it had at first."""
    bench, style, mode = shared
    bench.view.interactor.SetInteractorStyle(style)
    bench.view.camera.SetParallelProjection(False)
    bench.editor.mode = mode
    bench.editor.controller.camera.viewpoint.home()
    View.render(bench.view)
    return bench


def test_every_drag_moves_the_camera_in_every_mode_and_style(bench):
    for style, mode in zip([*STYLES, *STYLES], Mode, strict=False):
        bench.view.interactor.SetInteractorStyle(STYLES[style]())
        bench.editor.mode = mode
        before = bench.editor.session.state
        for button, place, alt in (
            ("Left", bench.middle, True), ("Left", (5, 395), False),
            ("Middle", bench.middle, False), ("Right", bench.middle, False),
        ):  # fmt: skip
            moved = bench.drag(button, place, alt=alt)
            assert moved[0] > 1e-3, (style, mode, button)
            assert (moved[1] > 1e-3) == (button == "Middle" or alt)
            assert np.isfinite(bench.camera).all()
            bench.editor.controller.camera.viewpoint.home()
        assert bench.editor.session.state is before
        assert bench.hand.failures == []


def test_with_blenders_keys_the_middle_button_orbits_and_pans_with_shift(bench):
    def turned():
        before = bench.view.view_direction
        bench.drag("Middle", bench.middle)
        return bool(np.linalg.norm(bench.view.view_direction - before) > 1e-3)

    assert not turned()  # it pans
    bench.editor.keys = PRESETS["Blender"] | {"segment": "f5"}
    assert turned()
    assert ("Shift+middle drag", "Pan") in bench.editor.keys.mouse
    place = bench.middle
    before, direction = bench.camera, bench.view.view_direction
    bench.hand.event("MiddleButtonPressEvent", place, shift=True)
    bench.hand.move(place + [20, 8], shift=True)
    bench.hand.event("MiddleButtonReleaseEvent", place + [20, 8], shift=True)
    assert np.abs(bench.view.view_direction - direction).max() < 1e-9
    assert np.abs(bench.camera[1] - before[1]).max() > 1e-3 * bench.mesh.diagonal
    bench.editor.keys = {"undo": "alt+z"}
    assert not turned()


def test_the_wheel_zooms_to_the_pointer_within_limits(bench):
    place, radius = bench.middle, bench.editor.widgets.selector.radius
    bench.hand.hover(place)
    point = bench.editor.widgets.point_at(bench.view.pointer(None))
    for clicks in (8, 40, -90):
        bench.hand.wheel(clicks, place)
        assert np.allclose(bench.hand.at(point), place, atol=1.0)
        distance = bench.view.camera.GetDistance() / bench.mesh.diagonal
        assert 1e-3 < distance < 200.0
        near, far = bench.view.camera.GetClippingRange()
        assert 0.0 < near < far
    assert bench.editor.widgets.selector.radius == radius


def test_the_camera_never_turns_upside_down(bench):
    for dy in (70, -90, 90):
        for _ in range(4):
            bench.hand.drag([(5, 200), (15, 200 + dy)])
        assert bench.camera[2] @ [0.0, 0.0, 1.0] >= -1e-9
        assert abs(bench.camera[2] @ bench.view.view_direction) < 1e-6


FACES = {
    "kp_1": (0, 1, 0), "ctrl+kp_1": (0, -1, 0), "kp_end": (0, 1, 0),
    "kp_3": (-1, 0, 0), "ctrl+kp_3": (1, 0, 0), "kp_7": (0, 0, -1), "ctrl+kp_7": (0, 0, 1),
}  # fmt: skip


def test_the_model_is_framed_again_in_another_window_until_the_camera_is_moved(bench):
    def is_seen():
        pixels = np.array([bench.hand.at(x) for x in bench.mesh.vertices])
        return bool((pixels >= 0).all() and (pixels < bench.view.window.GetSize()).all())

    before = bench.view.window.GetSize()
    small = before[0] // 8, before[1]
    try:
        for size in (small, before, small):
            bench.view.window.SetSize(*size)
            View.render(bench.view)
            assert is_seen()
        bench.drag("Left", (5, 5))
        camera = bench.camera
        bench.view.window.SetSize(*before)
        View.render(bench.view)
        assert np.array_equal(bench.camera, camera)
        bench.editor.controller.camera.viewpoint.home()
        bench.view.camera.SetPosition(camera[0] + bench.mesh.diagonal)  # by the host
        camera = bench.camera
        bench.view.window.SetSize(*small)
        View.render(bench.view)
        assert np.array_equal(bench.camera, camera)
    finally:
        bench.view.window.SetSize(*before)


def test_keys_of_the_keypad_show_the_model_and_change_no_mode(bench):
    mode = bench.editor.mode

    def looks(key):
        *held, name = key.split("+")
        bench.hand.key(name.upper() if "kp" in name else name, control="ctrl" in held)
        shown = bench.view.to_display(bench.mesh.vertices)[:, :2]
        assert shown.min() > 0.0
        assert shown.max() < 400.0
        return bench.view.view_direction

    for key, direction in FACES.items():
        assert np.allclose(looks(key), direction, atol=1e-6), key
    assert np.abs(looks("kp_0")).min() > 0.1  # from none of the sides
    for is_parallel in (True, False):
        looks("kp_5")
        assert bench.view.camera.GetParallelProjection() == is_parallel
    for key in ("period", "comma"):
        looks(key)
    assert bench.editor.mode is mode


def test_a_double_click_frames_and_a_click_on_the_cube_turns():
    bench = Bench()
    bench.hand.wheel(10, (100, 100))
    for _ in range(2):
        bench.hand.click((5, 5))
    shown = bench.view.to_display(bench.mesh.vertices)[:, :2]
    assert shown.min() > 0.0
    assert shown.max() < 400.0
    bench.editor.show_cube = True
    View.render(bench.view)
    left, bottom, right, top = bench.editor.controller.camera.cube.rectangle
    bench.hand.key("F1")  # the help card has its place
    before = bench.camera
    View.render(bench.view)
    bench.hand.click((0.5 * (left + right), top - 0.3 * (top - bottom)))
    assert np.array_equal(bench.camera, before)
    bench.hand.key("Escape")
    View.render(bench.view)
    bench.hand.click((0.5 * (left + right), top - 0.3 * (top - bottom)))
    assert bench.editor.session.history.undo_label is None
    assert bench.view.view_direction @ [0.0, 0.0, 1.0] < -0.7
    cube, gizmo = bench.editor.controller.camera.cube, bench.editor.widgets.dragger.gizmo
    at, step = bench.mesh.vertices.mean(axis=0), cube.rectangle[0] - np.array(bench.middle)[0]
    for share, is_covered in ((-0.5, False), (0.9, True)):
        aside = share * step * bench.view.pixel_at(at) * bench.camera[2]
        gizmo.place(at + aside + np.cross(bench.view.view_direction, aside))
        assert (cube.rectangle[2] == 0.0) is is_covered
    gizmo.place(None)
    low, high = np.array(cube.rectangle[:2]), np.array(cube.rectangle[2:])
    bench.editor.session.handles.pin(0)
    at = bench.mesh.vertices[0]
    for place, is_covered in ((low - 30.0, False), (0.5 * (low + high), True)):
        right = np.cross(bench.view.view_direction, bench.camera[2])
        x, y = (np.array(bench.hand.at(at)) - place) * bench.view.pixel_at(at)
        position, focus, _ = bench.camera
        bench.view.camera.SetPosition(*(position + x * right + y * bench.camera[2]))
        bench.view.camera.SetFocalPoint(*(focus + x * right + y * bench.camera[2]))
        assert (cube.rectangle[2] == 0.0) is is_covered
    bench.editor.session.undo()
    with_cube = picture(bench.view)
    bench.editor.show_cube = False
    assert not bench.editor.show_cube
    assert (picture(bench.view) != with_cube).any()
    count = bench.view.window.GetRenderers().GetNumberOfItems()
    bench.editor.remove()
    assert bench.view.window.GetRenderers().GetNumberOfItems() < count


@pytest.mark.parametrize("button", ["Middle", "Right"])
def test_a_left_press_during_a_drag_of_another_button_edits_nothing(bench, button):
    """A finger that slips onto the left button ends the drag; the next press edits again."""
    bench.editor.mode = Mode.HANDLES
    session, hand, start = bench.editor.session, bench.hand, bench.middle
    position = session.history.position
    hand.hover(start)
    hand.event(f"{button}ButtonPressEvent", start)
    hand.move(start + (10, 4))
    hand.drag([start + (10, 4), start + (30, 10), start + (60, 30)])
    hand.event(f"{button}ButtonReleaseEvent", start + (60, 30))
    assert session.history.position == position
    after = bench.camera
    hand.drag([start, start + (30, 10)])
    assert session.history.position > position
    assert np.array_equal(bench.camera, after)
    session.undo()


@pytest.mark.parametrize("mode", [Mode.PULL, Mode.HANDLES])
def test_no_ring_stays_behind_where_a_view_key_was_pressed(bench, mode):
    widgets, bench.editor.mode = bench.editor.widgets, mode
    ring = (widgets.puller if mode is Mode.PULL else widgets.selector)._ring
    is_shown = lambda: any(actor.GetVisibility() for actor in ring._actors)  # noqa: E731
    bench.hand.hover(bench.middle)
    assert is_shown()
    bench.hand.key("KP_7")
    assert not is_shown()
    bench.hand.hover(bench.middle)
    assert is_shown()


def test_the_mesh_at_rest_stays_while_the_camera_moves_until_a_press_on_it(bench):
    controller, hand = bench.editor.controller, bench.hand
    show_rest(controller)
    bench.drag("Left", bench.middle, alt=True)
    bench.drag("Left", np.array([6.0, 6.0]))
    bench.drag("Middle", bench.middle)
    hand.wheel(1, bench.middle)
    hand.key("KP_1")
    assert controller.shows_rest
    controller.camera.viewpoint.home()
    View.render(bench.view)
    before, position = bench.camera, bench.editor.session.history.position
    hand.drag([bench.middle, bench.middle + [20, 10]])
    assert not controller.shows_rest
    assert "The pose is shown again" in bench.editor.status
    assert np.array_equal(bench.camera, before)
    assert bench.editor.session.history.position == position


def test_the_next_axis_is_up_by_a_key():
    bench = Bench()
    viewpoint = bench.editor.controller.camera.viewpoint
    viewpoint.up = np.eye(3)[2]
    for axis in (0, 1, 2):
        bench.hand.types("shift+u")
        assert np.array_equal(viewpoint.up, np.eye(3)[axis])
        assert f"Up: {'XYZ'[axis]}" in bench.editor.status
        bench.hand.tick(60)  # until the camera has moved there
        assert bench.view.camera.GetViewUp()[axis] > 0.8


def test_a_guessed_up_axis_is_told_with_the_key_that_changes_it():
    bench = Bench(shift=np.array([0.0, 0.0, -0.5]))  # not on the ground
    controller = bench.editor.controller
    controller.camera.show_model()
    controller.refresh()
    up = "XYZ"[int(controller.camera.viewpoint.up.argmax())]
    assert f"{up} is up by a guess. Shift+U: next axis" in bench.editor.status
    state = bench.editor.session.state
    bench.editor.session.set_fixed([0])
    assert "guess" not in bench.editor.status
    bench.editor.session.undo()
    assert "guess" in bench.editor.status
    bench.hand.types("shift+u")
    assert "guess" not in bench.editor.status
    assert bench.editor.session.state is state


@pytest.mark.parametrize("axis", [1, 2])
def test_each_face_of_the_cube_is_named_upright_in_its_view(axis):
    bench = Bench()
    bench.editor.show_cube = True
    camera = bench.editor.controller.camera
    camera.viewpoint.up = np.eye(3)[axis]
    View.render(bench.view)
    for label in camera.cube._labels:
        camera.viewpoint.look_from(label.name, animate=False)
        to_camera = -bench.view.view_direction
        up = np.array(bench.view.camera.GetViewUp())
        matrix = label.actor.GetUserMatrix()
        across, along, out, at = (
            np.array([matrix.GetElement(i, j) for i in range(3)]) for j in range(4)
        )
        size = np.linalg.norm(along)
        for direction, wanted in ((across, np.cross(up, to_camera)), (along, up), (out, to_camera)):
            np.testing.assert_allclose(direction, size * wanted, atol=1e-12)
        low, high = np.reshape(label.actor.GetBounds(), (3, 2)).T
        assert at @ to_camera > 0.5  # above its face, and within it
        assert (np.sort(high - low)[1:] < 0.95).all()


def test_a_session_file_keeps_the_view_and_ignores_a_damaged_one(tmp_path):
    bench, path = Bench(), tmp_path / "work.segdeform"
    bench.hand.key("KP_3")
    bench.editor.mode = Mode.CAGES
    for k in range(3):
        bench.editor.session.handles.add([k])
    bench.editor.widgets.dragger.set_hidden("handle 1", True)
    bench.editor.widgets.dragger.set_locked("handle 2", True)
    bench.editor.save(path)
    kept = saved_view(path)
    other = Bench()
    other.editor.load(path)
    dragger = other.editor.widgets.dragger
    assert (dragger.hidden, dragger.locked) == ({"handle 1"}, {"handle 2"})
    for damaged, flags in ((3, {"handle 1"}), ([{}, "handle 7", "handle 3"], {"handle 3"})):
        other.editor.controller.camera.restore({**kept, "hidden": damaged})
        assert (dragger.hidden, dragger.locked) == (flags, {"handle 2"})
    assert np.allclose(other.camera, bench.camera)
    assert other.editor.mode is Mode.CAGES
    before = other.camera
    for name, value in (
        ("position", ["x"] * 3),
        ("angle", float("nan")),
        ("scale", -1.0),
        ("focus", kept["position"]),
        ("up", [0, 0, 0]),
        ("parallel", 1),
    ):
        other.editor.controller.camera.viewpoint.restore({**kept, name: value})
        assert np.array_equal(other.camera, before), name
    path.write_bytes(b"nothing")
    assert saved_view(path) == {}
