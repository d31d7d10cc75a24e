"""The four widgets together: modes, keys, background jobs, status line and help.

The files, in reading order:

    editor           `DeformEditor`
    controller       session, widgets, mode, job and file of the editor
    mode widget_set  the four modes, and the widgets of each
    camera           navigation, views, up axis and orientation cube
    actions recording_actions panel_actions view_actions
                     the actions behind keys, menus and panels
    bindings         the table of keys
    job              background work, with progress and cancellation
    session_file     the file that the session is saved to
    recordings       recordings of input and video
    messages hints status_line help_card log
                     messages, hints, the help card and the history
    notices notice_line
                     how the mesh differs from what was given, and where
    wrapping         text that fits into a window
"""

from . import actions
from .actions import Action, painting, save, split_region, toggle_cages, toggle_overlay
from .bindings import binding_of, key_cap
from .controller import Controller
from .editor import DeformEditor
from .job import Job, Timer
from .log import Entry
from .messages import error_text
from .mode import Mode
from .notices import Notice, Notices, notices_of
from .panel_actions import (
    choosing_handle,
    choosing_region,
    exporting,
    merging,
    naming_region,
    opening,
    renaming,
    saving,
    selecting_through,
    setting,
    setting_colour_range,
    showing_cage,
    with_radius,
)
from .session_file import MESH_FILES, READABLE_FILES, SessionFile, is_mesh, read_session
from .view_actions import (
    frame_all,
    frame_selection,
    looking_from,
    toggle_cube,
    toggle_projection,
    with_up,
)

__all__ = [
    "MESH_FILES",
    "READABLE_FILES",
    "Action",
    "Controller",
    "DeformEditor",
    "Entry",
    "Job",
    "Mode",
    "Notice",
    "Notices",
    "SessionFile",
    "Timer",
    "actions",
    "binding_of",
    "choosing_handle",
    "choosing_region",
    "error_text",
    "exporting",
    "frame_all",
    "frame_selection",
    "is_mesh",
    "key_cap",
    "looking_from",
    "merging",
    "naming_region",
    "notices_of",
    "opening",
    "painting",
    "read_session",
    "renaming",
    "save",
    "saving",
    "selecting_through",
    "setting",
    "setting_colour_range",
    "showing_cage",
    "split_region",
    "toggle_cages",
    "toggle_cube",
    "toggle_overlay",
    "toggle_projection",
    "with_radius",
    "with_up",
]
