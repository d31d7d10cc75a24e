"""Deformers that are bound to the cages of states; the last ones are kept.

regions, cages, options of binding  ->  a bound `Deformer`; takes seconds
+ symmetry                          ->  milliseconds
+ stiffness                         ->  another energy; a second for 60,000 vertices
+ parts with volumes                ->  milliseconds
"""

from __future__ import annotations

from functools import partial
from typing import Any, NamedTuple

from .. import sizes
from ..deformer import Deformer
from ..errors import CageError
from ..files import cache_folder
from ..freezing import Memo
from ..mesh import Mesh
from ..progress import Progress, part, tell
from .state import State

_KEPT = 3  # deformers of each kind
_BOUND = 0.7  # of the progress; the stiffness takes the rest


class Stiffened(NamedTuple):
    """A deformer with the stiffness of a state."""

    inputs: tuple[Any, ...]
    deformer: Deformer


class Bindings:
    """The bound deformers of one mesh.

    Parameters
    ----------
    mesh : Mesh
        n vertices.
    memo : Memo, optional
        What is known of them.
    """

    def __init__(self, mesh: Mesh, memo: Memo | None = None) -> None:
        self.mesh, self._memo = mesh, memo or Memo()

    def is_bound(self, state: State) -> bool:
        """Return whether the cages of *state* are bound, so that `bind` returns at once."""
        found = self._memo.find("bound", _binding(state))
        if found is None or state.stiffness is None:
            return found is not None
        return self._memo.find("stiffened", _stiffening(found, state)) is not None

    def bind(self, state: State, progress: Progress | None = None) -> Deformer:
        """Return a deformer for the cages of *state* without constraints; bind it if necessary.

        Raises
        ------
        CageError
            If there are no cages, or they do not fit.
        """
        stiffness = state.stiffness
        if stiffness is None:
            self.bound(state, progress)
            return self.enclosing(state)
        found = self.bound(state, part(progress, 0.0, _BOUND))

        def stiffened() -> Deformer:
            tell(progress, _BOUND, "binding the stiffness")
            return self._mirrored(state).stiffened(stiffness)

        inputs = _stiffening(found, state)
        return self._with_parts(self._memo.get("stiffened", inputs, stiffened, _KEPT), state)

    def enclosing(self, state: State) -> Deformer:
        """Return a deformer with the volumes of that of `bind`, whatever the stiffness."""
        return self._with_parts(self._mirrored(state), state)

    def enclosing_now(self, state: State) -> Deformer | None:
        """Return `enclosing`; None if nothing is bound yet."""
        is_bound = self._memo.find("bound", _binding(state)) is not None
        return self.enclosing(state) if is_bound else None

    def bound(self, state: State, progress: Progress | None = None) -> Deformer:
        """Return a deformer for the cages of *state* only; bind it if necessary."""

        def bound() -> Deformer:
            if state.regions is None or not state.cages:
                raise CageError("there are no cages to deform with; fit or set cages first")
            return Deformer(
                self.mesh,
                state.regions,
                state.cages,
                stretch=state.options.stretch,
                rotation_groups=state.options.rotation_groups,
                cache=cache_folder() if self.mesh.n_vertices >= sizes.CACHED_BINDING else None,
                progress=progress,
            )

        return self._memo.get("bound", _binding(state), bound, _KEPT)

    def _mirrored(self, state: State) -> Deformer:
        """Return `bound` with the symmetry of *state*."""
        found, symmetry = self.bound(state), state.options.symmetry
        if symmetry is None:
            return found
        held = partial(found.hold, symmetry=symmetry)
        return self._memo.get("mirrored", (found, symmetry), held, _KEPT)

    def _with_parts(self, deformer: Deformer, state: State) -> Deformer:
        """Return *deformer* with the volumes of the parts of *state*."""
        parts = state.parts
        if not parts:
            return deformer
        held = partial(deformer.hold, parts=dict(parts))
        return self._memo.get("with parts", (deformer, parts), held, _KEPT)

    def stiffened(self, state: State) -> Stiffened | None:
        """Return what `bind` keeps for the stiffness of *state*; None if it has or keeps none."""
        if state.stiffness is None:
            return None
        inputs = _stiffening(self.bound(state), state)
        found = self._memo.find("stiffened", inputs)
        return None if found is None else Stiffened(inputs, found)

    def adopt(self, state: State, deformer: Deformer, stiffened: Stiffened | None = None) -> None:
        """Use *deformer*, bound elsewhere, for the regions, cages and options of *state*."""
        self._memo.keep("bound", _binding(state), deformer, _KEPT)
        if stiffened is not None:
            self._memo.keep("stiffened", *stiffened, _KEPT)

    def snapshot(self) -> Bindings:
        """Return what is known now, for another thread."""
        return Bindings(self.mesh, self._memo.copy())


def _binding(state: State) -> tuple[Any, ...]:
    """Return the inputs of a bound deformer."""
    options = state.options
    return state.regions, state.cages, options.stretch, options.rotation_groups


def _stiffening(bound: Deformer, state: State) -> tuple[Any, ...]:
    """Return the inputs of a *bound* deformer with the stiffness of *state*."""
    return bound, state.options.symmetry, state.stiffness
