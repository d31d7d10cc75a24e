"""The actions behind the keys of the editor.

Every action is a function of the `Controller`; `bindings` names them and assigns keys.  Long
operations are started as jobs.  An action reports its result in the status line unless the view
shows it.

Long because nearly every key has its function here.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from vtk_segdeform.arrays import BoolArray
from vtk_segdeform.cages import Cage
from vtk_segdeform.deformer import LOCALITY
from vtk_segdeform.errors import CageError, ConstraintError, RegionError, SessionError
from vtk_segdeform.geometry import FREE
from vtk_segdeform.progress import Progress, part
from vtk_segdeform.regions import Regions
from vtk_segdeform.regions import segment as find_regions
from vtk_segdeform.session import (
    FinishedPose,
    Session,
    State,
    blend_label,
    finishing,
    load_session,
    preparing,
    separating,
    solving,
    volume_label,
)

from ..handle_dragger import STEPS, locked_components
from ..region_selector import Paint, RegionSelector
from ..scene import Phase, SurfaceStyle
from ..volume_overlay import signed
from .controller import Controller
from .finishing import measured
from .session_file import is_mesh, pose_remark, write_posed
from .widget_set import Mode, Spot

_GROWTH = 20  # per cent of the volume of a part at rest, at each press
_NOTICED = 0.005  # relative change of a volume that a whole number of per cent shows

Action = Callable[[Controller], None]
Then = Callable[[], str | None]


def to_mode(mode: Mode) -> Action:
    """Return the action that enters *mode*."""

    def enter(controller: Controller) -> None:
        controller.mode = mode

    return enter


def assigning(owner: Callable[[Controller], object], name: str, value: object) -> Action:
    """Return the action that sets an attribute of what *owner* returns, such as a widget."""
    return lambda controller: setattr(owner(controller), name, value)


def selector_of(controller: Controller) -> RegionSelector:
    """Return the selector, with the tools of painting."""
    return controller.widgets.selector


def painting(target: Paint) -> Action:
    """Return the action that selects the *target* of painting."""

    def paint(controller: Controller) -> None:
        selector_of(controller).paints = target
        controller.widgets.show(controller.mode)

    return paint


# In all modes.


def undo(controller: Controller) -> None:
    """Undo the last step."""
    puller = controller.widgets.puller
    if puller.waiting.has_pull and puller.cancel():
        controller.say("Undo: pull")
        return
    history, label = controller.history, controller.history.undo_label
    if label:
        history.jump(history.position - 1)
    controller.say(f"Undo: {label}" if label else "Nothing to undo")


def redo(controller: Controller) -> None:
    """Redo the last undone step."""
    history, label = controller.history, controller.history.redo_label
    if label:
        history.jump(history.position + 1)
    controller.say(f"Redo: {label}" if label else "Nothing to redo")


def reset(controller: Controller) -> None:
    """Reset the pose."""
    controller.session.reset_pose()
    controller.say("Pose reset")


def finish(controller: Controller) -> None:
    """Finish the pose on the mesh."""
    session = controller.session

    def accept(result: FinishedPose) -> str:
        is_same = controller.finishing.accept(result)
        return "Pose finished on the mesh" if is_same else "The pose changed; it was not finished"

    controller.start(
        "Finishing on the mesh", measured(finishing.finish(session.poses, session.state)), accept
    )


def save(controller: Controller) -> None:
    """Save to the editor's file; another existing file is replaced only if confirmed."""
    question = f"{controller.file.path} already exists. Save again to replace it"
    if controller.file.may_overwrite or controller.messages.confirms(question):
        once_settled(Controller.save)(controller)


def once_settled(action: Action) -> Action:
    """Return the action that waits until the pose has settled."""
    return lambda controller: controller.once_settled(lambda: action(controller))


def opening(path: Path) -> Action:
    """Return the action that opens a session or a mesh."""
    return lambda controller: controller.open(path)


def saving(path: Path, then: Callable[[], object] = lambda: None) -> Action:
    """Return the action that saves the session to *path*, which becomes its file.

    A pose that still converges is saved once it has settled, and *then* is called.
    """

    def save(controller: Controller) -> None:
        controller.file.path = path
        controller.save()
        then()

    def save_session(controller: Controller) -> None:
        if is_mesh(path):
            raise SessionError(
                f"{path.name} is the name of a mesh. Choose Save mesh as, or a name in .segdeform"
            )
        once_settled(save)(controller)

    return save_session


