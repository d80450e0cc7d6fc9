"""Layers of a square plate and their media, for tests and tables."""

from tetlux.fem import Medium
from tetlux.meshing import Surface, box

# Media that differ by a factor of 5 in scattering and of 25 in absorption.
DENSE = Medium(sigma_a=0.05, sigma_s=10.0, g=0.8, eta=1.4)
CLEAR = Medium(sigma_a=0.002, sigma_s=2.0, g=0.8, eta=1.4)
DOWN = (0.0, 0.0, -1.0)


def layer(low: float, high: float, width: float = 16.0) -> Surface:
    """The part between two depths of a plate whose upper face is z = 0."""
    return box((width, width, high - low), center=(0.0, 0.0, -0.5 * (low + high)))
