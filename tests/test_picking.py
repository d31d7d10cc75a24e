"""From the window to the mesh, checked against brute force."""

from __future__ import annotations

import numpy as np
import pytest
from hands import plain_view
from scenes import sausage
from vtk_segdeform.widgets.gestures import Phase, Pointer
from vtk_segdeform.widgets.picking import Picker, _in_polygon
from vtk_segdeform.widgets.surface_display import SurfaceDisplay
from vtk_segdeform.widgets.visibility import seen_vertices

from vtk_segdeform import Mesh, Session, models

RNG = np.random.default_rng(3)


def over(mesh, size=(400, 400), *, parallel=False):
    view = plain_view(size)
    session = Session(mesh)
    surface = SurfaceDisplay(view, session)
    view.camera.SetParallelProjection(parallel)
    view.camera.SetPosition(1.0, -3.0, 0.7)
    view.camera.SetViewUp(0.0, 0.0, 1.0)
    view.renderer.ResetCamera()
    view.render()
    return view, session, surface, Picker(surface)


def first_crossing(points, faces, near, far):
    """Return (face, share of the way) of the first triangle on the way from near to far."""
    a, b, c = points[faces.T]
    way = far - near
    normal = np.cross(b - a, c - a)
    with np.errstate(divide="ignore", invalid="ignore"):
        t = np.einsum("ij,ij->i", a - near, normal) / (normal @ way)
    place = near + t[:, None] * way
    sides = [np.cross(q - p, place - p) for p, q in ((a, b), (b, c), (c, a))]
    inside = np.all([np.einsum("ij,ij->i", s, normal) >= 0.0 for s in sides], axis=0)
    t = np.where(inside & (t >= 0.0) & (t <= 1.0), t, np.inf)
    return int(t.argmin()), float(t.min())


@pytest.mark.parametrize("parallel", [False, True])
def test_the_point_under_the_pointer_is_the_first_crossing(parallel):
    view, session, surface, picker = over(models.cactus(1200), parallel=parallel)
    met = 0
    for x, y in RNG.uniform(60, 340, (60, 2)):
        pointer = Pointer(Phase.HOVER, x, y)
        near, far = view.ray(pointer)
        face, share = first_crossing(surface.points, session.mesh.faces, near, far)
        hit = picker.hit(pointer)
        assert (hit is None) == np.isinf(share)
        if hit is not None:
            met += 1
            assert hit.face == face
            assert np.allclose(hit.point, near + share * (far - near), atol=1e-6)
            assert hit.vertex in session.mesh.faces[face]
    assert met > 5


def test_the_pose_that_is_drawn_is_the_one_that_is_asked():
    scene = sausage()
    view, session, surface, picker = over(scene.mesh)
    session.set_regions(scene.regions)
    session.set_cages(scene.cages)
    session.set_fixed(scene.fixed)
    session.add_handle(scene.handle)
    side = np.abs(scene.mesh.vertices - [2.7, -0.3, 0.1]).sum(axis=1)
    tip = int(np.argmin(side))

    def where():
        return view.to_display(surface.points[[tip]])[0]

    before = where()
    assert picker.hit(Pointer(Phase.HOVER, *before[:2])) is not None
    session.drag(scene.turned(60.0), max_steps=20)
    after = where()
    assert np.linalg.norm(after[:2] - before[:2]) > 50
    hit = picker.hit(Pointer(Phase.HOVER, *after[:2]))
    assert np.linalg.norm(hit.point - surface.points[tip]) < 0.3
    assert picker.hit(Pointer(Phase.HOVER, *before[:2])) is None


