"""Hits, distances and visible vertices, compared with brute force."""

from __future__ import annotations

import functools

import numpy as np
import pytest
from hands import look_from, plain_view
from scenes import sausage
from scipy.sparse import csgraph
from solids import icosphere, two_components

from vtk_segdeform import Mesh, Session, models
from vtk_segdeform.widgets.picking.line_of_sight import intersections
from vtk_segdeform.widgets.picking.picking import Picker
from vtk_segdeform.widgets.picking.surface_distance import SurfaceDistance
from vtk_segdeform.widgets.picking.visibility import visible_vertices
from vtk_segdeform.widgets.region_selector.strokes import Lasso
from vtk_segdeform.widgets.scene.gestures import Phase, Pointer
from vtk_segdeform.widgets.scene.surface_display import SurfaceDisplay


@functools.cache
def cactus():
    return models.cactus(500)


def over(mesh, size=(400, 400), *, parallel=False):
    view = plain_view(size)
    session = Session(mesh)
    surface = SurfaceDisplay(view, session)
    view.camera.SetParallelProjection(parallel)
    look_from(view, 1.0, -3.0, 0.7)
    return view, session, surface, Picker(surface)


def first_crossing(points, faces, near, far):
    """Return (face, fraction) of the first intersection of the segment from near to far."""
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
def test_a_hit_is_the_first_intersection_of_the_line_of_sight(parallel, rng):
    view, session, surface, picker = over(cactus(), parallel=parallel)
    met = 0
    for x, y in rng.uniform(60, 340, (30, 2)):
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


def test_a_line_through_a_vertex_or_an_edge_meets_the_surface():
    vertices, faces = icosphere(2)
    x = 1e3 + vertices  # away from the origin
    for k in range(20):
        face = vertices[faces[k]]
        for target in (face[0], 0.5 * (face[0] + face[1])):
            near, far = 1e3 + 3.0 * target, 1e3 - 0.5 * target
            places, met = intersections(x, faces, near, far, tolerance=1e-6)
            assert len(met)
            assert np.allclose(places, 1e3 + target, atol=1e-5)  # and not the other side
            assert k in met
    assert len(intersections(x, faces, near, near, tolerance=1e-6)[1]) == 0


def test_hits_are_in_the_displayed_pose():
    scene = sausage(is_coarse=True)
    view, session, surface, picker = over(scene.mesh)
    session.set_regions(scene.regions)
    session.set_cages(scene.cages)
    session.set_fixed(scene.fixed)
    session.handles.add(scene.handle)
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


@pytest.mark.parametrize("count", [1, 3])
def test_distances_on_a_sphere_are_those_of_great_circles(count):
    vertices, faces = icosphere(4)
    wave = SurfaceDistance(len(vertices), faces)
    rng = np.random.default_rng(4)
    where = rng.choice(len(faces), count, replace=False)
    points = np.einsum("kij,ki->kj", vertices[faces[where]], rng.dirichlet([1, 1, 1], count))
    distance = wave.within(vertices, points, where, 0.8)
    directions = points / np.linalg.norm(points, axis=1)[:, None]
    exact = np.arccos(np.clip(vertices @ directions.T, -1.0, 1.0)).min(axis=1)
    reached = distance <= 0.8
    assert np.count_nonzero(reached) > 100
    assert reached[exact < 0.78].all()
    assert not reached[exact > 0.81].any()
    assert np.allclose(distance[reached], exact[reached], rtol=0.02, atol=0.01)


