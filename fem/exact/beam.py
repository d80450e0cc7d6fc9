"""Source densities of diffuse light along a collimated beam in a medium."""

from dataclasses import dataclass
from typing import Literal

from tetlux.fem.media.medium import Medium
from tetlux.meshing.errors import InputError

Source = Literal["delta-eddington", "similarity"]


@dataclass(frozen=True)
class BeamSource:
    """Source densities along a collimated beam of unit power, at depth s along the beam.

    ``Q0 = isotropic e^{-extinction s}`` and ``Q1/sigma_t' = forward e^{-extinction s}`` along the beam. If f(s) is the
    field of a unit point source at depth s, the field of the beam is
    ``∫ e^{-extinction s} (isotropic f + forward df/ds) ds``.

    Attributes
    ----------
    extinction : float
        1/unit.
    isotropic : float
        1/unit.
    forward : float
        Dimensionless.
    """

    extinction: float
    isotropic: float
    forward: float

    @property
    def volume(self) -> float:
        """Density of point sources if df/ds is integrated by parts, besides two sources at the ends, 1/unit."""
        return self.isotropic + self.forward * self.extinction


def beam_source(medium: Medium, source: Source) -> BeamSource:
    """Source densities along a beam in a medium.

    Parameters
    ----------
    medium : Medium
        The medium around the beam.
    source : {"delta-eddington", "similarity"}
        ``"delta-eddington"`` (Joseph 1976): ``sigma_s* = sigma_s (1 - g²)``, ``g* = g/(1 + g)``, with the first
        moment ``Q1 = g* sigma_s* E``. ``"similarity"``: ``sigma_s' e^{-sigma_t' s}`` and no first moment. Both are
        equal in a medium that scatters isotropically.

    Returns
    -------
    BeamSource

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
