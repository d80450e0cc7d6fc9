"""Multigrid by smoothed aggregation, as the preconditioner of conjugate gradients."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from importlib.util import find_spec

import numpy as np
from scipy.sparse import csr_array, csr_matrix

from tetlux.fem.linear.direct import factors_of
from tetlux.fem.linear.krylov import Preconditioner, Product, dots, make_preconditioned_cg, real_majorant
from tetlux.meshing.arrays import FloatArray, NumberArray
from tetlux.meshing.describe import one_line

# PyAMG finds the aggregates, and has no wheel for Linux on ARM.
HAS_PYAMG = find_spec("pyamg") is not None
# Matrices of this many unknowns or fewer are factorised.
COARSEST = 500
# Steps of the power iteration that estimates a spectral radius.
POWER_STEPS = 8


@dataclass(frozen=True, eq=False)
class Multigrid:
    """Conjugate gradients, preconditioned by a cycle through a hierarchy of real matrices.

    The hierarchy is that of the matrix itself, of one like it, or of one that a complex matrix is a shift of.
    """

    product: Product
    cycle: "Cycle"

    def __call__(self, loads: NumberArray) -> tuple[NumberArray, int]:
        """See `tetlux.fem.linear.krylov.Method`."""
        return make_preconditioned_cg(self.product, self.cycle)(loads)

    __repr__ = one_line


def multigrid(product: Product) -> Multigrid:
    """Conjugate gradients, preconditioned by smoothed aggregation (Vaněk, Mandel & Brezina 1996).

    For a complex matrix the hierarchy is that of its `real_majorant`.
    """
    finest, levels = product, list[_Level]()
    if product.is_complex:
        product = Product(real_majorant(product.matrix))
    while product.matrix.shape[0] > COARSEST and (level := _level(product)) is not None:
        levels.append(level)
        product = Product(csr_array(level.down.matrix @ (product.matrix @ level.up.matrix)))
    return Multigrid(finest, Cycle(levels, factors_of(product.matrix)))


@dataclass(frozen=True, eq=False)
class Cycle:
    """A V-cycle through levels, from the finest to factors of the coarsest matrix."""

    levels: "Sequence[_Level]"
    coarsest: Preconditioner

    def __call__(self, residuals: FloatArray) -> FloatArray:
        """A rough solution for residuals (n, k)."""
        return self._from_level(residuals, 0)

    @cached_property
    def single(self) -> "Cycle":
        """The cycle in single precision, but for the coarsest matrix."""
        coarsest = self.coarsest
        return Cycle(
            [level.single for level in self.levels], lambda rest: coarsest(rest.astype(np.float64)).astype(np.float32)
        )

    def _from_level(self, residuals: FloatArray, depth: int) -> FloatArray:
        if depth == len(self.levels):
            return self.coarsest(residuals)
        level = self.levels[depth]
        result = level.smoother * residuals
        result += level.up(self._from_level(level.down(residuals - level.product(result)), depth + 1))
        result += level.smoother * (residuals - level.product(result))
        return result

    __repr__ = one_line


@dataclass(frozen=True, eq=False)
class _Level:
    """A level of the hierarchy: its matrix, the ways to the coarser one and back, and a damped Jacobi, (n, 1)."""

    product: Product
    down: Product
    up: Product
    smoother: FloatArray

    @property
    def single(self) -> "_Level":
        """The level in single precision."""
        return _Level(self.product.single, self.down.single, self.up.single, self.smoother.astype(np.float32))


def _level(product: Product) -> _Level | None:
    """Aggregates of neighbours, whose indicator functions are smoothed by one step of Jacobi.

    PyAMG finds the aggregates. Its own set-up takes three times as long, for better estimates of spectral radii
    than damping needs, and its Gauss-Seidel runs neither on two cores nor on several columns.
    """
    from pyamg.aggregation import standard_aggregation  # noqa: PLC0415

    matrix = product.matrix
    indicators = csr_array(standard_aggregation(csr_matrix(matrix))[0].astype(np.float64))
    if indicators.nnz == 0:
        return None
    diagonal = matrix.diagonal()
    # A power iteration from any start ends between the radius and a little less, and 4/3 leaves room for 3/2 of it.
    vector = np.random.default_rng(0).normal(size=(len(diagonal), 1))
    for _ in range(POWER_STEPS):
        vector = product(vector) / diagonal[:, None]
        radius = np.sqrt(dots(vector, vector))
        vector /= radius
    smoother = 4.0 / 3.0 / (radius * diagonal)
    smoothed = csr_array(matrix @ indicators)
    smoothed.data *= np.repeat(smoother, np.diff(smoothed.indptr))
    up = csr_array(indicators - smoothed)
    return _Level(product, Product(csr_array(up.T)), Product(up), smoother[:, None])
