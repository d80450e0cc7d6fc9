"""`ChargeSolution`: light in a body of homogeneous regions, by charges fitted to their surfaces, without a mesh."""

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from tetlux.fem.charges.check import ErrorEstimates
from tetlux.fem.charges.field import ChargeField
from tetlux.fem.charges.jumps import Jumps, errors_by_jumps, jumps_of
from tetlux.fem.charges.placement import EQUATION_REFINEMENT
from tetlux.fem.charges.quadrature import quadrature
from tetlux.fem.charges.readings import ReadingGoal
from tetlux.fem.charges.regions import Interface
from tetlux.fem.charges.samples import Samples, Spacing
from tetlux.fem.media.medium import Medium
from tetlux.fem.meshless.reading_error import reading_errors
from tetlux.fem.models.boundary import boundary_condition_of
from tetlux.fem.models.modulation import lag
from tetlux.fem.outcome.plan import Plan
from tetlux.fem.outcome.power import Power
from tetlux.fem.outcome.reading import Reading
from tetlux.fem.outcome.shown import Shown
from tetlux.fem.validity.meshless import SurfaceValidity
from tetlux.meshing.arrays import FloatArray, Number, NumberArray
from tetlux.meshing.describe import one_line
from tetlux.meshing.errors import InputError
from tetlux.meshing.surface.surface import Surface
from tetlux.meshing.tets.regions import region_at


@dataclass(frozen=True)
class LightLedger:
    """Power of a light that does not enter diffusion, and its diffuse irradiance.

    Attributes
    ----------
    ledger : Power
        Incident, specularly reflected, absorbed before the first scattering, and passed through the body, W.
    irradiance, transmitted : float
        Diffuse irradiance on the outside, and the part of it that is transmitted to the inside, W/unit².
    """

    ledger: Power
    irradiance: float = 0.0
    transmitted: float = 0.0


