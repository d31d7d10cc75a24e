"""The widgets together: modes, keys, background jobs, status line and help.

The files, in reading order:

    editor           `DeformEditor`
    controller       session, widgets, mode, job and file of the editor
    mode widget_set  the modes, and the widgets of each
    camera           navigation, views, up axis and orientation cube
    actions recording_actions panel_actions view_actions
                     the actions behind keys, menus and panels
    bindings         the table of keys
    job              background work, with progress and cancellation
    preparing        the preparation for pulls, while the editor remains usable
    session_file     the file that the session is saved to
    recordings       recordings of input and video
    messages hints status_line help_card
                     messages, hints and the help card
    history          the states of the session by name, jumps and previews
    notices notice_line
                     how the mesh differs from what was given, and where
    wrapping         text that fits into a window
"""

from . import actions
from .actions import (
    Action,
    converting,
    painting,
    reset_pivot,
    save,
    show_pose,
    show_rest,
    split_region,
    toggle_cages,
    toggle_local_axes,
    toggle_overlay,
    toggle_regions,
)
from .bindings import BEFORE_AFTER, binding_of, key_cap
from .controller import Controller
from .editor import DeformEditor
from .hints import hint
from .history import jumping_to, position_of, preview, states_of
from .job import Job, Timer
from .messages import error_text
from .mode import Mode
from .notices import Notice, Notices, notices_of
from .panel_actions import (
    choosing_handle,
    choosing_region,
    exporting,
    fitting_with,
    hiding_handle,
    locking_handle,
    merging,
    naming_region,
    opening,
    pulling_with,
    renaming,
    saving,
    segmenting,
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
    "BEFORE_AFTER",
    "MESH_FILES",
    "READABLE_FILES",
    "Action",
    "Controller",
    "DeformEditor",
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
    "converting",
    "error_text",
    "exporting",
    "fitting_with",
    "frame_all",
    "frame_selection",
    "hiding_handle",
    "hint",
    "is_mesh",
    "jumping_to",
    "key_cap",
    "locking_handle",
    "looking_from",
    "merging",
    "naming_region",
    "notices_of",
    "opening",
    "painting",
    "position_of",
    "preview",
    "pulling_with",
    "read_session",
    "renaming",
    "reset_pivot",
    "save",
    "saving",
    "segmenting",
    "selecting_through",
    "setting",
    "setting_colour_range",
    "show_pose",
    "show_rest",
    "showing_cage",
    "split_region",
    "states_of",
    "toggle_cages",
    "toggle_cube",
    "toggle_local_axes",
    "toggle_overlay",
    "toggle_projection",
    "toggle_regions",
    "with_radius",
    "with_up",
]
