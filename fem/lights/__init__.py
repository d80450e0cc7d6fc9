"""Lights, one a file: each computes what it deposits in a body."""

from tetlux.fem.lights.collimated import CollimatedBeam
from tetlux.fem.lights.diffuse import DiffuseLight
from tetlux.fem.lights.diffuse_patch import DiffusePatch
from tetlux.fem.lights.emission import Emission
from tetlux.fem.lights.environment import EnvironmentLight
from tetlux.fem.lights.pencil import PencilBeam
from tetlux.fem.lights.point import PointSource
from tetlux.fem.lights.spots import Disc, Gaussian, Image, Rectangle
from tetlux.fem.sources.deposit import Deposit
from tetlux.fem.sources.light import Light

__all__ = [
    "CollimatedBeam",
    "Deposit",
    "DiffuseLight",
    "DiffusePatch",
    "Disc",
    "Emission",
    "EnvironmentLight",
    "Gaussian",
    "Image",
    "Light",
    "PencilBeam",
    "PointSource",
    "Rectangle",
]
