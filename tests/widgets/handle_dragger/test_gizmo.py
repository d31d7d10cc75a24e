"""The gizmo: constant size away from borders, never hidden, and hit where it is drawn."""

from __future__ import annotations

import numpy as np
import pytest
from campaign import every
from hands import look_from, picture, plain_view
from solids import rotation

from vtk_segdeform import Session, models
from vtk_segdeform.pictures.palette import COLOURS, INK, rgb
from vtk_segdeform.widgets.handle_dragger.gizmo import AXIS_COLOURS, Gizmo
from vtk_segdeform.widgets.handle_dragger.gizmo_shapes import (
    FREE,
    PARTS,
    Kind,
    Part,
    distance_to_origin,
)
from vtk_segdeform.widgets.scene.gestures import Phase, Pointer
from vtk_segdeform.widgets.scene.surface_display import SurfaceDisplay

CENTRE = np.array([0.2, 0.1, -0.1])  # inside the displayed sphere
TURNED = rotation([1.0, 2.0, 3.0], 0.7)
LOOKS = [(4.0, -9.0, 5.0), (-6.0, 5.0, 3.0), (3.0, 4.0, -8.0)]
VIEW_RING = Part(Kind.ROTATION)


@pytest.fixture
def view():
    view = plain_view()
    SurfaceDisplay(view, Session(models.sphere(300)))
    look_from(view, *LOOKS[0])
    return view


def pointer(place):
    return Pointer(Phase.HOVER, *np.asarray(place, dtype=float)[:2])


def seen_lines(gizmo, part):
    """Return pixels where a part is drawn, (k, 2); none for a hidden part."""
    line = gizmo.line(part)[:, :2]
    if part.kind is Kind.AXIS:
        line = line[0] + np.linspace(0.3, 0.9, 7)[:, None] * (line[1] - line[0])
    elif part.kind is Kind.PLANE:
        line = line[:4].mean(axis=0)[None]
    else:
        line = line[np.isfinite(line).all(axis=1)][::5]
    return line


def is_painted(image, place, colour):
    """Return whether a pixel within one pixel of *place* has *colour*."""
    x, y = np.round(place).astype(int)
    row = len(image) - 1 - y
    near = image[row - 1 : row + 2, x - 1 : x + 2].astype(int)
    return bool((np.abs(near - rgb(colour).astype(int)).max(axis=2) <= 2).any())


@pytest.mark.parametrize("parallel", [False, True], ids=["perspective", "parallel"])
def test_its_size_on_the_screen_is_constant(view, parallel):
    view.camera.SetParallelProjection(parallel)
    gizmo = Gizmo(view)
    gizmo.place(CENTRE)
    sizes = []
    for zoom in (1.0, 2.5, 0.3):
        view.camera.Dolly(zoom)
        view.camera.SetParallelScale(view.camera.GetParallelScale() / zoom)
        view.renderer.ResetCameraClippingRange()
        image = picture(view)
        middle = view.to_display(CENTRE[None])[0, :2]
        ring = gizmo.line(VIEW_RING)[:, :2]
        sizes.append(np.linalg.norm(ring - middle, axis=1).mean())
        drawn = [is_painted(image, place, INK) for place in ring[::9]]
        assert np.mean(drawn) > 0.8  # the ring is drawn at its line
    assert np.ptp(sizes) < 1.0
    assert 60.0 < sizes[0] < 130.0


