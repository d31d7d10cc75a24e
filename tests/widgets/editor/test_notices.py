"""Notices: one line says how the mesh differs from what was given, and marks the places."""

from __future__ import annotations

import numpy as np
import pytest
from campaign import every
from hands import Hand, draw_seldom, picture, plain_view
from open_surfaces import bottle, polydata, sheet, split_at_seam
from solids import icosphere

from vtk_segdeform import Options, Regions, Session, Surface
from vtk_segdeform.cages.cage import Cage
from vtk_segdeform.mesh import Mesh
from vtk_segdeform.widgets import DeformEditor
from vtk_segdeform.widgets.editor import notices_of
from vtk_segdeform.widgets.scene.highlights import DOT, LOOP
from vtk_segdeform.widgets.scene.view import View

pytestmark = pytest.mark.usefixtures("unprepared")

LOOP_RGB, DOT_RGB = (np.array(list(bytes.fromhex(c[1:])), int) for c in (LOOP, DOT))


def closed():
    """Return a session of a closed mesh, exactly as given."""
    return Session(Surface(polydata(*icosphere(2))))


class Scene:
    """An editor over a session, seen from the front, and a hand."""

    def __init__(self, session, size=(480, 320)):
        self.view = plain_view(size)
        self.view.camera.SetPosition(0.0, -10.0, 2.0)
        self.view.camera.SetViewUp(0.0, 0.0, 1.0)
        self.editor = DeformEditor(self.view, session)
        self.view.renderer.ResetCamera()
        self.editor.On()
        self.hand = Hand(self.view)
        self.view.render()
        draw_seldom(self.view)

    @property
    def notices(self):
        return self.editor.controller.notices

    def click(self, button):
        View.render(self.view)
        self.hand.click(self.notices._line.centre_of(button))
        assert self.hand.failures == []

    def shade(self, colour):
        """Return where the picture has nearly this *colour*, (h, w) bool."""
        return np.abs(picture(self.view).astype(int) - colour).max(axis=2) < 25

    def remove(self):
        self.editor.remove()


@pytest.fixture
def open_editor():
    made = []

    def start(session, size=(480, 320)):
        made.append(Scene(session, size))
        return made[-1]

    yield start
    for scene in made:
        scene.remove()


def two_parts():
    """Return a bottle beside a sheet."""
    one, other = bottle(3, 3), sheet(6)
    faces = [np.asarray(each.regular_faces) for each in (one, other)]
    points = np.concatenate([one.points, np.add(other.points, [4.0, 0.0, 0.0])])
    return polydata(points, np.concatenate([faces[0], faces[1] + one.n_points]))


@pytest.mark.parametrize(
    ("given", "text"),
    [
        (lambda: bottle(12), "12 holes: volume kept under lids"),
        (lambda: bottle(1, 3), "1 hole: volume kept under a lid"),
        (lambda: sheet(8), "Open sheet: no volume to preserve"),
        (two_parts, "3 holes: volume kept under lids; 1 open sheet has no volume"),
    ],
)
def test_borders_are_counted_and_what_happens_to_the_volume_is_said(given, text):
    session = Session(Surface(given()))
    notices = notices_of(session)
    assert " · ".join(each.text for each in notices) == text
    marked = np.sort(np.concatenate([loop for each in notices for loop in each.loops]))
    assert (marked == np.unique(session.mesh.boundary)).all()


def test_a_workaround_is_told_as_it_is_and_its_points_are_vertices_of_the_mesh():
    session = Session(Surface(split_at_seam()))
    (notice,) = notices_of(session)
    assert notice.text == "welded 64 seam points"
    heights = session.mesh.vertices[notice.dots, 2]
    assert len(notice.dots) == 32
    assert np.abs(heights).max() < 1e-12


def test_a_closed_mesh_as_given_has_no_notice(open_editor):
    scene = open_editor(closed())
    assert scene.notices.text == ""
    assert not scene.notices.is_open
    scene.hand.types("i")
    assert "nothing to show" in scene.editor.status
    assert not scene.notices.is_open


