"""The widgets together: modes, keys, background jobs, status line and help.

The files, in reading order:

    editor           `DeformEditor`
    controller       session, widgets, mode, job and file of the editor
    widget_set       the modes, and the widgets of each
    camera           navigation, views, up axis and orientation cube
    actions          the actions behind keys, menus and panels
    keys bindings    tables of keys, and the editor's own one
    queue            what runs in the background, and what comes next
    preparing        the preparation for pulls, while the editor remains usable
    finishing        the finish of a pose on the mesh, after a drag
    session_file     the file that the session is saved to, and meshes that are written
    autosave autosaver
                     autosaved work on disk, recovery after a crash, and when to save
    messages hints status_line help_card
                     messages, hints and the help card
    session_history history
                     the steps of the session and of its repaired copies; what each did and where;
                     jumps and previews
    notices notice_line
                     how the mesh differs from what was given, and where
"""

from . import actions
from .actions import Action, copying_poses, exporting, opening, saving
from .autosave import About, Autosaves, Slot
from .autosaver import INTERVAL, Autosaver
from .bindings import PRESETS, KeyChoice, keys_of
from .controller import Controller
from .editor import DeformEditor
from .hints import TOOLS, hint
from .history import jumping_to, preview, states_of
from .keys import Binding, Keys, key_cap, key_name
from .messages import error_text
from .notices import Notice, Notices, notices_of
from .queue import Kind, Queue, Task
from .session_file import (
    SessionFile,
    WrittenMesh,
    file_types,
    is_mesh,
    read_session,
    write_posed,
)
from .widget_set import Mode

__all__ = [
    "INTERVAL",
    "PRESETS",
    "TOOLS",
    "About",
    "Action",
    "Autosaver",
    "Autosaves",
    "Binding",
    "Controller",
    "DeformEditor",
    "KeyChoice",
    "Keys",
    "Kind",
    "Mode",
    "Notice",
    "Notices",
    "Queue",
    "SessionFile",
    "Slot",
    "Task",
    "WrittenMesh",
    "actions",
    "copying_poses",
    "error_text",
    "exporting",
    "file_types",
    "hint",
    "is_mesh",
    "jumping_to",
    "key_cap",
    "key_name",
    "keys_of",
    "notices_of",
    "opening",
    "preview",
    "read_session",
    "saving",
    "states_of",
    "write_posed",
]
