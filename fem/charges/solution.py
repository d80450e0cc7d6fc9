"""`ChargeSolution`: light in a body of one even medium, by charges fitted to its surface, without a mesh."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from scipy.spatial import cKDTree

from tetlux.fem.charges.adapt import MOST, Drive, FittedCharges, fit_charges
from tetlux.fem.charges.check import Quality
from tetlux.fem.charges.field import ChargeField
from tetlux.fem.charges.kernel import equation_of
from tetlux.fem.charges.places import FINER
from tetlux.fem.charges.quadrature import quadrature
from tetlux.fem.fresnel import moments
from tetlux.fem.medium import Medium
from tetlux.fem.solution import Power
from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.errors import InputError
from tetlux.meshing.surface import Surface


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
    """Light in one body, as a sum of screened charges; what `tetlux.fem.Solution` is with a mesh.

    Attributes
    ----------
    surface : Surface
    medium : Medium
    fitted : FittedCharges
        With a column for each light.
    entries : tuple of Entry
        Of each light.
    seconds : dict
        Seconds spent on surface, solve, and total.
    warnings : list of str
    """

    surface: Surface
    medium: Medium
    fitted: FittedCharges
    entries: tuple[Entry, ...]
    seconds: dict[str, float] = field(default_factory=dict)
    warnings: list[str] = field(default_factory=list)

    mesh = None
    model = "charges"

    @property
    def error_estimate(self) -> float:
        """Estimated relative L2 error of the exitance: see `tetlux.fem.charges.check`."""
        return self.fitted.quality.estimate

    @property
    def error_bound(self) -> float:
        """Relative L2 error that the exitance does not exceed: see `tetlux.fem.charges.check`."""
        return self.fitted.quality.bound

    @cached_property
    def exitance(self) -> FloatArray:
        """Exitance at the vertices of `surface`, (v,), W/unit²."""
        return self.exitance_at(self.surface.points)

    def exitance_at(self, points: FloatArray) -> FloatArray:
        """Exitance at the points of the surface nearest to given points (q, 3), (q,), W/unit²; nan if not finite."""
        places = np.asarray(points, dtype=float).reshape(-1, 3)
        finite = np.isfinite(places).all(axis=1)
        values = np.full(len(places), np.nan)
        values[finite] = self.exitance_on(self.surface.project(places[finite])[0])
        return values

    def exitance_on(self, queries: FloatArray) -> FloatArray:
        """Exitance at points (q, 3) that lie on the surface, (q,), W/unit²."""
        return np.asarray(self._total.exitance(queries) + self._unscattered)

    def fluence_at(self, points: FloatArray) -> FloatArray:
        """Fluence at points (q, 3), (q,), W/unit²; nan outside the body, infinite at a source."""
        queries = np.asarray(points, dtype=float).reshape(-1, 3)
        fluence = np.full(len(queries), np.nan)
        inside = np.flatnonzero(self.surface.contains(queries))
        with np.errstate(divide="ignore"):
            fluence[inside] = self._total.fluence(queries[inside])
        return fluence

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
        fitted = self.fitted
        strengths, drive = fitted.field.strengths[:, [light]], fitted.drive
        drive = Drive(drive.points, drive.powers[:, [light]], drive.inflow[[light]])
        quality = Quality(np.nan, np.nan)
        own = replace(fitted, field=replace(fitted.field, strengths=strengths), drive=drive, quality=quality)
        return replace(self, fitted=own, entries=(self.entries[light],), warnings=[])

    @cached_property
    def power(self) -> Power:
        """The ledger, W.

        What exits is the integral of the exitance, and what is absorbed is what the lights give less what flows out by
        Gauss's theorem: they balance as far as the boundary condition holds.
        """
        fitted, drive = self.fitted, self.fitted.drive
        points = fitted.places.fitted
        tree = cKDTree(points.points)
        samples = quadrature(self.surface, lambda places: FINER * points.spacing[tree.query(places)[1]])
        area = float(samples.areas.sum())
        exitance, residual = self._total.exitance_and_residual(samples.points, samples.normals)
        diffused = float(samples.areas @ exitance)
        known = [entry.known for entry in self.entries]
        irradiance = sum(entry.irradiance for entry in self.entries)
        transmitted = sum(entry.transmitted for entry in self.entries)
        return Power(
            incident=sum(each.incident for each in known) + area * irradiance,
            specular=sum(each.specular for each in known) + area * (irradiance - transmitted),
            absorbed=sum(each.absorbed for each in known)
            + float(drive.powers.sum() + samples.areas @ residual - diffused),
            exited=diffused + area * self._unscattered,
            ballistic=sum(each.ballistic for each in known),
        )

    @cached_property
    def _total(self) -> ChargeField:
        fitted = self.fitted.field
        return replace(fitted, strengths=fitted.strengths.sum(axis=1))

    @property
    def _unscattered(self) -> float:
        """Exitance beside ``phi/(2A)``: under diffuse light ``M = E_t + E.n``, W/unit²."""
        share = 1.0 - 2.0 / (1.0 + 3.0 * moments(self.medium.eta)[1])
        return share * sum(entry.transmitted for entry in self.entries)


def charge_solution(
    surface: Surface,
    medium: Medium,
    points: FloatArray,
    powers: FloatArray,
    entries: Sequence[Entry],
    *,
    tolerance: float = 0.02,
    most: int = MOST,
) -> ChargeSolution:
    """Solve for point sources and diffuse light in a body of one even medium.

    Parameters
    ----------
    surface : Surface
    medium : Medium
    points : (p, 3) ndarray
        Sources inside the body.
    powers : (p, s) ndarray
        What each of s lights puts into each of them, W.
    entries : sequence of Entry
        Of each light.
    tolerance : float
        Wanted relative L2 error of the exitance.
    most : int
        Charges at which fitting ends in any case.

    Returns
    -------
    ChargeSolution
    """
    transmitted = np.array([entry.transmitted for entry in entries])
    inflow = 2.0 * transmitted / (1.0 + 3.0 * moments(medium.eta)[1])
    drive = Drive(points, powers, inflow)
    fitted = fit_charges(surface, equation_of(medium), drive, tolerance=tolerance, most=most)
    return ChargeSolution(surface, medium, fitted, tuple(entries))
