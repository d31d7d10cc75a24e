"""Painting by input events: the effect on the session and on the picture."""

from __future__ import annotations

import numpy as np
import pytest
from hands import Hand, Painter, draw_seldom, look_from, picture, plain_view
from vtkmodules.vtkRenderingCore import vtkTextActor

from vtk_segdeform import Regions, Session, models
from vtk_segdeform.errors import ConstraintError, RegionError, SegDeformError
from vtk_segdeform.widgets.region_selector.region_outlines import RegionOutlines
from vtk_segdeform.widgets.region_selector.region_selector import Paint, RegionSelector, Tool
from vtk_segdeform.widgets.scene.view import View


class Desk(Painter):
    """A sphere seen along y, z up, with a selector and a hand."""

    def __init__(self, *, halves=True):
        self.view = plain_view()
        self.session = Session(models.sphere(600))
        if halves:
            z = self.session.mesh.vertices[:, 2]
            self.session.set_regions(Regions.from_masks(self.session.mesh, [z > -0.2, z < 0.2]))
        self.selector = RegionSelector(self.view, self.session)
        look_from(self.view, 0.0, -4.0, 0.0)
        draw_seldom(self.view)
        self.hand = Hand(self.view)
        self.selector.On()

    @property
    def points(self):
        return self.session.mesh.vertices


@pytest.fixture
def desk():
    made = Desk()
    yield made
    assert made.hand.failures == []
    assert not made.selector.is_grabbing
    made.selector.remove()


def test_a_brush_stroke_adds_the_vertices_along_its_path_in_one_step(desk):
    before = desk.session.regions.membership[1].copy()
    desk.selector.region, desk.selector.radius = 1, 0.3
    # A fast stroke, one move over half the sphere, must leave no gap.
    desk.hand.drag([desk.under(-0.6, 0.6), desk.under(0.6, 0.6)])
    added = desk.session.regions.membership[1] & ~before
    places = desk.points[added]
    assert len(places) > 10
    assert (places[:, 1] < 0.0).all()  # not on the far side
    assert np.abs(places[:, 2] - 0.6).max() < 0.35
    for x in (-0.6, -0.3, 0.0, 0.3, 0.6):
        assert np.abs(places[:, 0] - x).min() < 0.15
    assert desk.session.undo() == "paint region 2"
    assert np.array_equal(desk.session.regions.membership[1], before)


def test_control_erases(desk):
    desk.selector.region, desk.selector.radius = 0, 0.15
    both = desk.session.regions.membership.all(axis=0)
    desk.hand.drag([desk.under(0.0, 0.0), desk.under(0.2, 0.0)], control=True)
    out = both & ~desk.session.regions.membership[0]
    assert out.any()
    assert desk.session.regions.membership[1][out].all()


def test_the_first_stroke_creates_regions():
    desk = Desk(halves=False)
    desk.selector.region = 1
    desk.hand.click(desk.under(0.3, 0.3))
    assert desk.hand.failures == []
    assert desk.session.regions.n_regions == 2
    assert desk.session.regions.membership[0].all()
    desk.selector.remove()


def test_a_stroke_is_previewed_and_escape_cancels_it(desk):
    idle = picture(desk.view)
    desk.selector.region, desk.selector.radius = 1, 0.3
    desk.hand.press(desk.under(0.0, 0.6))
    desk.hand.move(desk.under(0.2, 0.6))
    assert (picture(desk.view) != idle).any(axis=2).sum() > 500
    membership = desk.session.regions.membership
    desk.hand.key("Escape")
    desk.hand.release(desk.under(0.2, 0.6))
    assert desk.session.regions.membership is membership
    assert not desk.session.history.can_undo or desk.session.history.undo_label == "set regions"
    desk.hand.hover((5, 5))
    assert (picture(desk.view) == idle).all()


def test_a_press_beside_the_mesh_or_with_alt_moves_the_camera(desk):
    camera, regions = desk.view.camera.GetPosition(), desk.session.regions
    desk.hand.drag([(5, 5), (40, 40), (60, 50)])
    assert desk.view.camera.GetPosition() != camera
    camera = desk.view.camera.GetPosition()
    desk.view.interactor.SetAltKey(1)
    desk.hand.drag([desk.under(0.0, 0.0), desk.under(0.3, 0.2)])
    desk.view.interactor.SetAltKey(0)
    assert desk.view.camera.GetPosition() != camera
    assert desk.session.regions is regions


