"""The widgets together: modes, keys, background jobs, status line and help.

The files, in reading order:

    editor           `DeformEditor`
    controller       session, widgets, mode, job and file of the editor
    widget_set       the modes, and the widgets of each
    camera           navigation, views, up axis and orientation cube
    actions panel_actions
                     the actions behind keys, menus and panels
    keys bindings    tables of keys, and the editor's own one
    job              background work, with progress and cancellation
    queue            what runs in the background, and what comes next
    preparing        the preparation for pulls, while the editor remains usable
    finishing        the finish of a pose on the mesh, after a drag
    session_file     the file that the session is saved to, and meshes that are written
    autosave         autosaved work on disk, and recovery after a crash
    messages hints status_line help_card
                     messages, hints and the help card
    history neighbours
                     the states of the session by name, jumps and previews, and the sessions
                     before and after it
    notices notice_line
                     how the mesh differs from what was given, and where
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
from .autosave import About, Autosaves, Slot
from .bindings import PRESETS, KeyChoice, keys_of
from .controller import Controller
from .editor import DeformEditor
from .hints import hint
from .history import jumping_to, position_of, preview, states_of
from .job import Job, Timer
from .keys import MOUSE, Binding, Keys, key_cap, key_name
from .messages import error_text
from .neighbours import Neighbour
from .notices import Notice, Notices, notices_of
from .panel_actions import (
    choosing_handle,
    choosing_regions,
    exporting,
    finishing_after_drags,
    fitting_with,
    frame_all,
    frame_selection,
    hiding_handle,
    locking_handle,
    looking_from,
    merging,
    naming_region,
    opening,
    preserving_volume,
    pulling_with,
    renaming,
    saving,
    segmenting,
    selecting_through,
    setting,
    setting_colour_range,
    showing_cage,
    toggle_cube,
    toggle_projection,
    with_radius,
    with_up,
)
from .queue import Kind
from .session_file import (
    MESH_FILES,
    READABLE_FILES,
    SessionFile,
    WrittenMesh,
    expect_session,
    is_mesh,
    read_session,
    write_posed,
)
from .widget_set import Mode

__all__ = [
    "MESH_FILES",
    "MOUSE",
    "PRESETS",
    "READABLE_FILES",
    "About",
    "Action",
    "Autosaves",
    "Binding",
    "Controller",
    "DeformEditor",
    "Job",
    "KeyChoice",
    "Keys",
    "Kind",
    "Mode",
    "Neighbour",
    "Notice",
    "Notices",
    "SessionFile",
    "Slot",
    "Timer",
    "WrittenMesh",
    "actions",
    "choosing_handle",
    "choosing_regions",
    "converting",
    "error_text",
    "expect_session",
    "exporting",
    "finishing_after_drags",
    "fitting_with",
    "frame_all",
    "frame_selection",
    "hiding_handle",
    "hint",
    "is_mesh",
    "jumping_to",
    "key_cap",
    "key_name",
    "keys_of",
    "locking_handle",
    "looking_from",
    "merging",
    "naming_region",
    "notices_of",
    "opening",
    "painting",
    "position_of",
    "preserving_volume",
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
    "write_posed",
]
