"""`Ledger`: what becomes of the power of a light before it is scattered."""

from collections.abc import Sequence
from dataclasses import dataclass

from tetlux.meshing.arrays import Number


@dataclass(frozen=True)
class Ledger:
    """Power of a light that does not depend on the solution, W; `tetlux.fem.Power` is that of a solution.

    Parameters
    ----------
    incident : float, or complex of what modulated light makes dyes emit
        Power that reaches the body. For an irradiance or an emission leave it at 0: it follows from the area and the
        volume of the mesh.
    specular : float
        Power that the surface reflects from outside.
    absorbed : float
        Power that is absorbed before it is scattered.
    ballistic : float
        Power that leaves the body without having been scattered.
    """

    incident: Number = 0.0
    specular: float = 0.0
    absorbed: float = 0.0
    ballistic: float = 0.0

    @classmethod
    def merge(cls, parts: "Sequence[Ledger]") -> "Ledger":
        """Add up several ledgers."""
        return cls(
            incident=sum(part.incident for part in parts),
            specular=sum(part.specular for part in parts),
            absorbed=sum(part.absorbed for part in parts),
            ballistic=sum(part.ballistic for part in parts),
        )