@pytest.mark.parametrize(
    ("place", "axes"), every(3, [(look, axes) for look in LOOKS for axes in (np.eye(3), TURNED)])
)
def test_parts_are_hit_where_they_are_drawn(view, place, axes):
    view.camera.SetParallelProjection(place == LOOKS[1])
    look_from(view, *place)
    gizmo = Gizmo(view)
    gizmo.place(CENTRE, axes)
    image = picture(view)
    for part in PARTS:
        places = seen_lines(gizmo, part)
        found = [gizmo.part_at(pointer(p)) for p in places]
        own = INK if part.axis is None else AXIS_COLOURS[part.axis]
        drawn = [is_painted(image, p, own) for p in places]
        if part in found or part.kind in (Kind.FREE, Kind.ROTATION):
            assert found.count(part) > 0.4 * len(found), part  # other parts cross the rest
            assert np.mean(drawn) > 0.4, part
        else:  # a part seen edge-on or end-on is neither drawn nor hit
            edge = abs(axes[part.axis] @ view.view_direction)
            assert edge > 0.9 if part.kind is Kind.AXIS else edge < 0.4


def test_the_far_half_of_a_ring_is_neither_drawn_nor_hit(view):
    gizmo = Gizmo(view)
    gizmo.place(CENTRE)
    ring = Part(Kind.ROTATION, 2)
    turn = np.linspace(0.0, 2.0 * np.pi, 45, endpoint=False)
    around = np.column_stack([np.cos(turn), np.sin(turn), np.zeros(45)])
    hidden = around[around @ np.array(LOOKS[0]) < -3.0]
    shown = around[around @ np.array(LOOKS[0]) > 3.0]

    def hits(points):
        places = view.to_display(CENTRE + gizmo.radius * points)
        return [gizmo.part_at(pointer(place)) for place in places]

    def drawn(points):
        image, places = picture(view), view.to_display(CENTRE + gizmo.radius * points)[:, :2]
        return np.mean([is_painted(image, place, AXIS_COLOURS[2]) for place in places])

    assert ring not in hits(hidden)
    assert hits(shown).count(ring) > 0.7 * len(shown)
    assert drawn(hidden) < 0.2  # a few pixels belong to other parts
    assert drawn(shown) > 0.7
    gizmo.show_only(ring)
    assert drawn(hidden) > 0.9


def test_near_a_border_of_the_view_it_is_smaller_and_inside(view):
    gizmo, size = Gizmo(view), np.array(view.renderer.GetSize())
    usual, smaller = 0.0, 0
    for height in np.linspace(0.0, 3.0, 31):
        centre = CENTRE + [0.0, 0.0, height]
        gizmo.place(centre)
        place = view.to_display(centre[None])[0, :2]
        radius = gizmo.radius / view.pixel_at(centre)
        usual = usual or radius
        assert radius == usual or radius < usual
        if min(place.min(), (size - place).min()) > 65.0:
            lines = np.vstack([gizmo.line(part)[:, :2] for part in PARTS])
            assert np.nanmin(lines) > 0.0
            assert (np.nanmax(lines, axis=0) < size).all()
            smaller += radius < 0.9 * usual
        assert radius > 44.0
        corner = np.array([*place, *place]) + [1.3 * radius, 0.0, 1.5 * radius, 1.0]
        assert gizmo.reaches(tuple(corner))
        assert not gizmo.reaches(tuple(corner + [0.2 * radius, 0.0, 0.2 * radius, 0.0]))
    assert smaller
    gizmo.place(None)
    assert not gizmo.reaches((0.0, 0.0, 1e4, 1e4))


def test_where_a_ring_crosses_an_arrow_the_arrow_is_hit(view):
    look_from(view, 8.0, -6.0, 6.0)  # the ring about y crosses the arrow along y
    gizmo = Gizmo(view)
    gizmo.place(CENTRE)
    arrows = [gizmo.line(Part(Kind.AXIS, axis))[:, :2] for axis in range(3)]
    rings = [gizmo.line(Part(Kind.ROTATION, axis))[:, :2] for axis in range(3)]
    crossings = 0
    for axis, arrow in enumerate(arrows):
        for share in np.linspace(0.05, 0.95, 60):
            place = arrow[0] + share * (arrow[1] - arrow[0])
            side = np.array([arrow[0, 1] - arrow[1, 1], arrow[1, 0] - arrow[0, 0]])
            place = place + 1.5 * side / np.linalg.norm(side)  # pixels beside the arrow
            if min(distance_to_origin(ring - place) for ring in rings) < 1.0:
                crossings += 1
                assert gizmo.part_at(pointer(place)) == Part(Kind.AXIS, axis)
    assert crossings > 0


