"""The actions of the editor that record what hands do, and that film what becomes of it."""

from __future__ import annotations

from ..region_selector import Tool
from .desk import Desk
from .stage import Mode
from .takes import film_place

_KEY_OF = {Tool.BRUSH: "b", Tool.LASSO: "l", Tool.RECTANGLE: "t", Tool.COMPONENT: "k"}


def record(desk: Desk) -> None:
    """Begin to write down what hands do, or end it; see `recording`."""
    takes = desk.takes
    if takes.is_recording:
        desk.say(f"recording written to {takes.end_recording()}")
        return
    selector = desk.stage.selector
    keys = f"3{_KEY_OF[selector.tool]}" + "v" * selector.through + str(desk.mode.value)
    path = takes.record(desk.place, desk.session, keys)
    desk.say(f"recording to {path}, Ctrl+R ends it")


def film(desk: Desk) -> None:
    """Begin to film what the deform mode shows, or end it and write the film as a job."""
    takes = desk.takes
    if not takes.is_filming:
        film_place(desk.place)  # report an unwritable place before filming
        takes.take(lambda: desk.mode is Mode.DEFORM and not desk.is_busy)
        here = "" if desk.mode is Mode.DEFORM else ", in mode 4"
        desk.say(f"filming what is drawn{here}; Ctrl+M ends it")
        return
    path, taken = film_place(desk.place), takes.end_film()
    if not len(taken):
        desk.say("nothing filmed: in mode 4 nothing was drawn meanwhile")
        return

    def written(_: object) -> None:
        desk.say(f"film of {len(taken)} pictures written to {path}")

    desk.start(f"writing {path.name}", lambda p: taken.save(path, progress=p), written)
