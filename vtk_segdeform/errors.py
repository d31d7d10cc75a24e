"""Exceptions of the package.

Each is also a ValueError or a RuntimeError, so that callers can catch the built-in classes.
"""


class SegDeformError(Exception):
    """Base class of all exceptions of the package."""


class ArgumentError(SegDeformError, ValueError):
    """An argument of the wrong shape, type or range; the message says what it must be."""


class MeshError(SegDeformError, ValueError):
    """The mesh is not oriented, has bad faces or coordinates; the message names each fault."""


class RegionError(SegDeformError, ValueError):
    """The regions do not fit the mesh: a vertex in no region, an empty region, a wrong shape."""


class CageError(SegDeformError, ValueError):
    """A cage is open, inside-out, intersects itself, or does not enclose its region."""


class ConstraintError(SegDeformError, ValueError):
    """Invalid fixed vertices, handles or targets: out of range, overlapping, NaN."""


class SessionError(SegDeformError, ValueError):
    """An invalid option, name or file of a session; the message says what is valid."""


class Cancelled(SegDeformError, RuntimeError):
    """The work was cancelled by its progress callback; nothing was changed.

    Raise it in a callback; what the callback returns is ignored.

    >>> import vtk_segdeform as sd
    >>> def stop_while_binding(fraction, text):
    ...     if fraction > 0.7:
    ...         raise sd.Cancelled("cancelled by the user")
    >>> ball = sd.models.sphere(600)
    >>> try:
    ...     sd.pull(ball, 0, [0.0, 0.0, 1.5], progress=stop_while_binding)
    ... except sd.Cancelled as reason:
    ...     print(reason)
    cancelled by the user
    """


class MissingDependencyError(SegDeformError, RuntimeError):
    """An optional library is missing; the message names it and says how to install it."""
