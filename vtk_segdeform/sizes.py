"""Sizes from which the method computes in another way: all in one place, each with its reason.

Below a size the plain way is as fast, or more exact at no cost; above it another way pays.  The
table in ``docs/speed.rst`` has the measurements.  Read a size as an attribute of this module,
``sizes.INTERPOLATED``: tests lower it to cover the other way with small meshes.
"""

from __future__ import annotations

LARGE = 20_000
"""Vertices of a mesh beyond which most of these ways pay."""

COMPILED = 2_000
"""Faces, or work as long as that of so many faces, for which compiled kernels are worth a call.

Handing arrays to a kernel takes some microseconds, and importing numba half a second.  The volume
of 8,000 faces takes 0.03 ms instead of 0.13."""

COMPILED_LATE = 300_000
"""The same for the first mesh of an editor, until its stand-in can be pulled.

A mesh of 50,000 vertices is drawn after 0.4 s instead of 1.2, and follows the pointer after 1.5 s
instead of 2.8."""

COMPILED_PREPARATION = 12_000
"""Vertices from which the preparation of such a mesh then waits for the kernels.

At 12,000 it takes 2.5 s with their import and without them, at 5,400 vertices 2.5 s and 1.8."""

COMPILED_CHECKS = 1_500_000
"""Faces that checks of meshes process without compiled kernels before they import numba.

A mesh of 100,000 faces has five checks, which take 25 ms in numpy and 4 ms compiled; importing
numba takes 0.2 s."""

PARALLEL_SEARCH = 1_000
"""Points per thread, at least, whose nearest others are searched in several threads.

1,000 searches take 0.4 to 0.9 ms, waking another thread 0.1 ms."""

COARSE_VOLUME = 3_000
"""Vertices beyond which the solver's steps compute the volume over a coarse surface.

A step then costs the same for every mesh: a frame of 12,000 vertices takes 12 ms instead of 21."""

COARSE_VOLUME_POINTS = 2_000
"""Points of that coarse surface, about."""

VOLUME_HESSIAN_POINTS = 300
"""Points beyond which the second derivatives of one volume are computed from so many.

The cost is quadratic in the cage vertices at every point, and more points save no steps."""

PLACES = 500
"""Places that the vertices of a large fixed patch or handle share.

It depends on a few dozen cage vertices, which 500 places determine many times over.  With
20,000 fixed and as many handle vertices a frame takes 14 ms instead of 33."""

SHARED_PLACES = 2 * PLACES
"""Vertices of such a set beyond which neighbours share a place."""

DECIMATED = LARGE
"""Vertices beyond which regions are detected, and cages fitted, on a decimated mesh.

Both depend on the shape only: for a million vertices they take 2.7 s of processor time."""

DECIMATED_POINTS = 12_000
"""Vertices of the decimated mesh, about: several hundred for each limb."""

STAND_IN_POINTS = 800
"""Vertices of the decimated mesh that is pulled until the mesh itself is bound, about.

It is bound in 0.1 s."""

DRAFT = LARGE
"""Vertices beyond which a moving mesh may be drawn decimated, if drawing it is slow.

In software a picture takes 110 ms of processor time instead of 380 at 250,000 vertices, and 170
instead of 1,550 at a million, on a busy machine.  At 50,000 it takes half."""

DRAFT_POINTS = 24_000
"""Vertices drawn of such a mesh, at most: closed cells of equal size, some 18,000 of them.

With half as many, plates and folds of a body that fills half the window fade in a drag."""

FINISHED = 100_000
"""Vertices up to which `deform` and `pull` finish a pose on the mesh by themselves.

A finish takes 0.2 s of processor time for 5,000 vertices and 6 s for 100,000 if all of the body
bends, the rest of `deform` 5 s.  Beyond, the factor of the Laplacian grows faster: 16 s for 200,000
vertices."""

SCALED_VOLUME = LARGE
"""Vertices beyond which a pose is scaled to its exact volume instead of moved along a direction.

A frame then maps the vertices once, not the direction of the volume as well: 32 ms instead of 37
for 87,000 vertices."""

CACHED_BINDING = LARGE
"""Vertices from which a session keeps a binding on disk.

A mesh of 22,000 vertices is bound in 1.1 s, and read in 0.05 s."""

LOCAL_VOLUME_CELLS = LARGE
"""Vertices beyond which local volume change is computed for cells of vertices.

It is smooth, and an overlay needs it in every frame: 1 ms instead of 12 for 22,000 vertices."""

LOCAL_VOLUME_POINTS = 8_000
"""Cells of such a mesh, about."""

INTERPOLATED = 100_000
"""Vertices beyond which the rows of W~ are interpolated on a grid.

There are about 90,000 nodes, whatever the mesh: W~ of a million vertices takes 1 s instead of 7."""

CUBATURE_SAMPLE = 36_000
"""Vertices in the weighted sample from which the energy of a large mesh is computed."""

CUBATURE_FACTOR = 8
"""Vertices for each sampled one from which the sample is used: 8 x 36,000 = 288,000 vertices.

The triangles at a sampled vertex have six other corners, so that a denser sample would cost as
much as all vertices."""

SINGLE_PRECISION = 8_000_000
"""Vertices in regions times cage vertices, in a region, beyond which W~ is in single precision.

Such a product is limited by memory, and half the bytes are read.  A map by 5.7 million numbers
takes 1.6 ms instead of 6.7."""
