"""The actions that record the editor's input, and a video of pulls and drags."""

from __future__ import annotations

from vtk_segdeform.deformer import LOCALITY

from ..recording import Input
from ..region_selector import Tool
from .controller import Controller
from .keys import event_key
from .recordings import film_place
from .widget_set import Mode

_FILMED = Mode.PULL, Mode.DEFORM
_KEY_OF = {Tool.BRUSH: "b", Tool.LASSO: "l", Tool.RECTANGLE: "t", Tool.COMPONENT: "k",
           Tool.REGION: "r"}  # fmt: skip


def record_input(controller: Controller) -> None:
    """Start or stop a recording of the input; see `recording`."""
    recordings = controller.recordings
    if recordings.is_recording:
        controller.say(f"Recording saved to {recordings.end_recording()}")
        return
    selector = controller.widgets.selector
    keys = f"3{_KEY_OF[selector.tool]}" + "v" * selector.through + _pull_keys(controller)
    keys += str(controller.mode.value)

    def is_left_out(event: Input) -> bool:
        key = event_key(event.key, control=event.control, alt=event.alt, shift=event.shift)
        table = controller.keys
        return any(key in table[name].keys for name in ("record_input", "record_video"))

    path = recordings.start_recording(
        controller.place,
        controller.session,
        keys=keys,
        assigned=controller.keys.changes,
        skips=is_left_out,
    )
    controller.say(f"Recording input to {path}. {controller.keys.cap('record_input')} to stop")


def _pull_keys(controller: Controller) -> str:
    """Return the keys that set the radius and the locality of a pull, both rounded to a step.

    The widget gets the rounded values as well, so that the replay has the same ones.
    """
    puller = controller.widgets.puller
    steps, locality = puller.steps_of_radius, puller.locality
    puller.reset_radius(steps)
    if locality is None:
        local = "a"
    else:
        tenths = round(10.0 * locality)
        puller.locality = tenths / 10.0
        change = tenths - round(10.0 * LOCALITY)
        local = "a+-" + ("+" if change > 0 else "-") * abs(change)
    return "0" + ("]" if steps > 0 else "[") * abs(steps) + local


def record_video(controller: Controller) -> None:
    """Start a video of the modes that drag, or stop it and write it as a job."""
    recordings = controller.recordings
    if not recordings.is_filming:
        film_place(controller.place)  # report an unwritable place before filming
        recordings.start_film(lambda: controller.mode in _FILMED and not controller.is_busy)
        where = "" if controller.mode in _FILMED else " of modes 0 and 4"
        controller.say(f"Recording video{where}. {controller.keys.cap('record_video')} to stop")
        return
    path, frames = film_place(controller.place), recordings.end_film()
    if not len(frames):
        controller.say("No video saved: nothing was drawn in modes 0 and 4")
        return
    controller.start(
        f"Writing {path.name}",
        lambda progress: frames.save(path, progress=progress),
        lambda _: f"Video of {len(frames)} frames saved to {path}",
    )
