"""The error of a field of charges: a bound, and a sharper estimate.

**The bound.** Let G be the sum of the light's sources inside the body and of charges outside it. G solves the diffusion
equation inside, and its residual at the surface is ``r = D dG/dn + G/(2A)``. The error ``e = phi - G`` then solves the
equation without sources, and ``D de/dn + e/(2A) = -r``. Multiply by e and integrate by parts:

    ∫ D |grad e|² + sigma_a e²  +  ∮ e²/(2A)  =  -∮ r e

All terms on the left are positive, and the right is at most ``|r| |e|`` in L2 of the surface: ``|e|/(2A) <= |r|``.
Since the exitance is ``phi/(2A)``, the exitance of G has an error of at most ``|r|`` in L2, whatever the strengths and
positions of the charges outside. This holds in one homogeneous medium with a real wave number. The bound leaves out
three errors: that of the integral of r², which is a sum over points that were not fitted; that of the smooth surface,
which interpolates the triangles; and that of the diffusion approximation.

**The estimate.** At a flat surface a sinusoidal residual of wave number q causes an error e/(2A) that is
``1 + zb sqrt(q² + k²)`` times smaller than r, with zb = 2 A D. The residual of a fit has half waves about as long as
the spacing h of the charges, q = pi/h. HALF_WAVE_SPACINGS makes them longer, so that the estimate errs to the safe
side.
"""

from dataclasses import dataclass

import numpy as np

from tetlux.fem.charges.kernel import Equation
from tetlux.fem.charges.samples import Samples
from tetlux.meshing.arrays import FloatArray, NumberArray

# Assumed length of half a wave of the residual, in spacings of charges. Estimate over error for 100 to 800 charges:
# with 2 1.2 to 1.9 on smooth bodies and .6 to 2.8 on scans; with 1 .95 to 1.2 and .35 to 1.1.
HALF_WAVE_SPACINGS = 2.0


@dataclass(frozen=True)
class ErrorEstimates:
    """Relative L2 errors of an exitance over the surface.

    Attributes
    ----------
    bound : float
        Upper bound of the error; nan where there is none.
    estimate : float
        Estimate of the error.
    """

    bound: float
    estimate: float


def residual_wave_number(equation: Equation, spacing: FloatArray) -> FloatArray:
    """Wave number ``sqrt(q² + k²)`` of the residual of charges a spacing (n,) apart, (n,), 1/unit."""
    return np.asarray(np.sqrt((np.pi / (HALF_WAVE_SPACINGS * spacing)) ** 2 + abs(equation.wave_number) ** 2))


def exitance_error(equation: Equation, residual: NumberArray, spacing: FloatArray) -> NumberArray:
    """Errors of the exitance that residuals (n,) of charges a spacing (n,) apart cause, (n,), W/unit²."""
    return np.asarray(residual / (1.0 + equation.extrapolation_length * residual_wave_number(equation, spacing)))


def estimate_errors(
    equation: Equation, samples: Samples, spacing: FloatArray, exitance: NumberArray, residual: NumberArray
) -> ErrorEstimates:
    """Bound and estimate by exitance and residual (n,) at samples, for charges a spacing (n,) apart."""
    size = norm(samples.areas, exitance)
    if size == 0.0:
        # Light that fades to nothing on its way to the surface: relative errors are not defined.
        return ErrorEstimates(np.inf, np.inf)
    errors = exitance_error(equation, residual, spacing)
    return ErrorEstimates(norm(samples.areas, residual) / size, norm(samples.areas, errors) / size)


def norm(areas: FloatArray, values: NumberArray) -> float:
    """L2 norm over a surface of values (n,) at quadrature points with weights `areas` (n,)."""
    return float(np.sqrt(areas @ np.abs(values) ** 2))