@pytest.mark.parametrize("through", [False, True])
def test_a_rectangle_selects_visible_vertices_or_all(desk, through):
    desk.selector.tool, desk.selector.paints = Tool.RECTANGLE, Paint.FIXED
    desk.selector.through = through
    (x0, y0), (x1, y1) = (2, 2), desk.under(0.99, -0.5)
    desk.hand.drag([(x0, y0), (100, 60), (398, y1)])
    places = desk.points[desk.session.fixed]
    lower = desk.points[:, 2] < -0.6
    assert (places[:, 2] < -0.35).all()
    assert (places[:, 1] > 0.2).any() == through
    taken = np.isin(np.flatnonzero(lower), desk.session.fixed)
    assert taken.all() if through else 0.2 < taken.mean() < 0.8
    assert x1 > x0


def test_a_lasso_selects_the_vertices_inside(desk):
    desk.selector.tool, desk.selector.paints = Tool.LASSO, Paint.HANDLE
    angle = np.linspace(0, 2 * np.pi, 40)
    x, z = 0.3 * np.cos(angle), 0.5 + 0.3 * np.sin(angle)
    desk.hand.drag([desk.under(a, b) for a, b in zip(x, z, strict=True)])
    assert list(desk.session.handles) == ["handle 1"]
    assert desk.selector.handle == "handle 1"
    places = desk.points[desk.session.handles["handle 1"]]
    assert len(places) > 5
    assert np.hypot(places[:, 0], places[:, 2] - 0.5).max() < 0.33
    assert (places[:, 1] < 0.0).all()


def test_outlines_run_between_the_regions_and_their_numbers_stand_on_them(desk):
    outlines, idle = RegionOutlines(desk.selector.surface), picture(desk.view)
    outlines.show(lines=True, numbers=False)
    labels = desk.session.regions.labels
    between = labels[desk.session.mesh.edges]
    assert len(outlines._ends) == np.count_nonzero(between[:, 0] != between[:, 1])
    changed = (picture(desk.view) != idle).any(axis=2)
    (left, middle), (right, _) = desk.under(-0.6, 0.0), desk.under(0.6, 0.0)
    assert changed[:, round(left) : round(right)].any(axis=0).mean() > 0.85  # a thin line
    reach = desk.under(0.0, 0.2)[1] - middle
    assert np.abs(399 - np.flatnonzero(changed.any(axis=1)) - middle).max() < reach
    outlines.show(lines=False, numbers=True)
    assert (picture(desk.view) != idle).any()
    props = desk.view.renderer.GetViewProps()
    first, second = [prop for prop in props if isinstance(prop, vtkTextActor)]
    assert (first.GetInput(), second.GetInput()) == (" 1 ", " 2 ")
    assert outlines.n_numbers == 2
    assert first.GetPosition()[1] > middle + reach
    assert second.GetPosition()[1] < middle - reach
    outlines.remove()
    assert (picture(desk.view) == idle).all()


def test_a_click_selects_a_connected_part(desk):
    desk.selector.tool, desk.selector.paints = Tool.COMPONENT, Paint.HANDLE
    desk.hand.click(desk.under(0.1, 0.1))
    assert len(desk.session.handles["handle 1"]) == desk.session.mesh.n_vertices
    desk.hand.click(desk.under(0.1, 0.1), control=True)
    assert not desk.session.handles
    assert desk.selector.handle is None


def test_fixed_vertices_and_handles_remain_disjoint(desk):
    desk.selector.tool, desk.selector.paints = Tool.RECTANGLE, Paint.FIXED
    desk.selector.through = True
    desk.hand.drag([(2, 2), (398, 150)])
    fixed = desk.session.fixed.copy()
    desk.selector.paints = Paint.HANDLE
    desk.hand.drag([(2, 2), (398, 398)])  # the whole mesh
    handle = desk.session.handles["handle 1"]
    assert len(fixed) + len(handle) == desk.session.mesh.n_vertices
    assert np.array_equal(desk.session.fixed, fixed)
    desk.selector.paints = Paint.FIXED
    desk.hand.drag([(2, 300), (398, 398)])
    assert isinstance(desk.hand.failures.pop(), ConstraintError)


