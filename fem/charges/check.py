"""How far a field of charges is from the solution: a bound, and a sharper estimate.

**The bound.** Let G be charges, those of the light inside the body and others outside, so that G obeys the equation
inside with the light as it is, and let ``r = D dG/dn + G/(2A)`` be what it violates at the surface. The error
``e = phi - G`` then obeys the equation without light and ``D de/dn + e/(2A) = -r``. Multiply by e and integrate by
parts:

    ∫ D |grad e|² + sigma_a e²  +  ∮ e²/(2A)  =  -∮ r e

All terms on the left are positive, and the right is at most ``|r| |e|`` in L2 of the surface: ``|e|/(2A) <= |r|``.
Since the exitance is ``phi/(2A)``, that of G is off by at most ``|r|`` in L2, whatever the strengths and places of the
charges outside. This holds in one even medium with a real wave number, for the surface at which r is taken with the
normals it has there. What is not in it: the integral of r² is a sum over points, which were not fitted but are not all
points either; the smooth surface is one reading of the triangles; and diffusion itself has an error of its own.

**The estimate.** Only a part of r reaches e: over a flat surface a ripple of r of wave number q makes one of e/(2A)
that is ``1 + zb sqrt(q² + k²)`` times smaller, zb = 2 A D. A fit leaves ripples as long as the charges are apart, so
that ``q = pi/h`` at a spacing h takes most of the difference away. RIPPLE makes it lean to the safe side.
"""

from dataclasses import dataclass

import numpy as np

from tetlux.fem.charges.kernel import Equation, NumberArray
from tetlux.fem.charges.samples import Samples
from tetlux.meshing.arrays import FloatArray

# Half a ripple of r is taken to be so many spacings of charges long. With 2 the estimate was 1.2 to 1.9 times the error
# on smooth bodies and .6 to 2.8 times on scans (100 to 800 charges); with 1 .95 to 1.2, and .35 to 1.1 on scans.
RIPPLE = 2.0


@dataclass(frozen=True)
class Quality:
    """Relative L2 errors of an exitance over the surface.

    Attributes
    ----------
    bound : float
        It is not larger than this, see above.
    estimate : float
        It is about as large as this.
    """

    bound: float
    estimate: float


def ripple_of(equation: Equation, spacing: FloatArray) -> FloatArray:
    """How fast what charges a spacing (n,) apart leave changes across a surface, ``sqrt(q² + k²)``, (n,), 1/unit."""
    return np.asarray(np.sqrt((np.pi / (RIPPLE * spacing)) ** 2 + abs(equation.wave_number) ** 2))


def damped(equation: Equation, residual: NumberArray, spacing: FloatArray) -> NumberArray:
    """What residuals (n,) at charges a spacing (n,) apart make of the exitance, (n,), W/unit²."""
    zb = 2.0 * equation.boundary_factor * equation.diffusion
    return np.asarray(residual / (1.0 + zb * ripple_of(equation, spacing)))


def quality_of(
    equation: Equation, samples: Samples, spacing: FloatArray, exitance: NumberArray, residual: NumberArray
) -> Quality:
    """Bound and estimate from exitance and residual (n,) at samples, at charges a spacing (n,) apart."""
    size = norm(samples.areas, exitance)
    errors = damped(equation, residual, spacing)
    return Quality(norm(samples.areas, residual) / size, norm(samples.areas, errors) / size)


def norm(areas: FloatArray, values: NumberArray) -> float:
    """L2 norm over a surface of values (n,) at points that stand for areas (n,)."""
    return float(np.sqrt(areas @ np.abs(values) ** 2))
