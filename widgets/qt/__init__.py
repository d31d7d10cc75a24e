"""The editor in Qt applications.

The files, in reading order:

    widget      `DeformWidget` and `deform_dock`
    panel       the panel beside the view
    modes painting regions handles options foot log
                its parts
    controls    buttons and other pieces they are made of
"""

from .widget import DeformWidget, deform_dock

__all__ = [
    "DeformWidget",
    "deform_dock",
]