def test_vertices_of_no_other_region_cannot_be_erased(
    desk,
):
    desk.selector.tool, desk.selector.through = Tool.RECTANGLE, True
    first, second = desk.session.regions.membership
    desk.hand.drag([(2, 2), (398, 398)], control=True)
    assert np.array_equal(desk.session.regions.membership, [first & ~second, second])
    regions = desk.session.regions
    desk.hand.drag([(2, 2), (398, 398)], control=True)
    error = desk.hand.failures.pop()
    assert isinstance(error, RegionError)
    assert "are only in region 1; add them to another region first" in str(error)
    assert desk.session.regions is regions


def test_brackets_and_the_wheel_with_shift_over_the_mesh_change_the_brush(desk):
    here, radius = desk.under(0.0, 0.0), desk.selector.radius
    desk.hand.wheel(+2, here, shift=True)
    assert desk.selector.radius > 1.3 * radius
    desk.hand.wheel(-2, here, shift=True)
    assert desk.selector.radius == pytest.approx(radius)
    desk.hand.key("bracketright", here)
    assert desk.selector.radius > radius
    desk.hand.key("bracketleft", here)
    assert desk.selector.radius == pytest.approx(radius)


def test_the_wheel_zooms_without_shift_and_beside_the_mesh_but_not_during_a_stroke(desk):
    here, radius = desk.under(0.0, 0.0), desk.selector.radius
    for place, held in (((5, 5), {"shift": True}), (here, {}), (here, {"control": True})):
        camera = desk.view.camera.GetDistance()
        desk.hand.wheel(+1, place, **held)
        assert desk.view.camera.GetDistance() < camera
    assert desk.selector.radius == radius
    desk.selector.tool = Tool.LASSO
    desk.hand.press((50, 50))
    camera = desk.view.camera.GetDistance()
    desk.hand.wheel(+1, (60, 60))
    assert desk.view.camera.GetDistance() == camera
    desk.hand.key("Escape")
    desk.hand.release()


def test_the_radius_of_the_brush_is_limited(desk):
    here, size = desk.under(0.0, 0.0), desk.session.mesh.diagonal
    desk.selector.radius = 1.5 * size
    desk.hand.wheel(+8, here, shift=True)
    assert desk.selector.radius == pytest.approx(2.0 * size)
    desk.selector.radius = 1e-3 * size
    desk.hand.wheel(-40, here, shift=True)
    assert 0.0 < desk.selector.radius < 1e-3 * size
    desk.selector.paints = Paint.FIXED
    desk.hand.click(here)
    assert len(desk.session.fixed) == 1  # at least the nearest vertex
    for radius in (0.0, -1.0, np.nan, np.inf):
        with pytest.raises(ValueError, match="radius must be above 0"):
            desk.selector.radius = radius


def test_a_brush_paints_visible_vertices_or_also_hidden_ones(desk):
    desk.selector.paints, desk.selector.radius = Paint.FIXED, 0.5
    desk.hand.click(desk.under(0.9, 0.0))  # near the silhouette
    assert (desk.points[desk.session.fixed, 1] < -0.05).all()
    assert (desk.points[desk.session.fixed, 1] > -0.3).any()
    desk.session.undo()
    desk.selector.through = True
    desk.hand.click(desk.under(0.3, 0.0))
    sides = desk.points[desk.session.fixed, 1]
    assert (sides < -0.8).any()
    assert (sides > +0.8).any()
    assert not ((sides > -0.6) & (sides < 0.6)).any()


def test_a_stroke_beside_the_mesh_makes_no_undo_step(desk):
    desk.selector.tool, desk.selector.paints = Tool.RECTANGLE, Paint.FIXED
    label = desk.session.history.undo_label
    desk.hand.drag([(2, 2), (30, 30)])
    desk.hand.drag([(2, 2), (30, 30)], control=True)
    desk.hand.drag([desk.under(-0.2, -0.2), desk.under(0.2, 0.2)], control=True)
    assert desk.session.history.undo_label == label


