"""`Terms`: the real terms of a system matrix, all of one pattern, to be combined with a shift.

Beyond steady light the equation is the same with ``sigma_a + s n/c`` in place of sigma_a, with n the refractive index,
c the speed of light and ``s = i omega`` for light modulated at the angular frequency omega, so that its matrix is::

    K + A + B + (s n/c) M

with K the stiffness, A the absorption, B the boundary term and M the mass matrix. `mass` is M; `lumping` says how M, A
and B are integrated.
"""

from dataclasses import dataclass
from functools import cached_property, reduce
from typing import Literal

import numpy as np
from scipy.sparse import csr_array

from tetlux.fem.operators.pattern import Pattern
from tetlux.meshing.arrays import FloatArray, sum_by_index
from tetlux.meshing.describe import one_line
from tetlux.meshing.tets.mesh import TetMesh

Lumping = Literal["lumped", "consistent"]


@dataclass(frozen=True, eq=False)
class Term:
    """A symmetric matrix on the nodes of a mesh.

    Attributes
    ----------
    edges : (e,) ndarray, optional
        Entries along the edges; a diagonal matrix has none.
    diagonal : (n,) ndarray
    """

    edges: FloatArray | None
    diagonal: FloatArray

    def row_sums(self, mesh: TetMesh) -> FloatArray:
        """Sums of its rows, (n,)."""
        return self.diagonal if self.edges is None else self.diagonal + to_ends(mesh, self.edges)

    __repr__ = one_line


@dataclass(frozen=True, eq=False)
class Terms:
    """The terms of the weak form in `tetlux.fem.operators.forms`, and the mass matrix.

    Attributes
    ----------
    mesh : TetMesh
    pattern : Pattern
    lumping : {"lumped", "consistent"}
        Integration of all terms but the stiffness.
    stiffness : Term
        K, ``∫ D grad phi . grad v``.
    absorption : Term
        A, ``∫ sigma_a phi v``.
    boundary_term : Term
        B, ``∮ phi v / (2A)``.
    """

    mesh: TetMesh
    pattern: Pattern
    lumping: Lumping
    stiffness: Term
    absorption: Term
    boundary_term: Term

    @cached_property
    def mass(self) -> Term:
        """M, ``∫ phi v``."""
        return mass_term(self.mesh, 1.0, self.lumping)

    def combine(self, shift: complex = 0.0) -> csr_array:
        """The matrix ``K + A + B + shift M``.

        Parameters
        ----------
        shift : float or complex
            What is added to sigma_a, 1/unit.

        Returns
        -------
        (n, n) csr_array
            Symmetric, and not Hermitian where it is complex; it shares its pattern with others of the mesh.
        """
        parts = [self.stiffness, self.absorption, self.boundary_term]
        diagonal = reduce(np.add, [part.diagonal for part in parts])
        edges = reduce(np.add, [part.edges for part in parts if part.edges is not None])
        if shift != 0:
            diagonal = diagonal + shift * self.mass.diagonal
            edges = edges if self.mass.edges is None else edges + shift * self.mass.edges
        return self.pattern.matrix(edges, diagonal)

    __repr__ = one_line


def stiffness_term(mesh: TetMesh, edges: FloatArray) -> Term:
    """The stiffness of given entries along the edges (e,): each of its rows sums to zero."""
    return Term(edges, -to_ends(mesh, edges))


def mass_term(mesh: TetMesh, sigma_a: float | FloatArray, lumping: Lumping, scale: FloatArray | None = None) -> Term:
    """``∫ sigma_a phi v``, with sigma_a of all or of each tetrahedron (m,), and a factor on that of each node (n,)."""
    lumped = sigma_a * mesh.node_volumes if np.ndim(sigma_a) == 0 else mesh.to_nodes(sigma_a * mesh.volumes)
    lumped = lumped if scale is None else scale * lumped
    if lumping == "lumped":
        return Term(None, lumped)
    slots = mesh.tetrahedron_edges.T.reshape(-1)
    return _consistent_term(
        mesh, sum_by_index(slots, np.tile(sigma_a * mesh.volumes / 20.0, 6), len(mesh.edges)), lumped
    )


def boundary_term(mesh: TetMesh, robin: float | FloatArray, lumping: Lumping) -> Term:
    """``∮ robin phi v``, with robin of all or of each boundary triangle (f,)."""
    lumped = np.zeros(len(mesh.points))
    lumped[mesh.boundary_nodes] = mesh.to_boundary_nodes(robin * mesh.boundary_areas)
    if lumping == "lumped":
        return Term(None, lumped)
    across = np.repeat(robin * mesh.boundary_areas / 12.0, 3)
    return _consistent_term(mesh, sum_by_index(mesh.boundary_edges, across, len(mesh.edges)), lumped)


def _consistent_term(mesh: TetMesh, edges: FloatArray, lumped: FloatArray) -> Term:
    """The term of given entries along the edges (e,), whose rows sum to the diagonal of the lumped term (n,)."""
    return Term(edges, lumped - to_ends(mesh, edges))


def to_ends(mesh: TetMesh, edges: FloatArray) -> FloatArray:
    """Sums of values of edges (e,) at the nodes that these end in, (n,)."""
    low, high = mesh.edges.T
    return sum_by_index(low, edges, len(mesh.points)) + sum_by_index(high, edges, len(mesh.points))
