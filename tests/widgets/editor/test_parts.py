"""The volume of the part under the hand: shown while it is pulled, kept, enlarged, set free."""

from __future__ import annotations

import re

import numpy as np
import pytest
from hands import Hand, draw_seldom, look_from, plain_view
from numpy.testing import assert_allclose, assert_array_equal
from open_meshes import combined
from scenes import sausage
from solids import icosphere

from vtk_segdeform.mesh import Mesh
from vtk_segdeform.session import Session
from vtk_segdeform.solver.volume_constraints import volumes_by_label
from vtk_segdeform.widgets.editor.editor import DeformEditor
from vtk_segdeform.widgets.editor.widget_set import Mode
from vtk_segdeform.widgets.panel.panel import press, sections
from vtk_segdeform.widgets.panel.status import status
from vtk_segdeform.widgets.panel.toolbar import toolbar

pytestmark = pytest.mark.usefixtures("bound_once", "unprepared")

SCENE = sausage(is_coarse=True)
EXACT = 1e-12


class Bench:
    """An editor in mode PULL over a session with two regions, seen from the front, and a hand."""

    def __init__(self):
        self.session = Session(SCENE.mesh)
        self.session.set_regions(SCENE.regions)
        self.session.painting.rename(1, "arm")
        self.session.set_cages(SCENE.cages)
        self.session.bind()
        self.editor = DeformEditor(plain_view(), self.session)
        view = self.editor.view
        look_from(view, 0.0, -12.0, 0.0)
        draw_seldom(view)
        self.editor.On()
        self.hand = Hand(view)
        self.volumes = volumes_by_label(SCENE.mesh, SCENE.regions.labels)

    def begin(self, x=1.8):
        """Press on the front of the body at *x*, and pull upwards."""
        front = SCENE.mesh.vertices[:, 1] < 0.0
        away = np.linalg.norm(self.session.vertices[:, ::2] - [x, 0.0], axis=1)
        vertex = int(np.where(front, away, np.inf).argmin())
        place = np.round(self.hand.at(self.session.vertices[vertex]))
        self.hand.press(place)
        for k in range(1, 8):
            self.hand.move(place + [6 * k, 8 * k])
            yield
        while self.editor.widgets.puller.is_refining:
            self.hand.tick()
        self.hand.release()

    def pull(self, x=1.8):
        for _ in self.begin(x):
            pass

    def settle(self):
        while self.session.is_unsettled:
            self.hand.tick()

    def change(self, region=1):
        return self.volumes[region].relative(self.session.vertices)

    def field(self, name):
        every = (f for section in sections(self.editor) for f in section.fields)
        return next(f for f in every if f.name == f"volumes.{name}")


@pytest.fixture
def bench():
    made = Bench()
    yield made
    assert made.hand.failures == []
    made.editor.remove()


def told(text: str) -> int | None:
    """Return by how many per cent the arm has changed, as *text* says."""
    found = re.search(r"Arm ([+-]\d+) %", text)
    return None if found is None else int(found[1])


def test_the_change_of_the_pulled_region_is_told_in_every_frame(bench):
    seen = []
    for _ in bench.begin():
        seen.append((told(bench.editor.status) or 0, 100.0 * bench.change()))
    shown, true = np.array(seen).T
    assert np.abs(shown - true).max() <= 0.5
    assert np.abs(true).max() > 2.0
    assert told(status(bench.editor).hint) == round(100.0 * bench.change())
    assert ("Shift+P", "keep_part") in {(w.text, w.action) for w in status(bench.editor).words}
    bench.session.undo()
    assert told(bench.editor.status) is None


def test_a_part_is_kept_by_a_key_through_later_pulls_and_set_free_again(bench):
    bench.pull()
    before, change = bench.session.vertices, bench.change()
    assert abs(change) > 0.02
    bench.hand.types("shift+p")
    bench.editor.wait()
    bench.settle()
    assert abs(bench.change()) < EXACT
    assert bench.editor.status.startswith("Volume of arm kept")
    assert (bench.field("keep_part").label, bench.field("keep_part").value) == ("Keep arm", True)
    for _ in bench.begin(2.2):
        assert abs(bench.change()) < EXACT
    assert abs(bench.change()) < EXACT
    bench.session.undo()
    bench.hand.types("shift+p")
    bench.editor.wait()
    bench.settle()
    assert bench.session.options.volumes == ()
    assert not bench.field("keep_part").value
    assert_allclose(bench.session.vertices, before, atol=1e-3 * SCENE.mesh.diagonal)
    bench.hand.types("ctrl+z")
    assert bench.session.options.volumes == (("region 1", "keep"),)


