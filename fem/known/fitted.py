"""Charges fitted to the true surface, subtracted from the light of point sources throughout an even body.

Charges G that are fitted to the true surface (`tetlux.fem.charges`) violate the boundary condition there by
``r = D dG/dn + G/(2A)``. What is missing, ``u = phi - G``, obeys the equation without light, and

    ∫ D grad u . grad v + sigma_a u v  +  ∮ u v/(2A)  =  -∮ r v

Nothing else of G enters, so that flat facets do no harm: r is that of the true surface, and is carried to the facets of
a mesh by nearest points. u is some hundredths of the light or less, and smooth but for ripples as long as charges are
apart: a coarse mesh will do, and is refined where u asks for it.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.spatial import cKDTree

from tetlux.fem.charges.adapt import (
    LARGEST_USEFUL_ESTIMATE,
    MOST_CHARGES_WITH_FEM,
    FittedCharges,
    LightSources,
    fit_for_remainder,
    fit_strengths,
)
from tetlux.fem.charges.check import exitance_error
from tetlux.fem.charges.field import ChargeField
from tetlux.fem.charges.fit_readings import fit_for_readings
from tetlux.fem.charges.kernel import Equation, equation_of
from tetlux.fem.charges.placement import EQUATION_REFINEMENT, ChargePlacement
from tetlux.fem.charges.quadrature import group_size, quadrature
from tetlux.fem.charges.readings import reading_goal
from tetlux.fem.charges.samples import Samples, Spacing
from tetlux.fem.known.boundary_residual import BoundaryResidual, residual_at
from tetlux.fem.known.charges import Charges
from tetlux.fem.known.images import CLOSEST
from tetlux.fem.media.medium import Medium
from tetlux.fem.sources.deposit import Deposit
from tetlux.meshing.arrays import BoolArray, FloatArray, IntArray
from tetlux.meshing.describe import one_line
from tetlux.meshing.host.by_pair import ByPair
from tetlux.meshing.surface.surface import Surface
from tetlux.meshing.tets.mesh import TetMesh

# A source nearer to the surface than this share of a mean free path is not fitted: it would take many charges.
SHALLOWEST = 1e-3
# More sources than this are not fitted: charges would be needed near each of them.
MOST_SOURCES = 30
# Values near a charge are taken no nearer than this share of the least distance of charges from fitted points.
CLEAR = 0.25
# Charges that finite elements subtract are fitted until they alone read within this share of the tolerance: the rest of
# it is for the elements. Largest error of forty readings of plates and blocks, at .01, in %, for .2 / .1 / .05: .12 /
# .10 / .02, by up to 540 / 550 / 640 charges.
READING_SHARE = 0.05
# Charges are subtracted where they are off by at most this share of the exitance, on average over so many points of the
# surface. On a hare the far half, five decades darker than the entry, is left to finite elements: charges are off by
# once or twice the exitance there.
ACCURATE, AVERAGED = 0.3, 12

# Many runs have the same points on one mesh: the point nearest to each node.
_NEAREST: ByPair[TetMesh, Samples, IntArray] = ByPair()


@dataclass(frozen=True, eq=False)
class FittedLight:
    """One light's sources and the charges fitted to them.

    Attributes
    ----------
    charges : Charges
    points : Samples
        The points at which `residual` is integrated.
    placement : ChargePlacement
        Where charges were put and fitted; for the same light in other coefficients.
    surface : Surface
        What they were fitted to.
    like : FittedLight, optional
        The same light in other coefficients, where it is accurate.
    """

    charges: Charges
    points: Samples
    placement: ChargePlacement
    surface: Surface
    like: "FittedLight | None" = None

    @cached_property
    def residual(self) -> BoundaryResidual:
        """What the charges leave of the boundary condition."""
        return residual_at(self.points, self.charges)

    @cached_property
    def accurate(self) -> BoolArray:
        """Whether the charges are accurate at each of the points, (q,)."""
        return _accurate(self.residual, self.charges.equation) if self.like is None else self.like.accurate

    def refit(self, shift: complex) -> Charges:
        """The charges with another shift, 1/unit, at the same places."""
        known = self.charges
        sources, powers = known.positions[: known.sources], known.strengths[: known.sources, None]
        lights = LightSources(sources, powers, np.zeros(1))
        field, _ = fit_strengths(self.placement, equation_of(known.medium, shift), lights)
        return replace(known, equation=field.equation, strengths=field.strengths[:, 0])

    def unfitted(self, equation: Equation, lights: LightSources) -> ChargeField:
        """These charges without strengths, with other sources in another equation."""
        positions = np.vstack([lights.points, self.placement.charges])
        nothing = np.zeros((len(self.placement.charges), 1))
        return ChargeField(equation, positions, np.vstack([lights.powers, nothing]))

    def accurate_on(self, mesh: TetMesh) -> BoolArray:
        """Whether the charges are accurate at the point of `residual` nearest to each node of a mesh, (n,)."""
        if self.accurate.all():
            return np.ones(len(mesh.points), dtype=bool)
        nearest = _NEAREST.get(mesh, self.points, lambda: np.asarray(self.points.tree.query(mesh.points)[1]))
        return np.asarray(self.accurate[nearest])

    def points_within(self, wanted: Spacing) -> Samples:
        """Points as far apart as wanted at most, where a mesh is finer than those of the residual."""
        return _residual_points(self.placement, self.surface, wanted)

    __repr__ = one_line


def fit_light(
    deposit: Deposit,
    surface: Surface,
    medium: Medium,
    *,
    tolerance: float,
    readings: tuple[FloatArray, float] | None = None,
    like: FittedLight | None = None,
    shift: complex = 0.0,
    refit: bool = True,
) -> FittedLight | None:
    """Fit charges to the points of a deposit.

    Parameters
    ----------
    deposit : Deposit
    surface : Surface
    medium : Medium
    tolerance : float
        Relative L2 error of the exitance, of charges and finite elements together.
    readings : (d, 3) ndarray and float, optional
        Points of the surface that are read, and wanted relative error of each reading.
    like : FittedLight, optional
        The same light in other coefficients: charges are put where its are, and are accurate where its are.
    shift : complex
        What is added to sigma_a, 1/unit. Places of charges are chosen for the real part of the wave number: complex
        fits take four times as long.
    refit : bool
        Whether charges that are put where those of `like` are have strengths; else only their places are wanted.

    Returns
    -------
    FittedLight or None
        None if charges would not do: the light has lines or too many points, some of these lie on the surface, or a
        fit leaves too much.
    """
    if not _is_fit(deposit, surface, medium):
        return None
    lights = LightSources(deposit.terms.points, deposit.terms.powers[:, None], np.zeros(1))
    equation = equation_of(medium, shift)
    placement, field = None if like is None else like.placement, None
    if placement is None:
        real = replace(equation, wave_number=equation.wave_number.real)
        found = None
        if readings is not None:
            found = _fit_for_readings(surface, real, lights, *readings, tolerance)
        if found is None:
            found = fit_for_remainder(surface, real, lights, tolerance=tolerance)
        if found is None:
            return None
        placement, field = found.placement, found.field
    if like is not None and not refit:
        field = like.unfitted(equation, lights)
    elif field is None or shift != 0:
        field, _ = fit_strengths(placement, equation, lights)
    charges = _charges(field, placement, surface, medium)
    if like is not None and like.surface is surface:
        return FittedLight(charges, like.points, placement, surface, like)
    return FittedLight(charges, _residual_points(placement, surface), placement, surface, like)


def _fit_for_readings(
    surface: Surface,
    equation: Equation,
    lights: LightSources,
    points: FloatArray,
    reading_tolerance: float,
    tolerance: float,
) -> FittedCharges | None:
    """Charges of which finite elements solve for the remainder, small where it changes readings; None if too large."""
    aim = READING_SHARE * reading_tolerance
    goal = reading_goal(surface, equation, lights.points, lights.powers[:, 0], 0.0, points, aim)
    fitted = fit_for_readings(surface, equation, lights, goal, tolerance=tolerance, most=MOST_CHARGES_WITH_FEM)
    return fitted if fitted.errors.estimate <= LARGEST_USEFUL_ESTIMATE else None


def _accurate(residual: BoundaryResidual, equation: Equation) -> BoolArray:
    """Whether charges are accurate around each point, (q,), by the error that residuals make of the exitance there."""
    points = residual.points
    nearest = points.tree.query(points.points, k=min(AVERAGED, len(points.points)))[1]
    errors = exitance_error(equation, residual.values, points.spacing)
    error = np.sqrt((np.abs(errors[nearest]) ** 2).mean(axis=1))
    exitance = np.abs(residual.exitance[nearest]).mean(axis=1)
    return np.asarray(error <= ACCURATE * exitance)


def _is_fit(deposit: Deposit, surface: Surface, medium: Medium) -> bool:
    """Whether the light is a few points well inside a simple body."""
    terms = deposit.terms
    if surface.overlaps:
        return False
    if not 0 < len(terms.points) <= MOST_SOURCES or len(terms.segments) > 0:
        return False
    if np.any(terms.irradiance) or np.any(terms.emission) or deposit.on_mesh is not None:
        return False
    depths = surface.distances(terms.points)
    return bool((depths > SHALLOWEST * medium.mean_free_path).all() and surface.contains(terms.points).all())


def _charges(field: ChargeField, placement: ChargePlacement, surface: Surface, medium: Medium) -> Charges:
    """Sources and charges as one sum."""
    sources = field.positions[: len(field.positions) - len(placement.charges)]
    depths = surface.distances(sources)
    heights = np.asarray(cKDTree(placement.fitted.points).query(placement.charges)[0])
    closest = min(CLOSEST * min(medium.mean_free_path, float(depths.min())), CLEAR * float(heights.min()))
    return Charges(field.equation, field.positions, field.strengths[:, 0], closest, sources=len(sources), medium=medium)


def _residual_points(placement: ChargePlacement, surface: Surface, wanted: Spacing | None = None) -> Samples:
    """Points at which a residual is integrated; they do not depend on the coefficients."""
    samples, size = placement.fitted, group_size(len(placement.charges))

    def spacing(queries: FloatArray) -> FloatArray:
        own = EQUATION_REFINEMENT * samples.spacing[samples.tree.query(queries)[1]]
        return own if wanted is None else np.minimum(own, wanted(queries) / size)

    points = quadrature(surface, spacing, len(placement.charges))
    # Many runs may have these points on one mesh, which then finds them once.
    points.points.setflags(write=False)
    return replace(points, spacing=EQUATION_REFINEMENT * samples.spacing[samples.tree.query(points.points)[1]])
