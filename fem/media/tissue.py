"""`tissue`: media of living tissue from what it consists of, one for each wavelength."""

import math
from collections.abc import Mapping, Sequence

import numpy as np

from tetlux.fem.media.medium import BoundaryKind, Medium
from tetlux.fem.media.spectra import SPECTRA, Spectrum
from tetlux.meshing.errors import InputError
from tetlux.meshing.surface.surface import MILLIMETRES

# Of reduced scattering, nm.
REFERENCE_WAVELENGTH = 500.0
# Red blood cells hold some .005 mol/l of haemoglobin, and no dye dissolves to 1 mol/l: more is another unit.
MOST_HAEMOGLOBIN, MOST_MOLES = 0.01, 1.0


def tissue(
    *,
    wavelengths: Sequence[float],
    a: float,
    b: float,
    eta: float,
    hbo2: float = 0.0,
    hhb: float = 0.0,
    water: float = 0.0,
    fat: float = 0.0,
    others: Mapping[str, tuple[Spectrum, float]] | None = None,
    unit: str = "mm",
    boundary: BoundaryKind = "exact",
) -> list[Medium]:
    """Media of tissue at several wavelengths, from its chromophores and its scattering.

    The absorption coefficient is the sum of those of the chromophores, sigma_a = ln(10) (eps_HbO2 c_HbO2 + eps_HHb
    c_HHb) + f_water mu_water + f_fat mu_fat; reduced scattering is sigma_s' = a (wavelength/500 nm)^-b (Jacques 2013,
    Phys. Med. Biol. 58, R37).

    Parameters
    ----------
    wavelengths : sequence of float
        nm, from 600 to 1000 for the chromophores that have a name here.
    a : float
        Reduced scattering at 500 nm, 1/mm whatever the unit.
    b : float
        Scattering power: the exponent by which scattering falls with the wavelength.
    eta : float
        Refractive index relative to the outside.
    hbo2, hhb : float
        Concentrations of haemoglobin with and without oxygen, mol/l of tissue (60e-6 is 60 micromol/l).
    water, fat : float
        Fractions of the volume.
    others : mapping of str to (Spectrum, float), optional
        Substances of your own by name: the spectrum, and the concentration, mol/l, or fraction of the volume,
        whichever its kind asks for.
    unit : str
        Unit of length of the media: nm, um, mm, cm, m or in.
    boundary : {"exact", "classic"}
        See `Medium`.

    Returns
    -------
    list of Medium
        One for each wavelength; coefficients in 1/unit.

    Raises
    ------
    InputError
        If a wavelength is outside a spectrum, an amount is negative, a concentration is not plausible in mol/l, or
        fractions add up to more than 1.

    Notes
    -----
    Spectra are tabulated at every 10 nm. Interpolated from every second row, the rows between are off by 2 % at most
    for haemoglobin beyond 620 nm (8 % at the band of HHb around 750 nm), 7 % for water, and 36 % for fat around 930 nm;
    from all rows errors are a few times smaller.

    Examples
    --------
    >>> red, infrared = tissue(wavelengths=[690, 830], hbo2=60e-6, hhb=40e-6, water=0.7, a=1.2, b=1.3, eta=1.4)
    >>> round(red.sigma_a, 5), round(infrared.sigma_a, 5), round(red.reduced_scattering, 4)
    (0.02307, 0.02208, 0.7895)
    """
    amounts = _amounts({"hbo2": hbo2, "hhb": hhb, "water": water, "fat": fat}, others or {})
    if unit not in MILLIMETRES:
        raise InputError(f'unit "{unit}" is not known; it is one of {", ".join(MILLIMETRES)}.')
    if not math.isfinite(b):
        raise InputError(f"b is {b}; give a finite number.", field="b")
    if not (math.isfinite(a) and a > 0):
        raise InputError(f"a is {a:g}; give the reduced scattering at 500 nm, 1/mm, greater than 0.", field="a")
    if not np.size(wavelengths):
        raise InputError("there are no wavelengths; give at least one, in nm.", field="wavelengths")
    scale = MILLIMETRES[unit]
    media = []
    for wavelength in map(float, wavelengths):
        sigma_a = sum(_absorption(name, spectrum, amount, wavelength) for name, (spectrum, amount) in amounts.items())
        scattering = a * (wavelength / REFERENCE_WAVELENGTH) ** -b
        media.append(Medium(sigma_a=scale * sigma_a, sigma_s_prime=scale * scattering, eta=eta, boundary=boundary))
    return media


def _amounts(
    named: Mapping[str, float], others: Mapping[str, tuple[Spectrum, float]]
) -> dict[str, tuple[Spectrum, float]]:
    """Spectrum and amount of each substance that is there, by name."""
    for name in others:
        if name in SPECTRA:
            raise InputError(f'a spectrum of "{name}" is here already; give yours another name.', field=name)
    amounts = {name: (SPECTRA[name], amount) for name, amount in named.items()} | dict(others)
    for name, (spectrum, amount) in amounts.items():
        is_fraction = spectrum.kind == "absorption"
        most = 1.0 if is_fraction else MOST_HAEMOGLOBIN if name in SPECTRA else MOST_MOLES
        if not 0 <= amount <= most:
            what = "fraction of the volume" if is_fraction else "concentration in mol/l (1e-6 is one micromol/l)"
            raise InputError(f"{name} is {amount:g}; give a {what} from 0 to {most:g}.", field=name)
    fractions = {name: amount for name, (spectrum, amount) in amounts.items() if spectrum.kind == "absorption"}
    if sum(fractions.values()) > 1 + 1e-9:
        names = ", ".join(name for name, amount in fractions.items() if amount)
        raise InputError(f"the fractions of {names} add up to {sum(fractions.values()):g}; they can be 1 together.")
    return {name: each for name, each in amounts.items() if each[1] > 0}


def _absorption(name: str, spectrum: Spectrum, amount: float, wavelength: float) -> float:
    try:
        return spectrum.absorption_at(wavelength, amount)
    except InputError as error:
        raise InputError(f"{name}: {error}", field="wavelengths") from error
