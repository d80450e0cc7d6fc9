"""Lengths that the mesher is given: of edges, of its boundary from the surface, and of its envelope."""

import math

from tetlux.meshing.resolution import DEVIATION, DEVIATION_OF_THICKNESS
from tetlux.meshing.surface.surface import Surface

# Share of the deviation for fTetWild's envelope; the rest is for the proxy. Time grows with the proxy's triangles and
# with the inverse of the envelope; between .45 and .7 it is constant within 20 %.
ENVELOPE = 0.55
# Default edge length, as a share of the diagonal. An eighth gives 20 % fewer tetrahedra in the same time.
EDGE_LENGTH = 1.0 / 12.0


def default_lengths(
    surface: Surface, edge_length: float | None = None, deviation: float | None = None, epsilon: float | None = None
) -> tuple[float, float, float]:
    """Edge length, deviation and envelope, unit, with the defaults of those that are not given."""
    size = surface.diagonal
    if deviation is None:
        # The volume of a surface that crosses itself, and so its thickness, is unknown before it is meshed.
        thickness = math.inf if surface.overlaps else 2.0 * surface.volume / surface.area
        by_default = min(DEVIATION * size, DEVIATION_OF_THICKNESS * thickness)
        deviation = by_default if epsilon is None else epsilon * size / ENVELOPE
    envelope = ENVELOPE * deviation if epsilon is None else epsilon * size
    return EDGE_LENGTH * size if edge_length is None else edge_length, deviation, envelope
