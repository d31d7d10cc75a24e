"""The editing session: one mesh with its regions, cages, handles and pose; all edits undoable.

The files, in reading order:

    session        `Session`: the interface for widgets and scripts
    state          immutable states
    history        undo and redo
    handles        named handles and their targets
    pulling        pulls and pins
    painting       painting, merging and splitting regions
    finishing      poses finished on the mesh itself
    pose_solver    poses of states, with cached solvers
    stand_in       a coarse stand-in until a session is bound
    listeners      notification of changes
    naming         names of regions and handles
    store          saving and loading sessions
    surface_store  the given surface in a file
    archive        the file format
"""

from ..mesh import SurfacePoint
from .finishing import FinishedPose
from .handles import require_handle
from .listeners import Change
from .naming import region_name
from .pulling import automatic_locality, middle_vertex
from .session import Effort, Preparation, Session
from .stand_in import StandIn
from .state import Options, State
from .store import load_session, save_session, saved_view

__all__ = [
    "Change",
    "Effort",
    "FinishedPose",
    "Options",
    "Preparation",
    "Session",
    "StandIn",
    "State",
    "SurfacePoint",
    "automatic_locality",
    "load_session",
    "middle_vertex",
    "region_name",
    "require_handle",
    "save_session",
    "saved_view",
]
