"""pyvista's extension points: plotters, meshes, and the window of `edit`."""

from __future__ import annotations

import configparser
import functools
import importlib
import logging
import signal
import sys
from pathlib import Path

import numpy as np
import pytest
import pyvista as pv
from campaign import every
from given_surfaces import GIVEN, require_only_moved
from hands import Hand, picture
from numpy.testing import assert_allclose, assert_array_equal
from scenes import sausage
from solids import OCTAHEDRON

import vtk_segdeform as sd
from vtk_segdeform import models
from vtk_segdeform.cli.main import main
from vtk_segdeform.cli.progress_bar import ProgressBar
from vtk_segdeform.errors import ArgumentError, MeshError, MissingDependencyError
from vtk_segdeform.geometry.volume import signed_volume
from vtk_segdeform.io import convert
from vtk_segdeform.pictures import canvas
from vtk_segdeform.session.finishing import Finish
from vtk_segdeform.solver import Status
from vtk_segdeform.widgets import Mode, plugin
from vtk_segdeform.widgets.hosting import session_of
from vtk_segdeform.widgets.scene.surface_display import SurfaceStyle
from vtk_segdeform.widgets.scene.view import View

pytestmark = pytest.mark.usefixtures("bound_once")

ROOT = Path(__file__).resolve().parents[2]
SCENE = sausage(is_coarse=True)


@pytest.fixture
def bar() -> pv.PolyData:
    surface = convert.to_polydata(models.bar(divisions=(3, 3, 15)))
    surface.point_data["number"] = np.arange(surface.n_points)
    surface.cell_data["half"] = np.arange(surface.n_cells) % 2
    surface.field_data["author"] = ["me"]
    return surface


@pytest.fixture
def session() -> sd.Session:
    return SCENE.session()


@pytest.fixture
def plotter():
    plotter = pv.Plotter(off_screen=True, window_size=(300, 300))
    plotter.disable_anti_aliasing()
    yield plotter
    plotter.close()


# Meshes.


def test_a_surface_is_deformed_into_a_copy_with_its_arrays_and_its_volume(bar):
    before = bar.copy()
    height = bar.points[:, 2]
    fixed, handle = height < 0.1, height > 0.9
    targets = bar.points[handle] + [0.2, 0.0, -0.05]
    bent = bar.segdeform.deform(fixed, handle, targets, n_regions=2, n_cage_vertices=40)
    assert bar == before
    assert np.abs(bent.points[handle] - targets).max() < 1e-3
    assert np.abs(bent.points[fixed] - bar.points[fixed]).max() < 1e-3
    assert_array_equal(bent.faces, bar.faces)
    assert_array_equal(bent["number"], bar["number"])
    assert_array_equal(bent.cell_data["half"], bar.cell_data["half"])
    assert list(bent.field_data["author"]) == ["me"]
    faces = bar.regular_faces
    volumes = [signed_volume(np.asarray(s.points, float), faces) for s in (bar, bent)]
    assert volumes[1] == pytest.approx(volumes[0], rel=1e-12)


def test_a_surface_with_a_pulled_point_is_a_copy_with_its_arrays(bar):
    to = bar.points[-1] + [0.1, 0.1, 0.2]
    pulled = bar.segdeform.pull(bar.n_points - 1, to, 0.5, pins=[0])
    assert np.abs(pulled.points[-1] - to).max() < 1e-6
    assert np.abs(pulled.points[0] - bar.points[0]).max() < 1e-3
    assert_array_equal(pulled["number"], bar["number"])


