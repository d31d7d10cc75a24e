"""The command ``motion``: poses of a surface from files, as one file."""

from __future__ import annotations

from argparse import Namespace

from ..errors import MeshError
from ..io import Surface, read_mesh
from ..motions import write_motion
from ..progress import Progress
from .outputs import Say, report_surface


def motion(options: Namespace, say: Say, progress: Progress) -> bool:
    """Write a surface and poses of it as morph targets, or as a series for ParaView."""
    surface = Surface.read(options.input)
    mesh, poses = surface.mesh, []
    report_surface(surface, say)
    for k, path in enumerate(options.poses):
        progress(k / len(options.poses), f"reading {path.name}")
        pose = read_mesh(path)
        if pose.vertices.shape != mesh.vertices.shape or (pose.faces != mesh.faces).any():
            raise MeshError(f"{path}: is no pose of {options.input}: it has other faces")
        poses.append(pose.vertices)
    seconds = [(k + 1) / options.fps for k in range(len(poses))]
    tolerance = 0.01 * options.tolerance
    found = write_motion(options.output, surface, poses, seconds=seconds, tolerance=tolerance)
    say(f"poses           {len(poses)} after rest, of which {len(found.kept)} are written")
    if options.output.suffix.lower() == ".pvd":
        say(f"written         {options.output}")
        return True
    say(f"blend           off by at most {100.0 * found.deviation:.2g} % of the diagonal")
    say(f"volume          changes by at most {100.0 * found.volume_change:.2g} % in a blend")
    say(f"written         {options.output}")
    return True
