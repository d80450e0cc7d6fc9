"""The first mesh for some lights.

near_sources  regular tetrahedra, fine near sources, and between them and detectors
layers        flat ones below light that covers a surface
"""

from tetlux.fem.grading.layers import Layers, with_layers
from tetlux.fem.grading.near_sources import (
    LONGEST_EDGE,
    LONGEST_IF_FITTED,
    grade_between,
    grade_mesh,
    places_to_resolve,
)

__all__ = [
    "LONGEST_EDGE",
    "LONGEST_IF_FITTED",
    "Layers",
    "grade_between",
    "grade_mesh",
    "places_to_resolve",
    "with_layers",
]
