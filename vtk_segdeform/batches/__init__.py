"""Batches: many meshes in many poses, on the cores of this machine or of a cluster.

The files, in reading order:

    remote         files elsewhere, by their URLs
    plan           meshes and poses, checked and resolved to vertices
    random_poses   `random_poses`: limbs bent at random
    tasks          what a worker computes: a block of poses of one mesh
    store          `PoseStore`: the poses of a batch, in one file
    run            `batch`: the tasks of a plan, on any executor
"""

from .plan import Plan
from .random_poses import RandomPoses, random_poses
from .remote import is_url
from .run import batch
from .store import PoseStore
from .tasks import Row

__all__ = ["Plan", "PoseStore", "RandomPoses", "Row", "batch", "is_url", "random_poses"]
