"""Sizes from which the method computes in another way: all in one place, each with its reason.

Below a size the plain way is as fast, or more exact at no cost; above it another way pays.  The
table in ``docs/speed.rst`` has the measurements.  Read a size as an attribute of this module,
``sizes.LOW_RANK``: tests lower it to cover the other way with small meshes.
"""

from __future__ import annotations

COMPILED = 2_000
"""Faces, or work as long as that of so many faces, for which compiled kernels are worth a call.

Handing arrays to a kernel takes some microseconds, and importing numba half a second."""

PARALLEL_SEARCH = 2_000
"""Points whose nearest cluster centres are searched in several threads.

SciPy starts new threads at every search, which takes longer than a search of fewer points."""

ONE_CALL = 1 << 20
"""Numbers in W~ up to which one call of a kernel multiplies by all of it, in one thread.

Eight megabytes stay in the cache between a map and its transpose, and waking other threads takes
longer than the product."""

COARSE_VOLUME = 3_000
"""Vertices beyond which the solver's steps take the volume over a coarse surface."""

COARSE_VOLUME_POINTS = 2_000
"""Points of that coarse surface, about."""

VOLUME_HESSIAN_POINTS = 700
"""Points beyond which the second derivatives of the volumes are computed from so many."""

SHARED_PLACES = 1_000
"""Vertices of a fixed patch or handle beyond which neighbours share a place."""

PLACES = 500
"""Places that the vertices of such a set share.

A set reaches a few dozen cage vertices, so that 500 places determine them many times over."""

FIRST_CLUSTERS = 2_000
"""Rotation clusters of position, at least, that are joined to as many clusters as requested."""

FIRST_CLUSTERS_EACH = 6
"""First clusters for each one requested, if these are more."""

SCALED_VOLUME = 20_000
"""Vertices beyond which a pose is scaled to its exact volume instead of moved along a direction.

A frame then maps the vertices once, not the direction of the volume as well; of a small mesh
that saves nothing."""

CACHED_BINDING = 20_000
"""Vertices from which a session keeps a binding on disk.

A smaller mesh is bound in less than a second."""

LOCAL_VOLUME_CELLS = 20_000
"""Vertices beyond which local volume change is computed for cells of vertices."""

LOCAL_VOLUME_POINTS = 8_000
"""Cells of such a mesh, about."""

LOW_RANK = 100_000
"""Vertices beyond which W~ is mapped by its low-rank factors."""

CUBATURE_SAMPLE = 36_000
"""Vertices in the weighted sample from which the energy of a large mesh is computed."""

CUBATURE_SAMPLE_EACH = 18
"""Sampled vertices for each rotation cluster, if these are more."""

CUBATURE_FACTOR = 8
"""Vertices for each sampled one from which the sample is used: 8 x 36,000 = 288,000 vertices.

The triangles at a sampled vertex have six other corners, so that a denser sample would cost as
much as all vertices."""

SINGLE_PRECISION = 8_000_000
"""Vertices in regions times cage vertices, in a region, beyond which W~ is in single precision.

The product of so many numbers is limited by memory: half the bytes take half the time."""
