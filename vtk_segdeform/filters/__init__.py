"""The deformation as a filter of a VTK pipeline.

The files, in reading order:

    deform_filter      `SegmentedCageDeformFilter`
    settings           the setters of the filter
    surfaces           conversion from and to vtkPolyData, without pyvista
    paraview_plugin    the ParaView plugin
"""

from .deform_filter import SegmentedCageDeformFilter
from .settings import FilterSettings

__all__ = [
    "FilterSettings",
    "SegmentedCageDeformFilter",
]
