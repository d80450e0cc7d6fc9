"""Fluence and flux of screened charges.

A charge of q watts at p gives ``phi = q e^{-k r}/(4 pi D r)``, ``r = |x - p|``, which solves the diffusion equation
everywhere but at p. The wave number k may be complex: light modulated in time has ``k² = (sigma_a + i omega/v)/D``.
"""

import cmath
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.spatial.distance import cdist

from tetlux.fem.media.medium import Medium
from tetlux.meshing.arrays import FloatArray, NumberArray
from tetlux.meshing.host.blocks import run_in_blocks

# Pairs of a point and a charge that are evaluated at once; they fit into the processor's cache.
PAIRS_PER_BLOCK = 25_000


@dataclass(frozen=True)
class Equation:
    """``-div D grad phi + D k² phi = 0`` in one homogeneous medium, with ``D dphi/dn + phi/(2A) = 0`` on its surface.

    Attributes
    ----------
    wave_number : float or complex
        ``k = sqrt(sigma_a/D)``, 1/unit; with a positive real part.
    diffusion : float
        D, unit.
    boundary_factor : float
        A.
    shift : complex
        What is added to sigma_a in k, 1/unit: 0 for steady light.
    """

    wave_number: complex
    diffusion: float
    boundary_factor: float
    shift: complex = 0.0

    @property
    def robin(self) -> float:
        """``1/(2A)``, the ratio of exitance to fluence."""
        return 0.5 / self.boundary_factor

    @property
    def extrapolation_length(self) -> float:
        """``zb = 2 A D``, as of a medium, unit."""
        return 2.0 * self.boundary_factor * self.diffusion

    @property
    def dtype(self) -> npt.DTypeLike:
        """Type of the fluence."""
        return np.complex128 if isinstance(self.wave_number, complex) else np.float64

    def traces_of_each(
        self, points: FloatArray, normals: FloatArray, positions: FloatArray
    ) -> tuple[NumberArray, NumberArray]:
        """Fluence and ``D dphi/dn`` at points (n, 3) of a surface, of unit charges at (c, 3), two (n, c), W/unit²."""
        shape = len(points), len(positions)
        fluence, flux = np.empty(shape, dtype=self.dtype), np.empty(shape, dtype=self.dtype)

        def work(rows: slice) -> None:
            fluence[rows], flux[rows] = self._unit_traces(points[rows], normals[rows], positions)

        run_in_blocks(work, len(points), rows_per_block(positions))
        return fluence, flux

    def residual_of_each(self, points: FloatArray, normals: FloatArray, positions: FloatArray) -> NumberArray:
        """``D dphi/dn + phi/(2A)`` at points (n, 3) of a surface, of unit charges at (c, 3), (n, c), W/unit²."""
        matrix = np.empty((len(points), len(positions)), dtype=self.dtype)

        def work(rows: slice) -> None:
            fluence, flux = self._unit_traces(points[rows], normals[rows], positions)
            fluence *= self.robin
            flux += fluence
            matrix[rows] = flux

        run_in_blocks(work, len(points), rows_per_block(positions))
        return matrix

    def fluence(
        self, points: FloatArray, positions: FloatArray, strengths: NumberArray, closest: float = 0.0
    ) -> NumberArray:
        """Fluence of charges of given strengths (c, ...), W, at points (n, 3), (n, ...), W/unit².

        Points nearer to a charge than `closest` have its fluence at that distance.
        """
        sums = np.empty((len(points), *strengths.shape[1:]), dtype=np.result_type(self.dtype, strengths))

        def work(rows: slice) -> None:
            sums[rows] = self.unit_fluence(distances_between(points[rows], positions, closest)) @ strengths

        run_in_blocks(work, len(points), rows_per_block(positions))
        return sums

    def fluence_and_gradient(
        self, points: FloatArray, positions: FloatArray, strengths: NumberArray, closest: float = 0.0
    ) -> tuple[NumberArray, NumberArray]:
        """Fluence (n,), W/unit², and its gradient (n, 3), W/unit³, of charges of given strengths (c,), W."""
        dtype = np.result_type(self.dtype, strengths)
        fluence, gradient = np.empty(len(points), dtype=dtype), np.empty((len(points), 3), dtype=dtype)
        # Coordinates relative to a nearby point lose fewer digits.
        charges = positions - positions[0]

        def work(rows: slice) -> None:
            distance = distances_between(points[rows], positions, closest)
            each = self.unit_fluence(distance) * strengths
            fluence[rows] = each.sum(axis=1)
            each *= (self.wave_number + 1.0 / distance) / distance
            gradient[rows] = each @ charges - each.sum(axis=1)[:, None] * (points[rows] - positions[0])

        run_in_blocks(work, len(points), rows_per_block(positions))
        return fluence, gradient

    def traces(
        self, points: FloatArray, normals: FloatArray, positions: FloatArray, strengths: NumberArray
    ) -> tuple[NumberArray, NumberArray]:
        """Fluence and ``D dphi/dn`` of charges of given strengths (c, ...), two (n, ...), W/unit²."""
        shape, dtype = (len(points), *strengths.shape[1:]), np.result_type(self.dtype, strengths)
        fluence, flux = np.empty(shape, dtype=dtype), np.empty(shape, dtype=dtype)

        def work(rows: slice) -> None:
            value, slope = self._unit_traces(points[rows], normals[rows], positions)
            fluence[rows], flux[rows] = value @ strengths, slope @ strengths

        run_in_blocks(work, len(points), rows_per_block(positions))
        return fluence, flux

    def unit_fluence(self, distance: FloatArray) -> NumberArray:
        """Fluence of a unit charge at distances, W/unit²."""
        # In place: memory costs more than arithmetic.
        value: NumberArray = np.multiply(distance, -self.wave_number)
        value -= np.log(4.0 * np.pi * self.diffusion)
        np.exp(value, out=value)
        value /= distance
        return value

    def _unit_traces(
        self, points: FloatArray, normals: FloatArray, positions: FloatArray
    ) -> tuple[NumberArray, NumberArray]:
        distance = distances_between(points, positions)
        fluence = self.unit_fluence(distance)
        # Coordinates relative to a nearby point lose fewer digits.
        origin = points[0]
        outward = self.diffusion * normals
        depth = outward @ (positions - origin).T
        depth -= np.einsum("ij,ij->i", points - origin, outward)[:, None]
        np.reciprocal(distance, out=distance)
        depth *= distance
        flux = np.multiply(fluence, depth)
        flux *= np.add(distance, self.wave_number, out=None if np.iscomplexobj(flux) else distance)
        return fluence, flux


def distances_between(points: FloatArray, positions: FloatArray, closest: float = 0.0) -> FloatArray:
    """Distances between points (n, 3) and positions (c, 3), at least `closest`, (n, c)."""
    # Not from |x|² + |p|² - 2 x.p, which loses digits close to a charge.
    distance: FloatArray = cdist(points, positions)
    return distance if closest == 0.0 else np.maximum(distance, closest, out=distance)


def rows_per_block(positions: FloatArray) -> int:
    """Number of points that are evaluated at once with charges at positions (c, 3)."""
    return max(1, PAIRS_PER_BLOCK // max(1, len(positions)))


def equation_of(medium: Medium, shift: complex = 0.0) -> Equation:
    """The equation in a medium, with what is added to sigma_a, 1/unit: 0 for steady light."""
    if shift == 0:
        return Equation(medium.sigma_tr, medium.diffusion, medium.boundary_factor)
    # The root with a positive real part, as `cmath` has it.
    wave_number = cmath.sqrt((medium.sigma_a + shift) / medium.diffusion)
    return Equation(wave_number, medium.diffusion, medium.boundary_factor, shift)
