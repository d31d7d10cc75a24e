"""The widget that pulls the surface at any point.

The files, in reading order:

    puller    `Puller`
"""

from .puller import Puller

__all__ = [
    "Puller",
]
