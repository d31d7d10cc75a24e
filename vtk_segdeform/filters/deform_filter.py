"""The deformation as a filter of a VTK pipeline, for VTK, pyvista and ParaView alike.

    port 0   the surface: closed, of triangles, or of polygons, which are cut for solving only
    port 1   its cages, optional: a composite dataset with a surface for each region, or one
             surface for a single region; without them cages are fitted
    output   the surface with all its arrays and its points moved; and as well
             "LocalVolumeChange" (points), "VolumeChange", "HandleError", "Steps", "Status" (field)

Regions are told by a point array of labels, or found.  What stays and what is moved is told by
point arrays, true where not 0, or by numbers of points.  The handle goes to given targets, or is
turned about its centre and shifted.

The output is a function of inputs and settings, not of what was there before; its numbers are
those of `vtk_segdeform.deform`.  Only what changed is done again: other targets are solved for,
another handle takes milliseconds more, and for nothing but another surface, other regions, cages
or energies is anything bound anew (`rebinds` counts).

Faults are told as VTK does, by an ErrorEvent with a text or in the output window; the output is
empty then.  Needs numpy, scipy and VTK's own modules.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation
from vtkmodules.vtkCommonCore import vtkOutputWindow
from vtkmodules.vtkCommonDataModel import vtkDataObject, vtkPolyData

from ..arrays import FloatArray, as_ids
from ..cages import Cage, fit_cages
from ..deformer import Deformer
from ..errors import CageError, Cancelled, ConstraintError, SegDeformError
from ..geometry import local_volume_change
from ..mesh import Mesh
from ..progress import Progress, part
from ..regions import Regions, segment
from . import surfaces
from .settings import SettingsOfAFilter


class SegmentedCageDeformFilter(SettingsOfAFilter):
    """Deform a closed surface by its handle, detail and volume kept.

    Attributes
    ----------
    rebinds : int
        How often cages were fitted or bound so far.
    """

    def __init__(self) -> None:
        super().__init__(
            nInputPorts=2, inputType="vtkPolyData", nOutputPorts=1, outputType="vtkPolyData"
        )
        self.rebinds = 0
        self._bound: tuple[bytes, Deformer] | None = None

    # The pipeline.

    def FillInputPortInformation(self, port: int, info: Any) -> int:  # noqa: N802
        """Port 0 is a surface; port 1, cages, may be of several pieces, or missing."""
        if port == 1:
            info.Set(self.INPUT_REQUIRED_DATA_TYPE(), "vtkDataObject")
            info.Set(self.INPUT_IS_OPTIONAL(), 1)
        else:
            info.Set(self.INPUT_REQUIRED_DATA_TYPE(), "vtkPolyData")
        return 1

    def RequestData(self, _request: Any, inputs: Any, outputs: Any) -> int:  # noqa: N802
        """Deform; called by the pipeline."""
        source = vtkPolyData.GetData(inputs[0], 0)
        output = vtkPolyData.GetData(outputs, 0)
        given = inputs[1].GetNumberOfInformationObjects()
        cages = vtkDataObject.GetData(inputs[1], 0) if given else None
        try:
            self._deform(source, cages, output)
        except Cancelled:
            output.Initialize()
        except (SegDeformError, ValueError, TypeError) as fault:
            output.Initialize()
            self._tell(f"{type(self).__name__}: {fault}")
        return 1

    def _deform(self, source: Any, cages: Any, output: Any) -> None:
        vertices, faces = surfaces.surface(source)
        settings = self._settings
        labels = None
        if settings.region_array:
            labels = _required(source, settings.region_array, "SetRegionArrayName")
        deformer = self._binding(Mesh(vertices, faces), labels, _cages_of(cages))
        fixed = _marked(source, settings.fixed, settings.fixed_array)
        handle = _marked(source, settings.handle, settings.handle_array)
        if handle is None:
            handle = np.flatnonzero(_required(source, settings.handle_array, "SetHandleArrayName"))
        held = deformer.hold(
            fixed=np.zeros(0, np.int64) if fixed is None else fixed,
            handle=handle,
            preserve_volume=settings.preserve_volume,
        )
        solving = part(self._progress(), 0.95, 1.0)
        solution = held.solve(self._targets(vertices[held.handle]), progress=solving)
        output.ShallowCopy(source)
        surfaces.move(output, solution.vertices, faces)
        if settings.local_volume:
            change = local_volume_change(held.mesh, solution.vertices)
            surfaces.add_array(output.GetPointData(), "LocalVolumeChange", change)
        for name, value in (
            ("VolumeChange", [solution.volume_change]),
            ("HandleError", [solution.handle_error]),
            ("Steps", [solution.steps]),
            ("Status", str(solution.status)),
        ):
            surfaces.add_array(output.GetFieldData(), name, value)
        self.UpdateProgress(1.0)

    def _binding(self, mesh: Mesh, labels: Any, cages: Sequence[Cage]) -> Deformer:
        """Return a deformer that holds nothing yet: the one of the last time, if it may be."""
        settings, key = self._settings, hashlib.blake2b()
        choices = settings.n_regions, settings.n_cage_vertices, settings.overlap, settings.stretch
        key.update(repr((choices, labels is None, len(cages))).encode())
        arrays = [mesh.vertices, mesh.faces, *([] if labels is None else [labels])]
        for cage in cages:
            arrays += [cage.vertices, cage.faces]
        for array in arrays:
            key.update(repr(array.shape).encode() + np.ascontiguousarray(array).tobytes())
        if self._bound is None or self._bound[0] != key.digest():
            self._bound = None
            self.rebinds += 1
            self._bound = key.digest(), self._made(mesh, labels, cages)
        return self._bound[1]

    def _made(self, mesh: Mesh, labels: Any, cages: Sequence[Cage]) -> Deformer:
        settings, progress = self._settings, self._progress()
        if labels is not None:
            regions = Regions.from_labels(mesh, labels, settings.overlap)
        elif len(cages) == 1:
            regions = Regions.single(mesh)
        elif cages:
            raise CageError(
                f"{len(cages)} cages need regions: name an array of labels by SetRegionArrayName"
            )
        else:
            regions = segment(mesh, settings.n_regions or None, progress=part(progress, 0.0, 0.2))
        if not cages:
            cages = fit_cages(
                mesh, regions, settings.n_cage_vertices, progress=part(progress, 0.2, 0.7)
            )
        binding = part(progress, 0.7, 0.95)
        return Deformer(mesh, regions, cages, stretch=settings.stretch, progress=binding)

    def _targets(self, places: FloatArray) -> FloatArray:
        settings = self._settings
        if settings.targets is not None:
            return np.array(settings.targets).reshape(-1, 3)
        axis = np.array(settings.axis)
        length = np.linalg.norm(axis)
        if not length > 0.0:
            raise ConstraintError("the axis to turn about must not be 0 0 0")
        turn = Rotation.from_rotvec(np.radians(settings.angle) * axis / length)
        centre = places.mean(axis=0) if len(places) else np.zeros(3)
        return np.asarray(turn.apply(places - centre) + centre + settings.translation)

    def _progress(self) -> Progress:
        def report(fraction: float, text: str) -> None:
            self.SetProgressText(text)
            self.UpdateProgress(fraction)
            if self.CheckAbort():
                raise Cancelled("aborted")

        return report

    def _tell(self, text: str) -> None:
        """Tell a fault as VTK's own filters do."""
        if self.HasObserver("ErrorEvent"):
            self.InvokeEvent("ErrorEvent", text)
        else:
            vtkOutputWindow.GetInstance().DisplayErrorText(f"{text}\n")


def _required(source: Any, name: str, setter: str) -> Any:
    array = surfaces.point_array(source, name)
    if array is None:
        raise ConstraintError(f"the input has no point array '{name}'; name one by {setter}")
    return array


def _marked(source: Any, ids: Sequence[int] | None, name: str) -> Any:
    """Return numbers of points: those given, or those marked by an array; None without either."""
    if ids is not None:
        return as_ids(np.array(ids, dtype=np.int64), source.GetNumberOfPoints(), "points")
    array = surfaces.point_array(source, name) if name else None
    return None if array is None else np.flatnonzero(array)


def _cages_of(data: Any) -> tuple[Cage, ...]:
    if data is None:
        return ()
    return tuple(Cage(*surfaces.surface(piece)) for piece in surfaces.pieces(data))