@pytest.mark.parametrize("name", every(2, ["soup", "tube"]))
def test_any_surface_is_deformed_by_its_own_points(name):
    given = GIVEN[name]()
    height = given.points[:, 2]
    fixed, handle = height < 0.3, np.flatnonzero(height > 2.7)[::-1]
    targets = given.points[handle] + np.array([0.2, 0.0, 0.0])
    bent = given.segdeform.deform(
        fixed, handle, targets, n_regions=1, n_cage_vertices=40, refine=False
    )
    require_only_moved(given, bent)
    assert np.abs(bent.points[handle] - targets).max() < 5e-3
    assert np.abs(bent.points[fixed] - given.points[fixed]).max() < 5e-3
    regions = given.segdeform.regions(2)
    assert regions["region_weights"].shape == (given.n_points, 2)
    assert_array_equal(regions["region_weights"].argmax(axis=1), regions["region"])


def test_a_handle_that_misses_its_target_is_logged(bar, caplog):
    height = bar.points[:, 2]
    handle = height > 0.9
    with caplog.at_level(logging.WARNING, logger="vtk_segdeform.widgets.plugin"):
        bar.segdeform.deform(
            height < 0.1, handle, bar.points[handle] + [0, 0, 8.0], n_regions=1,
            n_cage_vertices=12, refine=False,
        )  # fmt: skip
    assert "handle error" in caplog.text


def test_check_names_the_faults_of_a_surface(bar):
    assert bar.segdeform.check().ok
    vertices, faces = OCTAHEDRON
    report = pv.make_tri_mesh(vertices, faces[:-1]).segdeform.check()
    assert report.ok
    assert not report.is_closed
    assert "3 open edges" in str(report)
    with pytest.raises(MeshError, match="face"):
        pv.PolyData(vertices).segdeform.regions()


# Plotters.


def test_the_overlay_is_shown_in_a_plotter_and_removed_with_it(plotter, session):
    blank = picture(View.of(plotter))
    overlay = plotter.segdeform.add_volume_overlay(session)
    plotter.show(auto_close=False, interactive=False)
    assert overlay.is_shown
    assert (picture(View.of(plotter)) != blank).any()
    plotter.close()
    assert not overlay.is_shown
    session.drag(SCENE.turned(10.0))  # no longer drawn


def test_the_editor_replaces_the_mesh_and_is_removed_with_the_plotter(plotter, bar):
    actor = plotter.add_mesh(bar)
    other = plotter.add_mesh(pv.Sphere(center=(2, 0, 0)))
    editor = plotter.segdeform.edit(bar, path="bar.segdeform")
    plotter.show(auto_close=False, interactive=False)
    assert editor.GetEnabled()
    assert editor.path == Path("bar.segdeform")
    assert actor.visibility
    assert not editor.widgets.surface.polydata.n_cells  # the actor shows all of it
    assert other.visibility
    assert_array_equal(editor.session.vertices, bar.points)
    plotter.close()
    assert not editor.GetEnabled()
    editor.session.segment(2)  # no longer shown


def colours_of(plotter: pv.Plotter) -> set[tuple[int, ...]]:
    """Return the vivid colours of a picture's top half, each as its strong channels (r, g, b)."""
    pixels = plotter.screenshot(return_img=True)[:150].reshape(-1, 3).astype(int)
    vivid = pixels[np.ptp(pixels, axis=1) > 100]
    return set(map(tuple, (vivid > vivid.mean(axis=1, keepdims=True)).astype(int).tolist()))


RED, GREEN, BLUE = (1, 0, 0), (0, 1, 0), (0, 0, 1)


def turned(session: sd.Session) -> np.ndarray:
    """Turn the pose about a pin at its first vertex, by a pull of the last; return its vertices."""
    session.accept(session.preparation())
    x = session.mesh.vertices
    session.handles.pin(0)
    session.pull(len(x) - 1, x[-1] + [0.7, 0.0, -0.3], locality=0.0)
    session.commit("pull")
    return session.vertices


