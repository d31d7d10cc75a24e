"""The gradient by the stiffness f of every vertex of what is linear in an energy, in one pass.

    T(f) = <Q, sum_k a_k b_k^T + diag(c)>  -  sum_g tr(R_g K_g v) + tr(N_g K_g p)

Q and K are those of `energy`.  With a = p and b = v it is the change of <v, half the gradient of
E(p)>, rotations R included: N, of `hessian.turning`, is how they turn.

Each of three parts of the energy, detail, stretch and interior, is a sum over vertices i, linear in
their factors f, and normalised by its trace tr in the subspace.  The rest is in proportion to the
scale of E, which is that of the detail, and so are the weights of handles.  With U, which is T when
these are included, and 0 but for the tolerance of a solve,

    dU = sum of parts (dT_part - T_part / tr_part dtr_part)  +  U / tr_detail dtr_detail

All are sums over vertices of what is known there: x = W~ a, C x, and squares of rows of W~.  Only
the points inside the body move with f, as the means of patches do; their gradients are central
differences, which take 2 (4 + regions) times as long as the gradients themselves.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from ..arrays import FloatArray
from ..subspace import row_pieces
from .energy import SampledOperators
from .interior import Interior, InteriorSamples

_STEP = 1e-4  # of what determines a point inside, relative: its gradient errs by 1e-8 of its change


@dataclass(frozen=True, eq=False)
class Contraction:
    """T, above: what the energy is multiplied by; m cage vertices, G clusters."""

    ahead: FloatArray  # a, (m, 3 k), of which the first is p
    beside: FloatArray  # b, (m, 3 k), of which the first is v
    squares: FloatArray  # c, (m,)
    rotations: FloatArray  # R, (G, 3, 3)
    twists: FloatArray  # N, (G, 3, 3)
    total: float  # U

    @property
    def _of_squares(self) -> FloatArray:
        """The factors (m, 2) of squares in T and in the trace."""
        return np.stack([self.squares, np.ones(len(self.squares))], axis=1)

    def of_surface(self, sampled: SampledOperators, stretch: float, n: int) -> FloatArray:
        """Return the gradient (n,) of detail and stretch, with weight *stretch* of the latter."""
        operators, _, rows, own, sample = sampled
        here = replace(
            self,
            ahead=rows.map(self.ahead),
            beside=rows.map(self.beside),
            rotations=self.rotations[own],
            twists=self.twists[own],
        )
        bent, flat, weights = here._bent(sampled), here._flat(sampled), operators.weights
        trace = float(weights @ bent[:, 1])
        ratio = stretch * trace / float(weights @ flat[:, 1])
        found = _normalised(bent, weights) + ratio * _normalised(flat, weights)
        found += self.total / trace * bent[:, 1]
        if sample is None:
            return found
        return np.asarray(np.bincount(sample.ids, sample.weights * found, minlength=n))

    def _bent(self, sampled: SampledOperators) -> FloatArray:
        """Return the detail of each vertex in T and in the trace, (k, 2), for a factor of 1.

        What T has of cages and clusters, self has of the vertices.
        """
        operators, c = sampled.operators, sampled.operators.laplacian
        a, b = c @ self.ahead, c @ self.beside
        squares = np.empty((len(a), 2))
        for piece in row_pieces(len(a), sampled.rows.n_columns):
            normals = sampled.rows.premultiplied(c[piece.start : piece.stop])
            squares[piece] = normals**2 @ self._of_squares
        squares[:, 0] += np.einsum("na,na->n", a, b)
        squares *= (0.25 / operators.areas)[:, None]
        delta = operators.delta
        squares[:, 0] -= 0.5 * np.einsum("na,nab,nb->n", b[:, :3], self.rotations, delta)
        squares[:, 0] -= 0.5 * np.einsum("na,nab,nb->n", a[:, :3], self.twists, delta)
        return np.asarray(squares * (operators.bends > 0.0)[:, None])

    def _flat(self, sampled: SampledOperators) -> FloatArray:
        """Return the stretch of each vertex likewise."""
        surface, rows = sampled.surface, sampled.rows
        motions = surface.vertices, self.ahead, self.beside
        found = np.zeros((len(surface.vertices), 2))
        for piece in row_pieces(len(surface.faces), 6 * rows.n_columns):
            faces, half = surface.faces[piece], 0.5 * surface.cotangents[piece]
            ends = faces[:, [1, 2, 0]], faces[:, [2, 0, 1]]
            at_corners = rows.at(faces.ravel()).reshape(len(faces), 3, -1)
            apart = (at_corners[:, [1, 2, 0]] - at_corners[:, [2, 0, 1]]) ** 2
            each = np.einsum("fe,fem->fm", half, apart) @ self._of_squares
            x, a, b = (y[ends[0]] - y[ends[1]] for y in motions)
            each[:, 0] += np.einsum("fe,fea,fea->f", half, a, b)
            of_corners = np.repeat(each[:, None], 3, axis=1)
            for by, turned in ((b, self.rotations), (a, self.twists)):
                stretched = np.einsum("fe,fea,feb->fab", half, by[..., :3], x)
                of_corners[..., 0] -= np.einsum("fab,fcab->fc", stretched, turned[faces])
            for k in range(2):
                found[:, k] += np.bincount(faces.ravel(), of_corners[..., k].ravel(), len(found))
        return found / 3.0

    def of_interior(
        self,
        samples: InteriorSamples,
        weights: FloatArray,
        gradients: Callable[[Interior], FloatArray],
        *,
        stiffness: FloatArray | None,
        n: int,
    ) -> FloatArray:
        """Return the gradient (n,) of the interior, whose clusters are the last ones.

        *weights* (q,) are those of `interior_weights`, *stiffness* (n,) the factors, and
        *gradients* those (q, 3, m) of the map of the cages at points inside.
        """
        if not len(weights):
            return np.zeros(n)
        means = samples.means(stiffness)
        turned = zip((self.beside, self.ahead), (self.rotations, self.twists), strict=True)
        loads = [(motion[:, :3], each[-len(weights) :]) for motion, each in turned]

        def parts(at: Interior) -> FloatArray:
            g = gradients(at)
            found = np.einsum("qam,mk->qk", g**2, self._of_squares)
            found[:, 0] += np.einsum("qab,qab->q", g @ self.ahead, g @ self.beside)
            for motion, each in loads:
                found[:, 0] -= np.einsum("qab,qba->q", g @ motion, each)
            return np.asarray(weights[:, None] * found)

        here, patch = parts(means), samples.patches
        lengths = np.array([1.0, -here[:, 0].sum() / here[:, 1].sum()])
        found = (here @ lengths)[patch]  # by the logarithm of the volume of its patch
        for ahead, back, off in _steps(samples, means):
            found += ((parts(ahead) - parts(back)) @ lengths)[patch] * off
        shares = samples.volumes / means.volumes[patch]
        return np.asarray(np.bincount(samples.vertices, shares * found, minlength=n))


def _steps(
    samples: InteriorSamples, means: Interior
) -> Iterator[tuple[Interior, Interior, FloatArray]]:
    """Yield *means* with one of their numbers a little larger, and smaller.

    And how far that of each sample is from it, (k,), in both steps together.
    """
    for name in ("points", "radii", "weights"):
        own, mean = getattr(samples, name), getattr(means, name)
        each, values = (own.T, mean.T) if name == "points" else np.atleast_2d(own, mean)
        for k, value in enumerate(values):
            step = np.zeros_like(values)
            step[k] = _STEP * (value if name == "weights" else means.radii)
            sides = [(values + sign * step).T for sign in (1.0, -1.0)]
            if name != "points":
                sides = [side.T.reshape(mean.shape) for side in sides]
            ahead, back = (replace(means, **{name: side}) for side in sides)
            off, size = each[k] - value[samples.patches], 2.0 * step[k][samples.patches]
            yield ahead, back, np.divide(off, size, out=np.zeros_like(off), where=size > 0.0)


def _normalised(each: FloatArray, weights: FloatArray) -> FloatArray:
    """Return dT - T / tr dtr, (k,), by the *weights* (k,) of *each* part of T and tr (k, 2)."""
    total, trace = weights @ each
    return np.asarray(each[:, 0] - total / trace * each[:, 1])
