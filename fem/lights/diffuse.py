"""Uniform diffuse light from all around."""

from dataclasses import dataclass

from tetlux.fem.body.body import Body
from tetlux.fem.inputs import check_positive
from tetlux.fem.media.fresnel import moments
from tetlux.fem.media.medium import Medium
from tetlux.fem.sources.deposit import Deposit
from tetlux.fem.sources.terms import SourceTerms
from tetlux.meshing.errors import InputError


@dataclass(frozen=True)
class DiffuseLight:
    """The same radiance from every direction, on the whole surface.

    With the irradiance E_t that passes the surface, the boundary condition of the fluence phi becomes ``phi + 2 A D
    dphi/dn = 4 E_t/(1 - 2 C1)``, where C1 is the first moment of the internal reflectance. A collimated beam that is
    modelled as diffuse light is off by 12 % at a reduced albedo of 0.9.

    Parameters
    ----------
    irradiance : float
        On the outside of the surface, W/unit².

    Raises
    ------
    InputError
        If the irradiance is not a positive number; and, when solved, if the medium's boundary is "classic", for whose
        A there are no Fresnel moments C1 and C2.

    Examples
    --------
    >>> sky = DiffuseLight(irradiance=0.1)
    """

    irradiance: float

    def __post_init__(self) -> None:
        check_positive(self.irradiance, "irradiance", "W/unit²")

    def deposit_in(self, body: Body) -> Deposit:
        """Compute the transmitted irradiance; the power follows from the area of the mesh.

        See `tetlux.fem.Light` for parameters and result.
        """
        transmittance = diffuse_transmittance(body.outer, "diffuse light")
        return Deposit(
            terms=SourceTerms(irradiance=self.irradiance, transmitted_irradiance=self.irradiance * transmittance)
        )


def diffuse_transmittance(medium: Medium, light: str) -> float:
    """Share of diffuse light that passes a surface from outside, ``eta² (1 - 2 C1)``.

    By reciprocity it is eta² times the share that passes from inside, 1 - 2 C1.

    Parameters
    ----------
    medium : Medium
        Below the surface.
    light : str
        What an error message calls the light.

    Returns
    -------
    float

    Raises
    ------
    InputError
        If the medium's boundary is "classic".
    """
    check_exact_boundary(medium, light)
    c1, _ = moments(medium.eta)
    return float(medium.eta**2 * (1.0 - 2.0 * c1))


def check_exact_boundary(medium: Medium, light: str) -> None:
    """Refuse a medium whose boundary is "classic", for a light that an error message calls by the name `light`.

    Raises
    ------
    InputError
    """
    if medium.boundary != "exact":
        raise InputError(f'{light} needs the boundary "exact": "classic" has no Fresnel moments to go with it.')
