"""Sources of diffuse light along a collimated beam in a medium."""

from dataclasses import dataclass
from typing import Literal

from tetlux.fem.media.medium import Medium
from tetlux.meshing.errors import InputError

Source = Literal["delta-eddington", "similarity"]


@dataclass(frozen=True)
class BeamSource:
    """Source densities along a collimated beam of unit power, at depth s along the beam.

    ``Q0 = isotropic e^{-extinction s}`` and ``Q1/sigma_t' = forward e^{-extinction s}`` along the beam. A
    field f that a unit point source at depth s causes somewhere becomes, for the beam,
    ``∫ e^{-extinction s} (isotropic f + forward df/ds) ds``.

    Attributes
    ----------
    extinction : float
        1/unit.
    isotropic : float
        1/unit.
    forward : float
        Without a unit.
    """

    extinction: float
    isotropic: float
    forward: float

    @property
    def volume(self) -> float:
        """Density of point sources after integrating df/ds by parts; two sources at the ends remain, 1/unit."""
        return self.isotropic + self.forward * self.extinction


def beam_source(medium: Medium, source: Source) -> BeamSource:
    """Describe the densities along a beam in `medium`.

    Parameters
    ----------
    medium : Medium
        Where the beam runs.
    source : {"delta-eddington", "similarity"}
        ``"delta-eddington"`` (Joseph 1976): ``sigma_s* = sigma_s (1 - g²)``, ``g* = g/(1 + g)``, with the first
        moment ``Q1 = g* sigma_s* E``. ``"similarity"``: ``sigma_s' e^{-sigma_t' s}`` and no first moment. Both are
        the same in a medium that scatters isotropically.

    Raises
    ------
    InputError
        If `source` is neither.
    """
    if source == "similarity":
        return BeamSource(medium.sigma_t_prime, medium.reduced_scattering, 0.0)
    if source == "delta-eddington":
        scattering, cosine = medium.delta_eddington
        return BeamSource(medium.sigma_a + scattering, scattering, cosine * scattering / medium.sigma_t_prime)
    raise InputError(f'source is "{source}"; it is "delta-eddington" or "similarity".')
