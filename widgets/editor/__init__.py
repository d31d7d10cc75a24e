"""The four widgets together: modes, keys, background jobs, status and help.

The files, in reading order:

    editor           `DeformEditor`
    desk             the state of the editor: session, mode, job, file
    stage            the widgets, and which are on in which mode
    actions take_actions panel_actions
                     what keys, menus and panels do
    bindings         the table of keys
    work jobs        background work, with progress and cancellation
    session_file     the file that is saved to
    takes            recordings and films
    voice hints status_line help_card log
                     messages, hints, the help card and the history
"""

from . import actions
from .actions import Action, painting, save, split_region, toggle_cages, toggle_overlay
from .bindings import binding_of, key_cap
from .desk import Desk
from .editor import DeformEditor
from .log import Entry
from .panel_actions import (
    choosing_handle,
    choosing_region,
    exporting,
    merging,
    naming_region,
    opening,
    ranging,
    reaching,
    renaming,
    saving,
    setting,
    showing_cage,
    with_radius,
)
from .session_file import SessionFile, is_mesh, read_bound
from .stage import Mode
from .voice import words_of

__all__ = [
    "Action",
    "DeformEditor",
    "Desk",
    "Entry",
    "Mode",
    "SessionFile",
    "actions",
    "binding_of",
    "choosing_handle",
    "choosing_region",
    "exporting",
    "is_mesh",
    "key_cap",
    "merging",
    "naming_region",
    "opening",
    "painting",
    "ranging",
    "reaching",
    "read_bound",
    "renaming",
    "save",
    "saving",
    "setting",
    "showing_cage",
    "split_region",
    "toggle_cages",
    "toggle_overlay",
    "with_radius",
    "words_of",
]
