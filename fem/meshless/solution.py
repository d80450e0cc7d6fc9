"""`ChargeSolution`: light in a body of even regions, by charges fitted to their surfaces, without a mesh."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from tetlux.fem.charges.adapt import MOST, Drive, fit_charges
from tetlux.fem.charges.check import Quality
from tetlux.fem.charges.field import ChargeField
from tetlux.fem.charges.kernel import equation_of
from tetlux.fem.charges.places import FINER
from tetlux.fem.charges.quadrature import quadrature
from tetlux.fem.charges.samples import Samples, Spacing
from tetlux.fem.charges.several import RegionLight, Wall, fit_regions
from tetlux.fem.media.medium import Medium
from tetlux.fem.models.boundary import boundary_condition_of
from tetlux.fem.outcome.power import Power
from tetlux.fem.outcome.reading import Reading
from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.errors import InputError
from tetlux.meshing.surface.surface import Surface
from tetlux.meshing.tets.nesting import nesting
from tetlux.meshing.tets.regions import region_at


@dataclass(frozen=True)
class Entry:
    """What is known of a light before it diffuses.

    Attributes
    ----------
    known : Power
        What of it meets the body, is reflected at once, absorbed before it was ever scattered, or passes through, W.
    irradiance, transmitted : float
        Diffuse light on the outside, and what of it passes to the inside, W/unit².
    """

    known: Power
    irradiance: float = 0.0
    transmitted: float = 0.0


@dataclass(frozen=True, eq=False)
class ChargeSolution:
    """Light in one body, as sums of screened charges; what `tetlux.fem.Solution` is with a mesh.

    Attributes
    ----------
    surface : Surface
    medium : Medium
        Of the body.
    walls : tuple of Wall
        The body's surface, and those of its regions.
    fields : tuple of ChargeField
        In the body's own region and in the others, each with a column of strengths for each light.
    samples : tuple of Samples
        Points of each wall at which charges were fitted.
    sources : (s,) ndarray
        Power of each light's points, W.
    entries : tuple of Entry
        Of each light.
    quality : Quality
        Of the sum of all lights.
    seconds : dict
        Seconds spent on surface, solve, and total.
    warnings : list of str
    readings : tuple of Reading
        What the detectors read that were given to `tetlux.fem.solve`, in their order.
    """

    surface: Surface
    medium: Medium
    walls: tuple[Wall, ...]
    fields: tuple[ChargeField, ...]
    samples: tuple[Samples, ...]
    sources: FloatArray
    entries: tuple[Entry, ...]
    quality: Quality
    seconds: dict[str, float] = field(default_factory=dict)
    warnings: list[str] = field(default_factory=list)
    readings: tuple[Reading, ...] = ()

    mesh = None
    model = "charges"

    @property
    def error_estimate(self) -> float:
        """Estimated relative L2 error of the exitance: see `tetlux.fem.charges.check`."""
        return self.quality.estimate

    @property
    def error_bound(self) -> float:
        """Relative L2 error that the exitance does not exceed, nan with regions: see `tetlux.fem.charges.check`."""
        return self.quality.bound

    @cached_property
    def exitance(self) -> FloatArray:
        """Exitance at the vertices of `surface`, (v,), W/unit²."""
        return self.exitance_at(self.surface.points)

    def exitance_at(self, points: npt.ArrayLike) -> FloatArray:
        """Exitance at the points of the surface nearest to given points (q, 3), (q,), W/unit²; nan if not finite."""
        places = np.asarray(points, dtype=float).reshape(-1, 3)
        finite = np.isfinite(places).all(axis=1)
        values = np.full(len(places), np.nan)
        values[finite] = self.exitance_on(self.surface.project(places[finite])[0])
        return values

    def exitance_on(self, queries: FloatArray) -> FloatArray:
        """Exitance at points (q, 3) that lie on the surface, (q,), W/unit²."""
        return np.asarray(self._sums[0].exitance(queries) + self._unscattered)

    def fluence_at(self, points: npt.ArrayLike) -> FloatArray:
        """Fluence at points (q, 3), (q,), W/unit²; nan outside the body, infinite at a source."""
        queries = np.asarray(points, dtype=float).reshape(-1, 3)
        fluence = np.full(len(queries), np.nan)
        inside = np.flatnonzero(self.surface.contains(queries))
        regions = region_at(queries[inside], [wall.surface for wall in self.walls[1:]])
        for region, each in enumerate(self._sums):
            some = inside[regions == region]
            with np.errstate(divide="ignore", invalid="ignore"):
                fluence[some] = each.fluence(queries[some])
        return fluence

    @property
    def resolution(self) -> tuple[FloatArray, FloatArray]:
        """Points of the body's surface (n, 3), and how far apart charges are above them (n,), unit."""
        return self.samples[0].points, FINER * self.samples[0].spacing

    @property
    def charges(self) -> int:
        """How many there are, sources included."""
        return sum(len(each.positions) for each in self.fields)

    @property
    def fluence(self) -> FloatArray:
        """Refused: it is that at the nodes of a mesh."""
        raise InputError('model "charges" has no mesh, nor fluence at its nodes; ask fluence_at(points).')

    @cached_property
    def of_lights(self) -> "tuple[ChargeSolution, ...]":
        """What each light adds, in their order, if there are several."""
        count = len(self.entries)
        return tuple(self._of_light(light) for light in range(count)) if count > 1 else ()

    def _of_light(self, light: int) -> "ChargeSolution":
        fields = tuple(replace(each, strengths=each.strengths[:, [light]]) for each in self.fields)
        return replace(
            self,
            fields=fields,
            sources=self.sources[[light]],
            entries=(self.entries[light],),
            quality=Quality(np.nan, np.nan),
            warnings=[],
        )

    @cached_property
    def power(self) -> Power:
        """The ledger, W.

        What exits is the integral of the exitance. What is absorbed is, by Gauss's theorem, what sources give and what
        flows into each region through its walls: the ledger balances as far as the conditions there hold.
        """
        area, diffused, inflow = self._flows
        known = [entry.known for entry in self.entries]
        irradiance = sum(entry.irradiance for entry in self.entries)
        transmitted = sum(entry.transmitted for entry in self.entries)
        return Power(
            incident=sum(each.incident for each in known) + area * irradiance,
            specular=sum(each.specular for each in known) + area * (irradiance - transmitted),
            absorbed=sum(each.absorbed for each in known) + float(self.sources.sum()) + inflow,
            exited=diffused + area * self._unscattered,
            ballistic=sum(each.ballistic for each in known),
        )

    @property
    def area(self) -> float:
        """Area of the body, unit²."""
        return self._flows[0]

    @cached_property
    def _flows(self) -> tuple[float, float, float]:
        """Area of the body, integral of ``phi/(2A)`` over it, and what flows into all regions through their walls."""
        area, diffused, inflow = 0.0, 0.0, 0.0
        for wall, fitted in zip(self.walls, self.samples, strict=True):
            tree = cKDTree(fitted.points)
            spacing = FINER * fitted.spacing
            points = quadrature(wall.surface, _nearest(tree, spacing))
            exitance, residual = self._sums[wall.inside].exitance_and_residual(points.points, points.normals)
            inflow += float(points.areas @ (residual - exitance))
            if wall.outside is None:
                area, diffused = float(points.areas.sum()), float(points.areas @ exitance)
            else:
                exitance, residual = self._sums[wall.outside].exitance_and_residual(points.points, points.normals)
                inflow -= float(points.areas @ (residual - exitance))
        return area, diffused, inflow

    @cached_property
    def _sums(self) -> tuple[ChargeField, ...]:
        """The fields of all lights together."""
        return tuple(replace(each, strengths=each.strengths.sum(axis=1)) for each in self.fields)

    @property
    def _unscattered(self) -> float:
        """Exitance beside ``phi/(2A)``: under diffuse light ``M = E_t + E.n``, W/unit²."""
        transmitted = sum(entry.transmitted for entry in self.entries)
        return float(boundary_condition_of(self.medium).exitance_offset(transmitted))