def exporting(path: Path, then: Callable[[], object] = lambda: None) -> Action:
    """Return the action that writes the surface in the pose, otherwise as it was given.

    The suffix selects the format, which may not support all arrays: see `io.write_mesh`; what is
    left out is said.  What the session carries along is written beside it.  The file is then read
    again in another thread, see `Controller.read_again`.
    A pose that still converges is written once it has settled, and *then* is called.
    """

    def export(controller: Controller) -> None:
        session = controller.session
        if session.is_dragging:
            raise SessionError("Finish the drag before saving the mesh")
        controller.finishing.interrupt()
        written = write_posed(session, path, displacement=controller.displacement)
        remarks = *written.remarks, *controller.file.write_carried(session, path.parent)
        written = replace(written, remarks=remarks)
        controller.say(". ".join([f"Mesh saved to {path}{pose_remark(session)}", *remarks]))
        controller.read_again(written)
        then()

    return once_settled(export)


def saving_displacement(name: str | None) -> Action:
    """Return the action that adds the displacement to saved meshes, as an array *name*, or not."""
    return assigning(lambda controller: controller, "displacement", name)


def open_file(controller: Controller) -> None:
    """Open the editor's file; unsaved changes are discarded only if confirmed."""
    path = controller.file.path
    question = f"Unsaved changes will be lost. Open again to continue with {path}"
    if not controller.is_modified or controller.messages.confirms(question):
        controller.open(path)


def segment(controller: Controller, n_regions: int | None = None) -> None:
    """Segment the mesh into regions, *n_regions* if given."""
    session, widgets = controller.session, controller.widgets

    def show(regions: Regions) -> str:
        before = session.state
        session.set_regions(regions, label="auto-segment")
        widgets.choose_region(min(widgets.selector.region, regions.n_regions - 1))
        return f"{_count(regions.n_regions, 'region')} found{_reset(controller, before)}"

    def work(progress: Progress) -> Regions:
        follows = preparing.following(session.mesh, session.state)
        return find_regions(session.mesh, n_regions, progress=progress, **follows)

    controller.start("Detecting regions", work, show)


def attaching(component: int, carrier: str, label: str) -> Action:
    """Return the action that lets a *component* follow another one: its number, "free", "auto".

    *label* names the undo step, and what has happened.
    """

    def attach(controller: Controller) -> None:
        session, before = controller.session, controller.session.state
        wanted = {k: other for k, other in before.options.attach if k != component}
        if carrier != "auto":
            wanted[component] = carrier if carrier == FREE else int(carrier)

        work = partial(separating.attached, session.poses, before, wanted)
        _start_step(controller, "Fitting cages", work, label, lambda: _sentence(label))

    return attach


def fit_cages(controller: Controller, n_cage_vertices: int | None = None) -> None:
    """Fit cages to the regions, with *n_cage_vertices* in total if given."""
    session, regions = controller.session, controller.session.regions
    if regions is None:
        raise RegionError(f"No regions to fit cages to. {_detecting(controller)}, or paint one")

    def work(progress: Progress) -> tuple[Sequence[Cage], Any]:
        state, x = preparing.sized(session.state, n_cage_vertices), session.vertices
        cages = preparing.fitted(session.mesh, state, part(progress, 0.0, 0.4))
        if state.pose is None or session.regions is not regions:  # changed in another view
            return cages, None
        after, rest = replace(state, cages=cages).at_rest(), part(progress, 0.4, 1.0)
        return cages, solving.carried(session.poses, after, x, rest)

    def show(found: tuple[Sequence[Cage], Any]) -> str:
        cages, posed = found
        if session.regions is not regions:
            again = f"Press {controller.keys.cap('fit_cages')} to refit"
            raise RegionError(f"The regions changed while cages were being fitted. {again}")
        before, fit = session.state, partial(session.set_cages, cages, label="fit cages")
        try:
            fit(n_cage_vertices=n_cage_vertices, posed=posed)
        except ConstraintError:  # they cannot have the pose
            fit(n_cage_vertices=n_cage_vertices)
        count, total = _count(len(cages), "cage"), sum(cage.n_vertices for cage in cages)
        return f"{count} fitted, {total} vertices in total{_reset(controller, before)}"

    controller.start("Fitting cages", work, show)