@pytest.mark.parametrize("smooth", every(2, [True, False]))
def test_colours_and_their_bar_stay_and_the_editor_draws_only_what_it_colours(plotter, bar, smooth):
    actor = plotter.add_mesh(
        bar, scalars="half", cmap=["red", "blue"], lighting=False, smooth_shading=smooth
    )
    before = actor.mapper.dataset
    editor = plotter.segdeform.edit(bar)
    plotter.show(auto_close=False, interactive=False)
    assert colours_of(plotter) == {RED, BLUE}
    lowest = plotter.scalar_bars["half"].GetPosition()[1] * plotter.window_size[1]
    assert lowest > editor.controller.messages.height > 0.0
    vertices = turned(editor.session)
    plotter.render()
    shown = actor.mapper.dataset
    assert np.abs(shown.points - vertices).max() < 1e-6
    assert np.abs(vertices - bar.points).max() > 0.5
    if smooth:
        expected = pv.PolyData(vertices, bar.faces).compute_normals(split_vertices=False)
        off = 1.0 - (shown.point_data.active_normals * expected.point_data["Normals"]).sum(axis=1)
        assert off.max() < 5e-3  # pyvista weights faces differently
    editor.session.history.jump(0)
    editor.session.set_fixed(bar.points[:, 2] < 0.3)
    plotter.render()
    drawn = editor.widgets.surface.polydata
    assert 0 < drawn.n_cells < bar.n_cells / 2
    editor.mode = Mode.REGIONS
    plotter.render()
    assert drawn.n_cells == bar.n_cells
    editor.mode = Mode.PULL
    editor.widgets.surface.style = SurfaceStyle.WIREFRAME
    plotter.render()
    assert not actor.visibility
    assert drawn.n_cells == bar.n_cells
    plotter.close()
    assert actor.mapper is None or actor.mapper.dataset is before


def test_a_texture_stays(plotter, bar):
    bar.active_texture_coordinates = np.ascontiguousarray(bar.points[:, :2])
    green = pv.numpy_to_texture(np.full((8, 8, 3), [0, 255, 0], dtype=np.uint8))
    plotter.add_mesh(bar, texture=green, lighting=False)
    plotter.segdeform.edit(bar)
    plotter.show(auto_close=False, interactive=False)
    assert colours_of(plotter) == {GREEN}


def test_an_editor_has_scalars_and_a_callback_as_widgets_of_pyvista_do(plotter, bar):
    got = []
    x = np.asarray(bar.points, float)
    given = sd.Mesh(x, bar.regular_faces)
    editor = plotter.segdeform.edit(
        given, scalars=np.arange(len(x)) % 2, cmap=["red", "blue"], callback=got.append
    )
    plotter.show(auto_close=False, interactive=False)
    assert {RED, BLUE} <= colours_of(plotter)
    vertices = turned(editor.session)
    assert [type(each) for each in got] == [sd.Mesh]  # not during a drag
    assert_array_equal(got[0].vertices, vertices)
    editor.session.undo()
    assert_array_equal(got[1].vertices, x)


def test_a_second_editor_in_a_subplot_is_refused_until_the_first_one_is_removed(bar):
    plotter = pv.Plotter(off_screen=True, shape=(1, 2), window_size=(300, 150))
    first = plotter.segdeform.edit(bar)
    with pytest.raises(ArgumentError, match="this subplot has an editor already; remove it"):
        plotter.segdeform.edit(bar)
    plotter.subplot(0, 1)
    assert plotter.segdeform.edit(bar).view.renderer is not first.view.renderer
    plotter.subplot(0, 0)
    first.remove()
    plotter.segdeform.edit(bar)
    plotter.close()


# Registration.


def test_pyvista_finds_the_plugin_by_its_entry_points():
    parser = configparser.ConfigParser()
    parser.read(ROOT / "setup.cfg", encoding="utf-8")
    for group in ("pyvista.plotter_components", "pyvista.accessors"):
        name, module = parser["options.entry_points"][group].strip().split(" = ")
        assert name == "segdeform"
        assert importlib.import_module(module) is plugin


# The window of `edit`.