@dataclass(frozen=True, eq=False)
class ChargeSolution(Shown):
    """The light in one body as a sum of screened charges; it is asked like `tetlux.fem.Solution`, and has no mesh.

    Attributes
    ----------
    surface : Surface
        The surface of the body.
    medium : Medium
        The medium of the body, outside of its regions.
    interfaces : tuple of Interface
        The body's surface, then those of its regions.
    fields : tuple of ChargeField
        In the region around all others, and in regions 1, 2, ...; each with a column of strengths for each light.
    samples : tuple of Samples
        Points of each interface at which charges were fitted.
    sources : (r, s) ndarray
        Power of the point sources of each light in each region, W.
    ledgers : tuple of LightLedger
        The ledger of each light.
    errors : ErrorEstimates
        Estimated errors of the sum of all lights.
    seconds : dict
        Seconds spent on surface, solve, and total.
    warnings : list of str
    readings : tuple of Reading
        Of the detectors that were given to `tetlux.fem.solve`, in their order.
    plan : Plan, optional
        Why this model was chosen, if it was.
    goal : ReadingGoal, optional
        What the charges were fitted for, if it was readings of all lights together.
    validity : SurfaceValidity, optional
        Expected errors of diffusion in a body of one medium, of all lights together.
    frequency : float
        Of modulated light, Hz: exitance, fluence, power and readings then are complex amplitudes. 0 for steady light.
    """

    surface: Surface
    medium: Medium
    interfaces: tuple[Interface, ...]
    fields: tuple[ChargeField, ...]
    samples: tuple[Samples, ...]
    sources: FloatArray
    ledgers: tuple[LightLedger, ...]
    errors: ErrorEstimates
    seconds: dict[str, float] = field(default_factory=dict)
    warnings: list[str] = field(default_factory=list)
    readings: tuple[Reading, ...] = ()
    plan: Plan | None = None
    goal: ReadingGoal | None = None
    validity: SurfaceValidity | None = None
    frequency: float = 0.0

    mesh, model = None, "charges"

    @property
    def error_estimate(self) -> float:
        """Estimated relative L2 error of the exitance: see `tetlux.fem.charges.check`."""
        return self.errors.estimate

    @property
    def error_bound(self) -> float:
        """Relative L2 error that the exitance does not exceed, nan with regions: see `tetlux.fem.charges.check`."""
        return self.errors.bound

    @cached_property
    def exitance(self) -> NumberArray:
        """Exitance at the vertices of `surface`, (v,), W/unit²."""
        return self.exitance_at(self.surface.points)

    def exitance_at(self, points: npt.ArrayLike) -> NumberArray:
        """Exitance at the points of the surface nearest to given points (q, 3), (q,), W/unit²; nan if not finite."""
        places = np.asarray(points, dtype=float).reshape(-1, 3)
        finite = np.isfinite(places).all(axis=1)
        values = np.full(len(places), np.nan, dtype=self.fields[0].equation.dtype)
        values[finite] = self.exitance_on(self.surface.project(places[finite])[0])
        return values

    def amplitude_at(self, points: npt.ArrayLike) -> FloatArray:
        """Modulus of `exitance_at`, (q,), W/unit²."""
        return np.abs(self.exitance_at(points))

    def phase_at(self, points: npt.ArrayLike) -> FloatArray:
        """How far the exitance lags behind the light at points of the surface, (q,), degrees from -30 up to 330."""
        return lag(self.exitance_at(points))

    def exitance_on(self, queries: FloatArray) -> NumberArray:
        """Exitance at points (q, 3) that lie on the surface, (q,), W/unit²."""
        return np.asarray(self._sums[0].exitance(queries) + self._unscattered)

    def errors_on(self, queries: FloatArray) -> FloatArray:
        """Estimated relative errors of the exitance at points (q, 3) on the surface, (q,)."""
        source = float(boundary_condition_of(self.medium).inflow(sum(ledger.transmitted for ledger in self.ledgers)))
        exitance = self.exitance_on(queries)
        errors = reading_errors(self.surface, self._sums[0], self.samples[0], source, queries, exitance, self.goal)
        if self.goal is None:
            return errors
        return np.hypot(errors, errors_by_jumps(self.surface, self.goal.at(queries), self._jumps, exitance))

    @cached_property
    def _jumps(self) -> list[Jumps]:
        """What the fields of all lights together violate at the surfaces of regions."""
        found = []
        for interface, (points, spacing) in zip(self.interfaces, self._quadratures, strict=True):
            if interface.outside is not None:
                fields = self._sums[interface.inside], self._sums[interface.outside]
                found.append(jumps_of(*fields, points, spacing))
        return found

    @cached_property
    def _quadratures(self) -> list[tuple[Samples, FloatArray]]:
        """Points at which each interface is integrated over, and the spacing of charges there, unit."""
        found = []
        for interface, fitted in zip(self.interfaces, self.samples, strict=True):
            spacing = _nearest(cKDTree(fitted.points), EQUATION_REFINEMENT * fitted.spacing)
            points = quadrature(interface.surface, spacing)
            found.append((points, spacing(points.points)))
        return found

    def fluence_at(self, points: npt.ArrayLike) -> NumberArray:
        """Fluence at points (q, 3), (q,), W/unit²; nan outside the body, infinite at a source."""
        queries = np.asarray(points, dtype=float).reshape(-1, 3)
        fluence = np.full(len(queries), np.nan, dtype=self.fields[0].equation.dtype)
        inside = np.flatnonzero(self.surface.contains(queries))
        regions = region_at(queries[inside], [interface.surface for interface in self.interfaces[1:]])
        for region, each in enumerate(self._sums):
            some = inside[regions == region]
            with np.errstate(divide="ignore", invalid="ignore"):
                fluence[some] = each.fluence(queries[some])
        return fluence

    @property
    def resolution(self) -> tuple[FloatArray, FloatArray]:
        """Points of the body's surface (n, 3), and the spacing of charges above them (n,), unit."""
        return self.samples[0].points, EQUATION_REFINEMENT * self.samples[0].spacing

    @property
    def charges(self) -> int:
        """Number of charges, sources included."""
        return sum(len(each.positions) for each in self.fields)

    @property
    def fluence(self) -> FloatArray:
        """Refused: this is the fluence at the nodes of a mesh, and there is no mesh."""
        raise InputError('model "charges" has no mesh, nor fluence at its nodes; ask fluence_at(points).')

    @cached_property
    def of_lights(self) -> "tuple[ChargeSolution, ...]":
        """The solution of each light, in their order; empty if there is only one."""
        count = len(self.ledgers)
        return tuple(self._of_light(light) for light in range(count)) if count > 1 else ()

    def _of_light(self, light: int) -> "ChargeSolution":
        fields = tuple(replace(each, strengths=each.strengths[:, [light]]) for each in self.fields)
        return replace(
            self,
            fields=fields,
            sources=self.sources[:, [light]],
            ledgers=(self.ledgers[light],),
            errors=ErrorEstimates(np.nan, np.nan),
            warnings=[],
            goal=None,
            validity=None,
        )

    @cached_property
    def power(self) -> Power:
        """The ledger, W.

        The exited power is the integral of the exitance. The absorbed power is, by Gauss's theorem, the power of the
        sources plus the net inflow of each region. The ledger balances as far as the interface conditions hold.
        """
        area, diffused, inflow = self._flows
        taken = self.sources.sum(axis=1) + inflow
        removals = np.array([each.equation.wave_number**2 * each.equation.diffusion for each in self.fields])
        shift = self.fields[0].equation.shift
        stored = (taken * shift / removals).sum().item() if shift else 0.0
        known = [ledger.ledger for ledger in self.ledgers]
        irradiance = sum(ledger.irradiance for ledger in self.ledgers)
        transmitted = sum(ledger.transmitted for ledger in self.ledgers)
        return Power(
            incident=sum(each.incident for each in known) + area * irradiance,
            specular=sum(each.specular for each in known) + area * (irradiance - transmitted),
            absorbed=sum(each.absorbed for each in known) + taken.sum().item() - stored,
            exited=diffused + area * self._unscattered,
            ballistic=sum(each.ballistic for each in known),
            stored=stored,
        )

    @property
    def area(self) -> float:
        """Area of the body, unit²."""
        return self._flows[0]

    @cached_property
    def _flows(self) -> tuple[float, Number, NumberArray]:
        """Area of the body, integral of ``phi/(2A)`` over it, and the net inflow of each region (r,), unit² and W."""
        diffused: Number
        area, diffused, inflow = 0.0, 0.0, np.zeros(len(self.fields), self.fields[0].equation.dtype)
        for interface, (points, _) in zip(self.interfaces, self._quadratures, strict=True):
            exitance, residual = self._sums[interface.inside].exitance_and_residual(points.points, points.normals)
            inflow[interface.inside] += points.areas @ (residual - exitance)
            if interface.outside is None:
                area, diffused = float(points.areas.sum()), (points.areas @ exitance).item()
            else:
                exitance, residual = self._sums[interface.outside].exitance_and_residual(points.points, points.normals)
                inflow[interface.outside] -= points.areas @ (residual - exitance)
        return area, diffused, inflow

    @cached_property
    def _sums(self) -> tuple[ChargeField, ...]:
        """The fields of all lights together."""
        return tuple(replace(each, strengths=each.strengths.sum(axis=1)) for each in self.fields)

    @property
    def _unscattered(self) -> float:
        """Exitance in addition to ``phi/(2A)``: under diffuse light ``M = E_t + E.n``, W/unit²."""
        transmitted = sum(ledger.transmitted for ledger in self.ledgers)
        return float(boundary_condition_of(self.medium).exitance_offset(transmitted))

    __repr__ = one_line


def _nearest(tree: cKDTree, values: FloatArray) -> Spacing:
    return lambda places: values[tree.query(places)[1]]