def _start_step(
    controller: Controller,
    name: str,
    work: Callable[[Progress], State],
    label: str,
    then: Then = lambda: None,
    *,
    join: bool = False,
) -> None:
    """Start the job *name*, whose result is the state of a step called *label*; *then* follows.

    If it is to *join*, it becomes part of the step before it with the same label.
    """
    session, before = controller.session, controller.session.state

    def show(after: State) -> str | None:
        if session.state is not before:  # changed in another view of the same session
            raise SessionError("The session changed meanwhile. Try again")
        if join:
            session.history.move(after)
            session.commit(label, join=True)
        else:
            session.history.step(label, after)
        return then()

    controller.start(name, work, show)


def _reset(controller: Controller, before: State) -> str:
    """Return what to say if the step from *before* has reset the pose, or ""."""
    if before.pose is None or controller.session.state.pose is not None:
        return ""
    return f". The pose was reset; {controller.keys.cap('undo')} brings it back"


def toggle_cages(controller: Controller) -> None:
    """Show cages in all modes, or in their own mode only."""
    if not controller.session.cages:
        fitting = f"Press {controller.keys.cap('fit_cages')} to fit them to the regions"
        raise CageError(f"No cages to show yet. {fitting}")
    controller.widgets.cages_wanted = not controller.widgets.cages_wanted
    controller.widgets.show(controller.mode)
    controller.say("Cages shown" if controller.widgets.cages.is_shown else "Cages hidden")


def toggle_regions(controller: Controller) -> None:
    """Show the outlines and numbers of the regions in all modes, or only while painting them."""
    if controller.session.regions is None:
        paint = f"{controller.keys.cap('regions')} to paint one"
        raise RegionError(f"No regions to show yet. {_detecting(controller)}, or {paint}")
    widgets = controller.widgets
    widgets.regions_wanted = not widgets.regions_wanted
    widgets.show(controller.mode)
    controller.say("Regions shown" if widgets.regions_wanted else "Regions hidden")


def next_style(controller: Controller) -> None:
    """Draw the surface in the next style: shaded, shaded with edges, wireframe."""
    surface, styles = controller.widgets.surface, [*SurfaceStyle]
    surface.style = styles[(styles.index(surface.style) + 1) % len(styles)]
    controller.say(surface.style.value)


def show_rest(controller: Controller) -> None:
    """Show the mesh at rest while the key is held; the session is unchanged."""
    controller.show_instead(controller.session.mesh.vertices, "The mesh at rest, while held")


def toggle_overlay(controller: Controller) -> None:
    """Show or hide the local volume change."""
    controller.widgets.overlay_wanted = not controller.widgets.overlay_wanted
    controller.widgets.show(controller.mode)
    controller.prepare()  # which shows the overlay once it is ready


def toggle_volume(controller: Controller) -> None:
    """Turn volume preservation on or off."""
    session = controller.session
    if not session.has_volume:
        raise SessionError(session.volume_summary)
    session.change_options(preserve_volume=not session.options.preserve_volume)
    is_on = session.options.preserve_volume
    controller.say(f"Volume preservation {'on from the next move' if is_on else 'off'}")


def toggle_notices(controller: Controller) -> None:
    """Show or hide where the mesh differs from what was given, and its holes."""
    if not controller.notices.toggle():
        controller.say("The mesh is closed and exactly as given: nothing to show")


def cancel(controller: Controller) -> None:
    """Cancel the job, the drag or the stroke, or close the help card."""
    controller.show_instead(None)
    controller.cancel()


def looking_from(name: str) -> Action:
    """Return the action that shows the model from a view: "front", "top" or another of `VIEWS`."""
    return lambda controller: controller.camera.viewpoint.look_from(name)


def frame_selection(controller: Controller) -> None:
    """Frame the selected region or handle, or else all."""
    controller.camera.frame_selection(controller.mode)


def frame_all(controller: Controller) -> None:
    """Frame the model."""
    controller.camera.viewpoint.frame()


def toggle_projection(controller: Controller) -> None:
    """Switch between perspective and orthographic projection."""
    is_orthographic = controller.camera.viewpoint.toggle_projection()
    controller.say("Orthographic" if is_orthographic else "Perspective")


# Pulling.


def changing_locality(change: float) -> Action:
    """Return the action that makes the next pull more local by *change*, or less."""

    def make_local(controller: Controller) -> None:
        puller = controller.widgets.puller
        before = LOCALITY if puller.locality is None else puller.locality
        puller.locality = min(max(round(before + change, 1), 0.0), 1.0)
        controller.say(f"Locality: {100.0 * puller.locality:.0f} %")

    return make_local


