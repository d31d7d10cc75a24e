"""Drafts: a large mesh that moves is drawn decimated, and in full when it has come to rest."""

from __future__ import annotations

import time

import numpy as np
import pytest
from hands import look_from, picture, plain_view
from open_meshes import moebius_strip
from scipy import ndimage
from vtkmodules.util.numpy_support import vtk_to_numpy

from vtk_segdeform import Session, models, sizes
from vtk_segdeform.geometry import VertexNormals
from vtk_segdeform.mesh import Mesh
from vtk_segdeform.widgets.scene import Draft, decimated_surface, draft, surface_display
from vtk_segdeform.widgets.scene.surface_display import SurfaceDisplay


@pytest.fixture
def shown(monkeypatch):
    """Return a display whose mesh counts as large and slow to draw."""
    monkeypatch.setattr(sizes, "DRAFT", 0)
    monkeypatch.setattr(sizes, "DRAFT_POINTS", 400)
    monkeypatch.setattr(surface_display, "SLOW", -1.0)
    monkeypatch.setattr(decimated_surface, "_PATIENCE", 60.0)
    view = plain_view()
    surface = SurfaceDisplay(view, Session(models.sphere(4000)))
    view.renderer.ResetCamera()
    view.render()
    return surface


def test_a_moving_mesh_is_drawn_by_few_of_its_vertices_and_then_in_full_again(shown, monkeypatch):
    view, session, mesh = shown.view, shown.session, shown.session.mesh
    shades = np.full((mesh.n_vertices, 3), 90, dtype=np.uint8)
    shown.set_colours("grey", shades)
    at_rest = picture(view)
    drafts = Draft(view)
    drafts.begin()
    view.render()
    few = shown._decimated
    assert not shown.actor.GetVisibility()
    assert few.actor.GetVisibility()
    assert few._polydata.GetNumberOfPoints() < 800
    assert np.abs(picture(view).astype(float) - at_rest).mean() < 1.0  # of 255

    pose = mesh.vertices * [1.0, 0.5, 1.0]
    monkeypatch.setattr(type(session), "vertices", property(lambda _: pose))
    shown.update()
    assert np.array_equal(shown.points, pose)  # for picking
    assert np.array_equal(few._points, pose[few._cells.centres])
    normals = VertexNormals(mesh).of(pose)
    assert (few._normals * normals[few._cells.centres]).sum(axis=1).min() > 0.99
    shown.set_colours("grey", shades // 2)
    assert vtk_to_numpy(few._polydata.GetPointData().GetScalars()).max() == 45

    drafts.end()
    assert shown.actor.GetVisibility()
    assert not few.actor.GetVisibility()
    drawn = vtk_to_numpy(shown.polydata.GetPointData().GetNormals())
    np.testing.assert_array_equal(drawn[: mesh.n_vertices], normals)


def rough(sphere):
    """Return a sphere whose vertices are off by up to half an edge, and which are light."""
    away = 1.0 + np.random.default_rng(0).uniform(-0.02, 0.02, (len(sphere), 1))
    return sphere * away, away.ravel() > 1.0


def plate(sphere):
    """Return a plate thinner than the cells of a draft are wide, and which side is light."""
    return sphere * [1.0, 0.01, 1.0], sphere[:, 1] > 0.0


@pytest.mark.parametrize(("body", "blur", "most"), [(rough, 2.0, 9.0), (plate, 0.0, 0.6)])
def test_in_motion_a_body_has_the_light_and_the_outline_of_rest(shown, body, blur, most):
    """Single vertices would spread their noise, and faces folded over would be dark specks."""
    view, sphere = shown.view, models.sphere(12_000)
    shown.remove()
    vertices, is_light = body(sphere.vertices)
    dense = SurfaceDisplay(view, Session(Mesh(vertices, sphere.faces)))
    dense.set_colours("sides", np.where(is_light[:, None], [[190] * 3], [[150] * 3]).astype("u1"))
    look_from(view, 0.0, -4.0, 0.0)
    sizes.DRAFT_POINTS = 2_000  # `shown` sets it back
    at_rest = picture(view).astype(float)
    Draft(view).begin()
    view.render()
    in_motion = picture(view).astype(float)
    inside, outside = at_rest.min(axis=2) < 250, in_motion.min(axis=2) > 250
    assert (inside & outside).sum() < 0.02 * inside.sum()
    off = ndimage.gaussian_filter(in_motion - at_rest, (blur, blur, 0.0))
    assert np.abs(off)[ndimage.binary_erosion(inside, iterations=3)].mean() < most  # of 255


def test_drafts_end_once_nothing_has_moved_for_a_while(shown, monkeypatch):
    drafts = Draft(shown.view)
    drafts.begin()
    shown.view.interactor.InvokeEvent("TimerEvent")
    assert not shown.actor.GetVisibility()
    later = time.perf_counter() + 1.0
    monkeypatch.setattr(draft.time, "perf_counter", lambda: later)
    shown.view.interactor.InvokeEvent("TimerEvent")
    assert shown.actor.GetVisibility()


def test_slow_drafts_last_as_long_as_another_thread_is_spared(shown, monkeypatch):
    monkeypatch.setattr(draft, "SLOW", 0.0)
    view = shown.view
    monkeypatch.setattr(view, "_drawing_time", 0.0)
    drafts, stop = Draft.of(view), view.spare()
    assert Draft.of(view) is drafts
    drafts.begin(if_slow=True)
    drafts.end()
    view.interactor.InvokeEvent("TimerEvent")
    assert not shown.actor.GetVisibility()
    stop()
    view.interactor.InvokeEvent("TimerEvent")
    assert shown.actor.GetVisibility()


def test_a_picture_is_measured_until_the_driver_has_drawn_it(shown):
    """OpenGL in software returns before that."""
    renderer, window = shown.view.renderer, shown.view.window

    class Slow:
        def __getattr__(self, name):
            return getattr(window, name)

        def WaitForCompletion(self):  # noqa: N802
            time.sleep(0.1)

    renderer.GetRenderWindow = Slow
    window.Render()
    del renderer.GetRenderWindow
    assert 0.1 < Draft.of(shown.view).seconds < 1.0


def test_a_spared_thread_has_most_of_the_time(shown, monkeypatch):
    view, pictures = shown.view, []
    view.window.AddObserver("EndEvent", lambda *_: pictures.append(1))
    stop = view.spare()

    def ask():
        with view.drawing_once():
            view.request_render()
        return len(pictures)

    view._drawn, view._drawing_time = time.perf_counter(), 0.05
    assert ask() == 0
    view._drawn -= 0.3
    assert ask() == 0
    view._drawn -= 0.2
    assert ask() == 1
    view._drawn, view._drawing_time = time.perf_counter(), 100.0
    assert ask() == 1
    view._drawn -= 0.3
    assert ask() == 1
    view._drawn -= 0.25  # half a second later at most, as the next one may be a draft
    assert ask() == 2
    view._drawn, view._drawing_time = time.perf_counter(), 100.0
    assert ask() == 2
    stop()
    assert len(pictures) == 3  # the picture that came too soon


@pytest.mark.parametrize("why", ["small", "fast", "hidden", "edges", "seam"])
def test_other_meshes_are_drawn_as_always(shown, monkeypatch, why):
    if why == "small":
        monkeypatch.setattr(sizes, "DRAFT", 4001)
    elif why == "fast":
        monkeypatch.setattr(surface_display, "SLOW", 100.0)
    elif why == "seam":
        shown = SurfaceDisplay(shown.view, Session(moebius_strip()))
    elif why == "hidden":
        shown.actor.VisibilityOff()
    else:
        shown.style = surface_display.SurfaceStyle.EDGES
    before = shown.actor.GetVisibility()
    Draft(shown.view).begin()
    assert shown.actor.GetVisibility() == before
    assert shown._decimated is None
