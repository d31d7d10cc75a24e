"""Poses as functions of PyTorch, whose gradients are exact; with the extra ``torch``.

x = deformed(deformer, targets)      tensors (k, 3) -> (n, 3), float64
loss(x).backward()                   the gradient of targets by `Deformer.vjp`
"""

from __future__ import annotations

from typing import Any

from .deformer import Deformer
from .importing import imported


def deformed(deformer: Deformer, targets: Any) -> Any:
    """Return the vertices (n, 3) of the pose of *deformer* for *targets* (k, 3), as a tensor.

    Each call solves from the present pose of *deformer*, which stays as it is, so that the result
    is a function of the targets.  It is on the device, and in the type, of *targets*; a derivative
    of single precision is no better than that.

    Parameters
    ----------
    deformer : Deformer
        With fixed vertices and a handle of k vertices.
    targets : (k, 3) tensor
        Where the handle goes.

    Raises
    ------
    ImportError
        If PyTorch is not installed.
    ArgumentError
        When the gradient is asked for: if the pose has none; see `Deformer.jvp`.
    """
    torch = imported("torch")

    class Pose(torch.autograd.Function):  # type: ignore[misc, name-defined]
        @staticmethod
        def forward(ctx: Any, given: Any) -> Any:
            ctx.deformer = deformer.copy()
            ctx.solution = ctx.deformer.solve(given.detach().cpu().numpy())
            return torch.tensor(ctx.solution.vertices, dtype=given.dtype, device=given.device)

        @staticmethod
        def backward(ctx: Any, cotangent: Any) -> Any:
            found = ctx.deformer.vjp(ctx.solution, cotangent.detach().cpu().numpy()).targets
            return torch.tensor(found, dtype=cotangent.dtype, device=cotangent.device)

    return Pose.apply(targets)