def changing_limb(steps: int) -> Action:
    """Return the action that lets the next pull move a larger limb, or a smaller one."""
    return lambda controller: controller.say(controller.widgets.puller.change_limb(steps))


def next_hinge(controller: Controller) -> None:
    """Let limbs bend along their length, half at their joint, or at their joint only."""
    puller = controller.widgets.puller
    puller.hinge = 0.0 if puller.hinge == 1.0 else 0.5 if puller.hinge < 0.5 else 1.0
    controller.say(f"Hinge: {100.0 * puller.hinge:.0f} %")


def auto_locality(controller: Controller) -> None:
    """Let pins decide how local a pull is, and the radius which limb it moves."""
    controller.widgets.puller.locality = controller.widgets.puller.limb = None
    controller.say("Locality: auto")


def unpin_all(controller: Controller) -> None:
    """Remove all pins and pulled points."""
    names = controller.widgets.puller.marked
    if not names:
        raise ConstraintError("No pins to remove. Shift-click the surface to add one")
    controller.session.handles.remove(*names)
    controller.say(f"Removed {_count(len(names), 'point')}")


# The volume of the part under the hand: of the region under the pointer, or else of the last pulled
# point or active handle.


def _part_under_hand(controller: Controller) -> str | None:
    spot = controller.widgets.spot_at(controller.view.pointer(Phase.HOVER))
    is_over = spot is not None and spot.region is not None
    return f"region {spot.region}" if spot and is_over else controller.widgets.part


def keep_part(controller: Controller) -> None:
    """Keep the volume of the part under the hand as at rest; if it has a goal, no longer."""
    keeping(_part_under_hand(controller))(controller)


def keeping(part: str | None) -> Action:
    """Return the action that keeps the volume of *part* as at rest; if it has a goal, no longer."""

    def keep(controller: Controller) -> None:
        name, session = _checked_part(controller, part), controller.session
        goal: str | None = "free" if session.options.preserve_region_volumes else "keep"
        if name in dict(session.options.volumes):
            goal = None

        def told() -> str:
            is_kept = controller.widgets.keeps(name)
            label = volume_label(session.state.region_names, name)
            return f"Volume of {label} {'kept' if is_kept else 'free'}"

        setting_volume(name, goal, then=told)(controller)

    return keep


def grow_part(controller: Controller) -> None:
    """Let the part under the hand have 20 % more of its volume at rest than now, in whole %."""
    growing(_part_under_hand(controller))(controller)


def growing(part: str | None) -> Action:
    """Return the action that lets *part* have 20 % more of its volume at rest than now."""

    def grow(controller: Controller) -> None:
        name, session = _checked_part(controller, part), controller.session
        goal = round(100.0 * session.volume(name)[1]) + _GROWTH
        then = partial(_change_beyond, session, name)
        setting_volume(name, f"{goal:+}%", then=then)(controller)

    return grow


def _change_beyond(session: Session, name: str) -> str | None:
    """Return how the whole, or else the rest of it, has changed with the volume of a part."""
    (whole, change), (own, own_change) = session.volume("whole"), session.volume(name)
    if abs(change) > _NOTICED:
        keep = "To keep its volume: Volumes, Whole, goal Kept"
        return f"The whole has changed by {signed(100.0 * change, 0)} %. {keep}"
    rest = (whole - own) / (whole / (1.0 + change) - own / (1.0 + own_change)) - 1.0
    if abs(rest) > _NOTICED:
        keep = "To keep that instead: Volumes, Whole, goal As by default"
        return f"The rest has changed by {signed(100.0 * rest, 0)} %: the whole is kept. {keep}"
    return None


