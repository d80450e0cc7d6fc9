"""Materials by name: coefficients measured by Jensen, Marschner, Levoy & Hanrahan (2001)."""

import difflib

from tetlux.fem.media.medium import Medium
from tetlux.meshing.errors import InputError
from tetlux.meshing.surface.surface import MILLIMETRES

Colours = tuple[float, float, float]

# sigma_s' and sigma_a, 1/mm, each for red, green and blue (Jensen 2001, figure 5).
MATERIALS: dict[str, tuple[Colours, Colours]] = {
    "apple": ((2.29, 2.39, 1.97), (0.0030, 0.0034, 0.046)),
    "chicken1": ((0.15, 0.21, 0.38), (0.015, 0.077, 0.19)),
    "chicken2": ((0.19, 0.25, 0.32), (0.018, 0.088, 0.20)),
    "cream": ((7.38, 5.47, 3.15), (0.0002, 0.0028, 0.0163)),
    "ketchup": ((0.18, 0.07, 0.03), (0.061, 0.97, 1.45)),
    "marble": ((2.19, 2.62, 3.00), (0.0021, 0.0041, 0.0071)),
    "potato": ((0.68, 0.70, 0.55), (0.0024, 0.0090, 0.12)),
    "skimmilk": ((0.70, 1.22, 1.90), (0.0014, 0.0025, 0.0142)),
    "skin1": ((0.74, 0.88, 1.01), (0.032, 0.17, 0.48)),
    "skin2": ((1.09, 1.59, 1.79), (0.013, 0.070, 0.145)),
    "spectralon": ((11.6, 20.4, 14.9), (0.0, 0.0, 0.0)),
    "wholemilk": ((2.55, 3.21, 3.77), (0.0011, 0.0024, 0.014)),
}
ETA, ETA_OF_MARBLE = 1.3, 1.5


def material(name: str, *, unit: str = "mm") -> tuple[Medium, Medium, Medium]:
    """Look up the media of a measured material for red, green and blue light (Jensen et al. 2001, figure 5).

    Parameters
    ----------
    name : str
        apple, chicken1, chicken2, cream, ketchup, marble, potato, skimmilk, skin1, skin2, spectralon or wholemilk.
    unit : str
        Unit of length; coefficients are in 1/unit: nm, um, mm, cm, m or in.

    Returns
    -------
    red, green, blue : Medium

    Raises
    ------
    InputError
        If the material or the unit is not known.

    Examples
    --------
    >>> red, green, blue = material("marble")
    >>> red
    Medium(sigma_a=0.0021, eta=1.5, sigma_s_prime=2.19)
    """
    if name not in MATERIALS:
        close = difflib.get_close_matches(str(name).lower(), MATERIALS, n=1)
        hint = f'did you mean "{close[0]}"? ' if close else ""
        raise InputError(f'material "{name}" is not known; {hint}the materials here are {", ".join(MATERIALS)}.')
    if unit not in MILLIMETRES:
        raise InputError(f'unit "{unit}" is not known; it is one of {", ".join(MILLIMETRES)}.')
    scale = MILLIMETRES[unit]
    eta = ETA_OF_MARBLE if name == "marble" else ETA
    red, green, blue = (
        Medium(sigma_a=scale * sigma_a, sigma_s_prime=scale * sigma_s_prime, eta=eta)
        for sigma_s_prime, sigma_a in zip(*MATERIALS[name], strict=True)
    )
    return red, green, blue
