"""Light diffusing in tetrahedra: media, lights, the weak form, and its solution."""

from tetlux.fem.lights import (
    CollimatedBeam,
    Deposit,
    DiffuseLight,
    Disc,
    Emission,
    EnvironmentLight,
    Gaussian,
    Image,
    Light,
    PencilBeam,
    PointSource,
    Rectangle,
)
from tetlux.fem.medium import Medium
from tetlux.fem.region import Region
from tetlux.fem.solution import Power, Solution
from tetlux.fem.solve import solve, solve_each
from tetlux.fem.system import System

__all__ = [
    "CollimatedBeam",
    "Deposit",
    "DiffuseLight",
    "Disc",
    "Emission",
    "EnvironmentLight",
    "Gaussian",
    "Image",
    "Light",
    "Medium",
    "PencilBeam",
    "PointSource",
    "Power",
    "Rectangle",
    "Region",
    "Solution",
    "System",
    "solve",
    "solve_each",
]