def setting_volume(
    name: str, goal: str | None, *, join: bool = False, then: Then = lambda: None
) -> Action:
    """Return the action that sets the goal of a volume in the background, or with None has none.

    With *join*, successive changes are one undo step.  *then* returns what to say.
    """

    def change(controller: Controller) -> None:
        session, state = controller.session, controller.session.state
        goals: dict[str, str | float] = dict(state.options.volumes)
        if goals.get(name) == goal:
            return
        goals = {each: own for each, own in goals.items() if each != name}
        if goal is not None:
            goals[name] = goal

        def work(progress: Progress) -> State:
            first, last = part(progress, 0.0, 0.5), part(progress, 0.5, 1.0)
            after = separating.with_goals(session.poses, state, goals, first)
            return solving.settled(session.poses, after, last)

        def finish() -> str | None:
            session.refine(max_steps=STEPS)  # and with it, whether it has settled is known
            _settle(controller)
            return then()

        label = volume_label(state.region_names, name)
        step = f"{'forget' if goal is None else 'set'} the volume of {label}"
        _start_step(controller, f"Volume of {label}", work, step, finish, join=join)

    return change


def _settle(controller: Controller) -> None:
    """Let the pose converge in the next moments, and be finished unless it is that of a pull."""
    controller.widgets.resume_refining()
    if controller.session.state.locality is None:
        controller.finishing.rest()


def _checked_part(controller: Controller, part: str | None) -> str:
    """Return *part* if it has a volume."""
    session = controller.session
    if session.bodies is None:
        raise SessionError("The mesh is not ready yet. Wait until it is prepared")
    if part is None:
        raise ConstraintError("Point at a part of the surface, or select a handle")
    if part not in session.volume_names:
        raise ConstraintError(
            f"{volume_label(session.state.region_names, part)} encloses no volume"
        )
    return part


# What the menu of the right button does at a place.


def resetting(region: int) -> Action:
    """Return the action that moves a region back to rest, while the others follow."""

    def reset_part(controller: Controller) -> None:
        session = controller.session
        label = f"reset {session.painting.name(region)}"
        work = partial(solving.with_region_at_rest, session.poses, session.state, region)
        _start_step(controller, "Resetting", work, label, lambda: _sentence(label))

    return reset_part


def pinning(vertex: int) -> Action:
    """Return the action that pins a vertex, or removes the handle there."""

    def pin(controller: Controller) -> None:
        controller.widgets.puller.toggle_pin(vertex)
        controller.say(controller.widgets.puller.remark)

    return pin


def next_up_axis(controller: Controller) -> None:
    """Show the model upright about the next axis."""
    turning_up((int(controller.camera.viewpoint.up.argmax()) + 1) % 3)(controller)


def turning_up(axis: int) -> Action:
    """Return the action that makes an axis the up axis, and shows the model upright."""

    def turn_up(controller: Controller) -> None:
        controller.camera.viewpoint.up = np.eye(3)[axis]
        controller.camera.is_up_unsure = False
        controller.camera.viewpoint.look_from("home")
        controller.say(f"Up: {'XYZ'[axis]}. {controller.keys.cap('next_up_axis')}: next axis")

    return turn_up


def isolating(spot: Spot) -> Action:
    """Return the action that hides all but the part at *spot*, or shows everything again."""

    def isolate(controller: Controller) -> None:
        widgets, session = controller.widgets, controller.session
        if widgets.surface.only is not None:
            widgets.show_only(None)
            controller.say("Everything is shown")
            return
        widgets.show_only(widgets.mask_of(spot))
        name = "this part" if spot.region is None else session.painting.name(spot.region)
        controller.say(f"Only {name} is shown. {controller.keys.cap('isolate')}: show everything")

    return isolate


def isolate(controller: Controller) -> None:
    """Hide all but the part under the pointer, or show everything again."""
    widgets = controller.widgets
    spot = widgets.spot_at(controller.view.pointer(Phase.HOVER))
    if spot is None and widgets.surface.only is None:
        raise ConstraintError("Point at the part to isolate")
    isolating(spot or Spot(0, None, None))(controller)


def framing(spot: Spot) -> Action:
    """Return the action that frames the part at *spot*."""
    return lambda c: c.camera.viewpoint.frame(c.widgets.part_of(spot))


# Bodies, by their vertices, a mask (n,), and their names: "Body 2".


def hide_body(controller: Controller) -> None:
    """Hide the body under the pointer."""
    hiding(*_body_under_pointer(controller, "hide"), hidden=True)(controller)


def hiding(body: BoolArray, name: str, *, hidden: bool) -> Action:
    """Return the action that hides a *body*, as `isolating` does, or shows it again."""

    def hide(controller: Controller) -> None:
        only = controller.widgets.surface.only
        shown = np.ones(len(body), dtype=bool) if only is None else only
        controller.widgets.show_only(shown & ~body if hidden else shown | body)
        everything = f" hidden. {controller.keys.cap('isolate')}: show everything"
        controller.say(f"{name} is{everything if hidden else ' shown'}")

    return hide


