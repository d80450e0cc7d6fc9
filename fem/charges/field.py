"""A sum of screened charges: the sources inside the body, and fitted charges outside."""

from dataclasses import dataclass

import numpy as np

from tetlux.fem.charges.kernel import Equation
from tetlux.meshing.arrays import FloatArray, NumberArray


@dataclass(frozen=True, eq=False)
class ChargeField:
    """The field of charges, which solves the equation wherever there is no charge.

    The one type of charges: fitted ones, images in a plane, beams as points. `tetlux.fem.known.charges.Charges` is a
    field of one light with what a mesh has to know to subtract it.

    Attributes
    ----------
    equation : Equation
    positions : (c, 3) ndarray
    strengths : (c, ...) ndarray
        W; a column for each light.
    closest : float
        Least distance from a charge at which fluence and gradient are evaluated, unit.
    """

    equation: Equation
    positions: FloatArray
    strengths: NumberArray
    closest: float = 0.0

    @property
    def is_complex(self) -> bool:
        """Whether the fluence is complex."""
        return np.result_type(self.equation.dtype, self.strengths) == np.complex128

    def fluence(self, points: FloatArray) -> NumberArray:
        """Fluence at points (n, 3), (n, ...), W/unit²."""
        return self.equation.fluence(points, self.positions, self.strengths, self.closest)

    def fluence_and_gradient(self, points: FloatArray) -> tuple[NumberArray, NumberArray]:
        """Fluence (n,), W/unit², and its gradient (n, 3), W/unit³, of one light."""
        return self.equation.fluence_and_gradient(points, self.positions, self.strengths, self.closest)

    def potential(self, points: FloatArray) -> NumberArray:
        """D times the fluence at points (n, 3), whose slope is the flux, (n, ...), W/unit."""
        return np.asarray(self.equation.diffusion * self.fluence(points))

    def fluence_and_flux(self, points: FloatArray) -> tuple[NumberArray, NumberArray]:
        """Fluence (n,), W/unit², and D times its gradient (n, 3), W/unit², of one light."""
        fluence, gradient = self.fluence_and_gradient(points)
        return fluence, self.equation.diffusion * gradient

    def exitance(self, points: FloatArray) -> NumberArray:
        """``phi/(2A)`` at points (n, 3) of the surface, (n, ...), W/unit²."""
        return np.asarray(self.equation.robin * self.fluence(points))

    def exitance_and_residual(self, points: FloatArray, normals: FloatArray) -> tuple[NumberArray, NumberArray]:
        """``phi/(2A)`` and ``r = D dphi/dn + phi/(2A)`` at points (n, 3) of the surface, two (n, ...), W/unit²."""
        fluence, flux = self.equation.traces(points, normals, self.positions, self.strengths)
        exitance = np.asarray(self.equation.robin * fluence)
        return exitance, flux + exitance
