"""The system matrix in closed form: what `tetlux.fem.operators.forms` says, some ten times quicker.

On a tetrahedron of volume V, with N_i the inward normal of the face opposite corner i, as long as twice its area,
the gradients of the hat functions are ``N_i / (6V)``, so that (Zienkiewicz, Taylor & Zhu, The Finite Element Method,
7th ed., 6.2)::

    ∫ D grad v_i . grad v_j = D N_i . N_j / (36V)
    ∫ sigma_a v_i v_j       = sigma_a V (1 + delta_ij)/20,   lumped: delta_ij sigma_a V/4
    ∮ v_i v_j / (2A)        = area (1 + delta_ij)/12 / (2A), lumped: delta_ij area/3 / (2A)

The gradients sum to zero, so the first is known from its values on the edges: each row sums to zero.
"""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from scipy.sparse import csr_array

from tetlux.fem.linear.multigrid import Cycle
from tetlux.fem.linear.solver import Solver, solver_for
from tetlux.fem.media.coefficients import Coefficients, coefficients_of
from tetlux.fem.media.medium import Medium
from tetlux.fem.models.diffusion import Diffusion
from tetlux.fem.models.model import Model
from tetlux.fem.operators.pattern import Pattern, pattern_of
from tetlux.fem.operators.terms import Lumping, Terms, boundary_term, mass_term, stiffness_term
from tetlux.meshing.arrays import FloatArray, sum_by_index
from tetlux.meshing.describe import one_line
from tetlux.meshing.host.corners import cross, dot, run_on_corners
from tetlux.meshing.tets.mesh import TetMesh
from tetlux.meshing.tets.topology import EDGES

__all__ = ["SHARE_PRECONDITIONER_BELOW", "Assembly", "Lumping", "condition_bound", "system_matrix"]

# Matrices whose `condition_bound` is no larger share a preconditioner. A shared one takes at most twice the iterations;
# on balls in a beam, with absorption or diffusion up to four times as strong, it takes no more than the matrix's own.
SHARE_PRECONDITIONER_BELOW = 4.0


def system_matrix(mesh: TetMesh, medium: Medium, lumping: Lumping = "lumped") -> csr_array:
    """The matrix of the left-hand side of the weak form in `tetlux.fem.operators.forms`.

    Several media on one mesh share an `Assembly`.

    Parameters
    ----------
    mesh : TetMesh
    medium : Medium
    lumping : {"lumped", "consistent"}
        How the two terms without derivatives are integrated. Lumped (by the corners) is as accurate at
        second order, and keeps the fluence from going negative where consistent mass does.

    Returns
    -------
    (n, n) csr_array
        Symmetric, positive definite, indices sorted.
    """
    return Assembly(mesh).assemble(coefficients_of(medium), lumping)


