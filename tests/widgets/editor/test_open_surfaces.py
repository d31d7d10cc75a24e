"""The widgets on surfaces with borders, fins and one side: painting, cages, handles, shading."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from campaign import every
from hands import Hand, draw_seldom, picture, plain_view
from open_surfaces import bottle, moebius, polydata, sheet
from solids import icosphere

from vtk_segdeform import Regions, Session, Surface
from vtk_segdeform.cages.cage import Cage
from vtk_segdeform.widgets import DeformEditor, Mode, Paint, Tool
from vtk_segdeform.widgets.editor import exporting
from vtk_segdeform.widgets.scene.view import View

pytestmark = pytest.mark.usefixtures("unprepared", "bound_once")


def test_what_a_format_cannot_store_is_said(tmp_path):
    given = bottle()
    given.cell_data["Material"] = np.arange(given.n_cells)
    given.point_data["heat"] = np.zeros(given.n_points)
    scene = Scene(given)
    scene.editor.do(exporting(tmp_path / "bottle.stl"))
    status = scene.editor.status
    assert f"Mesh saved to {tmp_path / 'bottle.stl'}. STL cannot store " in status
    assert "'Material'" in status
    assert "array" not in status
    scene.editor.do(exporting(tmp_path / "bottle.vtp"))
    assert "cannot store" not in scene.editor.status


def finned():
    """Return a ball of more than 1000 vertices with a fin: an edge with three faces."""
    points, faces = icosphere(4)
    edge = faces[0, :2]
    tip = 1.5 * points[edge].mean(axis=0)
    return polydata(np.vstack([points, tip]), np.vstack([faces, [[*edge, len(points)]]]))


class Scene:
    """An editor over a surface in one cage, seen from the front, and a hand."""

    def __init__(self, given):
        self.session = session = Session(Surface(given))
        mesh = session.mesh
        session.set_regions(Regions.single(mesh))
        ball, faces = icosphere(1)
        middle = 0.5 * (mesh.vertices.min(axis=0) + mesh.vertices.max(axis=0))
        session.set_cages([Cage(ball * 0.8 * mesh.diagonal + middle, faces)])
        self.view = plain_view((300, 300))
        self.view.camera.SetPosition(0.0, -10.0, 4.0)
        self.view.camera.SetViewUp(0.0, 0.0, 1.0)
        self.editor = DeformEditor(self.view, session)
        self.view.renderer.ResetCamera()
        self.editor.mode = Mode.HANDLES
        self.editor.On()
        self.editor.controller.notices.close()
        self.hand = Hand(self.view)
        self.view.render()
        draw_seldom(self.view)

    def paint(self, what, point, tool=Tool.BRUSH, *, through=False):
        """Paint at a point of the surface; return the vertices painted."""
        self.editor.mode = Mode.HANDLES
        selector = self.editor.widgets.selector
        selector.tool, selector.through, selector.paints = tool, through, what
        self.hand.click(self.hand.at(point))
        assert self.hand.failures == []
        return self.session.fixed if what is Paint.FIXED else self.session.state.handle

    def lasso(self, *, through):
        """Mark everything by a lasso around the middle of the window; return the vertices."""
        self.editor.mode = Mode.HANDLES
        selector = self.editor.widgets.selector
        selector.tool, selector.through, selector.paints = Tool.LASSO, through, Paint.FIXED
        angle = np.linspace(0.0, 6.0, 30)
        self.hand.drag(150.0 + 145.0 * np.stack([np.cos(angle), np.sin(angle)], axis=1))
        return self.session.fixed

    def front(self, every=1):
        """Return which vertices no face hides, by a ray from the camera to each of them.

        With *every* k, all but each k-th count as hidden, which saves time.
        """
        x, faces = self.session.vertices, self.session.mesh.faces
        eye = np.array(self.view.camera.GetPosition())
        a, b, c = (x[corner] - eye for corner in faces.T)
        areas = np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)])
        volume = np.einsum("ij,ij->i", a, areas[0])
        seen = np.zeros(len(x), dtype=bool)
        for i in range(0, len(x), every):
            u, v, w = (
                areas @ (x[i] - eye) / volume
            )  # the ray times u + v + w is in the plane of the face
            hides = (np.minimum(np.minimum(u, v), w) > 0.0) & (u + v + w > 1.0 + 1e-9)
            seen[i] = not hides[(faces != i).all(axis=1)].any()
        return seen


@pytest.fixture
def open_editor():
    made = []

    def start(given):
        made.append(Scene(given))
        return made[-1]

    yield start
    for scene in made:
        scene.editor.remove()


SURFACES = {
    "bottle": lambda: bottle(4, 3),
    "sheet": lambda: sheet(32),
    "one-sided": moebius,
    "finned": finned,
}


def test_the_visible_surface_includes_the_inside_seen_through_a_hole(open_editor):
    scene = open_editor(bottle(1, radius=0.8))  # a cup, open at the top
    scene.view.camera.SetPosition(0.0, -4.0, 10.0)
    scene.view.renderer.ResetCamera()
    View.render(scene.view)
    seen, front = scene.lasso(through=False), scene.front()
    assert np.array_equal(seen, np.flatnonzero(front))
    x = scene.session.mesh.vertices
    outward = x[seen] / [1.0, 1.0, 1.6**2]
    away = np.einsum("ij,ij->i", outward, x[seen] - scene.view.camera.GetPosition()) > 0.0
    assert away.sum() > 20  # of these only the inside is seen
    scene.session.undo()
    assert len(scene.lasso(through=True)) == len(x)


@pytest.mark.parametrize("name", every(2, SURFACES))
def test_a_handle_is_dragged_and_an_enclosed_volume_stays_exact(open_editor, name):
    scene = open_editor(SURFACES[name]())
    session, x = scene.session, scene.session.mesh.vertices
    session.change_options(n_cage_vertices=40)
    session.fit_cages()
    along = int(np.ptp(x, axis=0).argmax())
    low, high = np.quantile(x[:, along], [0.1, 0.9])
    session.set_fixed(x[:, along] < low)
    session.handles.add(x[:, along] > high)
    scene.editor.mode = Mode.DEFORM
    scene.editor.wait()
    start = np.array(scene.hand.at(scene.editor.widgets.dragger.gizmo.centre))
    scene.hand.press(start)
    for k in range(1, 4):
        scene.hand.move(start + k * np.array([5.0, 6.7]))
    said = scene.editor.status
    scene.hand.release()
    assert scene.hand.failures == []
    moved = np.linalg.norm(session.vertices - x, axis=1) / session.mesh.diagonal
    assert moved[session.handles["handle 1"]].min() > 0.07
    assert moved[session.fixed].max() < 0.002
    assert abs(session.volume_change) < 1e-12
    assert session.has_volume is (name in ("bottle", "finned"))
    assert ("No volume to preserve" in said) is not session.has_volume
    deformed = session.deformed
    assert deformed.n_points == session.surface.given.n_points


@pytest.mark.parametrize("name", ["bottle", "sheet", "finned"])
def test_nothing_is_black_from_either_side(open_editor, name):
    scene = open_editor(SURFACES[name]())
    for height in (6.0, -6.0):
        scene.view.camera.SetPosition(0.0, -8.0, height)
        scene.view.renderer.ResetCamera()
        with scene.editor.controller.clean_view():
            dark = picture(scene.view).max(axis=2) < 60
        assert dark.mean() < 0.002


def test_the_seam_of_a_surface_with_one_side_does_not_show(open_editor):
    """Where faces differ in orientation depends on which are flipped; the picture does not."""
    seen = []
    for flipped in (0, 400):
        given = moebius(100, 6)
        faces = np.array(given.regular_faces)
        faces[:flipped] = faces[:flipped, ::-1]
        scene = open_editor(polydata(given.points, faces))
        session, clean_view = scene.session, scene.editor.controller.clean_view
        assert session.mesh.n_vertices == given.n_points
        with clean_view():
            at_rest = picture(scene.view).astype(int)
        x = session.mesh.vertices @ np.diag([1.0, 1.0, 1.5])
        scene.editor.widgets.surface.set_colours("test", np.uint8(128 + 60 * np.sin(3 * x)))
        with clean_view():
            coloured = picture(scene.view).astype(int)
        session.move_cage(0, session.cage_vertices[0] * [0.8, 1.0, 1.3])
        with clean_view():
            seen.append((at_rest, coloured, picture(scene.view).astype(int)))
    for one, other in zip(*seen, strict=True):
        assert (np.abs(one - other).max(axis=2) > 12).mean() < 2e-4
    for one, other in pairwise(seen[0]):
        assert (np.abs(one - other).max(axis=2) > 12).mean() > 0.02
