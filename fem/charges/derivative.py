"""`ChargeDerivatives`: derivatives of a field of charges to coefficients that everything about them depends on.

With ``g = e^{-k r}/(4 pi D r)`` of a charge q at p and ``h = g (k + 1/r)/r``, so that ``grad g = -h (x - p)``, the
field ``q g`` has the derivative ``g (q' - q (k' r + D'/D)) + q h (x - p).p'``.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from tetlux.fem.charges.field import ChargeField
from tetlux.fem.charges.kernel import distances_between, rows_per_block
from tetlux.meshing.arrays import FloatArray, NumberArray
from tetlux.meshing.host.blocks import run_in_blocks


@dataclass(frozen=True, eq=False)
class ChargeDerivatives:
    """Derivatives of a field of charges of one light to k coefficients, which share all that takes time.

    Attributes
    ----------
    charges : ChargeField
    positions : (k, c, 3) ndarray
        Derivatives of the positions.
    strengths : (k, c) ndarray
        Of the strengths.
    wave_number : (k,) ndarray
        Of the wave number.
    diffusion : (k,) ndarray
        Of D.
    closest : (k,) ndarray
        Of the least distance at which the field is evaluated.
    """

    charges: ChargeField
    positions: FloatArray
    strengths: NumberArray
    wave_number: NumberArray
    diffusion: FloatArray
    closest: FloatArray

    @property
    def is_complex(self) -> bool:
        """Whether the fluence is complex."""
        return self.charges.is_complex

    def fluence(self, points: FloatArray) -> NumberArray:
        """Derivatives of the fluence at points (n, 3), (n, k)."""
        values, fluence = self._at_constant_diffusion(points)
        return np.asarray(values - fluence[:, None] * (self.diffusion / self.charges.equation.diffusion))

    def potential(self, points: FloatArray) -> NumberArray:
        """Derivatives of D times the fluence at points (n, 3), (n, k)."""
        return np.asarray(self.charges.equation.diffusion * self._at_constant_diffusion(points)[0])

    def _at_constant_diffusion(self, points: FloatArray) -> tuple[NumberArray, NumberArray]:
        """Derivatives of the fluence for the same D, (n, k), and the fluence, (n,), at points (n, 3)."""
        charges, equation = self.charges, self.charges.equation
        found = np.empty((len(points), len(self.positions)), self._dtype)
        fluence = np.empty(len(points), self._dtype)

        def work(rows: slice) -> None:
            some = points[rows]
            real = distances_between(some, charges.positions)
            distance = np.maximum(real, charges.closest)
            value = equation.unit_fluence(distance)
            weighted = value * charges.strengths
            fluence[rows] = weighted.sum(axis=1)
            by_wave_number = np.einsum("nc,nc->n", weighted, distance)
            weighted *= equation.wave_number + 1.0 / distance
            near = real < charges.closest
            for number, (positions, strengths) in enumerate(zip(self.positions, self.strengths, strict=True)):
                longer = -self._along(some, positions)
                longer /= distance
                longer[near] = self.closest[number]
                found[rows, number] = value @ strengths - self.wave_number[number] * by_wave_number
                found[rows, number] -= np.einsum("nc,nc->n", weighted, longer)

        run_in_blocks(work, len(points), rows_per_block(charges.positions))
        return found, fluence

    def fluence_and_flux(self, points: FloatArray) -> tuple[NumberArray, NumberArray]:
        """Derivatives of the fluence, (n, k), and of D times its gradient, (n, 3, k), at points (n, 3) off charges."""
        charges, equation, count = self.charges, self.charges.equation, len(self.positions)
        fluence = np.empty((len(points), count), self._dtype)
        gradient = np.empty((len(points), 3, count), self._dtype)
        k, origin, own = equation.wave_number, charges.positions[0], charges.strengths
        # Sums over charges are products with thin matrices, and powers are products: twice as fast as by each charge.
        ends = np.column_stack([charges.positions - origin, np.ones(len(charges.positions))])
        by_curve, by_value, by_slope = own[:, None] * ends, [], []
        for positions, strengths, of_k, of_diffusion in zip(
            self.positions, self.strengths, self.wave_number, self.diffusion, strict=True
        ):
            changed = strengths - of_diffusion / equation.diffusion * own
            by_value.append(np.column_stack([changed, -k * of_k * by_curve]))
            by_slope.append(np.column_stack([strengths[:, None] * ends, own[:, None] * positions]))

        def work(rows: slice) -> None:
            some = points[rows]
            distance = distances_between(some, charges.positions)
            value = equation.unit_fluence(distance)
            inverse = np.reciprocal(distance)
            slope = value * inverse
            slope *= inverse + k
            curve = k**2 * value
            curve += 3.0 * slope
            inverse *= inverse
            curve *= inverse
            by_wave_number = (value * distance) @ own
            for number in range(count):
                along = self._along(some, self.positions[number])
                of_value, of_slope = value @ by_value[number], slope @ by_slope[number]
                of_places = (slope * along) @ own
                fluence[rows, number] = of_value[:, 0] + of_places - self.wave_number[number] * by_wave_number
                outward = of_value[:, 1:] + of_slope[:, :4] + (curve * along) @ by_curve
                gradient[rows, :, number] = outward[:, :3] - outward[:, 3:] * (some - origin) + of_slope[:, 4:]

        run_in_blocks(work, len(points), rows_per_block(charges.positions))
        return fluence, equation.diffusion * gradient

    @property
    def _dtype(self) -> np.dtype[Any]:
        return np.result_type(self.charges.equation.dtype, self.strengths)

    def _along(self, points: FloatArray, positions: FloatArray) -> FloatArray:
        """``(x - p).p'`` at points (n, 3) for derivatives of positions (c, 3), (n, c)."""
        origin = self.charges.positions[0]
        own = np.einsum("ij,ij->i", self.charges.positions - origin, positions)
        return np.asarray((points - origin) @ positions.T - own)
