"""`ClosedFormSolution`: light in a ball or slab by its series, which is what ``model="closed-form"`` gives."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from tetlux.fem.body.body import Body
from tetlux.fem.media.medium import Medium
from tetlux.fem.meshless.exact_field import ExactField, exact_field
from tetlux.fem.outcome.plan import Plan
from tetlux.fem.outcome.power import Power
from tetlux.fem.outcome.reading import Reading
from tetlux.fem.outcome.shown import Shown
from tetlux.fem.sources.deposit import Deposit
from tetlux.fem.validity.meshless import SurfaceValidity
from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.describe import one_line
from tetlux.meshing.errors import InputError
from tetlux.meshing.notes import Note
from tetlux.meshing.surface.solids import Slab, Sphere
from tetlux.meshing.surface.surface import Surface

# Points are inside a shape up to this share of its size beyond its surface.
ROUNDING = 1e-9
# The exitance needs this share of the distance from the nearest source to change: see `ClosedFormSolution.resolution`.
RESOLUTION = 0.5


@dataclass(frozen=True, eq=False)
class ClosedFormSolution(Shown):
    """The light in a body by closed forms; it is asked like `tetlux.fem.Solution`, and has no mesh.

    Attributes
    ----------
    surface : Surface
        A ball or a slab.
    medium : Medium
    exact : ExactField
        The field of all lights together.
    deposits : tuple of Deposit
        Of each light.
    seconds : dict
        Seconds spent on surface, solve, and total; the exitance is computed when it is asked for.
    warnings : list of str
    readings : tuple of Reading
        Of the detectors that were given to `tetlux.fem.solve`, in their order.
    plan : Plan, optional
        Why this model was chosen, if it was.
    validity : SurfaceValidity, optional
        Expected errors of diffusion, of all lights together.
    """

    surface: Surface
    medium: Medium
    exact: ExactField
    deposits: tuple[Deposit, ...]
    seconds: dict[str, float] = field(default_factory=dict)
    warnings: list[str] = field(default_factory=list)
    readings: tuple[Reading, ...] = ()
    plan: Plan | None = None
    validity: SurfaceValidity | None = None

    mesh = None
    model = "closed-form"

    @property
    def error_estimate(self) -> float:
        """Bound of the relative L2 error of the exitance: see `tetlux.fem.meshless.exact_field`."""
        return self.exact.error

    @property
    def error_bound(self) -> float:
        """The same."""
        return self.exact.error

    @property
    def area(self) -> float:
        """Area of the body, unit²."""
        return self.exact.area

    @cached_property
    def exitance(self) -> FloatArray:
        """Exitance at the vertices of `surface`, (v,), W/unit²."""
        return self.exitance_at(self.surface.points)

    def exitance_at(self, points: npt.ArrayLike) -> FloatArray:
        """Exitance at the points of the surface nearest to given points (q, 3), (q,), W/unit²; nan if not finite."""
        places = np.asarray(points, dtype=float).reshape(-1, 3)
        finite = np.isfinite(places).all(axis=1)
        values = np.full(len(places), np.nan)
        values[finite] = self.exitance_on(self._nearest(places[finite]))
        return values

    def _nearest(self, points: FloatArray) -> FloatArray:
        """Points of the surface nearest to points (q, 3); for a ball any points in the same directions."""
        shape = self.surface.shape
        if isinstance(shape, Sphere) and not (points == np.asarray(shape.center)).all(axis=1).any():
            return points
        return self.surface.project(points)[0]

    def exitance_on(self, queries: FloatArray) -> FloatArray:
        """Exitance at points (q, 3) that lie on the surface, (q,), W/unit²."""
        return self.exact.exitance(queries)

    def errors_on(self, queries: FloatArray) -> FloatArray:
        """Bounds of the relative errors of the exitance at points (q, 3) on the surface, (q,)."""
        return self.exact.errors_at(queries)

    def fluence_at(self, points: npt.ArrayLike) -> FloatArray:
        """Fluence at points (q, 3), (q,), W/unit²; nan outside the body, infinite at a source."""
        queries = np.asarray(points, dtype=float).reshape(-1, 3)
        fluence = np.full(len(queries), np.nan)
        inside = _is_inside(self.surface, queries)
        with np.errstate(divide="ignore", invalid="ignore"):
            fluence[inside] = self.exact.fluence(queries[inside])
        return fluence

    @property
    def fluence(self) -> FloatArray:
        """Refused: this is the fluence at the nodes of a mesh, and there is no mesh."""
        raise InputError('model "closed-form" has no mesh, nor fluence at its nodes; ask fluence_at(points).')

    @property
    def resolution(self) -> tuple[FloatArray, FloatArray]:
        """Points of the surface (n, 3), and how much space the exitance needs to change there, (n,), unit."""
        surface = self.surface
        points = np.vstack([each.terms.points for each in self.deposits])
        middles = surface.points[surface.faces].mean(axis=1)
        if len(points) == 0:
            return middles, np.full(len(middles), surface.diagonal)
        places = np.vstack([middles, surface.project(points)[0]])
        apart = np.min([np.linalg.norm(places - point, axis=1) for point in points], axis=0)
        return places, RESOLUTION * apart

    @cached_property
    def of_lights(self) -> "tuple[ClosedFormSolution, ...]":
        """The solution of each light, in their order; empty if there is only one."""
        if len(self.deposits) == 1:
            return ()
        shape, medium = self.surface.shape, self.medium
        alone = replace(self, warnings=[], readings=(), validity=None)
        return tuple(
            replace(alone, exact=exact_field(shape, medium, [each]), deposits=(each,)) for each in self.deposits
        )

    @cached_property
    def power(self) -> Power:
        """The ledger, W; what neither leaves nor is known to be absorbed before is absorbed by diffusion."""
        ledgers, terms = [each.ledger for each in self.deposits], [each.terms for each in self.deposits]
        irradiance = sum(float(each.irradiance) for each in terms)
        entered = self.area * sum(float(each.transmitted_irradiance) for each in terms)
        sources = sum(float(each.powers.sum()) for each in terms)
        return Power(
            incident=sum(each.incident for each in ledgers) + self.area * irradiance,
            specular=sum(each.specular for each in ledgers) + self.area * irradiance - entered,
            absorbed=sum(each.absorbed for each in ledgers) + sources + entered - self.exact.exited,
            exited=self.exact.exited,
            ballistic=sum(each.ballistic for each in ledgers),
        )

    __repr__ = one_line


def solution_of(
    exact: ExactField, surface: Surface, medium: Medium, deposits: Sequence[Deposit], *, tolerance: float
) -> ClosedFormSolution:
    """The solution that a closed form is, with a warning if it misses the tolerance.

    Parameters
    ----------
    exact : ExactField
        Of all deposits.
    surface : Surface
    medium : Medium
        Of the whole body.
    deposits : sequence of Deposit
        Of each light.
    tolerance : float
        Wanted relative L2 error of the exitance.
    """
    warnings = [*surface.warnings, *(warning for deposit in deposits for warning in deposit.warnings)]
    if not exact.error <= tolerance:
        warnings.append(
            Note(
                "tolerance-missed",
                f"the tolerance of {tolerance:g} may be missed: the {exact.name} is off by up to {exact.error:.2g} "
                'in this one, which ends; solve it with model "full".',
                value=exact.error,
            )
        )
    validity = SurfaceValidity(surface, medium, deposits)
    return ClosedFormSolution(
        surface, medium, exact, tuple(deposits), warnings=list(dict.fromkeys(warnings)), validity=validity
    )


def homogeneous(body: Body) -> Medium:
    """The medium of the whole body.

    Raises
    ------
    InputError
        If there are several, or it varies.
    """
    if body.only_medium is None:
        raise InputError("closed forms are those of one homogeneous medium")
    return body.only_medium


def _is_inside(surface: Surface, points: FloatArray) -> npt.NDArray[np.bool_]:
    shape, finite = surface.shape, np.isfinite(points).all(axis=1)
    inside = np.zeros(len(points), dtype=bool)
    if isinstance(shape, Sphere):
        apart = np.linalg.norm(points[finite] - np.asarray(shape.center), axis=1)
        inside[finite] = apart <= (1.0 + ROUNDING) * shape.radius
    elif isinstance(shape, Slab):
        half = 0.5 * np.array([shape.width, shape.width, shape.depth])
        away = np.abs(points[finite] + [0.0, 0.0, half[2]]) - half
        inside[finite] = (away <= ROUNDING * shape.width).all(axis=1)
    return inside
