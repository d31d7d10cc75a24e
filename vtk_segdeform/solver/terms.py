"""Further terms of the objective, such as contact.

A term is smooth.  One that is not always active is exactly 0 at most poses: then a step costs
hardly more, and its result is bit for bit that without the term.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np

from ..arrays import FloatArray

NO_SURFACE = np.empty((0, 3))  # of a pose whose surface is not known


class Term(Protocol):
    """A further term of the objective; see `terms`."""

    @property
    def is_always_active(self) -> bool:
        """Whether its Hessian counts at all poses."""
        ...

    def renewed(self, p: FloatArray, /) -> Term:
        """Return the term to go on with from cages *p* (m, 3), where a solve has ended."""
        ...

    def value_and_slope(
        self, p: FloatArray, x: FloatArray = NO_SURFACE, /
    ) -> tuple[float, FloatArray]:
        """Return the term for cages at *p* (m, 3), and half its gradient (m, 3).

        *x* (n, 3) is the surface of the volumes there, or empty if it is not known.  The value is
        exactly 0 while the term is inactive.
        """
        ...

    def hessian(self, p: FloatArray, x: FloatArray = NO_SURFACE, /) -> FloatArray | None:
        """Return half the Hessian at *p*, made positive semi-definite; None while inactive.

        It is (3m, 3m), stacked axis by axis.  Only its lower half is read.
        """
        ...

    def share(self, p: FloatArray, step: FloatArray, /) -> float:
        """Return the share of a *step* (m, 3) from *p*, at most 1, that the term allows."""
        ...


def with_terms(
    terms: Sequence[Term], p: FloatArray, x: FloatArray, *, value: float, slope: FloatArray
) -> tuple[float, FloatArray]:
    """Return an objective and half its gradient with those of *terms* added."""
    for term in terms:
        more, steeper = term.value_and_slope(p, x)
        if more:
            value, slope = value + more, slope + steeper
    return value, slope


def hessian_of(terms: Sequence[Term], p: FloatArray, x: FloatArray) -> FloatArray | None:
    """Return half the Hessian of all *terms*, (3m, 3m); None while all are inactive."""
    total = None
    for term in terms:
        own = term.hessian(p, x)
        if own is not None:
            total = own if total is None else total + own
    return total


def share_of_step(terms: Sequence[Term], p: FloatArray, step: FloatArray) -> float:
    """Return the share of a *step* (m, 3) from *p*, at most 1, that all *terms* allow."""
    return min([1.0, *(term.share(p, step) for term in terms)])
