"""The editing session: one mesh with its regions, cages, handles and pose; all edits undoable.

The files, in reading order:

    session        `Session`: the interface for widgets and scripts
    handle_edits   edits of the handles
    state          immutable states
    timeline       undo and redo
    handles        named handles and their targets
    pulls          pulls and pins
    painting       painting, merging and splitting regions
    poses          surfaces and deformers of states, cached
    bindings       their deformers, bound to cages
    solving        the next pose of a state
    preparing      regions, cages and binding in advance
    separating     components that follow others, and those with regions of their own
    finishing      poses finished on the mesh itself
    saved_poses    poses by name: saved, applied and blended
    landmark_edits landmarks and their targets, and the pose fitted to them
    carried        files whose points follow the mesh
    pose_copies    a pose of one mesh given to another one
    output         the surface as PolyData and files
    stand_in       a coarse stand-in until a session is bound
    listeners      notification of changes
    naming         names of regions and handles
    store          saving and loading sessions
    state_store    the states in their files
    surface_store  the given surface in a file
    archive        the file format
"""

from ..freezing import same_inputs
from ..mesh import SurfacePoint
from . import finishing, preparing, pulls, separating, solving
from .carried import SessionCarried
from .finishing import FinishedPose
from .handle_edits import Handles
from .handles import require_handle
from .landmark_edits import SessionLandmarks
from .listeners import Change
from .naming import region_name, volume_label
from .painting import Painting
from .poses import Poses
from .preparing import Preparation
from .saved_poses import SavedPoses, blend_label
from .session import Session
from .stand_in import StandIn
from .state import Options, State
from .store import load_session, save_session, saved_view
from .timeline import Timeline

__all__ = [
    "Change",
    "FinishedPose",
    "Handles",
    "Options",
    "Painting",
    "Poses",
    "Preparation",
    "SavedPoses",
    "Session",
    "SessionCarried",
    "SessionLandmarks",
    "StandIn",
    "State",
    "SurfacePoint",
    "Timeline",
    "blend_label",
    "finishing",
    "load_session",
    "preparing",
    "pulls",
    "region_name",
    "require_handle",
    "same_inputs",
    "save_session",
    "saved_view",
    "separating",
    "solving",
    "volume_label",
]
