"""The deformation as a filter of a VTK pipeline, for VTK, pyvista and ParaView.

    port 0   any surface: of polygons or strips, closed or open, with seams
    port 1   cages, optional: a composite dataset with a surface for each region, or one surface
             for a single region; without cages, the filter fits them
    output   the same points, cells and arrays, moved, and also
             "LocalVolumeChange" (points), "VolumeChange", "HandleError", "Steps", "Status" (field),
             "HasVolume" (field), 1 if it encloses a volume, and "Lids" (field), the number of
             holes whose lids enclose it

Regions come from a point array of labels or from automatic segmentation.  Fixed points and the
handle are point arrays, where nonzero, or point indices.  The handle moves to given targets, or is
rotated about its centre and translated.  Points at a seam follow one vertex of the mesh.

The output depends on inputs and settings only, not on earlier executions: it is the solution of a
`Deformer` with the regions of `segment` and the cages of `fit_cages`.  (`vtk_segdeform.deform` has
regions that depend on the handle.)  Polygons are cut into triangles by VTK.  Only the parts that
changed are computed again: new targets need a solve, a new handle some milliseconds more, and
only a new surface, regions, cages or stretch resistance needs a new binding (counted by `rebinds`).

Errors are reported as in VTK, by an ErrorEvent with a text or in the output window, and the output
is empty.  Requires numpy, scipy and VTK's modules, but not pyvista.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation
from vtkmodules.vtkCommonCore import vtkOutputWindow
from vtkmodules.vtkCommonDataModel import vtkDataObject, vtkPolyData

from ..arrays import FloatArray, IntArray, as_ids
from ..cages import Cage, fit_cages, suggested_size
from ..deformer import Deformer
from ..errors import CageError, Cancelled, ConstraintError, SegDeformError
from ..geometry import lids_of, local_volume_change
from ..mesh import Mesh, mesh_of
from ..progress import Progress, part
from ..regions import Regions, segment
from . import surfaces
from .settings import FilterSettings


class SegmentedCageDeformFilter(FilterSettings):
    """Deform a surface by a handle, preserving detail and volume.

    Attributes
    ----------
    rebinds : int
        Number of times that cages were fitted or bound so far.
    """

    def __init__(self) -> None:
        super().__init__(
            nInputPorts=2, inputType="vtkPolyData", nOutputPorts=1, outputType="vtkPolyData"
        )
        self.rebinds = 0
        self._cached: tuple[bytes, Deformer] | None = None

    # The pipeline.

    def FillInputPortInformation(self, port: int, info: Any) -> int:  # noqa: N802
        """Declare the inputs: port 0 a surface; port 1 cages, composite or missing."""
        if port == 1:
            info.Set(self.INPUT_REQUIRED_DATA_TYPE(), "vtkDataObject")
            info.Set(self.INPUT_IS_OPTIONAL(), 1)
        else:
            info.Set(self.INPUT_REQUIRED_DATA_TYPE(), "vtkPolyData")
        return 1

    def RequestData(self, _request: Any, inputs: Any, outputs: Any) -> int:  # noqa: N802
        """Deform the input; called by the pipeline."""
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
            self._report_error(f"{type(self).__name__}: {fault}")
        return 1

    def _deform(self, source: Any, cages: Any, output: Any) -> None:
        soup, settings, labels = mesh_of(*surfaces.surface(source)), self._settings, None
        if settings.region_array:
            labels = _required(source, settings.region_array, "SetRegionArrayName")
            labels = soup.at_vertices(labels)
        fixed = _marked(source, settings.fixed, settings.fixed_array)
        handle = _marked(source, settings.handle, settings.handle_array)
        if handle is None:
            handle = np.flatnonzero(_required(source, settings.handle_array, "SetHandleArrayName"))
        if settings.targets is not None:
            targets = np.array(settings.targets).reshape(-1, 3)
            vertices, targets = soup.targets_at(handle, targets)
        else:
            vertices, _ = soup.targets_at(handle, soup.points[handle])
            targets = self._moved(soup.mesh.vertices[vertices])
        held = soup.vertices_at(np.zeros(0, np.int64) if fixed is None else fixed)
        both = np.union1d(held, vertices)
        deformer = self._binding(soup.mesh, labels, _cages_of(cages), both)
        constrained = deformer.hold(
            fixed=held,
            handle=vertices,
            preserve_volume=settings.preserve_volume,
            lids=settings.lids,
        )
        solution = constrained.solve(targets, progress=part(self._progress(), 0.95, 1.0))
        output.ShallowCopy(source)
        surfaces.move(output, soup.moved(solution.vertices))
        if settings.local_volume:
            change = local_volume_change(constrained.mesh, solution.vertices)[soup.vertex_of]
            surfaces.add_array(output.GetPointData(), "LocalVolumeChange", change)
        lids = lids_of(soup.mesh, settings.lids)
        for name, value in (
            ("VolumeChange", [solution.volume_change]),
            ("HandleError", [solution.handle_error]),
            ("Steps", [solution.steps]),
            ("Status", str(solution.status)),
            ("HasVolume", [int(constrained.has_volume)]),
            ("Lids", [int(lids.used.sum())]),
        ):
            surfaces.add_array(output.GetFieldData(), name, value)
        self.UpdateProgress(1.0)

    def _binding(self, mesh: Mesh, labels: Any, cages: Sequence[Cage], held: IntArray) -> Deformer:
        """Return a deformer without constraints: that of the last execution, if still valid."""
        settings, key = self._settings, hashlib.blake2b()
        choices = settings.n_regions, settings.n_cage_vertices, settings.overlap, settings.stretch
        key.update(repr((choices, settings.attach, labels is None, len(cages))).encode())
        arrays = [mesh.vertices, mesh.faces, *([] if labels is None else [labels])]
        arrays.append(np.unique(mesh.components[held]))  # others may follow these
        for cage in cages:
            arrays += [cage.vertices, cage.faces]
        for array in arrays:
            key.update(repr(array.shape).encode() + np.ascontiguousarray(array).tobytes())
        if self._cached is None or self._cached[0] != key.digest():
            self._cached = None
            self.rebinds += 1
            self._cached = key.digest(), self._new_deformer(mesh, labels, cages, held)
        return self._cached[1]

    def _new_deformer(
        self, mesh: Mesh, labels: Any, cages: Sequence[Cage], held: IntArray
    ) -> Deformer:
        settings, progress = self._settings, self._progress()
        if settings.attach and (labels is not None or cages):
            raise ConstraintError("SetAttach is for automatic regions only; leave it out")
        if labels is not None:
            regions = Regions.from_labels(mesh, labels, settings.overlap)
        elif len(cages) == 1:
            regions = Regions.single(mesh)
        elif cages:
            raise CageError(
                f"{len(cages)} cages need regions; set an array of labels with SetRegionArrayName"
            )
        else:
            number, share = settings.n_regions or None, part(progress, 0.0, 0.2)
            attach = dict(settings.attach)
            regions = segment(mesh, number, attach=attach, held=held, progress=share)
        if not cages:
            size = settings.n_cage_vertices or suggested_size(regions)
            cages = fit_cages(mesh, regions, size, progress=part(progress, 0.2, 0.7))
        binding = part(progress, 0.7, 0.95)
        return Deformer(mesh, regions, cages, stretch=settings.stretch, progress=binding)

    def _moved(self, points: FloatArray) -> FloatArray:
        """Return *points* (k, 3) rotated about their centre and translated."""
        settings = self._settings
        axis = np.array(settings.axis)
        length = np.linalg.norm(axis)
        if not length > 0.0:
            raise ConstraintError(
                "the rotation axis must not be 0 0 0; set it with SetRotationAxis"
            )
        rotation = Rotation.from_rotvec(np.radians(settings.angle) * axis / length)
        centre = points.mean(axis=0) if len(points) else np.zeros(3)
        return np.asarray(rotation.apply(points - centre) + centre + settings.translation)

    def _progress(self) -> Progress:
        def report(fraction: float, text: str) -> None:
            self.SetProgressText(text)
            self.UpdateProgress(fraction)
            if self.CheckAbort():
                raise Cancelled("aborted")

        return report

    def _report_error(self, text: str) -> None:
        """Report an error like the filters of VTK."""
        if self.HasObserver("ErrorEvent"):
            self.InvokeEvent("ErrorEvent", text)
        else:
            vtkOutputWindow.GetInstance().DisplayErrorText(f"{text}\n")


def _required(source: Any, name: str, setter: str) -> Any:
    array = surfaces.point_array(source, name)
    if array is None:
        raise ConstraintError(f"the input has no point array '{name}'; set its name with {setter}")
    return array


def _marked(source: Any, ids: Sequence[int] | None, name: str) -> Any:
    """Return the given point indices, or those where an array is nonzero; None without either."""
    if ids is not None:
        return as_ids(np.array(ids, dtype=np.int64), source.GetNumberOfPoints(), "points")
    array = surfaces.point_array(source, name) if name else None
    return None if array is None else np.flatnonzero(array)


def _cages_of(data: Any) -> tuple[Cage, ...]:
    if data is None:
        return ()
    return tuple(Cage(*surfaces.surface(piece)) for piece in surfaces.pieces(data))