@dataclass(frozen=True, eq=False)
class Assembly:
    """Assembles matrices on one mesh, which share their pattern and the integrals of their hat functions.

    Parameters
    ----------
    mesh : TetMesh
    multigrid_cycles : list of tuple of Model and callable
        Multigrid cycles that were prepared, each with the model that it was prepared for.
    """

    mesh: TetMesh
    multigrid_cycles: list[tuple[Model, Cycle]] = field(default_factory=list)

    def solver(self, model: Model, matrix: csr_array, expected_right_hand_sides: int) -> Solver:
        """A solver for the matrix of a model with one unknown; it takes the multigrid cycle of a similar one."""
        similar = next(
            (
                cycle
                for other, cycle in self.multigrid_cycles
                if condition_bound(model, other) <= SHARE_PRECONDITIONER_BELOW
            ),
            None,
        )
        solver = solver_for(matrix, expected_right_hand_sides, similar)
        if similar is None and solver.cycle is not None:
            self.multigrid_cycles.append((model, solver.cycle))
        return solver

    def assemble(self, coefficients: Coefficients, lumping: Lumping = "lumped") -> csr_array:
        """The matrix of steady diffusion for given coefficients, see `system_matrix`."""
        ((block,),) = Diffusion(coefficients).blocks
        return self.matrix(block.diffusion, block.sigma, block.robin, lumping)

    def matrix(
        self,
        diffusion: float | FloatArray,
        sigma_a: float | FloatArray,
        robin: float | FloatArray,
        lumping: Lumping = "lumped",
    ) -> csr_array:
        """The matrix of ``∫ D grad phi . grad v + ∫ sigma_a phi v + ∮ robin phi v``, see `terms`."""
        return self.terms(diffusion, sigma_a, robin, lumping).combine()

    def terms(
        self,
        diffusion: float | FloatArray,
        sigma_a: float | FloatArray,
        robin: float | FloatArray,
        lumping: Lumping = "lumped",
        absorption_scale: FloatArray | None = None,
    ) -> Terms:
        """The terms of ``∫ D grad phi . grad v + ∫ sigma_a phi v + ∮ robin phi v``.

        Parameters
        ----------
        diffusion : float or (m,) ndarray
            D, of all or of each tetrahedron, unit.
        sigma_a : float or (m,) ndarray
            Absorption coefficient, 1/unit.
        robin : float or (f,) ndarray
            1/(2A), of all or of each boundary triangle; 0 where no light passes (Neumann).
        lumping : {"lumped", "consistent"}
        absorption_scale : (n,) ndarray, optional
            The factor on the absorption in the lumped mass of each node, see `tetlux.fem.operators.fitting`.

        Returns
        -------
        Terms
        """
        edges = diffusion * self._stiffness if np.ndim(diffusion) == 0 else self._stiffness_of(diffusion)
        return Terms(
            self.mesh,
            self._pattern,
            lumping,
            stiffness_term(self.mesh, edges),
            mass_term(self.mesh, sigma_a, lumping, absorption_scale),
            boundary_term(self.mesh, robin, lumping),
        )

    @cached_property
    def _stiffness(self) -> FloatArray:
        return self._stiffness_of(1.0)

    def _stiffness_of(self, diffusion: float | FloatArray) -> FloatArray:
        """``∫ D grad v_i . grad v_j`` of the edges (e,)."""
        mesh = self.mesh
        values = np.empty((6, len(mesh.tetrahedra)))
        each = np.broadcast_to(diffusion, len(mesh.tetrahedra))

        def fill(block: slice, corners: FloatArray) -> None:
            u, v, w = corners[1:] - corners[0]
            normals = [cross(v, w), cross(w, u), cross(u, v)]
            scale = each[block] / (6.0 * dot(u, normals[0]))
            normals.insert(0, -(normals[0] + normals[1] + normals[2]))
            for edge, (i, j) in enumerate(EDGES):
                values[edge, block] = scale * dot(normals[i], normals[j])

        run_on_corners(fill, mesh.points, mesh.tetrahedra)
        return sum_by_index(mesh.tetrahedron_edges.T.reshape(-1), values, len(mesh.edges))

    @cached_property
    def _pattern(self) -> Pattern:
        return pattern_of(self.mesh)

    __repr__ = one_line


def condition_bound(one: Model, other: Model) -> float:
    """A bound of the condition number of one matrix preconditioned by that of another model, both of one unknown.

    For any fluence, each term of one weak form is the same term of the other times a ratio of coefficients, and so the
    sums differ by a factor between the least and the largest ratio. The bound is the largest over the least. Of a shift
    the modulus counts, as in the real matrices that complex ones are preconditioned by (`real_majorant`).
    """
    ratios = []
    for pair in zip(_moduli(one), _moduli(other), strict=True):
        first, second = np.broadcast_arrays(*pair)
        present = (first > 0) | (second > 0)
        with np.errstate(divide="ignore"):
            ratios.append(np.ravel(first[present] / second[present]))
    every = np.concatenate(ratios)
    return float(every.max() / every.min()) if every.min() > 0 else np.inf


def _moduli(model: Model) -> tuple[float | FloatArray, ...]:
    """D, sigma with the modulus of the shift, and robin of a model of one unknown."""
    ((block,),) = model.blocks
    return block.diffusion, block.sigma + abs(model.shift), block.robin
