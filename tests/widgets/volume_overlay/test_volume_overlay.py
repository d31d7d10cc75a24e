"""The overlay of the local volume change: colours, lines of text, no work while hidden."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
import vtkmodules.vtkRenderingOpenGL2  # noqa: F401 - a plain window needs it
from campaign import every
from hands import draw_seldom, look_from, picture, plain_view
from open_meshes import open_box, sheet
from scenes import sausage
from solids import rotation
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkRenderingAnnotation import vtkScalarBarActor
from vtkmodules.vtkRenderingCore import vtkTextActor

from vtk_segdeform import Regions, Session
from vtk_segdeform.geometry.local_volume import LocalVolume
from vtk_segdeform.solver.volume_constraints import region_volumes
from vtk_segdeform.widgets.scene.surface_display import SurfaceDisplay
from vtk_segdeform.widgets.scene.view import View
from vtk_segdeform.widgets.volume_overlay.diverging import (
    HALF_RANGES,
    NEUTRAL,
    colours_of,
    half_range_for,
    lookup_table,
)
from vtk_segdeform.widgets.volume_overlay.volume_overlay import VolumeOverlay

pytestmark = pytest.mark.usefixtures("bound_once")


@pytest.fixture
def overlay(request):
    """Return the overlay of a sausage along x seen from -y, by default with one region."""
    session = sausage(getattr(request, "param", 1), is_coarse=True).session()
    session.change_options(preserve_volume=False)
    view = plain_view((400, 300))
    surface = SurfaceDisplay(view, session)
    look_from(view, 0.0, -10.0, 0.0)
    draw_seldom(view)
    overlay = VolumeOverlay(view, session, surface)
    overlay.wanted_range = None
    overlay.surface = surface
    yield overlay
    overlay.remove()
    surface.remove()


three_regions = pytest.mark.parametrize("overlay", [3], indirect=True)


def colours(overlay):
    return vtk_to_numpy(overlay.surface.polydata.GetPointData().GetScalars())


def props(overlay, kind):
    return [prop for prop in overlay.view.renderer.GetViewProps() if isinstance(prop, kind)]


def lines_of(overlay):
    """Return the lines of text from the top."""
    lines = sorted(props(overlay, vtkTextActor), key=lambda line: -line.GetPosition()[1])
    return [line.GetInput().strip() for line in lines]


def move_all(session, matrix, shift=(0.0, 0.0, 0.0)):
    """Apply an affine map to all cages, and thereby to the mesh."""
    for region, cage in enumerate(session.cages):
        session.move_cage(region, cage.vertices @ np.asarray(matrix).T + shift)
    session.commit()


# The colours.


def lightness(rgb):
    """Return CIELAB L* of (n, 3) colours."""
    c = np.asarray(rgb) / 255.0
    linear = np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)
    y = linear @ [0.2126, 0.7152, 0.0722]
    return np.where(y > (6 / 29) ** 3, 116 * np.cbrt(y) - 16, y * (29 / 3) ** 3)


def test_zero_has_exactly_one_colour():
    tiny = np.array([-1e-12, 0.0, 1e-12, -1e-4, 1e-4])
    assert (colours_of(tiny, 0.1) == NEUTRAL).all()
    others = colours_of(np.array([-0.05, -0.002, 0.002, 0.05]), 0.1)
    assert (others != NEUTRAL).any(axis=1).all()


def test_lightness_falls_evenly_and_alike_on_both_sides():
    size = np.linspace(0.0, 1.0, 101)
    below, above = lightness(colours_of(-size, 1.0)), lightness(colours_of(size, 1.0))
    expected = np.interp(size, [0.0, 1.0], [below[0], below[-1]])
    for side in (below, above):
        assert np.abs(side - expected).max() < 2.0
        assert (np.diff(side) <= 0.3).all()  # colours are rounded to whole numbers
    assert below[-1] < 40 < 85 < below[0]


@pytest.mark.parametrize("half_range", HALF_RANGES)
def test_the_colour_bar_has_the_colours_of_the_mesh(half_range, rng):
    shares = rng.uniform(-1.3 * half_range, 1.3 * half_range, 500)
    table, got = lookup_table(half_range), np.zeros(3)
    for share, colour in zip(shares, colours_of(shares, half_range), strict=True):
        table.GetColor(share, got)
        assert np.array_equal(np.round(255 * got), colour)


def test_the_range_does_not_flicker_when_values_vary_slightly():
    half_range, seen = None, []
    for size in 0.1 + 0.01 * np.sin(np.arange(50)):
        half_range = half_range_for(np.array([size]), half_range)
        seen.append(half_range)
    assert set(seen[3:]) == {0.2}
    assert half_range_for(np.array([0.01]), 0.2) == 0.05  # a much smaller size does reduce it


# On the mesh.


def test_hidden_it_computes_nothing_and_changes_no_pixel(overlay, monkeypatch):
    asked = []
    change = LocalVolume.change
    monkeypatch.setattr(LocalVolume, "change", lambda *a: asked.append("change") or change(*a))
    before = picture(overlay.view)
    move_all(overlay.session, np.diag([1.0, 1.1, 1.0]))
    assert not overlay.is_shown
    assert overlay.change is None
    assert not asked
    overlay.show()
    assert overlay.is_shown
    assert (picture(overlay.view) != before).any()
    overlay.session.undo()
    assert len(asked) == 2
    overlay.hide()
    assert (picture(overlay.view) == before).all()
    overlay.session.redo()
    assert len(asked) == 2


def test_it_is_neutral_under_any_rigid_motion(overlay):
    overlay.show()
    assert (colours(overlay) == NEUTRAL).all()
    for axis, angle in (([1.0, 2.0, 3.0], 1.0), ([0.0, 1.0, -1.0], 2.5)):
        move_all(overlay.session, rotation(axis, angle), (1.0, 2.0, -0.5))
        assert np.abs(overlay.session.vertices - overlay.session.mesh.vertices).max() > 1.0
        assert (colours(overlay) == NEUTRAL).all()
        assert lines_of(overlay)[1] == "Local: 0 to 0 %"


# The lines of text.


@three_regions
def test_the_lines_show_totals_and_regions(overlay):
    session = overlay.session
    overlay.show()
    regions = [f"region {r}: 0 %" for r in (1, 2, 3)]
    assert lines_of(overlay) == ["Volume: 0 %", "Local: 0 to 0 %", *regions]
    session.change_options(preserve_volume=True)
    session.drag(sausage(3, is_coarse=True).turned(30.0), max_steps=4)
    lines = lines_of(overlay)
    assert lines[0] == "Volume: 0 %"
    s = LocalVolume(session.mesh).change(session.vertices)
    assert lines[1] == f"Local: {100 * s.min():+.0f} to {100 * s.max():+.0f} %"
    for r, volume in enumerate(region_volumes(session.mesh, session.regions.labels)):
        share = volume.violation(session.vertices) / volume.target
        assert float(lines[2 + r].split()[2]) == pytest.approx(100 * share, abs=0.051)
    assert any("region" in line and line.split()[2] != "0" for line in lines)
    overlay.hide()
    loaded = Session(session.mesh, state=session.state)  # has no solution,
    assert loaded.solution is None
    again = VolumeOverlay(overlay.view, loaded, overlay.surface)
    again.show()
    assert lines_of(again) == lines  # so the regions' volumes are measured
    again.remove()


@three_regions
@pytest.mark.parametrize(
    ("background", "size"),
    every(
        2,
        [
            ((shade,) * 3, size)
            for size, shades in (
                ((400, 300), (1.0, 0.0)), ((800, 600), (0.0, 1.0)), ((1600, 1200), (1.0, 0.0))
            )
            for shade in shades
        ],
    ),
)  # fmt: skip
def test_text_and_colour_bar_are_legible_and_do_not_overlap(overlay, size, background):
    view = overlay.view
    view.window.SetSize(*size)
    view.renderer.SetBackground(*background)
    overlay.show()
    View.render(view)
    boxes = []
    for line in props(overlay, vtkTextActor):
        place, extent = np.array(line.GetPosition()), np.zeros(2)
        line.GetSize(view.renderer, extent)
        assert extent[1] >= max(9, size[1] / 60)
        boxes.append((place, place + extent))
        style = line.GetTextProperty()
        on = style.GetBackgroundColor() if style.GetBackgroundOpacity() else background
        ink, paper = (float(lightness(255 * np.array([c]))[0]) for c in (style.GetColor(), on))
        assert abs(ink - paper) > 35
    assert all((low >= 0).all() and (high <= size).all() for low, high in boxes)
    boxes.sort(key=lambda box: -box[0][1])
    assert all(below[1][1] <= above[0][1] for above, below in itertools.pairwise(boxes))
    (bar,) = props(overlay, vtkScalarBarActor)
    assert bar.GetPosition()[0] * size[0] > max(high[0] for _, high in boxes)
    table = bar.GetLookupTable()
    ticks = [table.GetAnnotation(k) for k in range(table.GetNumberOfAnnotatedValues())]
    assert ticks == ["-5 %", "-2.5 %", "0", "+2.5 %", "+5 %"]


def test_a_region_without_a_face_is_left_out():
    scene = sausage(1)
    x = scene.mesh.vertices[:, 0]
    masks = np.array([x < 0.3, np.arange(len(x)) == 0, x > -0.3])
    session = Session(scene.mesh)
    session.set_regions(Regions.from_masks(scene.mesh, masks | (masks.sum(axis=0) == 0)))
    session.set_cages(scene.cages * 3)
    view = plain_view()
    overlay = VolumeOverlay(view, session)
    overlay.show()
    assert lines_of(overlay)[2:] == ["region 1: 0 %", "region 3: 0 %"]
    session.change_options(preserve_volume=False)
    move_all(session, np.diag([1.0, 1.0, 1.1]))
    assert lines_of(overlay)[2:] == ["region 1: +10.0 %", "region 3: +10.0 %"]
    overlay.remove()


def test_of_more_than_eight_regions_the_rest_is_counted():
    mesh = sausage(1).mesh
    labels = np.digitize(
        mesh.vertices[:, 0], np.quantile(mesh.vertices[:, 0], np.arange(0.1, 1, 0.1))
    )
    session = Session(mesh)
    session.set_regions(Regions.from_labels(mesh, labels, overlap=1))
    overlay = VolumeOverlay(plain_view(), session)
    overlay.show()
    regions = [f"region {r}: 0 %" for r in range(1, 9)]
    assert lines_of(overlay)[2:] == [*regions, "2 more regions"]
    session.painting.merge([0, 1])
    assert lines_of(overlay)[-1] == "1 more region"
    overlay.remove()


def test_remove_restores_the_view(overlay):
    view = overlay.view
    before = picture(view)
    overlay.show()
    overlay.show()
    overlay.remove()
    assert (picture(view) == before).all()
    assert view.renderer.GetViewProps().GetNumberOfItems() == 1
    own = VolumeOverlay(view, overlay.session)
    own.show()
    own.remove()
    assert view.renderer.GetViewProps().GetNumberOfItems() == 1


def overlay_of(mesh):
    """Return the overlay of a mesh whose upper end has been moved."""
    session = Session(mesh)
    z = mesh.vertices[:, 2]
    session.set_fixed(z <= z.min() + 1e-9)
    session.handles.add(z >= z.max() - 1e-9, "end")
    session.segment(2)
    session.change_options(n_cage_vertices=40)
    session.fit_cages()
    session.drag({"end": session.targets["end"] + [0.1, 0.2, 0.1]})
    session.commit()
    return VolumeOverlay(plain_view((400, 300)), session)


def test_an_open_body_has_a_line_about_its_lids():
    overlay = overlay_of(open_box())
    overlay.show()
    first, whole, local, *regions = lines_of(overlay)
    assert (first, whole) == ("1 hole: volume kept under a lid", "Volume: 0 %")
    assert local.startswith("Local: -")
    assert [line.split(":")[0] for line in regions[:2]] == ["region 1", "region 2"]
    overlay.session.change_options(lids=False)
    assert lines_of(overlay)[0] == "Open surface, lids off: no volume to preserve"
    overlay.remove()


def test_an_open_sheet_has_no_colours_and_the_overlay_says_that_it_has_no_volume():
    overlay = overlay_of(sheet(lambda u, v: (u, 0.1 * u**2, v), 12, 12))
    overlay.show()
    assert [bar.GetVisibility() for bar in props(overlay, vtkScalarBarActor)] == [0]
    assert overlay.half_range is None
    assert overlay._surface.polydata.GetPointData().GetScalars() is None
    overlay.wanted_range = 0.1
    assert overlay.half_range is None
    first, *others = lines_of(overlay)
    assert first == "Open sheet: no volume to preserve"
    assert not [line for line in others if "%" in line]
    assert not overlay.change.any()
    overlay.session.change_options(lids=True)
    assert overlay.session.has_volume
    assert not [line for line in lines_of(overlay) if line.startswith("Local")]
    overlay.remove()