def lock_body(controller: Controller) -> None:
    """Lock the body under the pointer, or unlock it."""
    body, name = _body_under_pointer(controller, "lock")
    locking(body, name, locked=not is_locked(controller.session, body))(controller)


def locking(body: BoolArray, name: str, *, locked: bool) -> Action:
    """Return the action that fixes a *body* where it is, or lets it move again.

    Handles on it keep their places; while it is locked, they cannot be grabbed.  With a symmetry,
    its mirror image is locked as well.
    """

    def lock(controller: Controller) -> None:
        session, state = controller.session, controller.session.state
        mirror = session.poses.mirror(state)
        own = body if mirror is None else body | body[mirror.mates]
        ids = np.flatnonzero(own)
        fixed = np.setdiff1d(state.fixed, ids)
        if locked:
            fixed = np.union1d(state.fixed, np.setdiff1d(ids, state.handle))

        work = partial(separating.with_fixed, session.poses, state, fixed)
        outcome = f"{name} is {'locked' if locked else 'unlocked'}"
        verb = "lock" if locked else "unlock"
        label = f"{verb} {name[:1].lower()}{name[1:]}"
        _start_step(controller, f"{_sentence(verb)}ing {name}", work, label, lambda: outcome)

    return lock


def is_locked(session: Session, body: BoolArray) -> bool:
    """Return whether all vertices of a *body*, a mask (n,), are fixed, but for those in handles."""
    return bool(locked_components(session)[session.mesh.components[body]].all())


def _body_under_pointer(controller: Controller, verb: str) -> tuple[BoolArray, str]:
    session = controller.session
    bodies, components = session.bodies, session.mesh.components
    if bodies is None:
        raise SessionError("The mesh is not ready yet. Wait until it is prepared")
    spot = controller.widgets.spot_at(controller.view.pointer(Phase.HOVER))
    number = -1 if spot is None else int(bodies.of_component[components[spot.vertex]])
    if number < 0:
        raise ConstraintError(f"Point at the body to {verb}")
    body = np.asarray(bodies.of_component[components] == number)
    if body.all():
        raise ConstraintError(f"The mesh is a single body: there is none to {verb}")
    return body, _sentence(volume_label(session.state.region_names, f"body {number}"))


# Saved poses.


def save_pose(controller: Controller) -> None:
    """Save the current pose by a new name."""
    name = controller.session.saved_poses.save()
    controller.say(f"Saved {name}. F2 renames it in the list")


def copying_poses(path: Path) -> Action:
    """Return the action that saves the poses of a session file here, as poses of this mesh."""

    def copy(controller: Controller) -> None:
        session, before = controller.session, controller.session.state

        def work(_: Progress) -> dict[str, State]:
            return session.saved_poses.copied(load_session(path))

        def show(after: dict[str, State]) -> str:
            if session.state is not before:  # changed in another view of the same session
                raise SessionError("The session changed while poses were being copied. Try again")
            names = session.saved_poses.add(after)
            return f"Copied {_count(len(names), 'pose')}. Select one in the list of poses"

        controller.start("Copying poses", work, show)

    return copy


def going_to(name: str) -> Action:
    """Return the action that lets the mesh have a saved pose."""

    def go(controller: Controller) -> None:
        saved = controller.session.saved_poses
        if saved.has_cages(name):
            saved.apply(name)
        else:
            work, label = lambda _: saved.applied(name), f"go to {name}"
            _start_step(controller, "Fitting the pose to other cages", work, label)

    return go


def blending(first: str | None, second: str | None, share: float) -> Action:
    """Return the action that shows a pose between two; moves of a slider are one undo step."""

    def blend(controller: Controller) -> None:
        session = controller.session
        session.saved_poses.blend(first, second, share, max_steps=STEPS)
        session.commit(blend_label(first, second), join=True)
        if 0.0 < share < 1.0:  # the ends are as they were saved
            _settle(controller)

    return blend


# Landmarks.


def toggle_landmarks(controller: Controller) -> None:
    """Let a press on the surface add a landmark, or no longer."""
    marks = controller.widgets.landmarks
    marks.adds = not marks.adds
    if marks.adds:
        marks.is_hidden = False
    else:
        controller.say("Landmarks are no longer added")


