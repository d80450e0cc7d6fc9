"""`ChargeDerivative`: the derivative of a field of charges to a coefficient that everything about them depends on.

With ``g = e^{-k r}/(4 pi D r)`` of a charge q at p and ``h = g (k + 1/r)/r``, so that ``grad g = -h (x - p)``, the
field ``q g`` has the derivative ``g (q' - q (k' r + D'/D)) + q h (x - p).p'``.
"""

from dataclasses import dataclass

import numpy as np

from tetlux.fem.charges.field import ChargeField
from tetlux.fem.charges.kernel import distances_between, rows_per_block
from tetlux.meshing.arrays import FloatArray, NumberArray
from tetlux.meshing.host.blocks import run_in_blocks


@dataclass(frozen=True, eq=False)
class ChargeDerivative:
    """The derivative of a field of charges of one light.

    Attributes
    ----------
    charges : ChargeField
    positions : (c, 3) ndarray
        Derivative of the positions.
    strengths : (c,) ndarray
        Of the strengths.
    wave_number : float or complex
        Of k.
    diffusion : float
        Of D.
    closest : float
        Of the least distance at which the field is evaluated.
    """

    charges: ChargeField
    positions: FloatArray
    strengths: NumberArray
    wave_number: complex
    diffusion: float
    closest: float = 0.0

    @property
    def is_complex(self) -> bool:
        """Whether the fluence is complex."""
        return self.charges.is_complex

    def fluence(self, points: FloatArray) -> NumberArray:
        """Derivative of the fluence at points (n, 3), (n,)."""
        charges = self.charges
        return (self.potential(points) - self.diffusion * charges.fluence(points)) / charges.equation.diffusion

    def potential(self, points: FloatArray) -> NumberArray:
        """Derivative of D times the fluence at points (n, 3), (n,)."""
        charges, equation = self.charges, self.charges.equation
        found = np.empty(len(points), np.result_type(equation.dtype, self.strengths))

        def work(rows: slice) -> None:
            some = points[rows]
            real = distances_between(some, charges.positions)
            distance = np.maximum(real, charges.closest)
            longer = np.where(real < charges.closest, self.closest, -self._along(some) / distance)
            change = self.wave_number * distance + (equation.wave_number + 1.0 / distance) * longer
            value = equation.unit_fluence(distance)
            found[rows] = value @ self.strengths - (value * change) @ charges.strengths

        run_in_blocks(work, len(points), rows_per_block(charges.positions))
        return np.asarray(equation.diffusion * found)

    def fluence_and_flux(self, points: FloatArray) -> tuple[NumberArray, NumberArray]:
        """Derivatives of the fluence, (n,), and of D times its gradient, (n, 3), at points (n, 3) away from charges."""
        charges, equation = self.charges, self.charges.equation
        dtype = np.result_type(equation.dtype, self.strengths)
        fluence, gradient = np.empty(len(points), dtype), np.empty((len(points), 3), dtype)
        k, origin = equation.wave_number, charges.positions[0]
        # Sums over charges are products with thin matrices, and powers are products: twice as fast as by each charge.
        ends = np.column_stack([charges.positions - origin, np.ones(len(charges.positions))])
        own, turned = charges.strengths, self.wave_number * charges.strengths
        changed = self.strengths - self.diffusion / equation.diffusion * own
        by_value = np.column_stack([changed, -k * turned[:, None] * ends])
        by_slope = np.column_stack([self.strengths[:, None] * ends, own[:, None] * self.positions])
        by_curve = own[:, None] * ends

        def work(rows: slice) -> None:
            some = points[rows]
            distance, along = distances_between(some, charges.positions), self._along(some)
            value = equation.unit_fluence(distance)
            inverse = np.reciprocal(distance)
            slope = value * inverse
            slope *= inverse + k
            curve = k**2 * value
            curve += 3.0 * slope
            inverse *= inverse
            inverse *= along
            curve *= inverse
            of_value, of_slope = value @ by_value, slope @ by_slope
            fluence[rows] = of_value[:, 0] + (slope * along) @ own - (value * distance) @ turned
            outward = of_value[:, 1:] + of_slope[:, :4] + curve @ by_curve
            gradient[rows] = outward[:, :3] - outward[:, 3:] * (some - origin) + of_slope[:, 4:]

        run_in_blocks(work, len(points), rows_per_block(charges.positions))
        return fluence, equation.diffusion * gradient

    def _along(self, points: FloatArray) -> FloatArray:
        """``(x - p).p'`` at points (n, 3) for each charge, (n, c)."""
        origin = self.charges.positions[0]
        own = np.einsum("ij,ij->i", self.charges.positions - origin, self.positions)
        return np.asarray((points - origin) @ self.positions.T - own)
