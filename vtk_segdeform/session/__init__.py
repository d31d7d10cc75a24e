"""The editing session: one mesh, its regions, cages, handles and pose, every step undoable.

The files, in reading order:

    session      `Session`: what widgets and scripts talk to
    state        the state at one moment, immutable
    history      undo and redo
    handles      named handles
    painting     edits of regions
    posing       poses from states, with their solvers kept
    listeners    notification of changes
    naming       names of regions and handles
    store        sessions in files
    archive      the file format
"""

from .handles import require_handle
from .listeners import Change
from .naming import called
from .session import Effort, Session
from .state import Options, State
from .store import load_session, save_session

__all__ = [
    "Change",
    "Effort",
    "Options",
    "Session",
    "State",
    "called",
    "load_session",
    "require_handle",
    "save_session",
]
