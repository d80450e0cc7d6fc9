"""Closed forms to hold the solver against, one module for each body.

Every function takes a `Medium` and returns what unit power, or unit irradiance, gives. Exitance is
``M = phi/(2A)``, W/unit², unless the function says otherwise.
"""

from tetlux.fem.exact import (
    concentric,
    cylinder,
    dipole,
    half_space,
    layered,
    monte_carlo,
    slab,
    slab_plane,
    sphere,
    sphere_light,
)

__all__ = [
    "concentric",
    "cylinder",
    "dipole",
    "half_space",
    "layered",
    "monte_carlo",
    "slab",
    "slab_plane",
    "sphere",
    "sphere_light",
]
