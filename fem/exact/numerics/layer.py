"""The field of a point source between two parallel planes with Robin or zero boundary conditions.

Up to one thickness from the source it is the free field, the reflection by each plane alone, and a Hankel integral over
multiple reflections; farther out it is a sum over modes across the layer.
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy import special

from tetlux.fem.exact.numerics.images import mirror_flux, sink_line
from tetlux.fem.exact.numerics.quadrature import CUTOFF, compute_in_chunks, graded_rule
from tetlux.meshing.arrays import FloatArray


@dataclass(frozen=True)
class Layer:
    """The layer ``0 <= z <= thickness`` between planes where phi is zb times its inward derivative.

    The Robin boundary is its own layer; the extrapolated boundary is ``zb = 0`` on the layer between the
    extrapolated planes.

    Attributes
    ----------
    k : float
        Effective transport coefficient, 1/unit.
    zb : float
        Extrapolation length, 0 or more, unit.
    thickness : float
        L, unit.
    """

    k: float
    zb: float
    thickness: float

    def field(self, z: FloatArray, z0: float, rho: FloatArray) -> FloatArray:
        """``4 pi D phi`` of unit power at depth z0.

        Parameters
        ----------
        z, rho : (n,) ndarray
            Depth, and distance from the axis through the source, unit.
        z0 : float
            Depth of the source, unit.

        Returns
        -------
        (n,) ndarray
            1/unit; infinite at the source.
        """
        return compute_in_chunks(lambda d, r: self._field(d, z0, r), z, rho)

    def slope(self, z: FloatArray, z0: float, rho: FloatArray) -> FloatArray:
        """``4 pi D dphi/dz``, for ``zb = 0`` alone; otherwise as `field`."""
        assert self.zb == 0.0
        return compute_in_chunks(lambda d, r: self._slope(d, z0, r), z, rho)

    def _field(self, z: FloatArray, z0: float, rho: FloatArray) -> FloatArray:
        result = np.empty_like(rho)
        near = rho <= self.thickness
        if np.any(near):
            d, r = z[near], rho[near]
            source = np.hypot(r, d - z0)
            with np.errstate(divide="ignore"):
                field = np.exp(-self.k * source) / source
            for height in (d + z0, 2.0 * self.thickness - d - z0):
                mirror = np.hypot(r, height)
                field += 2.0 * sink_line(self.k, self.zb, r, height) - np.exp(-self.k * mirror) / mirror
            result[near] = field + self._reflections(d, z0, r, slope=False)
        if not np.all(near):
            result[~near] = self._modes(z[~near], z0, rho[~near], slope=False)
        return result

    def _slope(self, z: FloatArray, z0: float, rho: FloatArray) -> FloatArray:
        result = np.empty_like(rho)
        near = rho <= self.thickness
        if np.any(near):
            d, r = z[near], rho[near]
            slope = mirror_flux(self.k, r, d + z0) - mirror_flux(self.k, r, 2.0 * self.thickness - d - z0)
            slope -= mirror_flux(self.k, r, d - z0)
            result[near] = slope + self._reflections(d, z0, r, slope=True)
        if not np.all(near):
            result[~near] = self._modes(z[~near], z0, rho[~near], slope=True)
        return result

    def _reflections(self, z: FloatArray, z0: float, rho: FloatArray, *, slope: bool) -> FloatArray:
        """Sum the multiple reflections between both planes by a Hankel integral over ``mu = sqrt(k² + q²)``.

        A plane reflects ``e^{-mu z}`` by ``G = (zb mu - 1)/(zb mu + 1)``, and the reflections form a geometric
        series in ``G² e^{-2 mu L}``.
        """
        k, zb, thickness = self.k, self.zb, self.thickness
        nodes, weights = graded_rule(30, 20)
        mu = (k + CUTOFF / thickness * nodes)[:, None]
        reflection = (zb * mu - 1.0) / (zb * mu + 1.0)
        # 1 - G² e^{-2 mu L}, without cancellation at small mu.
        denominator = 4.0 * zb * mu / (1.0 + zb * mu) ** 2 - reflection**2 * np.expm1(-2.0 * mu * thickness)
        up_factor, down_factor = (-mu, mu) if slope else (1.0, 1.0)
        # Waves towards larger and smaller z, after a reflection at each plane.
        up = reflection * np.exp(-mu * (2.0 * thickness + z + z0)) + np.exp(-mu * (2.0 * thickness + z - z0))
        down = reflection * np.exp(-mu * (4.0 * thickness - z - z0)) + np.exp(-mu * (2.0 * thickness - z + z0))
        radial = special.j0(np.sqrt(mu**2 - k**2) * rho)
        integrand = reflection**2 / denominator * (up_factor * up + down_factor * down) * radial
        return np.asarray((CUTOFF / thickness * weights) @ integrand)

    def _modes(self, z: FloatArray, z0: float, rho: FloatArray, *, slope: bool) -> FloatArray:
        """``2 sum_n Z_n(z) Z_n(z0)/N_n K_0(rho sqrt(k² + b_n²))`` with ``Z = sin b z + zb b cos b z`` (Prahl 1988)."""
        k, zb, thickness = self.k, self.zb, self.thickness
        reach = CUTOFF / float(np.min(rho))
        largest = math.sqrt(reach * (reach + 2.0 * k))
        b = _wavenumbers(zb, thickness, int(largest * thickness / math.pi) + 3)[:, None]
        norm = 0.5 * ((1.0 + (zb * b) ** 2) * thickness + 2.0 * zb)
        source = np.sin(b * z0) + zb * b * np.cos(b * z0)
        shape = b * (np.cos(b * z) - zb * b * np.sin(b * z)) if slope else np.sin(b * z) + zb * b * np.cos(b * z)
        return np.asarray(2.0 * np.sum(source * shape / norm * special.k0(rho * np.hypot(k, b)), axis=0))


def _wavenumbers(zb: float, thickness: float, count: int) -> FloatArray:
    """The first `count` positive roots of ``b L + 2 atan(zb b) = n pi``, by Newton's method.

    The left side is concave, so Newton's method from below a root remains below it, and no root is skipped.
    """
    target = math.pi * np.arange(1, count + 1)
    b = (target - math.pi) / thickness
    for _ in range(100):
        step = (target - b * thickness - 2.0 * np.arctan(zb * b)) / (thickness + 2.0 * zb / (1.0 + (zb * b) ** 2))
        b = b + step
        if np.all(np.abs(step) <= 1e-15 * b):
            break
    return np.asarray(b)
