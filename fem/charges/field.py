"""A sum of screened charges: some inside the body, its sources; the others outside."""

from dataclasses import dataclass

import numpy as np

from tetlux.fem.charges.kernel import Equation, NumberArray
from tetlux.meshing.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class ChargeField:
    """The field of charges, which obeys the equation wherever there is no charge.

    Attributes
    ----------
    equation : Equation
    positions : (c, 3) ndarray
    strengths : (c, ...) ndarray
        W; where there are several columns, each is a field of its own.
    """

    equation: Equation
    positions: FloatArray
    strengths: NumberArray

    def fluence(self, points: FloatArray) -> NumberArray:
        """Fluence at points (n, 3), (n, ...), W/unit²."""
        return self.equation.fluence(points, self.positions, self.strengths)

    def exitance(self, points: FloatArray) -> NumberArray:
        """``phi/(2A)`` at points (n, 3) of the surface, (n, ...), W/unit²."""
        return np.asarray(self.equation.robin * self.fluence(points))

    def exitance_and_residual(self, points: FloatArray, normals: FloatArray) -> tuple[NumberArray, NumberArray]:
        """``phi/(2A)`` and ``r = D dphi/dn + phi/(2A)`` at points (n, 3) of the surface, two (n, ...), W/unit²."""
        fluence, flux = self.equation.traces(points, normals, self.positions, self.strengths)
        exitance = np.asarray(self.equation.robin * fluence)
        return exitance, flux + exitance
