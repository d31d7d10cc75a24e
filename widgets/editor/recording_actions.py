"""The actions that record the editor's input, and a video of its deform mode."""

from __future__ import annotations

from ..region_selector import Tool
from .controller import Controller
from .mode import Mode
from .recordings import film_place

_KEY_OF = {Tool.BRUSH: "b", Tool.LASSO: "l", Tool.RECTANGLE: "t", Tool.COMPONENT: "k"}


def record_input(controller: Controller) -> None:
    """Start or stop a recording of the input; see `recording`."""
    recordings = controller.recordings
    if recordings.is_recording:
        controller.say(f"Recording saved to {recordings.end_recording()}")
        return
    selector = controller.widgets.selector
    keys = f"3{_KEY_OF[selector.tool]}" + "v" * selector.through + str(controller.mode.value)
    path = recordings.start_recording(controller.place, controller.session, keys)
    controller.say(f"Recording input to {path}. Ctrl+R to stop")


def record_video(controller: Controller) -> None:
    """Start a video of the deform mode, or stop it and write it as a job."""
    recordings = controller.recordings
    if not recordings.is_filming:
        film_place(controller.place)  # report an unwritable place before filming
        recordings.start_film(lambda: controller.mode is Mode.DEFORM and not controller.is_busy)
        where = "" if controller.mode is Mode.DEFORM else " of mode 4"
        controller.say(f"Recording video{where}. Ctrl+M to stop")
        return
    path, frames = film_place(controller.place), recordings.end_film()
    if not len(frames):
        controller.say("No video saved: nothing was drawn in mode 4")
        return
    controller.start(
        f"Writing {path.name}",
        lambda progress: frames.save(path, progress=progress),
        lambda _: f"Video of {len(frames)} frames saved to {path}",
    )
