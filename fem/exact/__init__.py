"""Closed forms to verify the solver, one module for each body; `registry` looks them up by shape and light.

Each function takes a `Medium` and returns the result for unit power or unit irradiance. Exitance is ``M = phi/(2A)``,
W/unit², unless the function says otherwise.
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
