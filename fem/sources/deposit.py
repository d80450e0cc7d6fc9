"""`Deposit`: what a light leaves in a body."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Protocol

from tetlux.fem.media.coefficients import Coefficients
from tetlux.fem.sources.footprint import Footprint
from tetlux.fem.sources.hints import MeshHints
from tetlux.fem.sources.ledger import Ledger
from tetlux.fem.sources.terms import SourceTerms
from tetlux.meshing.describe import one_line
from tetlux.meshing.surface.surface import Surface
from tetlux.meshing.tets.mesh import TetMesh


@dataclass(frozen=True, eq=False)
class Deposit:
    """What a light leaves in a body, as plain data that can be pickled.

    Parameters
    ----------
    ledger : Ledger
        What becomes of its power before it is scattered.
    terms : SourceTerms
        What it adds to the right-hand side.
    hints : MeshHints
        Where the mesh has to be fine.
    footprint : Footprint
        Where it enters the body, for the error of the diffusion approximation.
    warnings : tuple of str
        What the user should know; a `Note` is a sentence with a code.
    on_mesh : MeshDependent, optional
        The part that can only be computed on a mesh, such as light on each of its facets.

    Examples
    --------
    An isotropic point source of 2 W, on a mesh that resolves half a length unit:

    >>> import numpy as np
    >>> terms = SourceTerms(points=np.array([[0.0, 0.0, 1.0]]), powers=np.array([2.0]))
    >>> Deposit(Ledger(incident=2.0), terms, MeshHints(resolution=0.5)).ledger.incident
    2.0
    """

    ledger: Ledger = field(default_factory=Ledger)
    terms: SourceTerms = field(default_factory=SourceTerms)
    hints: MeshHints = field(default_factory=MeshHints)
    footprint: Footprint = field(default_factory=Footprint)
    warnings: tuple[str, ...] = ()
    on_mesh: "MeshDependent | None" = None

    def evaluate_on(self, mesh: TetMesh, surface: Surface, coefficients: Coefficients) -> "Deposit":
        """Compute what depends on the mesh, and add it to the rest.

        Parameters
        ----------
        mesh : TetMesh
        surface : Surface
            The surface of the body, which the mesh approximates.
        coefficients : Coefficients
            Of the tetrahedra.

        Returns
        -------
        Deposit
            Without `on_mesh`.
        """
        if self.on_mesh is None:
            return self
        return merge_deposits([replace(self, on_mesh=None), self.on_mesh.deposit_on(mesh, surface, coefficients)])

    __repr__ = one_line


class MeshDependent(Protocol):
    """The part of a deposit that depends on the mesh: a frozen dataclass of plain values, without closures."""

    def deposit_on(self, mesh: TetMesh, surface: Surface, coefficients: Coefficients) -> Deposit:
        """Compute the deposit on a mesh; see `Deposit.evaluate_on` for the parameters."""
        ...


def merge_deposits(parts: Sequence[Deposit]) -> Deposit:
    """Add up several deposits, at least one."""
    on_mesh = tuple(part.on_mesh for part in parts if part.on_mesh is not None)
    return Deposit(
        Ledger.merge([part.ledger for part in parts]),
        SourceTerms.merge([part.terms for part in parts]),
        MeshHints.merge([part.hints for part in parts]),
        Footprint.merge([part.footprint for part in parts]),
        warnings=tuple(warning for part in parts for warning in part.warnings),
        on_mesh=_Several(on_mesh) if on_mesh else None,
    )


@dataclass(frozen=True, eq=False)
class _Several:
    """The mesh-dependent parts of several deposits."""

    parts: tuple[MeshDependent, ...]

    def deposit_on(self, mesh: TetMesh, surface: Surface, coefficients: Coefficients) -> Deposit:
        """See `MeshDependent`."""
        return merge_deposits([part.deposit_on(mesh, surface, coefficients) for part in self.parts])

    __repr__ = one_line
