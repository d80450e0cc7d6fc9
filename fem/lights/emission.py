"""Light that the volume itself emits: a glow, or a fluorescent dye."""

from dataclasses import dataclass

import numpy as np

from tetlux.fem.body.body import Body
from tetlux.fem.inputs import check_positive
from tetlux.fem.media.coefficients import Coefficients
from tetlux.fem.sources.deposit import Deposit
from tetlux.fem.sources.terms import SourceTerms
from tetlux.meshing.errors import InputError
from tetlux.meshing.surface.surface import Surface
from tetlux.meshing.tets.mesh import TetMesh


@dataclass(frozen=True)
class Emission:
    """Uniform isotropic emission of the whole body, or of one of its regions: ``Q0 = density``.

    Parameters
    ----------
    density : float
        Emitted power per volume, W/unit³.
    region : int, optional
        Emit in this region only: 0 is the body outside of its regions, i is the i-th region.

    Raises
    ------
    InputError
        If the density is not positive; and, when solved, if there is no such region.

    Examples
    --------
    >>> glow = Emission(density=0.002, region=1)
    """

    density: float
    region: int | None = None

    def __post_init__(self) -> None:
        check_positive(self.density, "density", "W/unit³")

    def deposit_in(self, body: Body) -> Deposit:
        """Emit everywhere, or in the tetrahedra that a mesh has in the region.

        See `tetlux.fem.Light` for parameters and result.
        """
        del body
        if self.region is None:
            return Deposit(terms=SourceTerms(emission=self.density))
        return Deposit(on_mesh=RegionEmission(self.density, self.region))


@dataclass(frozen=True)
class RegionEmission:
    """Uniform emission of one region of a mesh, W/unit³."""

    density: float
    region: int

    def deposit_on(self, mesh: TetMesh, surface: Surface, coefficients: Coefficients) -> Deposit:
        """See `tetlux.fem.sources.deposit.MeshDependent`."""
        del surface, coefficients
        inside = mesh.regions == self.region
        if not inside.any():
            raise InputError(f"emission is of region {self.region}, and there is none; give one of the body's regions.")
        return Deposit(terms=SourceTerms(emission=np.where(inside, self.density, 0.0)))