def fitting_landmarks(*, keep_volume: bool) -> Action:
    """Return the action that fits the mesh to its landmarks, in the background."""

    def fit(controller: Controller) -> None:
        session, before = controller.session, controller.session.state
        volume = "keep" if keep_volume else "free"

        def show(after: State) -> str:
            if session.state is not before:  # changed in another view of the same session
                raise SessionError("The session changed while it was being fitted. Try again")
            session.history.step("fit landmarks", after)
            return f"Fitted to {_count(len(session.landmarks), 'landmark')}"

        def work(progress: Progress) -> State:
            return session.landmarks.fitted(volume, progress).state

        controller.start("Fitting landmarks", work, show)

    return fit


def loading_landmarks(path: Path, *, targets: bool) -> Action:
    """Return the action that reads landmarks, or their targets, from a file."""

    def load(controller: Controller) -> None:
        lacking = controller.session.landmarks.read(path, targets=targets)
        controller.widgets.landmarks.is_hidden = False
        what = _count(len(controller.session.landmarks), "landmark")
        if not lacking:
            controller.say(f"{what}, all with targets")
        else:
            more = "" if len(lacking) == 1 else f" and {len(lacking) - 1} more"
            controller.say(f"{what}; without a point or a target: {lacking[0]}{more}")

    return load


def saving_landmarks(path: Path, *, targets: bool) -> Action:
    """Return the action that writes the landmarks, at rest, or their targets, to a file."""

    def save(controller: Controller) -> None:
        controller.session.landmarks.write(path, targets=targets)
        controller.say(f"Saved to {path}")

    return save


def carrying(paths: Sequence[Path]) -> Action:
    """Return the action that carries files along with the mesh."""

    def carry(controller: Controller) -> None:
        names = controller.session.carried.add(*paths)
        what = names[0] if len(names) == 1 else f"{len(names)} files"
        controller.say(f"The mesh carries {what} along")

    return carry


def saving_carried(name: str, path: Path) -> Action:
    """Return the action that writes a carried file in the pose, once that has settled."""

    def save(controller: Controller) -> None:
        controller.session.carried.write(name, path)
        controller.say(f"Saved to {path}")

    return once_settled(save)


# Painting.


def toggle_through(controller: Controller) -> None:
    """Select hidden vertices too, or the visible surface only."""
    selector = controller.widgets.selector
    selector.through = not selector.through
    if not selector.through:  # otherwise the hint says so
        controller.say("Visible surface only")


def select_all(controller: Controller) -> None:
    """Add all vertices that are free to the painted region, fixed vertices or handle."""
    selector = controller.widgets.selector
    selector.select_all()
    if selector.remark:
        controller.say(selector.remark)


def toggle_stiffness(controller: Controller) -> None:
    """Paint the stiffness of the surface instead of regions, or regions again."""
    is_on = controller.widgets.selector.paints is Paint.STIFFNESS
    painting(Paint.REGION if is_on else Paint.STIFFNESS)(controller)


def painting_stiffness(stiffness: float) -> Action:
    """Return the action that selects a *stiffness* for painting."""

    def choose(controller: Controller) -> None:
        controller.widgets.selector.stiffness = stiffness
        painting(Paint.STIFFNESS)(controller)

    return choose


def next_region(controller: Controller) -> None:
    """Select the next region for painting."""
    painting(Paint.REGION)(controller)
    widgets = controller.widgets
    widgets.choose_region((widgets.selector.region + 1) % max(1, widgets.n_regions))


def new_region(controller: Controller) -> None:
    """Start painting a new region."""
    painting(Paint.REGION)(controller)
    controller.widgets.choose_region(controller.widgets.n_regions)


def merge_region(controller: Controller) -> None:
    """Merge the selected region with the one under the pointer."""
    selector = controller.widgets.selector
    _require_regions(controller, "merge")
    other = selector.region_under_pointer()
    if other is None or other == selector.region:
        raise RegionError(
            f"Point at the region to merge with {controller.session.painting.name(selector.region)}"
        )
    merging([selector.region, other])(controller)


def merging(regions: Sequence[int]) -> Action:
    """Return the action that merges two or more *regions*."""

    def merge(controller: Controller) -> None:
        *names, last = map(controller.session.painting.name, sorted(regions))
        controller.session.painting.merge(sorted(regions))
        controller.widgets.choose_region(min(regions))
        controller.say(f"Merged {', '.join(names)} and {last}")

    return merge