def test_distances_lie_between_the_straight_line_and_the_path_along_edges():
    mesh = cactus()
    start = 400
    face = int(np.flatnonzero((mesh.faces == start).any(axis=1))[0])
    radius = 0.3 * mesh.diagonal
    point = mesh.vertices[start]
    wave = SurfaceDistance(mesh.n_vertices, mesh.faces)
    distance = wave.within(mesh.vertices, point[None], np.array([face]), radius)
    edges = csgraph.dijkstra(mesh.adjacency, indices=start)
    straight = np.linalg.norm(mesh.vertices - point, axis=1)
    slack = 1e-4 * radius
    assert (distance >= straight - slack).all()
    assert (distance[edges <= radius] <= edges[edges <= radius] + slack).all()
    assert np.isinf(distance[straight > 1.5 * radius]).all()
    inside = distance[mesh.edges] <= radius
    around = mesh.edges[inside[:, 0] != inside[:, 1]]
    assert np.isfinite(distance[around]).all()  # the ring is interpolated there


def test_without_points_all_distances_are_infinite():
    _, _, _, picker = over(models.sphere(300))
    assert np.isinf(picker.distances([], 1.0)).all()


def test_hits_include_the_front_and_the_back():
    view, _, surface, picker = over(models.sphere(800))
    front, back = picker.hits(Pointer(Phase.HOVER, 205, 213))
    assert back.face != front.face
    eye = np.array(view.camera.GetPosition())
    assert np.linalg.norm(front.point - eye) < np.linalg.norm(back.point - eye)
    near = np.linalg.norm(surface.points - front.point, axis=1)
    assert near[front.vertex] == pytest.approx(near.min())
    assert picker.hits(Pointer(Phase.HOVER, 2, 2)) == []


