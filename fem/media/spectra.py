"""Absorption spectra of what colours tissue: haemoglobin, water and fat from 600 to 1000 nm, and your own."""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Literal, get_args

import numpy as np

from tetlux.meshing.describe import one_line
from tetlux.meshing.errors import InputError

if TYPE_CHECKING:
    from scipy.interpolate import PchipInterpolator

SpectrumKind = Literal["extinction", "absorption"]


@dataclass(frozen=True)
class Spectrum:
    """How strongly a substance absorbs at each wavelength.

    Between the wavelengths values are interpolated by monotone cubic polynomials, so that none is negative.

    Parameters
    ----------
    wavelengths : tuple of float
        At least two, ascending, nm.
    values : tuple of float
        One for each wavelength: molar extinction coefficients to the base 10, 1/(cm mol/l), or absorption coefficients
        of the pure substance to the base e, 1/mm.
    kind : {"extinction", "absorption"}
        Which of the two they are. Of a substance by extinction a concentration is given, mol/l, of one by absorption a
        fraction of the volume.

    Raises
    ------
    InputError
        If wavelengths do not ascend, or a value is negative or not finite.

    Examples
    --------
    >>> dye = Spectrum((700.0, 800.0, 900.0), (5e4, 2e5, 1e4), kind="extinction")
    >>> round(dye.absorption_at(800.0, 1e-6), 6)  # ln(10) 2e5/(cm mol/l) 1e-6 mol/l
    0.046052
    """

    wavelengths: tuple[float, ...]
    values: tuple[float, ...]
    kind: SpectrumKind

    def __post_init__(self) -> None:
        if self.kind not in get_args(SpectrumKind):
            raise InputError(f'the kind of a spectrum is "{self.kind}"; it is "extinction" or "absorption".')
        if len(self.wavelengths) != len(self.values) or len(self.values) < 2:
            raise InputError("a spectrum needs at least two wavelengths, and a value for each.")
        if not (np.diff(self.wavelengths) > 0).all() or not np.isfinite(self.wavelengths).all():
            raise InputError("the wavelengths of a spectrum must ascend, without repetition.")
        for wavelength, value in zip(self.wavelengths, self.values, strict=True):
            if not (math.isfinite(value) and value >= 0):
                raise InputError(f"the value at {wavelength:g} nm is {value:g}; give finite values of 0 or more.")

    @cached_property
    def _between(self) -> "PchipInterpolator":
        # It takes a fifth of a second to import, which only tissue needs.
        from scipy.interpolate import PchipInterpolator  # noqa: PLC0415

        return PchipInterpolator(self.wavelengths, self.values)

    def absorption_at(self, wavelength: float, amount: float) -> float:
        """Absorption coefficient of an amount of the substance, 1/mm.

        Parameters
        ----------
        wavelength : float
            nm.
        amount : float
            Concentration, mol/l, or fraction of the volume.

        Raises
        ------
        InputError
            If the spectrum does not reach the wavelength.
        """
        first, last = self.wavelengths[0], self.wavelengths[-1]
        if not first <= wavelength <= last:
            raise InputError(f"the wavelength {wavelength:g} nm is outside the spectrum, {first:g} to {last:g} nm.")
        value = amount * float(self._between(wavelength))
        # Tables of extinction are to the base 10 and in 1/cm.
        return math.log(10.0) * value / 10.0 if self.kind == "extinction" else value

    __repr__ = one_line


# Wavelength, nm; extinction of oxygenated and deoxygenated haemoglobin, 1/(cm mol/l), base 10 (compiled by S. Prahl,
# Oregon Medical Laser Center, from data of W. B. Gratzer and N. Kollias; a molecule has four haems); absorption of pure
# water and of pure fat, 1/mm (water to 720 nm as measured by Pope & Fry 1997, Appl. Opt. 36, 8710).
_TABLE = (
    (600, 3200, 14677.2, 0.0002224, 0.000466),
    (610, 1506, 9443.6, 0.0002644, 0.000464),
    (620, 942, 6509.6, 0.0002755, 0.00043),
    (630, 610, 5148.8, 0.0002916, 0.000428),
    (640, 442, 4345.2, 0.0003108, 0.000452),
    (650, 368, 3750.12, 0.00034, 0.000471),
    (660, 319.6, 3226.56, 0.00041, 0.000418),
    (670, 294, 2795.12, 0.000439, 0.00045),
    (680, 277.6, 2407.92, 0.000465, 0.000406),
    (690, 276, 2051.96, 0.000516, 0.000342),
    (700, 290, 1794.28, 0.000624, 0.000323),
    (710, 314, 1540.48, 0.000827, 0.000315),
    (720, 348, 1325.88, 0.001231, 0.000367),
    (730, 390, 1102.2, 0.001962, 0.000499),
    (740, 446, 1115.88, 0.002768, 0.000654),
    (750, 518, 1405.24, 0.002848, 0.000972),
    (760, 586, 1548.52, 0.002861, 0.001278),
    (770, 650, 1311.88, 0.002823, 0.000871),
    (780, 710, 1075.44, 0.002691, 0.000409),
    (790, 756, 890.8, 0.002466, 0.000346),
    (800, 816, 761.72, 0.002246, 0.000403),
    (810, 864, 717.08, 0.002188, 0.000527),
    (820, 916, 693.76, 0.002329, 0.000691),
    (830, 974, 693.04, 0.003202, 0.000803),
    (840, 1022, 692.36, 0.003949, 0.000726),
    (850, 1058, 691.32, 0.004199, 0.000637),
    (860, 1092, 694.32, 0.004449, 0.000674),
    (870, 1128, 705.84, 0.004752, 0.000938),
    (880, 1154, 726.44, 0.005298, 0.001636),
    (890, 1178, 743.6, 0.005831, 0.003116),
    (900, 1198, 761.84, 0.006409, 0.004633),
    (910, 1214, 774.56, 0.007112, 0.007046),
    (920, 1224, 777.36, 0.008605, 0.01065),
    (930, 1222, 763.84, 0.01238, 0.0131),
    (940, 1214, 693.44, 0.01818, 0.008754),
    (950, 1204, 602.24, 0.02976, 0.003799),
    (960, 1186, 525.56, 0.04385, 0.002047),
    (970, 1162, 429.32, 0.048, 0.001528),
    (980, 1128, 359.656, 0.04821, 0.001417),
    (990, 1080, 283.22, 0.04532, 0.001716),
    (1000, 1024, 206.784, 0.04072, 0.002654),
)
_WAVELENGTHS, _HBO2, _HHB, _WATER, _FAT = (tuple(map(float, column)) for column in zip(*_TABLE, strict=True))

SPECTRA = {
    "hbo2": Spectrum(_WAVELENGTHS, _HBO2, kind="extinction"),
    "hhb": Spectrum(_WAVELENGTHS, _HHB, kind="extinction"),
    "water": Spectrum(_WAVELENGTHS, _WATER, kind="absorption"),
    "fat": Spectrum(_WAVELENGTHS, _FAT, kind="absorption"),
}
