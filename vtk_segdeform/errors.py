"""What can go wrong, as exceptions a caller can tell apart.

Each is also a built-in kind of error, so ``except ValueError`` keeps working.
"""


class SegDeformError(Exception):
    """Everything this package raises on purpose."""


class ArgumentError(SegDeformError, ValueError):
    """An array or a number of the wrong shape, type or range; the text says what it must be."""


class MeshError(SegDeformError, ValueError):
    """The mesh is not a closed, outward oriented two-manifold; the text names each fault."""


class RegionError(SegDeformError, ValueError):
    """The regions do not fit the mesh: a vertex in no region, an empty region, a wrong shape."""


class CageError(SegDeformError, ValueError):
    """A cage is open, inside-out, crosses itself, or leaves out part of its region."""


class ConstraintError(SegDeformError, ValueError):
    """Fixed vertices, handles or targets that make no sense: out of range, overlapping, NaN."""


class SessionError(SegDeformError, ValueError):
    """An option, a name or a file that makes no sense to a session; the text says what would."""


class Cancelled(SegDeformError, RuntimeError):
    """The caller's progress callback asked to stop; nothing was changed."""


class MissingDependencyError(SegDeformError, RuntimeError):
    """An optional library is absent; the text says which one and how to install it."""