def test_a_brush_does_not_leak_to_what_is_near_in_space_only():
    # Two leaves of one folded sheet: a flat box bent to a U by its coordinates.
    u, v = np.meshgrid(np.linspace(-1, 1, 81), np.linspace(0, 1, 21), indexing="ij")
    angle = np.pi * np.clip((u + 0.1) / 0.2, 0.0, 1.0)
    middle = np.stack([np.abs(u), v, np.where(u < 0, -0.05, 0.05)], axis=-1)
    bend = np.abs(u) <= 0.1
    middle[bend] = np.stack([0.1 - 0.05 * np.sin(angle), v, -0.05 * np.cos(angle)], axis=-1)[bend]
    count = u.size
    across = np.gradient(middle, axis=0)
    normal = np.cross(across, [0.0, 1.0, 0.0])
    normal /= np.linalg.norm(normal, axis=-1)[..., None]
    vertices = np.concatenate([(middle + s * 0.01 * normal).reshape(-1, 3) for s in (-1, 1)])
    i, j = np.meshgrid(np.arange(80), np.arange(20), indexing="ij")
    a = (i * 21 + j).ravel()
    b, c, d = a + 21, a + 22, a + 1
    upper = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    rim = np.concatenate([
        np.arange(80) * 21, 80 * 21 + np.arange(20), (80 - np.arange(80)) * 21 + 20,
        20 - np.arange(20),
    ])  # fmt: skip
    after = np.roll(rim, -1)
    wall = np.concatenate([
        np.stack([rim, after, after + count], 1), np.stack([rim, after + count, rim + count], 1)
    ])  # fmt: skip
    faces = np.concatenate([upper[:, ::-1], upper + count, wall])
    if np.einsum("ij,ij", vertices[faces[:, 0]], np.cross(*vertices[faces[:, 1:].T])) < 0:
        faces = faces[:, ::-1]
    mesh = Mesh(vertices, faces)
    view, _, surface, picker = over(mesh)
    view.camera.SetPosition(0.6, 0.5, 4.0)
    view.camera.SetFocalPoint(0.6, 0.5, 0.0)
    view.camera.SetViewUp(0.0, 1.0, 0.0)
    view.renderer.ResetCamera()
    x, y, _ = view.to_display(np.array([[0.6, 0.5, 0.06]]))[0]
    taken = picker.around(picker.hit(Pointer(Phase.HOVER, x, y)), 0.2)
    assert np.count_nonzero(taken) > 20
    assert (surface.points[taken, 2] > 0.0).all()  # the other leaf is half as far as the brush
    near = np.linalg.norm(surface.points - [0.6, 0.5, 0.06], axis=1) < 0.15
    assert (near & (surface.points[:, 2] < 0.0)).any()


def test_a_brush_takes_at_least_the_nearest_vertex():
    _, _, surface, picker = over(models.sphere(300))
    hit = picker.hit(Pointer(Phase.HOVER, 200, 200))
    taken = picker.around(hit, 1e-9)
    assert np.flatnonzero(taken).tolist() == [hit.vertex]
    wide = picker.around(hit, 0.5)
    assert np.linalg.norm(surface.points[wide] - hit.point, axis=1).max() <= 0.5
    near = np.linalg.norm(surface.points - hit.point, axis=1) < 0.4
    assert wide[near].all()


def test_what_is_seen_is_what_no_triangle_hides():
    mesh = models.cactus(1500)
    view, _, surface, _ = over(mesh, (500, 500))
    display = view.to_display(surface.points)
    seen = seen_vertices(display, mesh.faces)
    eye = np.array(view.camera.GetPosition())
    exact = np.zeros(len(seen), dtype=bool)
    sample = RNG.choice(mesh.n_vertices, 400, replace=False)
    for k in sample:
        elsewhere = mesh.faces[~(mesh.faces == k).any(axis=1)]
        _, share = first_crossing(surface.points, elsewhere, eye, surface.points[k])
        exact[k] = share > 1.0 - 1e-9
    assert 0.2 < exact[sample].mean() < 0.8
    assert np.array_equal(seen[sample], exact[sample])


def test_few_large_triangles_hide_as_well_as_many_small_ones():
    cube = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=float)
    square = [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
              [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]]  # fmt: skip
    mesh = Mesh(cube, np.array(square))
    view, *_ = over(mesh)
    seen = seen_vertices(view.to_display(cube), mesh.faces)
    assert np.count_nonzero(~seen) == 1  # of a cube's corners one is behind
    far = np.linalg.norm(cube - view.camera.GetPosition(), axis=1)
    assert not seen[far.argmax()]


def test_what_is_behind_the_camera_is_not_seen():
    display = np.array([[10.0, 10, 0.5], [20, 10, 0.5], [10, 20, 0.5], [np.nan] * 3])
    seen = seen_vertices(display, np.array([[0, 1, 2], [1, 3, 2]]))
    assert seen.tolist() == [True, True, True, False]
    assert not seen_vertices(np.full((3, 3), np.nan), np.array([[0, 1, 2]])).any()


def test_inside_of_an_outline_is_where_a_ray_crosses_it_an_odd_number_of_times():
    star = np.array([[0.0, 3.0], [2.0, -3.0], [-3.0, 1.0], [3.0, 1.0], [-2.0, -3.0]])
    tips = 0.8 * star
    assert _in_polygon(tips, star).all()
    assert not _in_polygon(np.array([[0.0, 0.0], [5.0, 0.0], [np.nan, 0.0]]), star).any()


def test_an_outline_takes_what_is_seen_or_all_of_it():
    view, _, surface, picker = over(models.sphere(800))
    whole = np.array([[0, 0], [400, 0], [400, 400], [0, 400]], dtype=float)
    assert picker.inside(whole, through=True).all()
    share = picker.inside(whole, through=False).mean()
    assert 0.3 < share < 0.5  # less than half of a sphere is seen from near
    left = whole * [0.5, 1.0]
    taken = picker.inside(left, through=True)
    assert np.array_equal(taken, view.to_display(surface.points)[:, 0] < 200)
