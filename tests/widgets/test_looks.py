"""Pictures of each widget, idle, hovered and in use, compared with reference pictures.

Pictures may differ in a few pixels, as renderers do.  After an intended change run
SEGDEFORM_NEW_LOOKS=1 python -m pytest tests/widgets/test_looks.py and check the pictures in
tests/widgets/looks.
"""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import pyvista as pv
from hands import Hand, look_from, picture, plain_view
from open_surfaces import bottle
from scenes import sausage

from vtk_segdeform import Options, Session, Surface
from vtk_segdeform.widgets import (
    CageDisplay,
    DeformEditor,
    HandleDragger,
    Mode,
    RegionSelector,
    Tool,
    VolumeOverlay,
)
from vtk_segdeform.widgets.editor import preview
from vtk_segdeform.widgets.puller import Puller
from vtk_segdeform.widgets.region_selector.region_colours import RegionColours
from vtk_segdeform.widgets.scene import set_background
from vtk_segdeform.widgets.scene.surface_display import SurfaceDisplay

LOOKS = Path(__file__).resolve().parent / "looks"
pytestmark = pytest.mark.usefixtures("bound_once")

SIZE, LARGER = (240, 160), (320, 240)
NEAR = 40  # of 255: shades may differ between renderers
MOST = 0.02  # of the pixels may differ more: text and thin lines


@pytest.fixture(scope="module")
def ready():
    scene = sausage()
    session = scene.session()
    return scene, session.state


class Scene:
    """A session in a small view, from the front, with its colours."""

    def __init__(self, ready, size=SIZE, **options):
        self.scene, state = ready
        self.session = Session(
            self.scene.mesh, state=replace(state, options=Options(**options)) if options else state
        )
        self.view = plain_view(size)
        self.surface = SurfaceDisplay(self.view, self.session)
        self.colours = RegionColours(self.surface)
        self.view.camera.SetPosition(0.0, -20.0, 4.0)
        self.view.camera.SetViewUp(0.0, 0.0, 1.0)
        self.view.renderer.ResetCamera()
        self.view.camera.Zoom(1.6)
        self.view.render()
        self.hand = Hand(self.view)

    def looks(self, name):
        """Compare the view with the reference picture *name*."""
        looks(name, self.view, self.hand)


def looks(name, view, hand):
    """Compare a view with the reference picture *name*."""
    assert hand.failures == []
    seen, path = picture(view), LOOKS / f"{name}.png"
    if os.environ.get("SEGDEFORM_NEW_LOOKS"):
        from PIL import Image

        LOOKS.mkdir(exist_ok=True)
        Image.fromarray(seen).save(path, optimize=True)
    kept = np.asarray(pv.read(path).active_scalars).reshape(*seen.shape[:2], -1)[::-1, :, :3]
    off = np.abs(seen.astype(int) - kept).max(axis=2) > NEAR
    assert off.mean() <= MOST, f"{name}: {100 * off.mean():.1f} % of the pixels are off"


def test_painting(ready):
    scene = Scene(ready)
    selector = RegionSelector(scene.view, scene.session, scene.surface, scene.colours)
    selector.On()
    selector.region, selector.radius = 1, 0.5
    scene.looks("painting-idle")
    here = scene.hand.at([-1.2, -0.7, 0.0])
    scene.hand.hover(here)
    scene.looks("painting-hover")
    scene.hand.press(here)
    scene.hand.move(scene.hand.at([-0.6, -0.7, 0.2]))
    scene.looks("painting-stroke")
    scene.hand.key("Escape")
    scene.hand.release()
    selector.tool = Tool.LASSO
    angle = np.linspace(0.0, 5.5, 20)
    way = np.add(here, 30 * np.stack([np.cos(angle), np.sin(angle)], axis=1))
    scene.hand.press(way[0])
    for place in way[1:]:
        scene.hand.move(place)
    scene.looks("painting-lasso")
    scene.hand.key("Escape")
    selector.remove()


def test_cages(ready):
    scene = Scene(ready)
    cages = CageDisplay(scene.view, scene.session)
    cages.On()
    scene.looks("cages-idle")
    corner = scene.session.cage_vertices[1]
    front = corner[np.argmin(corner[:, 1])]
    scene.hand.hover(scene.hand.at(front))
    scene.looks("cages-hover")
    scene.hand.press(scene.hand.at(front))
    scene.hand.move(np.add(scene.hand.at(front), [10, 25]))
    scene.looks("cages-drag")
    scene.hand.key("Escape")
    cages.remove()


def test_dragging(ready):
    scene = Scene(ready)
    dragger = HandleDragger(scene.view, scene.session, scene.surface)
    scene.session.bind()
    dragger.On()
    scene.looks("dragging-idle")
    centre = scene.hand.at(dragger.gizmo.centre)
    scene.hand.hover(centre)
    scene.looks("dragging-hover")
    scene.hand.press(centre)
    for share in (0.25, 0.5, 0.75, 1.0):  # each move solves a few steps only
        scene.hand.move(np.add(centre, share * np.array([-20.0, 40.0])))
    scene.session.refine()
    scene.looks("dragging-drag")
    scene.hand.key("Escape")
    dragger.remove()


