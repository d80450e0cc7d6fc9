"""`Subtraction`: charges that are subtracted on a mesh, and what that adds to the equations there."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tetlux.fem.known.charges import Charges
from tetlux.fem.known.fitted import FittedLight
from tetlux.fem.known.fitted_patch import FittedPatch, fitted_patch, fitted_terms
from tetlux.fem.known.kept_patches import kept_patch
from tetlux.fem.known.patch import Patch, patch_of
from tetlux.fem.known.patch_terms import PatchTerms, patch_terms
from tetlux.fem.operators.assembly import Lumping
from tetlux.fem.operators.operator import Operator
from tetlux.meshing.arrays import BoolArray, NumberArray
from tetlux.meshing.describe import one_line
from tetlux.meshing.tets.mesh import TetMesh


@dataclass(frozen=True, eq=False)
class Subtraction:
    """Charges of one light that are subtracted on a patch of a mesh.

    Attributes
    ----------
    light : int
        The number of the light.
    patch : Patch
        Where they are subtracted.
    terms : PatchTerms
        What that adds to the load vector and to the ledger.
    mass : {"lumped", "consistent"}
        As in the system matrix.
    is_kept : bool
        Whether the patch is that of an earlier solution on the mesh.
    """

    light: int
    patch: Patch
    terms: PatchTerms
    mass: Lumping
    is_kept: bool = False

    def shrink_to(self, accurate: BoolArray) -> "Subtraction":
        """The same on the tetrahedra whose four nodes are accurate, (n,), alone."""
        patch = patch_of(self.patch.mesh, self.patch.charges, accurate, self.patch.at_nodes)
        return replace(self, patch=patch, terms=patch_terms(patch, self.mass))

    def fluence_of(self, solution: NumberArray) -> NumberArray:
        """Fluence at the nodes, (n,), by the solution (n,) for the load of `terms`."""
        missing = isinstance(self.patch, FittedPatch) and self.patch.is_whole
        return solution + self.patch.at_nodes if missing else solution

    __repr__ = one_line


def subtract_on(
    mesh: TetMesh, light: int, charges: Charges, mass: Lumping, accurate: BoolArray | None = None
) -> Subtraction:
    """Subtract charges of a light at accurate nodes (n,), or everywhere if these are not known."""
    patch = patch_of(mesh, charges, np.ones(len(mesh.points), dtype=bool) if accurate is None else accurate)
    return Subtraction(light, patch, patch_terms(patch, mass), mass)


def subtract_as_before(mesh: TetMesh, light: int, charges: Charges, mass: Lumping) -> Subtraction:
    """Subtract charges of a light where they were subtracted on the mesh before; everywhere if they were not."""
    patch = kept_patch(mesh, charges, charges.fluence(mesh.points), "linear")
    if patch is None:
        return subtract_on(mesh, light, charges, mass)
    return Subtraction(light, patch, patch_terms(patch, mass), mass, is_kept=True)


def subtract_fitted(
    light: int, fitted: FittedLight, operator: Operator, mass: Lumping, before: Sequence[Patch] = ()
) -> Subtraction:
    """Subtract fitted charges of a light; where it is whole, its load is that of what is missing.

    Parameters
    ----------
    light : int
    fitted : FittedLight
    operator : Operator
        That is solved with.
    mass : {"lumped", "consistent"}
    before : sequence of Patch
        Of all lights on a mesh that the operator's is a refinement of.

    Returns
    -------
    Subtraction
    """
    ours = (each for each in before if isinstance(each, FittedPatch) and each.charges is fitted.charges)
    patch = fitted_patch(operator.mesh, fitted, next(ours, None))
    return Subtraction(light, patch, fitted_terms(patch, operator.absorption_weights, mass), mass)
