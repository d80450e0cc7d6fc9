"""Closed forms to verify the solver, one module for each body; `registry` looks them up by shape and light.

Each function takes a `Medium` and returns the result for unit power or unit irradiance. Exitance is ``M = phi/(2A)``,
W/unit², unless the function says otherwise.
"""

import importlib
from types import ModuleType
from typing import TYPE_CHECKING

if TYPE_CHECKING:
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


def __getattr__(name: str) -> ModuleType:
    """Import a closed form when it is asked for: a run needs few of them, and all take .05 s to import."""
    if name in __all__:
        return importlib.import_module(f"{__name__}.{name}")
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