def test_control_erases_from_the_selected_handle_and_removes_it_when_empty(desk):
    desk.selector.tool, desk.selector.paints = Tool.RECTANGLE, Paint.HANDLE
    desk.hand.drag([(2, 200), (398, 398)])
    count = len(desk.session.handles["handle 1"])
    desk.hand.drag([(2, 200), (398, 300)], control=True)
    assert 0 < len(desk.session.handles["handle 1"]) < count
    desk.selector.handle = None
    desk.hand.drag([(2, 200), (398, 398)], control=True)
    assert "select the handle" in str(desk.hand.failures.pop())
    desk.selector.handle = "handle 1"
    desk.hand.drag([(2, 200), (398, 398)], control=True)
    assert not desk.session.handles
    assert desk.session.undo() == "remove handle 1"
    assert len(desk.session.handles["handle 1"])


def test_region_under_pointer_is_that_of_the_vertex_there(desk):
    for z, region in ((0.6, 0), (-0.6, 1)):
        desk.hand.hover(desk.under(0.0, z))
        assert desk.selector.region_under_pointer() == region
    desk.hand.hover((3, 3))
    assert desk.selector.region_under_pointer() is None


def test_random_strokes_can_all_be_undone(desk):
    dice = np.random.default_rng(5)
    for _ in range(20):
        desk.selector.tool = list(Tool)[dice.integers(4)]
        desk.selector.paints = list(Paint)[dice.integers(3)]
        desk.selector.region = int(dice.integers(3))
        desk.selector.through = bool(dice.integers(2))
        held = {"control": bool(dice.integers(2)), "shift": dice.random() < 0.1}
        desk.hand.press(dice.integers(-20, 420, 2), **held)
        for _ in range(dice.integers(4)):
            desk.hand.move(dice.integers(-20, 420, 2), **held)
        if dice.random() < 0.2:
            desk.hand.key("Escape")
        desk.hand.release(dice.integers(-20, 420, 2), **held)
        assert not desk.selector.is_grabbing
    assert all(isinstance(error, SegDeformError) for error in desk.hand.failures)
    desk.hand.failures.clear()
    while desk.session.undo():
        pass
    desk.selector.tool = Tool.LASSO
    desk.hand.hover((3, 3))
    assert desk.session.regions is None
    reds = picture(desk.view).astype(int)
    assert not ((reds[..., 0] > 150) & (reds[..., 1] < 90)).any()  # no preview is left


def test_the_ring_has_the_radius_of_the_brush(desk):
    idle = picture(desk.view)
    widths = []
    for radius in (0.2, 0.4):
        desk.selector.radius = radius
        desk.hand.hover(desk.under(0.0, 0.0))
        changed = (picture(desk.view) != idle).any(axis=2)
        widths.append(np.ptp(np.flatnonzero(changed.any(axis=0))))
    left, right = desk.hand.at([-0.4, -1.0, 0.0]), desk.hand.at([0.4, -1.0, 0.0])
    assert widths[1] == pytest.approx(right[0] - left[0], abs=8)
    assert widths[1] / widths[0] == pytest.approx(2.0, abs=0.2)
    desk.hand.hover((5, 5))
    assert (picture(desk.view) == idle).all()


def test_grow_and_shrink_change_one_ring_of_neighbours(desk):
    desk.selector.tool, desk.selector.paints = Tool.RECTANGLE, Paint.HANDLE
    desk.selector.through = True
    desk.hand.drag([(2, 300), (398, 398)])
    small = desk.session.handles["handle 1"]
    desk.selector.grow()
    large = desk.session.handles["handle 1"]
    mesh = desk.session.mesh
    reached = mesh.adjacency[small].indices
    assert np.array_equal(large, np.union1d(small, reached))
    desk.selector.shrink()
    assert np.array_equal(desk.session.handles["handle 1"], small)


def test_remove_restores_the_view():
    view = plain_view()
    props = view.renderer.GetViewProps().GetNumberOfItems()
    selector = RegionSelector(view, Session(models.sphere(200)))
    selector.On()
    View.render(view)
    selector.remove()
    assert view.renderer.GetViewProps().GetNumberOfItems() == props
    idle = picture(view)
    Hand(view).drag([(200, 200), (210, 210)])
    assert (picture(view) == idle).all()


