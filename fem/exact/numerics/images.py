"""Fields of the mirror image of a point source in a plane with a Robin boundary: a point, and a line of sinks."""

import numpy as np

from tetlux.fem.exact.numerics.quadrature import CUTOFF, compute_in_chunks, graded_rule
from tetlux.meshing.arrays import FloatArray


def sink_line(k: float, zb: float, rho: FloatArray, height: FloatArray) -> FloatArray:
    """``∫0..inf e^{-l/zb} w (1 + k R) e^{-k R}/R³ dl`` with ``w = height + l``; 0 at ``zb = 0``."""
    if zb == 0.0:
        return np.zeros_like(rho)
    nodes, weights = graded_rule()
    l = CUTOFF * zb * nodes[:, None]  # noqa: E741

    def integral(part: FloatArray, above: FloatArray) -> FloatArray:
        return np.asarray((CUTOFF * zb * weights) @ (np.exp(-l / zb) * mirror_flux(k, part, above + l)))

    return compute_in_chunks(integral, rho, height)


def mirror_flux(k: float, rho: FloatArray, w: FloatArray) -> FloatArray:
    """``-d/dw e^{-k R}/R = w (1 + k R) e^{-k R}/R³``."""
    distance = np.hypot(rho, w)
    return np.asarray(w * (1.0 + k * distance) * np.exp(-k * distance) / distance**3)