@pytest.mark.parametrize("preserved", [True, False])
def test_volume(ready, preserved):
    scene = Scene(ready, preserve_volume=preserved)
    overlay = VolumeOverlay(scene.view, scene.session, scene.surface)
    overlay.show()
    if preserved:
        scene.looks("volume-rest")
    scene.session.drag(scene.scene.turned(50.0))
    scene.looks("volume-preserved" if preserved else "volume-not-preserved")
    overlay.remove()


@pytest.mark.usefixtures("unprepared")  # else the line shows how far it is
def test_notices():
    view = plain_view(SIZE)
    view.camera.SetPosition(0.0, -20.0, 4.0)
    view.camera.SetViewUp(0.0, 0.0, 1.0)
    session = Session(Surface(bottle(5)))
    editor = DeformEditor(view, session)
    view.renderer.ResetCamera()
    editor.On()
    view.render()
    hand = Hand(view)
    looks("notices-line", view, hand)
    hand.types("i")
    looks("notices-shown", view, hand)
    editor.remove()


def test_pulling(ready):
    scene = Scene(ready, LARGER)
    scene.session.bind()
    scene.colours.fill(regions=False, handles=False)
    set_background(scene.view.renderer)
    puller = Puller(scene.view, scene.session, scene.surface)
    puller.On()
    hand, start = scene.hand, np.array(scene.hand.at([1.4, -0.7, 0.1]))

    def settles(name):
        scene.session.refine()  # each move solves a few steps only
        scene.looks(name)

    hand.hover(start)
    scene.looks("pull-hover")
    hand.press(start)
    for share in (0.25, 0.5, 0.75, 1.0):
        hand.move(start + share * np.array([10.0, 45.0]))
    settles("pull-free")
    hand.key("z")
    settles("pull-axis")
    hand.key("1")
    settles("pull-number")
    hand.key("BackSpace")
    hand.key("r")
    hand.move(start + [40.0, 20.0])
    settles("pull-turn")
    hand.key("Escape")
    hand.release()
    for x in (-1.2, 0.2):
        hand.click(hand.at([x, -0.7, 0.2]), shift=True)
    scene.looks("pull-pins")
    puller.remove()


def test_the_editor(ready):
    scene, state = ready
    view = plain_view(LARGER)
    set_background(view.renderer)
    session = Session(scene.mesh, state=state)
    session.bind()  # else the line shows how far it is
    editor = DeformEditor(view, session)
    editor.show_cube = True
    editor.On()
    editor.controller.camera.viewpoint.home()
    view.render()
    hand = Hand(view)
    looks("editor-pull", view, hand)
    hand.types("shift+g")
    looks("editor-outlines", view, hand)
    hand.types("w")
    looks("editor-edges", view, hand)
    hand.types("w")
    looks("editor-wireframe", view, hand)
    hand.types("w")
    set_background(view.renderer, dark=True)
    hand.event("KeyPressEvent", key="backslash")
    looks("editor-rest", view, hand)
    hand.event("KeyReleaseEvent", key="backslash")
    hand.tick(10)
    looks("editor-dark", view, hand)
    editor.remove()


def test_the_editor_with_a_bent_body(ready):
    scene, state = ready
    view = plain_view(LARGER)
    set_background(view.renderer)
    session = Session(scene.mesh, state=state)
    session.drag(scene.turned(50.0))
    session.commit()
    (name,) = session.handles
    session.handles.set_pivot(name, [0.0, 0.0, 0.0])
    editor = DeformEditor(view, session)
    dragger = editor.widgets.dragger
    editor.On()
    editor.mode, dragger.local = Mode.DEFORM, True
    look_from(view, 0.0, -20.0, 4.0)
    hand = Hand(view)
    looks("editor-pivot", view, hand)
    hand.event("KeyPressEvent", key="backslash")
    looks("editor-before", view, hand)
    hand.event("KeyReleaseEvent", key="backslash")
    hand.tick(10)
    preview(editor.controller, 0)
    looks("editor-history", view, hand)
    preview(editor.controller, None)
    centre = np.array(hand.at(dragger.gizmo.centre))
    radius = 1.15 * dragger.gizmo.radius / view.pixel_at(dragger.gizmo.centre)
    hand.press(centre + [0.0, radius])
    for angle in (0.05, 0.1):
        place = centre + radius * np.array([np.sin(angle), np.cos(angle)])
        hand.move(place, control=True)
    looks("editor-steps", view, hand)
    hand.key("Escape")
    hand.release()
    editor.mode = Mode.HANDLES
    hand.types("r")
    hand.press(hand.at(session.vertices[np.argmin(session.vertices[:, 1])]))
    looks("editor-region", view, hand)
    hand.key("Escape")
    editor.remove()


def test_no_two_pictures_are_alike():
    kept = {
        path.stem: np.asarray(pv.read(path).active_scalars, dtype=np.int16)
        for path in LOOKS.glob("*.png")
    }
    assert len(kept) == 32
    names = sorted(kept)
    for k, name in enumerate(names):
        for other in names[:k]:
            if kept[name].shape != kept[other].shape:
                continue
            assert np.abs(kept[name] - kept[other]).max() > NEAR