def split_region(controller: Controller) -> None:
    """Split the selected region in two."""
    _require_regions(controller, "split")
    region = controller.widgets.selector.region
    controller.session.painting.split(region)
    controller.say(f"Split {controller.session.painting.name(region)}")


# Handles.


def next_handle(controller: Controller) -> None:
    """Select the next handle, for painting or dragging."""
    names = _handle_names(controller)
    widgets = controller.widgets
    tool: Any = widgets.dragger if controller.mode is Mode.DEFORM else widgets.selector
    here = names.index(tool.handle) if tool.handle in names else -1
    tool.handle = names[(here + 1) % len(names)]
    widgets.selector.paints = Paint.HANDLE


def new_handle(controller: Controller) -> None:
    """Start painting a new handle."""
    controller.widgets.selector.paints = Paint.HANDLE
    controller.widgets.selector.handle = None


def remove_handle(controller: Controller) -> None:
    """Remove the selected handle."""
    name = _selected_handle(controller)
    controller.session.handles.remove(name)
    controller.say(f"Removed {name}")


def toggle_local_axes(controller: Controller) -> None:
    """Let the axes of the gizmo rotate with the handle, or use those of the world."""
    dragger = controller.widgets.dragger
    dragger.local = not dragger.local
    controller.say(f"Axes: {'local' if dragger.local else 'global'}")


def move_pivot(controller: Controller) -> None:
    """Move the pivot of the handle to the surface under the pointer; beside it, reset it."""
    name, session = _selected_handle(controller), controller.session
    point = controller.widgets.point_at(controller.view.pointer(Phase.HOVER))
    if point is None and name not in session.state.pivots:
        raise ConstraintError("Point at the surface to place the pivot")
    session.handles.set_pivot(name, point)
    controller.say(f"Pivot of {name} {'reset' if point is None else 'moved'}")


def convert_handle(controller: Controller) -> None:
    """Make the pin under the pointer, or else the handle with the gizmo, a handle or a pin."""
    if controller.mode is Mode.PULL:
        name = controller.widgets.puller.marker_under_pointer()
        if name is None:
            raise ConstraintError("Point at a pin to make it a handle")
    else:
        name = _selected_handle(controller)
    converting(name)(controller)


def converting(name: str) -> Action:
    """Return the action that makes a pin or pulled point a handle, and a handle a pin."""

    def convert(controller: Controller) -> None:
        session, widgets = controller.session, controller.widgets
        if name in widgets.puller.marked:
            new = session.handles.to_patch(name, radius=widgets.puller.radius)
        else:
            new = session.handles.to_pin(name)
        widgets.selector.handle = widgets.dragger.handle = new
        controller.say(f"Converted {name} to {new}")

    return convert


def reset_pivot(controller: Controller) -> None:
    """Reset the pivot of the handle to its centre."""
    name = _selected_handle(controller)
    controller.session.handles.set_pivot(name, None)
    controller.say(f"Pivot of {name} reset")


def _selected_handle(controller: Controller) -> str:
    """Return the handle that is painted, or the one with the gizmo; raise if there is none."""
    _handle_names(controller)
    widgets = controller.widgets
    name = widgets.selector.handle if controller.mode is Mode.HANDLES else widgets.dragger.handle
    if name is None:
        key = controller.keys.cap("next_handle")
        raise ConstraintError(f"No handle selected. Press {key} to select one")
    return name


def _require_regions(controller: Controller, verb: str) -> None:
    region, count = controller.widgets.selector.region, controller.widgets.n_regions
    if not count:
        raise RegionError(f"No regions to {verb} yet. {_detecting(controller)}, or paint one")
    if region >= count:
        name = controller.session.painting.name(region)
        another = f"Press {controller.keys.cap('next_region')} to select another"
        raise RegionError(f"Cannot {verb} {name}: not painted yet. {another}")


def _handle_names(controller: Controller) -> list[str]:
    """Return the names of all handles; raise if there are none."""
    names = list(controller.session.handles)
    if not names:
        key = controller.keys.cap("paint_handle")
        raise ConstraintError(f"No handle yet. In mode 3, press {key} and paint one")
    return names


def _detecting(controller: Controller) -> str:
    return f"Press {controller.keys.cap('segment')} to detect them"


def _sentence(label: str) -> str:
    return label[:1].upper() + label[1:]


def _count(number: int, noun: str) -> str:
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"