# Without a stroke.


def targets(desk):
    """Return the vertices of the fixed set, of the handle and of region 2, as masks."""
    session, found = desk.session, np.zeros((3, desk.session.mesh.n_vertices), dtype=bool)
    found[0, session.fixed] = True
    found[1, session.handles.get("tip", [])] = True
    found[2] = session.regions.membership[1]
    return found


def test_all_none_and_invert_skip_what_is_taken_and_are_single_undo_steps(desk):
    selector, session, z = desk.selector, desk.session, desk.points[:, 2]
    session.handles.add(z > 0.5, "tip")
    selector.paints = Paint.FIXED
    selector.select_all()
    assert selector.remark == f"{(z > 0.5).sum()} vertices skipped: already fixed or in a handle"
    assert np.array_equal(targets(desk)[0], z <= 0.5)
    selector.select_none()
    assert not targets(desk)[0].any()
    session.set_fixed(z < -0.5)
    selector.invert()
    assert np.array_equal(targets(desk)[0], (z >= -0.5) & (z <= 0.5))
    assert session.undo() == "set fixed vertices"
    assert np.array_equal(targets(desk)[0], z < -0.5)
    selector.paints, selector.handle = Paint.HANDLE, "tip"
    selector.invert()
    assert np.array_equal(targets(desk)[1], (z <= 0.5) & (z >= -0.5))
    selector.select_none()
    assert selector.handle is None
    assert not session.handles
    selector.handle = "tip"
    selector.invert()  # of nothing: everything that is free
    assert np.array_equal(targets(desk)[1], z >= -0.5)
    selector.paints, selector.region = Paint.REGION, 1
    selector.select_all()
    assert targets(desk)[2].all()
    assert session.undo() == "paint region 2"


@pytest.mark.parametrize(
    ("act", "paint", "message"),
    [
        ("grow", Paint.FIXED, "Nothing to grow: the set of fixed vertices has no vertices"),
        ("shrink", Paint.HANDLE, "Nothing to shrink: the new handle has no vertices"),
        ("select_none", Paint.FIXED, "Nothing to deselect"),
        ("select_none", Paint.REGION, "region 2 cannot become empty"),
        ("invert", Paint.REGION, "Only fixed vertices and handles can be inverted"),
    ],
)
def test_what_a_selection_cannot_do_is_named(desk, act, paint, message):
    desk.selector.paints, desk.selector.region = paint, 1
    before = desk.session.state
    with pytest.raises(SegDeformError, match=message):
        getattr(desk.selector, act)()
    assert desk.session.state is before


def test_a_click_takes_a_whole_region_as_fixed_vertices_or_names_what_is_missing(desk):
    selector, session = desk.selector, desk.session
    selector.paints, selector.tool = Paint.FIXED, Tool.REGION
    plain = desk.colours
    desk.hand.move(desk.under(0.2, 0.7))  # shows what a click would fix
    shown = (desk.colours != plain).any(axis=1)
    assert np.array_equal(shown, session.regions.membership[0])
    for leave in (
        lambda: desk.hand.move((1, 1)),
        lambda: setattr(selector, "tool", Tool.REGION),
        lambda: desk.view.interactor.InvokeEvent("LeaveEvent"),
    ):
        desk.hand.move(desk.under(0.2, 0.7))
        assert not np.array_equal(desk.colours, plain)
        leave()
        assert np.array_equal(desk.colours, plain)
    desk.hand.click(desk.under(0.2, 0.7))
    assert np.array_equal(targets(desk)[0], session.regions.membership[0])
    desk.hand.click(desk.under(0.2, 0.7), control=True)
    assert not len(session.fixed)
    session.set_fixed(session.regions.membership[0])
    selector.select_all()
    with pytest.raises(ConstraintError, match="All vertices are already in"):
        selector.select_all()
    with pytest.raises(ConstraintError, match="it contains all vertices"):
        selector.invert()
    while session.undo():
        pass
    assert session.regions is None
    desk.hand.click(desk.under(0.2, 0.7))
    (failure,) = desk.hand.failures
    assert "No regions yet" in str(failure)
    desk.hand.failures.clear()