def pull(hand: Hand, editor, shift=(12, 21), *, releases: bool = True) -> None:
    """Switch to the deform mode and drag the centre of the handle by *shift* pixels."""
    editor.wait()
    hand.key("4")
    editor.wait()
    session = editor.session
    x, y = hand.at(session.vertices[session.handles["handle 1"]].mean(axis=0))
    way = [(x + share * shift[0], y + share * shift[1]) for share in (0.0, 0.45, 1.0)]
    if releases:
        hand.drag(way)
        return
    hand.press(way[0])
    for position in way[1:]:
        hand.move(position)


@pytest.mark.parametrize("kind", every(2, [pv.PolyData, sd.Session, sd.Mesh]))
def test_off_screen_the_window_closes_at_once_and_nothing_is_changed(kind, bar):
    mesh = convert.from_polydata(bar)
    given = {sd.Mesh: mesh, pv.PolyData: bar, sd.Session: sd.Session(mesh)}[kind]
    back = sd.edit(given)
    assert isinstance(back, kind)
    vertices = back.points if kind is pv.PolyData else back.vertices
    assert_array_equal(vertices, mesh.vertices)
    if kind is pv.PolyData:
        assert_array_equal(back["number"], bar["number"])


def test_the_window_returns_the_edited_session(session, monkeypatch):
    show, failures = pv.Plotter.show, []

    def show_and_work(plotter):
        editor, _ = plotter.segdeform.added
        show(plotter, auto_close=False, interactive=False)
        hand = Hand(editor.view)
        pull(hand, editor)
        failures.extend(hand.failures)

    monkeypatch.setattr(pv.Plotter, "show", show_and_work)
    assert sd.edit(session) is session
    assert failures == []
    assert session.history.undo_label == "drag handle 1"
    assert np.abs(session.vertices - session.mesh.vertices).max() > 0.1
    assert abs(session.volume_change) < 1e-12
    assert_array_equal(session.deformed.points, session.vertices)


def test_the_command_writes_the_deformed_mesh(tmp_path, session, monkeypatch, capsys):
    saved, out = tmp_path / "work.segdeform", tmp_path / "out.vtp"
    sd.save_session(saved, session)

    def edit(session, *, path, title, progress):
        assert path == saved
        assert "work.segdeform" in title
        session.drag(SCENE.turned(20.0))
        return session

    monkeypatch.setattr(plugin, "edit", edit)
    monkeypatch.setattr("vtk_segdeform.cli.commands.require_screen", lambda: None)
    assert main(["edit", str(saved), "-o", str(out)]) == 0
    assert "volume change   " in capsys.readouterr().out
    session.drag(SCENE.turned(20.0))
    assert_array_equal(convert.read_polydata(out).points, session.vertices)


@pytest.fixture
def closed_early(tmp_path, session, monkeypatch):
    """Return a function that runs the command, drags in its window, and closes that at once.

    It calls ``before_closing(hand, editor)``, and returns the session, the vertices shown before
    the window closed and those that the command wrote.
    """
    saved, out = tmp_path / "work.segdeform", tmp_path / "out.vtp"
    sd.save_session(saved, session)
    monkeypatch.setattr("vtk_segdeform.widgets.handle_dragger.live_solve.STEPS", 3)
    monkeypatch.setattr("vtk_segdeform.cli.commands.require_screen", lambda: None)
    show = pv.Plotter.show

    def run(before_closing=lambda *_: None):
        seen = []

        def show_and_work(plotter):
            editor, _ = plotter.segdeform.added
            show(plotter, auto_close=False, interactive=False)
            hand = Hand(editor.view)
            pull(hand, editor, (-40, 90))
            assert editor.session.solution.status is Status.STEP_LIMIT
            before_closing(hand, editor)
            assert hand.failures == []
            seen.extend([editor.session, editor.session.vertices])
            plotter.close()  # as the real one does when its window is closed

        monkeypatch.setattr(pv.Plotter, "show", show_and_work)
        assert main(["edit", str(saved), "-o", str(out)]) == 0
        return *seen, np.asarray(convert.read_polydata(out).points)

    return run


