"""A sum of screened charges: the sources inside the body, and fitted charges outside."""

from dataclasses import dataclass

import numpy as np

from tetlux.fem.charges.kernel import Equation
from tetlux.meshing.arrays import FloatArray, NumberArray


@dataclass(frozen=True, eq=False)
class ChargeField:
    """The field of charges, which solves the equation wherever there is no charge.

    Fits use this class: strengths may be complex and of many lights, and the residual needs normals of the surface. A
    mesh uses `tetlux.fem.known.charges.Charges`: real strengths of one light, limited near the charges, with gradients.

    Attributes
    ----------
    equation : Equation
    positions : (c, 3) ndarray
    strengths : (c, ...) ndarray
        W; a column for each light.
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
