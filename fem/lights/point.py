"""An isotropic point source inside the body."""

from dataclasses import dataclass

import numpy as np

from tetlux.fem.body.body import Body
from tetlux.fem.inputs import as_vector, check_positive
from tetlux.fem.lights.arrows import Arrows
from tetlux.fem.sources.deposit import Deposit
from tetlux.meshing.arrays import Vector
from tetlux.meshing.describe import as_text
from tetlux.meshing.errors import InputError
from tetlux.meshing.surface.surface import Surface

# A point nearer to the surface than this share of the body's diagonal is on it.
ON_SURFACE = 1e-9


@dataclass(frozen=True)
class PointSource:
    """An isotropic point: ``Q0 = power delta(x - position)``, ``Q1 = 0`` (CS667 notes, eqs. 4 and 7).

    Parameters
    ----------
    position : (3,) floats
        Inside the body, unit.
    power : float
        W.

    Raises
    ------
    InputError
        If a coordinate is not finite or the power not positive; and, when solved, if it lies outside.
    """

    position: Vector
    power: float = 1.0

    def __post_init__(self) -> None:
        as_vector(self.position, "position")
        check_positive(self.power, "power", "watts")

    def arrows(self, surface: Surface) -> Arrows:
        """A point."""
        del surface
        return Arrows(as_vector(self.position, "position")[None])

    def deposit_in(self, body: Body) -> Deposit:
        """All of its power at one point."""
        surface, position = body.surface, as_vector(self.position, "position")
        if not surface.contains(position[None])[0]:
            raise InputError(
                f"the point source at {as_text(position)} lies outside the body, which spans {surface.extent}; "
                "move it inside."
            )
        nearest, _ = surface.closest(position[None])
        depth = float(np.linalg.norm(nearest[0] - position))
        if depth <= ON_SURFACE * surface.diagonal:
            raise InputError(f"the point source at {as_text(position)} lies on the surface; move it inside.")
        mean_free_path = float(body.mean_free_paths(position[None])[0])
        return Deposit(
            incident=self.power,
            points=position[None],
            powers=np.array([self.power]),
            resolution=max(depth, min(0.1 * mean_free_path, 0.02 * surface.diagonal)),
        )
