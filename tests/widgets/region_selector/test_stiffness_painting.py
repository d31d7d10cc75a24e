"""Painting how stiff the surface is: falloff, rigid cores, erasing, colours, undo."""

from __future__ import annotations

import numpy as np
import pytest
from hands import Hand, Painter, draw_seldom, look_from, plain_view
from numpy.testing import assert_allclose, assert_array_equal
from scenes import sausage

from vtk_segdeform import Session, models
from vtk_segdeform.pictures.palette import BODY, INK, rgb
from vtk_segdeform.widgets.editor.editor import DeformEditor
from vtk_segdeform.widgets.editor.widget_set import Mode
from vtk_segdeform.widgets.panel.panel import press, sections
from vtk_segdeform.widgets.region_selector.region_colours import stiffness_colours
from vtk_segdeform.widgets.region_selector.region_selector import Paint, Tool

pytestmark = pytest.mark.usefixtures("bound_once", "unprepared")


class Desk(Painter):
    """An editor over a session, in mode REGIONS, with a hand."""

    def __init__(self, session):
        self.session = session
        self.editor = DeformEditor(plain_view(), session)
        view = self.editor.view
        look_from(view, 0.0, -4.0, 0.0)
        draw_seldom(view)
        self.editor.On()
        self.editor.mode = Mode.REGIONS
        self.editor.wait()
        self.selector = self.editor.widgets.selector
        self.hand = Hand(view)

    @property
    def stiffness(self):
        return self.session.state.stiffness


@pytest.fixture
def desk():
    """Yield a desk over a sphere that paints stiffness, with a large brush."""
    made = Desk(Session(models.sphere(2000)))
    made.hand.types("s")
    made.selector.radius = 0.5
    yield made
    assert made.hand.failures == []
    made.editor.remove()


def away_from_path(desk):
    """Return how far each vertex is from the arc that the strokes of these tests draw."""
    x = desk.session.mesh.vertices
    arc = np.array([[t, -np.sqrt(1.0 - t * t), 0.0] for t in np.linspace(-0.3, 0.3, 61)])
    return np.linalg.norm(x[:, None] - arc, axis=2).min(axis=1)


def stroke(desk, **held):
    desk.hand.drag([desk.under(-0.3, 0.0), desk.under(0.3, 0.0)], **held)


def test_a_stroke_is_strongest_on_its_path_and_fades_towards_the_radius(desk):
    stroke(desk)
    away, painted = away_from_path(desk), desk.stiffness
    assert painted[away < 0.05].min() > 9.0
    assert_array_equal(painted[away > 0.55], 1.0)
    between = (away > 0.1) & (away < 0.45)
    order = np.argsort(away[between])
    assert np.corrcoef(away[between][order], np.log(painted[between][order]))[0, 1] < -0.97
    half = np.abs(away - 0.5 * desk.selector.radius) < 0.02
    assert_allclose(np.log10(painted[half]), (1.0 - 0.5**2) ** 2, atol=0.08)
    assert desk.selector.remark == "Stiffness counts from the next move"
    assert desk.session.undo() == "set stiffness"
    assert desk.stiffness is None


def test_strokes_go_on_from_what_is_there_and_control_makes_it_usual_again(desk):
    stroke(desk)
    once = desk.stiffness
    desk.selector.stiffness = 0.3
    stroke(desk)
    away = away_from_path(desk)
    assert desk.stiffness[away < 0.05].max() < 0.36
    rim = (away > 0.35) & (away < 0.45)
    assert (desk.stiffness[rim] < once[rim]).all()
    desk.selector.radius = 1.0
    stroke(desk, control=True)
    assert np.abs(np.log(desk.stiffness[away < 0.2])).max() < 0.1
    desk.selector.tool, desk.selector.through = Tool.RECTANGLE, True
    desk.hand.drag([(2, 2), (398, 398)], control=True)
    assert desk.stiffness is None


def test_a_rigid_part_is_the_core_of_a_stroke(desk):
    press(desk.editor, "paint.what", "inf")
    stroke(desk)
    away = away_from_path(desk)
    share = np.clip(1.0 - (away / desk.selector.radius) ** 2, 0.0, 1.0) ** 2
    assert np.isinf(desk.stiffness[share > 0.6]).all()
    assert_array_equal(desk.stiffness[share < 0.4], 1.0)
    press(desk.editor, "paint.what", "3")
    stroke(desk)
    assert not np.isinf(desk.stiffness[share > 0.6]).any()
    assert_allclose(desk.stiffness[away < 0.02], 3.0, rtol=0.02)