def test_a_window_closed_during_the_drag_completes_its_pose_as_well(closed_early):
    session, _, written = closed_early(functools.partial(pull, shift=(30, -40), releases=False))
    assert not session.can_finish
    assert session.solution.handle_error < 1e-12
    assert_array_equal(written, session.vertices)


def test_a_pose_stopped_by_escape_is_written_as_it_was_shown(closed_early, capfd):
    _, shown, written = closed_early(lambda hand, _: hand.key("Escape"))
    assert_array_equal(written, shown)
    assert "finishing" not in capfd.readouterr().out


@pytest.mark.parametrize(("stage", "settled"), every(2, [(0.5, True), (0.0, False)]))
def test_ctrl_c_while_the_pose_is_completed_writes_what_there_is(
    closed_early, capfd, monkeypatch, stage, settled
):
    def press_ctrl_c(bar, fraction, text):
        if fraction >= stage:
            signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr(ProgressBar, "__call__", press_ctrl_c)
    handler = signal.signal(signal.SIGINT, signal.default_int_handler)  # a background job has none
    try:
        session, shown, written = closed_early()
    finally:
        signal.signal(signal.SIGINT, handler)
    assert session.can_finish
    assert (session.solution.status is not Status.STEP_LIMIT) == settled
    assert np.array_equal(written, shown) != settled
    assert_array_equal(written, session.vertices)
    assert abs(session.volume_change) < 1e-12
    assert "interrupted: the pose is not finished" in capfd.readouterr().err


def test_a_pose_that_cannot_be_finished_is_written_all_the_same(closed_early, capfd, monkeypatch):
    def fail(*_, **__):
        raise MeshError("the matrix is singular")

    monkeypatch.setattr(Finish, "__call__", fail)
    session, _, written = closed_early()
    assert session.solution.status is not Status.STEP_LIMIT
    assert_array_equal(written, session.vertices)
    assert "the pose is not finished: the matrix is singular" in capfd.readouterr().err


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere there is always a screen")
def test_without_a_screen_the_command_says_so_in_one_line(tmp_path, bar, monkeypatch, capfd):
    path = tmp_path / "bar.vtp"
    convert.write_mesh(path, bar)
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(pv, "OFF_SCREEN", False)
    monkeypatch.setattr(pv.Plotter, "show", lambda _: pytest.fail("a window was opened"))
    with pytest.raises(MissingDependencyError, match="there is no screen"):
        sd.edit(bar)
    monkeypatch.setattr(plugin, "edit", lambda *_, **__: pytest.fail("edit was called"))
    capfd.readouterr()
    assert main(["edit", str(path), "-o", str(tmp_path / "o.vtp")]) == 1
    told = capfd.readouterr().err
    assert told.count("\n") == 1
    assert "no window can be opened: there is no screen; set DISPLAY" in told
    assert list(tmp_path.iterdir()) == [path]


def test_the_blocks_of_a_file_are_edited_as_one_surface(tmp_path, bar):
    convert.write_mesh(tmp_path / "bar.glb", bar)
    whole = pv.read(tmp_path / "bar.glb")
    assert isinstance(whole, pv.MultiBlock)
    two = pv.MultiBlock([whole, None, bar.translate((9.0, 0.0, 0.0))])
    mesh = session_of(two).mesh
    assert mesh.n_vertices == 2 * bar.n_points
    assert_allclose(mesh.vertices.max(axis=0), np.max(bar.points + [9.0, 0.0, 0.0], axis=0))
    for wrong in (pv.MultiBlock([bar, pv.ImageData()]), pv.MultiBlock()):
        with pytest.raises(ValueError, match="mesh must be a PolyData, a Mesh"):
            session_of(wrong)


def test_other_types_are_refused():
    with pytest.raises(ValueError, match="cactus: there is no such file"):
        sd.edit("cactus")
    with pytest.raises(ValueError, match="or another surface; got 3"):
        sd.edit(3)
    with pytest.raises(MissingDependencyError, match="off-screen"):
        canvas.require_screen()
