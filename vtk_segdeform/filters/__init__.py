"""The deformation as a VTK pipeline filter.

The files, in reading order:

    deform_filter      `SegmentedCageDeformFilter`
    settings           its setters
    surfaces           vtkPolyData in and out, without pyvista
    paraview_plugin    the ParaView plugin
"""

from .deform_filter import SegmentedCageDeformFilter
from .settings import SettingsOfAFilter

__all__ = [
    "SegmentedCageDeformFilter",
    "SettingsOfAFilter",
]
