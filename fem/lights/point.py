"""An isotropic point source inside the body."""

from dataclasses import dataclass

import numpy as np

from tetlux.fem.body.body import Body
from tetlux.fem.inputs import as_vector, check_positive
from tetlux.fem.lights.arrows import Arrows
from tetlux.fem.sources.deposit import Deposit
from tetlux.fem.sources.hints import MeshHints
from tetlux.fem.sources.ledger import Ledger
from tetlux.fem.sources.terms import SourceTerms
from tetlux.meshing.arrays import Vector
from tetlux.meshing.describe import as_text
from tetlux.meshing.errors import InputError
from tetlux.meshing.surface.surface import Surface

# A point is on the surface if it is nearer to it than this share of the body's diagonal.
ON_SURFACE = 1e-9
# The resolution is the depth of the source, but no finer than these shares of the mean free path and of the body's
# diagonal, whichever is smaller.
FINEST_MEAN_FREE_PATH, FINEST_DIAGONAL = 0.1, 0.02


@dataclass(frozen=True)
class PointSource:
    """An isotropic point source: ``Q0 = power delta(x - position)``, ``Q1 = 0`` (CS667 notes, equations 4 and 7).

    Parameters
    ----------
    position : (3,) floats
        Inside the body, unit.
    power : float
        Emitted power, W.

    Raises
    ------
    InputError
        If a coordinate is not finite or the power not positive; and, when solved, if the position is outside the body.

    Examples
    --------
    >>> from tetlux.fem import Medium, solve
    >>> from tetlux.meshing import sphere
    >>> medium = Medium(sigma_a=0.01, sigma_s_prime=1.0, eta=1.4)
    >>> solution = solve(sphere(10.0), medium, [PointSource((0.0, 0.0, 0.0), power=2.0)], tolerance=0.05)
    >>> round(solution.power.exited + solution.power.absorbed, 6)
    2.0
    """

    position: Vector
    power: float = 1.0

    def __post_init__(self) -> None:
        as_vector(self.position, "position")
        check_positive(self.power, "power", "watts")

    def arrows(self, surface: Surface) -> Arrows:
        """Draw a point; see `HasArrows`."""
        del surface
        return Arrows(as_vector(self.position, "position")[None])

    def deposit_in(self, body: Body) -> Deposit:
        """Put all of the power at one point.

        See `tetlux.fem.Light` for parameters and result.
        """
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
        finest = min(FINEST_MEAN_FREE_PATH * mean_free_path, FINEST_DIAGONAL * surface.diagonal)
        return Deposit(
            Ledger(incident=self.power),
            SourceTerms(points=position[None], powers=np.array([self.power])),
            MeshHints(resolution=max(depth, finest)),
        )
