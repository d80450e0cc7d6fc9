"""Light modulated at one frequency: what that adds to the absorption, and the amplitude and phase of what is seen.

All powers vary as ``Re(P exp(i omega t))``. Then the fluence does so too, with a complex amplitude that solves the
diffusion equation with ``sigma_a + i omega n/c`` in place of sigma_a. Its boundary and D are those of steady light. The
flux itself lags behind its gradient, ``grad phi = -3 (sigma_t' + i omega n/c) E``, which diffusion leaves out.
"""

import math
from collections.abc import Iterable, Sequence

import numpy as np

from tetlux.fem.media.coefficients import AnyMedium, base_of
from tetlux.fem.media.medium import Medium
from tetlux.meshing.arrays import FloatArray, NumberArray
from tetlux.meshing.errors import InputError
from tetlux.meshing.notes import Note
from tetlux.meshing.surface.surface import MILLIMETRES

# In vacuum, mm/s.
SPEED_OF_LIGHT = 299_792_458e3
# A larger omega over v sigma_t' is reported. At this one D with the lag of the flux, ``D/(1 + i omega/(v sigma_t'))``,
# has 2 % less of a modulus than D, and lags by 11 degrees.
FASTEST = 0.2
# Light of a larger one is no longer diffuse by any account, and would need a mesh of millions; it is refused.
REFUSED = 10.0
# Lags are given from this angle on, in degrees: rounding may put them below 0.
LEAST_LAG = -30.0


def shift_of_frequency(frequency: float, medium: Medium, unit: str, outside_index: float = 1.0) -> complex:
    """What modulation adds to sigma_a: ``i omega n/c``, with n = `eta` times the index of the outside.

    Parameters
    ----------
    frequency : float
        Hz; 0 for steady light.
    medium : Medium
    unit : str
        Of length.
    outside_index : float
        Refractive index of what surrounds the body.

    Returns
    -------
    complex
        1/unit.

    Raises
    ------
    InputError
        If the frequency is negative, not finite or far too high, or the index is not sensible.

    Examples
    --------
    >>> tissue = Medium(sigma_a=0.01, sigma_s_prime=1.0, eta=1.4)
    >>> round(shift_of_frequency(100e6, tissue, "mm").imag, 7)
    0.0029342
    """
    if not (math.isfinite(frequency) and frequency >= 0):
        raise InputError(f"frequency is {frequency:g}; give a frequency in Hz, 0 for steady light.", field="frequency")
    if not 1.0 <= outside_index <= 10.0:
        raise InputError(
            f"outside_index is {outside_index:g}; give the refractive index of what surrounds the body, 1 or more.",
            field="outside_index",
        )
    if frequency == 0:
        return 0.0
    omega_over_v = 2.0 * math.pi * frequency * seconds_per_length(medium, unit, outside_index)
    if omega_over_v > REFUSED * medium.sigma_t_prime:
        raise InputError(
            f"frequency is {frequency:g} Hz, at which light does not diffuse: omega is "
            f"{omega_over_v / medium.sigma_t_prime:.2g} of v sigma_t'; give less, at most {FASTEST:g} of it.",
            field="frequency",
        )
    return 1j * omega_over_v


def seconds_per_length(medium: Medium, unit: str, outside_index: float = 1.0) -> float:
    """``n/c``, the time that light takes for a unit of length in a medium, s/unit."""
    return medium.eta * outside_index * MILLIMETRES[unit] / SPEED_OF_LIGHT


def shifts_of_scenes(
    frequency: float | Sequence[float], outer: Sequence[Medium], unit: str, outside_index: float
) -> tuple[tuple[float, ...], tuple[complex, ...]]:
    """The frequency and the shift of each scene, by the outer medium of each; one frequency may be that of all."""
    each = tuple(frequency) if isinstance(frequency, Sequence) else (frequency,) * len(outer)
    if len(each) != len(outer):
        raise InputError(
            f"there are {len(each)} frequencies for {len(outer)} scenes; give one, or one for each.", field="frequency"
        )
    return each, tuple(
        shift_of_frequency(one, medium, unit, outside_index) for one, medium in zip(each, outer, strict=True)
    )


def notes_on_frequency(frequency: float, shift: complex, media: Iterable[AnyMedium]) -> list[Note]:
    """A note where light is modulated too fast for diffusion."""
    least = min(base_of(medium).sigma_t_prime for medium in media)
    ratio = abs(shift) / least
    if ratio <= FASTEST:
        return []
    return [
        Note(
            "frequency-high",
            f"at {frequency:g} Hz the modulation is too fast for diffusion: omega is {ratio:.2g} of v sigma_t', and up "
            f"to {FASTEST:g} amplitude and phase can be relied on; do not rely on them here.",
            value=ratio,
        )
    ]


def modulus(values: NumberArray) -> FloatArray:
    """Values of steady light as they are, moduli of complex amplitudes."""
    return np.abs(values) if np.iscomplexobj(values) else values


def lag(values: NumberArray) -> FloatArray:
    """How far complex amplitudes lag behind the light, degrees from -30 up to 330: 0 for steady light."""
    return np.asarray((-np.degrees(np.angle(values)) - LEAST_LAG) % 360.0 + LEAST_LAG)
