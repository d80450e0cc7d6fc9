"""Fluorophores in a body: where each of them is, what it adds to the media, and how much of the light it emits."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from tetlux.fem.labels import find_label
from tetlux.fem.media.coefficients import AnyMedium
from tetlux.fem.media.fluorophore import Fluorophore, add_absorption
from tetlux.fem.outcome.power import DyePower
from tetlux.meshing.arrays import BoolArray, NumberArray
from tetlux.meshing.describe import one_line
from tetlux.meshing.errors import InputError
from tetlux.meshing.tets.mesh import TetMesh


class PlacedDye(NamedTuple):
    """A fluorophore and the label of the part that holds it; None for the whole body."""

    fluorophore: Fluorophore
    label: int | None

    def cells(self, mesh: TetMesh) -> BoolArray:
        """Whether it is in each tetrahedron of a mesh, (m,)."""
        whole = self.label is None
        return np.ones(len(mesh.tetrahedra), dtype=bool) if whole else np.asarray(mesh.regions == self.label)


@dataclass(frozen=True, eq=False)
class Dyes:
    """All fluorophores of a body.

    Attributes
    ----------
    placed : tuple of PlacedDye
    """

    placed: tuple[PlacedDye, ...]

    def add_to(self, media: Mapping[int, AnyMedium]) -> dict[int, AnyMedium]:
        """Media of the excitation by label, with the absorption of the dyes."""
        return {label: self._added(medium, label) for label, medium in media.items()}

    def _added(self, medium: AnyMedium, label: int) -> AnyMedium:
        here = [dye.absorption for dye, place in self.placed if place in (None, label)]
        return add_absorption(medium, sum(here)) if here else medium

    def weights(self, mesh: TetMesh, omega: float) -> NumberArray:
        """Emitted power over the fluence in each tetrahedron of a mesh, (m,), 1/unit, of light modulated at omega."""
        shares = [each.fluorophore.absorption * each.fluorophore.emitted_share(omega) for each in self.placed]
        return np.asarray(
            np.sum([share * each.cells(mesh) for share, each in zip(shares, self.placed, strict=True)], axis=0)
        )

    __repr__ = one_line


def power_of(dye: Fluorophore, integral: complex, frequency: float) -> DyePower:
    """The ledger of a dye by the integral of the fluence over where it is, W unit, of light of a frequency, Hz."""
    omega = 2.0 * math.pi * frequency
    absorbed = dye.absorption * integral
    stored = dye.stored_share(omega) * absorbed if omega else 0.0
    return DyePower(absorbed, (1.0 - dye.quantum_yield) * absorbed, dye.emitted_share(omega) * absorbed, stored)


def place_dyes(fluorophores: Sequence[Fluorophore], mesh: TetMesh | None, regions: int | None) -> Dyes:
    """Find the parts of a body that hold fluorophores.

    Parameters
    ----------
    fluorophores : sequence of Fluorophore
    mesh : TetMesh, optional
        Whose labels have the media.
    regions : int, optional
        How many regions the body has; None if its media are those of labels.

    Returns
    -------
    Dyes

    Raises
    ------
    InputError
        If there is no fluorophore, or no such part.
    """
    if not isinstance(fluorophores, Sequence) or len(fluorophores) == 0:
        raise InputError("there is no fluorophore; give a list of at least one.", field="fluorophores")
    placed = []
    for dye in fluorophores:
        if not isinstance(dye, Fluorophore):
            raise InputError(f"{dye!r} is no fluorophore; give Fluorophore(absorption, quantum_yield).")
        placed.append(PlacedDye(dye, None if dye.region is None else _label_of(dye.region, mesh, regions)))
    return Dyes(tuple(placed))


def _label_of(region: int | str, mesh: TetMesh | None, regions: int | None) -> int:
    if regions is None:
        assert mesh is not None
        return find_label(mesh, region)
    if isinstance(region, int) and not isinstance(region, bool) and 0 <= region <= regions:
        return region
    known = "0, which is all of it" if regions == 0 else f"0, outside of its regions, to {regions}"
    raise InputError(f"a fluorophore is in region {region!r}, where the body has nothing; its parts are {known}.")