@pytest.mark.parametrize("axis", every(2, range(3)))
def test_parts_seen_end_on_are_not_hit(view, axis):
    view.camera.SetParallelProjection(axis == 1)
    place = 9.0 * np.eye(3)[axis]
    view.camera.SetViewUp(*np.eye(3)[axis - 1])
    view.camera.SetPosition(*place)
    view.renderer.ResetCamera()
    gizmo = Gizmo(view)
    gizmo.place(np.zeros(3))
    x, y = view.to_display(np.zeros((1, 3)))[0, :2]
    grid = [(x + i, y + j) for i in range(-96, 97, 24) for j in range(-96, 97, 24)]
    found = {gizmo.part_at(pointer(p)) for p in grid}
    others = [a for a in range(3) if a != axis]
    assert found == {
        None, FREE, VIEW_RING, *(Part(Kind.ROTATION, a) for a in range(3)),
        Part(Kind.PLANE, axis), *(Part(Kind.AXIS, a) for a in others),
    }  # fmt: skip


def test_beside_it_and_while_it_is_hidden_nothing_is_hit(view):
    gizmo = Gizmo(view)
    middle = view.to_display(CENTRE[None])[0]
    assert gizmo.part_at(pointer(middle)) is None
    gizmo.place(CENTRE)
    assert gizmo.part_at(pointer(middle)) == FREE
    outer = 1.14 * gizmo.radius / view.pixel_at(CENTRE)
    assert gizmo.part_at(pointer(middle[:2] + [0.0, outer + 2.0])) == VIEW_RING
    assert gizmo.part_at(pointer(middle[:2] + [0.0, outer + 5.0])) is None
    gizmo.place(None)
    assert gizmo.part_at(pointer(middle)) is None


def test_a_highlighted_part_is_yellow_and_show_only_hides_the_others(view):
    gizmo = Gizmo(view)
    gizmo.place(CENTRE)
    arrow, ring = Part(Kind.AXIS, 0), Part(Kind.ROTATION, 2)
    there, other = seen_lines(gizmo, arrow)[3], seen_lines(gizmo, ring)
    gizmo.highlight(arrow)
    image = picture(view)
    assert is_painted(image, there, COLOURS[4])
    assert any(is_painted(image, place, AXIS_COLOURS[2]) for place in other)
    gizmo.show_only(arrow)
    image = picture(view)
    assert is_painted(image, there, COLOURS[4])
    assert not any(is_painted(image, place, AXIS_COLOURS[2]) for place in other)
    middle = view.to_display(CENTRE[None])[0, :2]
    assert not is_painted(image, middle, INK)
    gizmo.show_only(ring)
    assert is_painted(picture(view), middle, INK)  # the centre of the rotation
    gizmo.show_only(None)
    gizmo.highlight(None)
    assert is_painted(picture(view), there, AXIS_COLOURS[0])


def test_the_first_picture_after_a_camera_move_is_final():
    view = plain_view()
    SurfaceDisplay(view, Session(models.sphere(300)))
    look_from(view, *LOOKS[0])
    assert view.foreground.GetLayer() == 1  # the foreground exists already
    gizmo = Gizmo(view)
    gizmo.place(np.array([0.0, -0.9, 0.4]))
    for zoom in (0.2, 0.3, 4.0):
        view.camera.Dolly(zoom)
        first = picture(view)
        assert np.array_equal(first, picture(view))


def test_remove_restores_the_view(view):
    before = picture(view)
    gizmo = Gizmo(view)
    gizmo.place(CENTRE)
    gizmo.set_caption("30.0°")
    assert (picture(view) != before).any()
    gizmo.remove()
    assert np.array_equal(picture(view), before)
    assert view.foreground.GetViewProps().GetNumberOfItems() == 0