def test_the_map_is_shown_while_it_is_painted_and_regions_again_afterwards(desk):
    assert (desk.colours == rgb(BODY)).all()
    desk.hand.press(desk.under(-0.3, 0.0))
    desk.hand.move(desk.under(0.3, 0.0))
    away, during = away_from_path(desk), desk.colours
    assert desk.stiffness is None
    assert (during[away > 0.55] == rgb(BODY)).all()
    desk.hand.release()
    assert_array_equal(desk.colours, stiffness_colours(desk.stiffness))
    assert np.abs(during.astype(int) - desk.colours)[away < 0.05].max() < 30  # nearly opaque
    desk.hand.types("s")
    assert desk.selector.paints is Paint.REGION
    assert (desk.colours == rgb(BODY)).all()


def test_soft_usual_stiff_and_rigid_differ_also_without_hues():
    soft, usual, stiff, rigid = stiffness_colours(np.array([0.1, 1.0, 10.0, np.inf])).astype(int)
    assert_array_equal(usual, rgb(BODY))
    assert_array_equal(rigid, rgb(INK))
    assert soft[2] - soft[0] > 100  # blue
    assert stiff[0] - stiff[2] > 100  # orange
    lightness = [colour @ [0.2126, 0.7152, 0.0722] for colour in (usual, stiff, soft, rigid)]
    assert (-np.diff(lightness) > 10.0).all()


def test_escape_cancels_and_a_lasso_paints_all_alike(desk):
    desk.hand.press(desk.under(0.0, 0.0))
    desk.hand.move(desk.under(0.3, 0.0))
    desk.hand.key("Escape")
    desk.hand.release()
    assert desk.stiffness is None
    desk.selector.tool = Tool.RECTANGLE
    desk.hand.drag([(150, 150), (250, 250)])
    assert set(np.unique(desk.stiffness)) == {1.0, 10.0}


def test_painting_stiffness_keeps_the_pose_and_the_mode_remembers_it():
    scene = sausage(is_coarse=True)
    session = scene.session()
    session.drag(scene.turned(20.0))
    session.commit()
    desk = Desk(session)
    desk.editor.view.renderer.ResetCamera()
    desk.editor.view.render()
    desk.hand.types("s")
    assert "paint 10 times the usual stiffness" in desk.editor.status
    assert "resets the pose" not in desk.editor.status
    pose = session.state.pose
    desk.hand.click(desk.hand.at(session.vertices[session.vertices[:, 1].argmin()]))
    assert session.state.pose is pose
    assert desk.stiffness.max() > 9.0
    for mode in (Mode.PULL, Mode.REGIONS):
        desk.editor.mode = mode
        desk.editor.wait()
    assert desk.selector.paints is Paint.STIFFNESS
    (field,) = (f for each in sections(desk.editor) for f in each.fields if f.name == "paint.what")
    assert (field.value, field.visible) == ("10", True)
    desk.hand.types("n")  # the next region, which is painted then
    assert desk.selector.paints is Paint.REGION
    for mode in (Mode.HANDLES, Mode.REGIONS):
        desk.editor.mode = mode
    assert desk.selector.paints is Paint.REGION
    assert desk.hand.failures == []
    desk.editor.remove()


@pytest.mark.parametrize("target", [Paint.STIFFNESS, Paint.FIXED, Paint.HANDLE])
def test_with_a_symmetry_both_sides_are_fixed_or_stiffened_but_a_handle_is_on_one(desk, target):
    x = desk.session.mesh.vertices
    desk.session.change_options(symmetry="x")
    desk.editor.mode = Mode.REGIONS if target is Paint.STIFFNESS else Mode.HANDLES
    desk.selector.paints, desk.selector.radius = target, 0.2

    def painted():
        if target is Paint.STIFFNESS:
            return np.ones(len(x)) if desk.stiffness is None else desk.stiffness
        mask = np.zeros(len(x))
        (ids,) = [desk.session.fixed] if target is Paint.FIXED else desk.session.handles.values()
        mask[ids] = 1.0
        return mask

    idle = painted() if target is not Paint.HANDLE else np.zeros(len(x))
    desk.hand.press(desk.under(0.5, 0.2))
    during = desk.colours
    desk.hand.release()
    on_right = x[:, 0] > 0.2
    assert (painted() != idle)[on_right].sum() > 5
    if target is Paint.HANDLE:
        assert_array_equal(painted()[~on_right], 0.0)
        return
    mates = desk.session.poses.mirror(desk.session.state).mates
    assert_array_equal(x[mates[on_right], 0] < 0.0, True)
    assert (painted() != idle)[~on_right].sum() > 5
    changed = (during != desk.colours[x[:, 2].argmin()]).any(axis=1)
    assert changed[~on_right].sum() > 5
    desk.selector.tool, desk.selector.through = Tool.RECTANGLE, True
    desk.hand.drag([(2, 2), (180, 398)], control=True)
    assert_array_equal(painted(), idle)
