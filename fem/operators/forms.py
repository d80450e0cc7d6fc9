"""The weak form of the diffusion equation, as it stands on paper.

Find phi such that for every test function v::

    ∫ D grad phi . grad v  +  ∫ sigma_a phi v  +  ∮ phi v / (2A)  =  ∫ Q0 v  +  (1/sigma_t') ∫ Q1 . grad v

which is equation 9 of the CS667 notes, tested with v and integrated by parts, with the partial-current
boundary ``E.n = phi/(2A)``. The boundary term of Q1 cancels against that of the flux
``E = Q1/sigma_t' - D grad phi`` and is left out on purpose. The right-hand side is in `tetlux.fem.operators.loads`.
"""

from typing import Any

import numpy as np
from scipy.sparse import csr_array
from skfem import Basis, BilinearForm, ElementTetP1, FacetBasis, MeshTet1
from skfem.helpers import dot, grad

from tetlux.fem.media.medium import Medium
from tetlux.fem.operators.assembly import Lumping
from tetlux.meshing.tets.mesh import TetMesh

# Quadrature at the corners makes the mass matrices diagonal: that is all that lumping is for P1.
_CORNERS_OF_TETRAHEDRON = (np.array([[0.0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]), np.full(4, 1 / 24))
_CORNERS_OF_TRIANGLE = (np.array([[0.0, 1, 0], [0, 0, 1]]), np.full(3, 1 / 6))


@BilinearForm
def diffusion(phi: Any, v: Any, w: Any) -> Any:
    """``∫ D grad phi . grad v``."""
    return w.D * dot(grad(phi), grad(v))


@BilinearForm
def absorption(phi: Any, v: Any, w: Any) -> Any:
    """``∫ sigma_a phi v``."""
    return w.sigma_a * phi * v


@BilinearForm
def exitance(phi: Any, v: Any, w: Any) -> Any:
    """``∮ phi v / (2A)``: what leaves through the boundary."""
    return phi * v / (2.0 * w.A)


def weak_form_matrix(mesh: TetMesh, medium: Medium, lumping: Lumping = "lumped") -> csr_array:
    """The matrix of the left-hand side by scikit-fem's quadrature, to check `tetlux.fem.operators.assembly` by.

    Parameters
    ----------
    mesh : TetMesh
    medium : Medium
    lumping : {"lumped", "consistent"}
        How the two terms without derivatives are integrated.

    Returns
    -------
    (n, n) csr_array
        Symmetric, positive definite.
    """
    lumped = lumping == "lumped"
    body = MeshTet1(np.ascontiguousarray(mesh.points.T), np.ascontiguousarray(mesh.tetrahedra.T))
    element = ElementTetP1()
    whole = {"quadrature": _CORNERS_OF_TETRAHEDRON} if lumped else {"intorder": 2}
    facet = {"quadrature": _CORNERS_OF_TRIANGLE} if lumped else {"intorder": 2}
    constant = Basis(body, element, intorder=0)
    inside = Basis(body, element, **whole)
    boundary = FacetBasis(body, element, **facet)
    matrix = (
        diffusion.assemble(constant, D=medium.diffusion)
        + absorption.assemble(inside, sigma_a=medium.sigma_a)
        + exitance.assemble(boundary, A=medium.boundary_factor)
    )
    return csr_array(matrix)
