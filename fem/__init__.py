"""Light diffusing in tetrahedra: media, lights, the weak form, and its solution."""

from tetlux.fem.lights import Deposit, DiffuseLight, Light, PencilBeam, PointSource
from tetlux.fem.medium import Medium
from tetlux.fem.solution import Power, Solution
from tetlux.fem.solve import solve, solve_each
from tetlux.fem.system import System

__all__ = [
    "Deposit",
    "DiffuseLight",
    "Light",
    "Medium",
    "PencilBeam",
    "PointSource",
    "Power",
    "Solution",
    "System",
    "solve",
    "solve_each",
]