def test_a_click_on_show_marks_the_holes_and_a_second_one_removes_the_marks(open_editor):
    scene = open_editor(Session(Surface(bottle())))
    assert not scene.shade(LOOP_RGB).any()
    scene.click("Show")
    assert scene.notices.are_marked
    marked = scene.shade(LOOP_RGB)
    assert marked.sum() > 500
    scene.click("Hide")
    assert not scene.notices.are_marked
    assert not scene.shade(LOOP_RGB).any()
    assert scene.editor.session.history.undo_label is None  # the click did not paint


def test_the_buttons_work_in_a_part_of_the_window(open_editor):
    scene = open_editor(Session(Surface(bottle())), (640, 420))
    scene.view.renderer.SetViewport(0.25, 0.3, 1.0, 1.0)
    View.render(scene.view)
    origin = np.array(scene.view.renderer.GetOrigin())
    assert (origin > 100).all()
    place = scene.notices._line.centre_of("Show")
    seen = np.abs(picture(scene.view).astype(int) - [140, 196, 234]).max(axis=2) < 10  # a button
    x, y = np.add(place, origin).astype(int)
    assert seen[::-1][y - 3 : y + 4, x - 20 : x + 21].any()
    scene.hand.click(place)  # of the window
    assert not scene.notices.are_marked
    scene.hand.click(place + origin)
    assert scene.notices.are_marked


def test_marks_lie_on_the_borders_and_holes_at_the_back_show_through(open_editor):
    session = Session(Surface(bottle(1)))  # one hole at the top
    scene = open_editor(session)
    scene.view.camera.SetPosition(0.0, -3.0, -10.0)  # seen from below
    scene.view.renderer.ResetCamera()
    plain = picture(scene.view).astype(int)
    scene.hand.types("i")
    changed = np.abs(picture(scene.view).astype(int) - plain).max(axis=2) > 40
    (loop,) = session.mesh.borders
    x, y = scene.view.to_display(session.mesh.vertices[loop])[:, :2].T.round().astype(int)
    spots = np.stack([changed.shape[0] - 1 - y, x], axis=1)
    assert np.mean([changed[r - 3 : r + 4, c - 3 : c + 4].any() for r, c in spots]) > 0.9


def test_welded_points_are_dots(open_editor):
    scene = open_editor(Session(Surface(split_at_seam())))
    scene.click("Show")
    assert scene.shade(DOT_RGB).sum() > 100
    assert not scene.shade(LOOP_RGB).any()


def test_another_file_has_its_own_notices_and_marks(open_editor, tmp_path):
    scene = open_editor(Session(Surface(bottle(3, 3))))
    scene.click("Show")
    sheet(6).save(tmp_path / "sheet.ply")
    scene.editor.load(tmp_path / "sheet.ply")
    assert scene.notices.text == "Open sheet: no volume to preserve"
    assert scene.notices.is_open
    assert not scene.notices.are_marked
    assert not scene.editor.controller.is_modified
    assert not scene.shade(LOOP_RGB).any()
    Surface(polydata(*icosphere(2))).given.save(tmp_path / "ball.ply")
    scene.editor.load(tmp_path / "ball.ply")
    assert scene.notices.text == ""
    assert not scene.notices.is_open


def test_the_line_closes_by_its_button_and_returns_by_the_key(open_editor):
    scene = open_editor(Session(Surface(sheet())))
    scene.click("×")
    assert not scene.notices.is_open
    scene.hand.types("i")
    assert scene.notices.is_open
    assert scene.notices.are_marked
    scene.hand.types("i")
    assert not scene.notices.is_open
    assert not scene.notices.are_marked


def test_the_first_edit_closes_the_line_and_later_ones_do_not(open_editor):
    session = Session(Surface(sheet()))
    scene = open_editor(session)
    scene.click("Show")
    session.set_fixed([0, 1])
    assert not scene.notices.is_open
    assert not scene.notices.are_marked
    scene.hand.types("i")
    session.set_fixed([0, 1, 2])
    assert scene.notices.is_open
    assert scene.notices.are_marked


