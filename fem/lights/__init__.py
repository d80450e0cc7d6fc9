"""Lights, one a file: where each one's power goes."""

from tetlux.fem.lights.deposit import Deposit, Light
from tetlux.fem.lights.diffuse import DiffuseLight
from tetlux.fem.lights.pencil import PencilBeam
from tetlux.fem.lights.point import PointSource

__all__ = ["Deposit", "DiffuseLight", "Light", "PencilBeam", "PointSource"]
