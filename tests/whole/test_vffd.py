"""The same ends and the same volume by PyGeM's VFFD, if it is installed from its repository.

A lattice has no handles, but the first and the last layer of its control points alone move the
points in these planes.  So both give the flat ends of a bar the same places, VFFD by these layers;
the control points between them are free for the volume.
"""

from __future__ import annotations

import functools
import time

import numpy as np
import pytest
from solids import rotation

import vtk_segdeform as sd
from vtk_segdeform.geometry import distortion, signed_volume

LATTICES = (3, 3, 4), (4, 4, 6)
MARGIN = 1e-9  # of the lattice around the bar, relative


def carved(n_vertices):
    """Return a bar with flat ends and carved sides."""
    k = round((n_vertices / 14) ** 0.5)
    bar = sd.models.bar((0.4, 0.4, 1.0), (k, k, 3 * k))
    x = np.array(bar.vertices)
    depth = 0.06 * np.sin(2.0 * np.pi * x[:, 2]) * np.sin(25.0 * x[:, 2])
    x[:, :2] *= (1.0 + depth * np.cos(4.0 * np.arctan2(x[:, 1], x[:, 0])))[:, None]
    return bar.with_vertices(x)


def moved(x):
    """Return points (k, 3) of the upper end where it is moved to."""
    return (x - [0, 0, 1]) @ rotation([0, 1, 0], np.radians(40.0)).T + [0.15, 0, 0.95]


def by_lattice(vffd, x, lattice):
    """Return the vertices *x* (n, 3) deformed; control points between the ends begin in line."""
    low, size = x.min(axis=0), np.ptp(x, axis=0)
    vffd.box_origin, vffd.box_length = low - MARGIN * size, (1.0 + 2.0 * MARGIN) * size
    share = np.stack(np.meshgrid(*(np.linspace(0, 1, k) for k in lattice), indexing="ij"), axis=-1)
    end = (vffd.box_origin + share * vffd.box_length)[:, :, -1:]
    shifts = share[..., 2:] * (moved(end) - end) / vffd.box_length
    vffd.array_mu_x, vffd.array_mu_y, vffd.array_mu_z = np.moveaxis(shifts, -1, 0).copy()
    vffd.ffd_mask[:, :, [0, -1]] = False
    vffd.adjust_control_points(x)
    return vffd(x)


@pytest.mark.campaign
@pytest.mark.parametrize("share", [1.0, 0.9])
def test_a_pose_takes_a_fiftieth_of_the_time_of_vffd_and_is_less_distorted(share):
    pygem = pytest.importorskip("pygem")
    if not hasattr(pygem, "VFFD"):
        pytest.skip("this is another pygem; PyGeM is at https://github.com/mathLab/PyGeM")
    mesh = carved(50_000)
    x, rest = mesh.vertices, signed_volume(mesh.vertices, mesh.faces)
    base, top = np.flatnonzero(x[:, 2] < 1e-9), np.flatnonzero(x[:, 2] > 1.0 - 1e-9)
    places = moved(x[top])

    def measured(name, pose):
        begin = time.process_time()
        y = pose()
        seconds = time.process_time() - begin
        error = abs(signed_volume(y, mesh.faces) / (share * rest) - 1.0)
        off = max(np.abs(y[top] - places).max(), np.abs(y[base] - x[base]).max()) / mesh.diagonal
        stretched = distortion(mesh, y)
        print(
            f"{len(x)} vertices, volume {share:.0%}, {name}: {seconds:.3f} s, volume error "
            f"{error:.0e}, ends off by {off:.0e}, distortion {stretched:.3f}"
        )
        assert error <= 1e-12
        assert off <= 1e-3
        return seconds, stretched

    volumes = {"whole": share * rest}
    theirs = []
    for lattice in LATTICES:
        vffd = pygem.VFFD(mesh.faces, np.array([6.0 * share * rest]), list(lattice))
        pose = functools.partial(by_lattice, vffd, x, lattice)
        theirs.append(measured(f"VFFD, lattice of {lattice}", pose))
    finished = measured(
        "sd.deform, finished",
        lambda: sd.deform(mesh, base, top, places, volumes=volumes).vertices,
    )
    begin = time.process_time()
    regions = sd.segment(mesh)
    cages = sd.fit_cages(mesh, regions, 155)
    deformer = sd.Deformer(mesh, regions, cages, fixed=base, handle=top, volumes=volumes)
    deformer.solve(x[top] + 0.9 * (places - x[top]))
    print(f"set-up and a first pose: {time.process_time() - begin:.1f} s")
    ours = measured("Deformer, the next pose", lambda: deformer.solve(places).vertices)
    assert ours[0] <= min(seconds for seconds, _ in theirs) / 50.0
    assert max(finished[1], ours[1]) < min(stretched for _, stretched in theirs)
