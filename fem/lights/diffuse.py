"""Uniform diffuse light from all around."""

from dataclasses import dataclass

from tetlux.fem.body.body import Body
from tetlux.fem.inputs import check_positive
from tetlux.fem.media.fresnel import moments
from tetlux.fem.media.medium import Medium
from tetlux.fem.sources.deposit import Deposit
from tetlux.meshing.errors import InputError


@dataclass(frozen=True)
class DiffuseLight:
    """The same radiance from every direction, on every part of the surface.

    With the transmitted irradiance E_t the boundary becomes ``phi + 2 A D dphi/dn = 4 E_t/(1 - 2 C1)``; it is
    for light that is diffuse, and a collimated beam modelled so is off by 12 % at a reduced albedo of 0.9.

    Parameters
    ----------
    irradiance : float
        On the outside of the surface, W/unit².

    Raises
    ------
    InputError
        If it is not a positive number; and, when solved, if the medium's boundary is "classic", whose A
        has no moments C1 and C2 to go with it.
    """

    irradiance: float

    def __post_init__(self) -> None:
        check_positive(self.irradiance, "irradiance", "W/unit²")

    def deposit_in(self, body: Body) -> Deposit:
        """What passes the surface; its power depends on the mesh's area, and is known when solved."""
        transmittance = diffuse_transmittance(body.outer, "diffuse light")
        return Deposit(irradiance=self.irradiance, transmitted_irradiance=self.irradiance * transmittance)


def diffuse_transmittance(medium: Medium, light: str) -> float:
    """Share of diffuse light that passes a surface from outside, ``eta² (1 - 2 C1)``.

    Parameters
    ----------
    medium : Medium
        Below the surface.
    light : str
        What an error calls the light.

    Raises
    ------
    InputError
        If the medium's boundary is "classic".
    """
    if medium.boundary != "exact":
        raise InputError(f'{light} needs the boundary "exact": "classic" has no Fresnel moments to go with it.')
    # Reciprocity: from outside passes eta² times the share that passes from inside, 1 - 2 C1.
    c1, _ = moments(medium.eta)
    return float(medium.eta**2 * (1.0 - 2.0 * c1))