def test_a_part_grows_by_a_fifth_of_its_volume_at_rest_at_each_press(bench):
    volumes = bench.session.volumes()
    rest = volumes["whole"] - volumes["region 1"]
    bench.pull()
    change, steps = round(bench.change(), 2), len(bench.session.history.labels)
    assert change < -0.02
    for count in (1, 2):
        bench.hand.types("e")
        bench.editor.wait()
        assert_allclose(bench.change(), change + 0.2 * count, atol=EXACT)
        volumes = bench.session.volumes()
        assert_allclose(volumes["whole"] - volumes["region 1"], rest, rtol=EXACT)
    assert bench.session.history.labels[steps:] == ("set the volume of arm",) * 2
    bench.hand.types("ctrl+z")
    assert_allclose(bench.change(), change + 0.2, atol=EXACT)
    assert press(bench.editor, "volumes.grow_part") is None
    bench.editor.wait()
    assert_allclose(bench.change(), change + 0.4, atol=EXACT)
    for expected in ((), (("region 1", "keep"),)):
        assert press(bench.editor, "keep_part") is None  # in the toolbar
        bench.editor.wait()
        assert bench.session.options.volumes == expected


def test_the_part_under_the_pointer_grows_and_the_line_tells_what_the_whole_gains(bench):
    front = SCENE.mesh.vertices[:, 1] < 0.0
    away = np.linalg.norm(SCENE.mesh.vertices[:, ::2] - [-1.8, 0.0], axis=1)
    bench.pull()  # of the arm
    bench.hand.move(
        np.round(bench.hand.at(bench.session.vertices[np.where(front, away, 9.0).argmin()]))
    )
    bench.hand.types("e")
    bench.editor.wait()
    assert bench.session.history.undo_label == "set the volume of region 1"
    assert_allclose(
        bench.session.volume("region 0")[1], round(bench.session.volume("region 0")[1], 2)
    )
    told = re.search(r"The whole has changed by (\+\d+) %", bench.editor.status)
    assert int(told[1]) == round(100.0 * bench.session.volume_change) > 0
    press(bench.editor, "volumes.name", "whole")
    press(bench.editor, "volumes.goal", "keep")
    bench.editor.wait()
    assert abs(bench.session.volume_change) < EXACT
    bench.hand.types("e")
    bench.editor.wait()
    told = re.search(r"The rest has changed by (-\d+) %", bench.editor.status)
    assert int(told[1]) == round(100.0 * bench.change())


def test_with_volumes_kept_per_region_the_key_sets_the_part_free(bench):
    bench.session.change_options(preserve_region_volumes=True)
    bench.pull()
    assert abs(bench.change()) < EXACT
    assert bench.field("keep_part").value
    press(bench.editor, "volumes.keep_part", False)
    bench.editor.wait()
    assert bench.editor.status.startswith("Volume of arm free")
    bench.pull(2.2)
    assert abs(bench.change()) > 0.02


def test_without_a_part_under_the_hand_nothing_changes_and_the_line_says_why(bench):
    state = bench.session.state
    for key in ("shift+p", "e"):
        bench.hand.types(key)
        assert "Point at a part of the surface" in bench.editor.status
        bench.hand.failures.pop()
    assert not {f.name: f for f in toolbar(bench.editor)}["keep_part"].enabled
    assert not bench.field("keep_part").enabled
    assert bench.session.state is state


def test_a_dragged_handle_tells_the_change_of_its_region(bench):
    session = bench.session
    session.set_fixed(SCENE.fixed)
    session.handles.add(SCENE.handle)
    bench.editor.mode = Mode.DEFORM
    bench.editor.wait()
    centre = np.array(bench.hand.at(bench.editor.widgets.dragger.gizmo.centre))
    bench.hand.press(centre)
    for k in range(1, 8):
        bench.hand.move(centre - [8 * k, 0])
    assert told(bench.editor.status) == round(100.0 * bench.change())
    assert abs(bench.change()) > 0.02
    bench.hand.key("Escape")
    bench.hand.release()
    assert_array_equal(session.vertices, SCENE.mesh.vertices)


def test_the_slider_of_a_cavity_fits_cages_in_the_background_and_is_one_step():
    x, faces = icosphere(2)
    session = Session(combined(Mesh(x, faces), Mesh(0.7 * x, faces)))
    session.segment()
    session.fit_cages()
    session.bind()
    editor = DeformEditor(plain_view(), session)
    editor.mode = Mode.DEFORM
    draw_seldom(editor.view)
    editor.On()
    press(editor, "volumes.name", "cavity")
    for share in (-10, -15, -20):
        press(editor, "volumes.change", share)
        assert editor.is_busy
        editor.wait()
    assert session.history.labels[-2:] == ("fit cages", "set the volume of cavity")
    assert session.volume("cavity")[1] == pytest.approx(-0.2, abs=EXACT)
    assert not len(session.solution.crossings())
    editor.remove()
