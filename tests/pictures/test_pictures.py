"""Pictures show the expected colours in the expected places; no reference images."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
import pyvista as pv
from solids import icosphere

from vtk_segdeform import models
from vtk_segdeform.errors import MeshError, MissingDependencyError
from vtk_segdeform.mesh.mesh import Mesh
from vtk_segdeform.pictures import canvas
from vtk_segdeform.pictures.pictures import (
    picture_before_after,
    picture_distortion,
    picture_regions_and_cages,
    picture_volume_change,
)

BAR = models.bar(divisions=(4, 4, 20))
HEIGHT = BAR.vertices[:, 2]


@pytest.fixture(scope="module", autouse=True)
def renderer():
    try:
        canvas.require_offscreen()
    except MissingDependencyError as error:
        pytest.skip(str(error))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(canvas, "_HEIGHT", 400)  # half as high as those of users
        yield


def pixels(path) -> np.ndarray:
    """Return a picture as (h, w, 3) float, 0 to 255, top row first."""
    image = pv.read(path)
    width, height, _ = image.dimensions
    values = image.point_data.active_scalars.reshape(height, width, -1)[::-1, :, :3]
    return values.astype(float)


def red(image: np.ndarray) -> np.ndarray:
    return (image[..., 0] > 120) & (image[..., 1] < 90) & (image[..., 2] < 90)


def blue(image: np.ndarray) -> np.ndarray:
    return (image[..., 2] > image[..., 0] + 40) & (image[..., 2] > 80)


def middle(mask: np.ndarray) -> tuple[float, float]:
    """Return the mean (row, column) of a mask, relative to its size."""
    rows, columns = np.nonzero(mask)
    return rows.mean() / mask.shape[0], columns.mean() / mask.shape[1]


def test_the_handle_is_red_at_the_top_at_rest_and_at_the_right_when_deformed(tmp_path):
    bent = BAR.vertices.copy()
    bent[:, 0] += 0.8 * HEIGHT**2
    handle, fixed = HEIGHT > 0.85, HEIGHT < 0.1
    picture_before_after(tmp_path / "a.png", BAR, bent, fixed=fixed, handle=handle)
    image = pixels(tmp_path / "a.png")
    half = image.shape[1] // 2
    rest, after = red(image[:, :half]), red(image[:, half:])
    assert min(rest.sum(), after.sum()) > 75
    assert middle(rest)[0] < 0.35
    assert middle(after)[1] > middle(rest)[1] + 0.2
    assert middle(after)[0] == pytest.approx(middle(rest)[0], abs=0.1)  # one camera, one scale
    dark = image.max(axis=-1) < 140
    assert middle(dark[image.shape[0] // 2 :, :half])[0] > 0.5  # the fixed foot is grey, below


def test_the_background_is_white_and_the_model_is_inside_the_picture(tmp_path, monkeypatch):
    monkeypatch.setattr(canvas, "_HEIGHT", 800)  # titles have the same size in small pictures
    picture_before_after(tmp_path / "a.png", BAR, BAR.vertices, fixed=[], handle=[])
    image = pixels(tmp_path / "a.png")
    frame = np.concatenate([image[0], image[-1], image[:, 0], image[:, -1]])
    assert (frame == 255).all()
    assert 0.05 < (image.min(axis=-1) < 250).mean() < 0.7


def test_expansion_is_red_and_compression_blue_at_their_places(tmp_path):
    change = np.where(BAR.vertices[:, 2] > 0.5, 0.1, -0.1)
    picture_volume_change(tmp_path / "a.png", BAR, BAR.vertices, change)
    image = pixels(tmp_path / "a.png")
    model = image[: int(0.8 * len(image))]  # without the colour bar
    warm = (model[..., 0] > model[..., 2] + 60) & (model[..., 0] > 60)
    assert middle(warm)[0] < middle(blue(model))[0] - 0.2


def test_no_change_at_all_is_drawn_without_dividing_by_zero(tmp_path):
    picture_volume_change(tmp_path / "a.png", BAR, BAR.vertices, np.zeros(BAR.n_vertices))
    model = pixels(tmp_path / "a.png")[:300]
    assert np.ptp(model, axis=-1).max() < 25  # no colour anywhere
    picture_distortion(tmp_path / "b.png", BAR, BAR.vertices, np.zeros(BAR.n_faces))


def test_each_region_and_its_cage_have_the_same_colour(tmp_path):
    top, bottom = HEIGHT > 0.4, HEIGHT < 0.6
    cages = [
        SimpleNamespace(vertices=1.3 * (corners - centre) + centre, faces=faces)
        for chosen in (top, bottom)
        for corners, faces in [_box(BAR.vertices[chosen])]
        for centre in [corners.mean(axis=0)]
    ]
    picture_regions_and_cages(tmp_path / "a.png", BAR, [top, bottom], cages)
    image = pixels(tmp_path / "a.png")
    half = image.shape[1] // 2
    orange = (image[..., 0] > image[..., 2] + 90) & (image[..., 1] > 60)
    for part in (image[:, :half], image[:, half:]):
        there = orange[:, :half] if part is image else orange[:, : part.shape[1]]
        assert there.any()
    assert middle(orange[:, :half])[0] < middle(blue(image[:, :half]))[0] - 0.2
    assert middle(orange[:, half:])[0] < middle(blue(image[:, half:]))[0] - 0.2


def _box(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    low, high = points.min(axis=0), points.max(axis=0)
    cube = models.bar((1.0, 1.0, 1.0), (1, 1, 1))
    return low + (cube.vertices + [0.5, 0.5, 0.0]) * (high - low), cube.faces


@pytest.mark.parametrize("least", [0, 1, 2])
def test_the_camera_looks_along_the_axis_of_least_extent_with_orthonormal_axes(least):
    points = np.array(icosphere(2)[0])
    points[:, least] *= 0.2
    view = canvas.view_of(points, points)
    np.testing.assert_allclose(view @ view.T, np.eye(3), atol=1e-14)
    assert np.linalg.det(view) == pytest.approx(1.0)
    assert abs(view[2, least]) > 0.9
    if least < 2:
        assert view[1, 2] > 0.9  # z is up
    else:
        assert view[2, 2] > 0.9  # from above


def test_a_folded_mesh_can_be_shown(tmp_path):
    mesh = Mesh(*icosphere(1))
    picture_before_after(tmp_path / "a.png", mesh, -mesh.vertices, fixed=[0], handle=[1])
    assert (tmp_path / "a.png").stat().st_size > 1000


def test_a_path_that_cannot_be_written_is_an_error_before_drawing(tmp_path):
    for path in (tmp_path / "a.jpg", tmp_path / "no" / "a.png"):
        with pytest.raises(MeshError, match="png"):
            picture_before_after(path, BAR, BAR.vertices, fixed=[], handle=[])


def test_without_a_gl_library_the_error_names_the_packages(monkeypatch):
    monkeypatch.setattr(canvas, "_PROBE", "import os; os.abort()")
    with pytest.raises(MissingDependencyError, match=r"apt-get install .* libegl1 libgl1"):
        canvas.require_offscreen.__wrapped__()  # the answer of others is not kept