def _nearest(tree: cKDTree, values: FloatArray) -> Spacing:
    return lambda places: values[tree.query(places)[1]]


def charge_solution(
    surface: Surface,
    medium: Medium,
    points: FloatArray,
    powers: FloatArray,
    entries: Sequence[Entry],
    *,
    inner: Sequence[tuple[Surface, Medium]] = (),
    tolerance: float = 0.02,
    most: int = MOST,
) -> ChargeSolution:
    """Solve for point sources and diffuse light in a body of even regions.

    Parameters
    ----------
    surface : Surface
    medium : Medium
        Of the body.
    points : (p, 3) ndarray
        Sources inside the body.
    powers : (p, s) ndarray
        What each of s lights puts into each of them, W.
    entries : sequence of Entry
        Of each light; diffuse light is for a body without regions.
    inner : sequence of (Surface, Medium)
        Regions of the body.
    tolerance : float
        Wanted relative L2 error of the exitance.
    most : int
        Charges at which fitting ends in any case, about.

    Returns
    -------
    ChargeSolution
    """
    sources = powers.sum(axis=0)
    if not inner:
        inflow = np.asarray(boundary_condition_of(medium).inflow(np.array([entry.transmitted for entry in entries])))
        drive = Drive(points, powers, inflow)
        fitted = fit_charges(surface, equation_of(medium), drive, tolerance=tolerance, most=most)
        samples, wall = fitted.places.fitted, Wall(surface, 0, None)
        return ChargeSolution(
            surface, medium, (wall,), (fitted.field,), (samples,), sources, tuple(entries), fitted.quality
        )
    surfaces = [each for each, _ in inner]
    parents = nesting(surface, surfaces).parents
    walls = [Wall(surface, 0, None)]
    walls += [Wall(own, region, parents[region - 1]) for region, own in enumerate(surfaces, 1)]
    light = RegionLight(points, region_at(points, surfaces), powers)
    equations = [equation_of(each) for each in (medium, *(medium for _, medium in inner))]
    fit = fit_regions(walls, equations, light, tolerance=tolerance, most=most)
    fitted_at = tuple(each.places.fitted for each in fit.places)
    return ChargeSolution(surface, medium, tuple(walls), fit.fields, fitted_at, sources, tuple(entries), fit.quality)