def test_the_line_and_the_marks_follow_the_option_of_lids(open_editor):
    session = Session(Surface(bottle(2)))
    scene = open_editor(session)
    scene.click("Show")
    before = scene.notices.text
    session.change_options(lids=False)
    assert scene.notices.text != before
    assert scene.notices.are_marked


def test_a_clean_view_has_no_line_and_no_marks(open_editor):
    scene = open_editor(Session(Surface(bottle())))
    scene.click("Show")
    with scene.editor.controller.clean_view():
        assert not scene.shade(LOOP_RGB).any()
        assert not scene.notices.is_open
    assert scene.notices.is_open


@pytest.mark.parametrize(
    "size", every(2, [((300, 200),), ((1920, 1080),), ((900, 600),), ((3840, 2160),)])
)
def test_the_line_covers_neither_the_status_line_nor_most_of_the_window(open_editor, size):
    scene = open_editor(Session(Surface(two_parts())), size)
    scene.notices.offer("Repair ...", lambda: None, lambda _: True)
    View.render(scene.view)
    x, y, wide, high = scene.notices._line.box
    assert y >= scene.editor.controller.messages.height > 0
    assert x + wide <= size[0]
    assert high < 0.25 * size[1]
    for button in ("Show", "Repair ...", "×"):
        assert x < scene.notices._line.centre_of(button)[0] < x + wide


def test_a_button_that_is_offered_calls_its_function(open_editor):
    scene, calls = open_editor(Session(Surface(sheet()))), []
    session = scene.editor.session
    scene.notices.offer("Repair ...", lambda: calls.append(1), lambda each: each is session)
    scene.click("Repair ...")
    assert calls == [1]
    scene.notices.follow(Session(Surface(sheet())))
    View.render(scene.view)
    with pytest.raises(StopIteration):
        scene.notices._line.centre_of("Repair ...")


def test_a_press_beside_the_buttons_does_not_reach_the_camera(open_editor):
    scene = open_editor(Session(Surface(sheet())))
    before = scene.view.camera.GetPosition()
    x, y, _, high = scene.notices._line.box
    start = np.array([x + 3.0, y + 0.5 * high])
    scene.hand.drag([start, start + [60.0, 0.0], start + [120.0, 40.0]])
    assert scene.view.camera.GetPosition() == before
    assert scene.hand.failures == []


def test_for_a_sheet_the_volume_is_not_0_per_cent(open_editor):
    scene = open_editor(Session(Surface(sheet())))
    scene.hand.types("p")
    assert "no volume" in scene.editor.status.lower()
    assert scene.editor.session.options.preserve_volume is Options().preserve_volume


def test_a_mesh_without_a_surface_has_notices_of_its_borders():
    given = bottle(2)
    mesh = Mesh(given.points, given.regular_faces)
    assert [each.text for each in notices_of(Session(mesh))] == ["2 holes: volume kept under lids"]


def test_marks_follow_the_pose(open_editor):
    session = Session(Surface(bottle(4)))
    session.set_regions(Regions.single(session.mesh))
    ball, faces = icosphere(1)
    session.set_cages([Cage(3.0 * ball, faces)])
    session.change_options(preserve_volume=False)
    scene = open_editor(session)
    scene.view.camera.ParallelProjectionOn()  # all marks move equally far
    session.move_cage(0, 3.0 * ball)  # the first edit
    session.commit()
    scene.hand.types("i")
    before = np.flatnonzero(scene.shade(LOOP_RGB).any(axis=0))
    session.move_cage(0, 3.0 * ball + [0.5, 0.0, 0.0])
    after = np.flatnonzero(scene.shade(LOOP_RGB).any(axis=0))
    there = scene.view.to_display(np.array([[0.0, 0.0, 0.0], [0.5, 0.0, 0.0]]))[:, 0]
    shift = there[1] - there[0]
    assert shift > 20.0
    assert after.min() - before.min() == pytest.approx(shift, abs=6)
    assert after.max() - before.max() == pytest.approx(shift, abs=6)
