"""Dyes that light excites before it is scattered: the dyes' share of what a beam loses to absorption on its way."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from tetlux.fem.media.coefficients import Coefficients, at_cells
from tetlux.fem.operators.loads import load_vector
from tetlux.fem.quadratic.loads import line_load, quadratic_load
from tetlux.fem.quadratic.space import QuadraticSpace
from tetlux.fem.sources.deposit import Deposit
from tetlux.fem.sources.terms import SourceTerms
from tetlux.meshing.arrays import FloatArray, IntArray, NumberArray
from tetlux.meshing.describe import one_line
from tetlux.meshing.tets.mesh import TetMesh


@dataclass(frozen=True, eq=False)
class DirectLight:
    """Light of one source before it is scattered, as it excites dyes.

    Attributes
    ----------
    mesh : TetMesh
    coefficients : Coefficients
        Of the excitation.
    deposit : Deposit
        Of the light, on the mesh.
    """

    mesh: TetMesh
    coefficients: Coefficients
    deposit: Deposit

    def at_nodes(self, weights: NumberArray) -> NumberArray:
        """Its integrals times weights (m,) and each hat function, (n,); 0 if nothing is absorbed before it scatters."""
        if self.deposit.ledger.absorbed == 0.0:
            return np.zeros(len(self.mesh.points))

        def load(part: FloatArray) -> NumberArray:
            return load_vector(self.mesh, self._emitting(part), self._terms(part))

        return _of_parts(load, weights)

    def in_space(self, space: QuadraticSpace, weights: NumberArray) -> NumberArray:
        """The same with the shape functions of quadratic elements, (size,)."""
        if self.deposit.ledger.absorbed == 0.0:
            return np.zeros(space.size)

        def load(part: FloatArray) -> NumberArray:
            coefficients, terms = self._emitting(part), self._terms(part)
            return quadratic_load(space, coefficients, terms, line_load(space, coefficients, terms.segments))

        return _of_parts(load, weights)

    def _emitting(self, weights: FloatArray) -> Coefficients:
        """Coefficients of beams that decay as they do, and scatter what dyes emit, evenly."""
        return replace(
            self.coefficients,
            sigma_a=self.coefficients.extinction - weights,
            delta_eddington_scattering=weights,
            delta_eddington_cosine=0.0,
        )

    def _terms(self, weights: FloatArray) -> SourceTerms:
        """Beams, and what is emitted at points: of what the ledger says is absorbed, all but what beams absorb."""
        terms = self.deposit.terms
        beams = SourceTerms(segments=terms.segments)
        if len(terms.points) == 0:
            return beams
        sigma_a = at_cells(self.coefficients.sigma_a, np.arange(len(self.mesh.tetrahedra)))
        of_beams = load_vector(self.mesh, self._emitting(sigma_a), beams).sum() if len(terms.segments) else 0.0
        absorbed = (self.deposit.ledger.absorbed - of_beams) * terms.powers / terms.powers.sum()
        cells = self._cells_of_points()
        return replace(beams, points=terms.points, powers=absorbed * weights[cells] / sigma_a[cells])

    def _cells_of_points(self) -> IntArray:
        """The tetrahedra of the points, and of those outside the mesh the nearest ones."""
        points = self.deposit.terms.points
        cells, _ = self.mesh.locate(points)
        outside = np.flatnonzero(cells < 0)
        cells[outside] = self.mesh.boundary_cells[self.mesh.closest_boundary(points[outside])[1]]
        return cells

    __repr__ = one_line


def _of_parts(load: Callable[[FloatArray], NumberArray], weights: NumberArray) -> NumberArray:
    """A load that is linear in weights, of complex ones by their parts."""
    if np.iscomplexobj(weights):
        return load(weights.real.copy()) + 1j * load(weights.imag.copy())
    return load(weights)