def test_a_component_is_a_connected_part():
    vertices, faces = two_components()
    _, _, _, picker = over(Mesh(vertices, faces))
    second = picker.component(len(vertices) - 1)
    assert np.array_equal(np.flatnonzero(second), np.arange(len(vertices) // 2, len(vertices)))


def test_visible_vertices_agree_with_ray_casting(rng):
    mesh = cactus()
    view, _, surface, _ = over(mesh, (500, 500))
    display = view.to_display(surface.points)
    seen = visible_vertices(display, mesh.faces)
    eye = np.array(view.camera.GetPosition())
    exact = np.zeros(len(seen), dtype=bool)
    sample = rng.choice(mesh.n_vertices, 200, replace=False)
    for k in sample:
        elsewhere = mesh.faces[~(mesh.faces == k).any(axis=1)]
        _, share = first_crossing(surface.points, elsewhere, eye, surface.points[k])
        exact[k] = share > 1.0 - 1e-9
    assert 0.2 < exact[sample].mean() < 0.8
    assert np.array_equal(seen[sample], exact[sample])


def test_vertices_behind_the_camera_are_not_visible():
    display = np.array([[10.0, 10, 0.5], [20, 10, 0.5], [10, 20, 0.5], [np.nan] * 3])
    seen = visible_vertices(display, np.array([[0, 1, 2], [1, 3, 2]]))
    assert seen.tolist() == [True, True, True, False]
    assert not visible_vertices(np.full((3, 3), np.nan), np.array([[0, 1, 2]])).any()


def test_the_depth_tolerance_separates_rounding_errors_from_hidden_vertices():
    x, y = np.array([[0.0, 30.0, 0.0, 7.0, 8.0, 9.0], [0.0, 0.0, 30.0, 5.0, 6.0, 7.0]])
    depth = 0.4 + 0.002 * x + 0.001 * y  # the plane of the triangle
    depth[3:] += [-1e-10, 5e-10, 2e-9]  # in front of it, behind within the tolerance, behind it
    display = np.stack([x, y, depth], axis=1)
    visible = visible_vertices(display, np.array([[0, 1, 2]]))
    assert visible.tolist() == [True, True, True, True, True, False]


def crossings_above(point, corners):
    """Return how often a ray straight up crosses a closed line, by a loop over its segments."""
    count = 0
    for (x0, y0), (x1, y1) in zip(corners, [*corners[1:], corners[0]], strict=True):
        if (x0 > point[0]) != (x1 > point[0]):
            count += y0 + (point[0] - x0) * (y1 - y0) / (x1 - x0) > point[1]
    return count


def test_a_lasso_selects_by_the_even_odd_rule(rng):
    _, _, _, picker = over(cactus())
    corners = (200 + 170 * rng.uniform(-1, 1, (9, 2))).tolist()  # a line that crosses itself
    lasso = Lasso(picker, Pointer(Phase.PRESS, *corners[0]), through=True)
    for corner in corners[1:]:
        lasso.extend(Pointer(Phase.MOVE, *corner))
        so_far = lasso.outline.tolist()
        odd = [crossings_above(p, so_far) % 2 == 1 for p in picker.display_points()]
        assert lasso.mask.tolist() == (odd if len(so_far) > 2 else [False] * len(odd))
    assert 20 < lasso.mask.sum() < 480


def test_visible_vertices_are_cached_until_the_camera_or_the_pose_changes():
    scene = sausage()
    view, session, surface, picker = over(scene.mesh)
    session.set_regions(scene.regions)
    session.set_cages(scene.cages)
    session.set_fixed(scene.fixed)
    session.handles.add(scene.handle)

    def now():
        return visible_vertices(view.to_display(surface.points), scene.mesh.faces)

    first = picker.visible()
    assert np.array_equal(first, now())
    view.renderer.ResetCameraClippingRange(-9, 9, -9, 9, -9, 9)
    assert picker.visible() is first  # cached
    view.camera.Azimuth(50)
    assert not np.array_equal(picker.visible(), first)
    assert np.array_equal(picker.visible(), now())
    second = picker.visible()
    session.drag(scene.turned(60.0), max_steps=5)
    assert not np.array_equal(picker.visible(), second)
    assert np.array_equal(picker.visible(), now())


@pytest.mark.parametrize("parallel", [False, True])
def test_a_test_of_some_vertices_agrees_with_the_test_of_all(parallel, rng):
    mesh = cactus()
    view, _, surface, picker = over(mesh, parallel=parallel)
    view.camera.Zoom(3.0)  # some vertices are outside the window
    everything = visible_vertices(view.to_display(surface.points), mesh.faces)
    assert 0.2 < everything.mean() < 0.8
    nowhere = np.zeros(mesh.n_vertices, dtype=bool)
    assert not picker.visible(nowhere).any()
    for share in (0.005, 0.1, 0.5):
        some = rng.random(mesh.n_vertices) < share
        assert np.array_equal(picker.visible(some), everything & some)
    near = view.to_display(surface.points)
    near = np.hypot(*(near - near[7])[:, :2].T) < 25.0
    assert np.array_equal(Picker(surface).visible(near), everything & near)
    assert np.array_equal(picker.visible(), everything)


@pytest.mark.parametrize("parallel", [False, True])
def test_a_point_is_seen_unless_the_surface_is_in_front_of_it(parallel, rng):
    mesh = cactus()
    view, _, surface, picker = over(mesh, parallel=parallel)
    seen = visible_vertices(view.to_display(surface.points), mesh.faces)
    sample = rng.choice(mesh.n_vertices, 60, replace=False)
    found = [picker.sees(surface.points[k], within=1e-6) for k in sample]
    assert 0.2 < np.mean(found) < 0.8
    assert np.mean(found == seen[sample]) > 0.95  # at a silhouette a vertex is beside its faces
    toward = -np.array(view.view_direction)
    assert all(picker.sees(x + 2.0 * toward, within=0.0) for x in surface.points[sample])
    assert all(picker.sees(x, within=2.0) for x in surface.points[sample])
    assert not picker.sees(np.full(3, np.nan), within=0.0)


def test_other_actors_do_not_hide_vertices():
    view, session, surface, picker = over(models.sphere(300))
    before = picker.visible()
    other = SurfaceDisplay(view, Session(Mesh(1.5 * surface.points, session.mesh.faces)))
    view.render()
    assert np.array_equal(Picker(surface).visible(), before)
    other.remove()
