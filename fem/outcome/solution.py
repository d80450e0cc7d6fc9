"""`Solution`: fluence, exitance, and where the power went."""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import numpy.typing as npt

from tetlux.fem.known.fitted_patch import FittedPatch
from tetlux.fem.known.patch import Patch
from tetlux.fem.media.medium import Medium
from tetlux.fem.models.boundary import BoundaryCondition
from tetlux.fem.models.modulation import lag
from tetlux.fem.operators.fitting import LayerFitting
from tetlux.fem.outcome.between_nodes import follow_fading, interpolate
from tetlux.fem.outcome.plan import Plan
from tetlux.fem.outcome.power import DyePower, Power
from tetlux.fem.outcome.reading import Reading
from tetlux.fem.outcome.shown import Shown
from tetlux.fem.quadratic.error import fluence_with_error
from tetlux.fem.quadratic.solution import QuadraticSolution
from tetlux.fem.validity.local import Validity
from tetlux.meshing.arrays import FloatArray, IntArray, Number, NumberArray
from tetlux.meshing.describe import count
from tetlux.meshing.errors import InputError
from tetlux.meshing.surface.surface import Surface
from tetlux.meshing.tets.mesh import TetMesh


@dataclass(frozen=True, eq=False)
class Solution(Shown):
    """The light in one body, as `tetlux.fem.solve` finds it on a mesh.

    Attributes
    ----------
    mesh : TetMesh
    surface : Surface
        The surface that the mesh approximates; `exitance_at` takes points to it.
    boundary_condition : BoundaryCondition
        How the exitance follows from the fluence: see `tetlux.fem.models.boundary`.
    fluence : (n,) ndarray, real or complex
        Fluence at the nodes of `mesh` (CS667 notes, definition 1.9 i), W/unit².
    power : Power
        The ledger: where the power went, W.
    patches : tuple of Patch
        Where the fluence is known better than its values at the nodes tell: see `tetlux.fem.known`.
    transmitted_irradiance : float or (b,) ndarray
        Diffuse light that passed to the inside, throughout or at each boundary node, W/unit².
    error_estimate : float
        Estimated relative L2 error of the exitance: see `tetlux.fem.error.estimate`.
    seconds : dict
        Seconds spent on surface, mesh, assemble, solve, and total.
    warnings : list of str
        Plain sentences, each a `tetlux.meshing.notes.Note` with a code.
    limited_power : float
        Power moved from node to node to keep the fluence from going below zero, W: see `tetlux.fem.operators.limiter`.
    of_lights : tuple of Solution
        What each light adds, in their order, if there are several.
    validity : Validity, optional
        How far the diffusion approximation itself is to be trusted; of all lights together.
    residual : float
        Largest relative residual of the linear systems on `mesh`, computed anew from their solutions.
    iterations : int
        Most iterations that one of them took; 0 if all were solved directly.
    readings : tuple of Reading
        What the detectors read that were given to `tetlux.fem.solve`, in their order.
    quadratic : QuadraticSolution, optional
        The same in quadratic elements, which detectors are read by: see `tetlux.fem.quadratic`.
    is_quadratic : bool
        Whether exitance and fluence are those of quadratic elements, as under a tolerance everywhere or inside.
    everywhere_error, volume_error : float
        Relative error that about 95 % of the surface keep in exitance, and 95 % of the volume in fluence, at each level
        of brightness: see `tetlux.fem.quadratic.field_error`. nan without such a tolerance.
    plan : Plan, optional
        Why this model was chosen, if it was.
    frequency : float
        Of modulated light, Hz: fluence, exitance, power and readings then are complex amplitudes. 0 for steady light.
    known_absorption : tuple of float or complex
        Of one light, the power that each patch absorbs beyond the interpolation of its values at nodes, W.
    fitting : LayerFitting, optional
        Of one light, coefficients where its layers are thinner than tetrahedra.
    dyes : tuple of DyePower
        Of emitted light, what became of the power that each fluorophore absorbed: see `tetlux.fem.fluorescence`.

    Examples
    --------
    >>> from tetlux.fem import Medium, PencilBeam, solve
    >>> from tetlux.meshing import sphere
    >>> tissue = Medium(sigma_a=0.01, sigma_s_prime=1.0, eta=1.4)
    >>> solution = solve(sphere(10.0), tissue, [PencilBeam((0, 0, 20), (0, 0, -1))], tolerance=0.05)
    >>> solution.exitance_at([[0, 0, 10], [0, 10, 0]]).shape, solution.fluence_at([[0, 0, 5]]).shape  # W/mm²
    ((2,), (1,))
    >>> round(solution.power.exited, 2), abs(solution.power.balance_error) < 1e-9  # of 1 W, W
    (0.76, True)
    """

    mesh: TetMesh
    surface: Surface
    boundary_condition: BoundaryCondition
    fluence: NumberArray
    power: Power
    patches: tuple[Patch, ...] = ()
    transmitted_irradiance: float | FloatArray = 0.0
    error_estimate: float = np.nan
    seconds: dict[str, float] = field(default_factory=dict)
    warnings: list[str] = field(default_factory=list)
    limited_power: float = 0.0
    of_lights: "tuple[Solution, ...]" = ()
    validity: Validity | None = None
    residual: float = 0.0
    iterations: int = 0
    readings: tuple[Reading, ...] = ()
    quadratic: QuadraticSolution | None = None
    is_quadratic: bool = False
    everywhere_error: float = np.nan
    volume_error: float = np.nan
    plan: Plan | None = None
    frequency: float = 0.0
    known_absorption: tuple[Number, ...] = ()
    fitting: LayerFitting | None = None
    dyes: tuple[DyePower, ...] = ()

    model = "full"

    @cached_property
    def exitance(self) -> NumberArray:
        """Exitance at the boundary nodes of `mesh`, (b,), W/unit²: see `tetlux.fem.models.boundary`."""
        return self.boundary_condition.exitance(self.fluence[self.mesh.boundary_nodes], self.transmitted_irradiance)

    @property
    def medium(self) -> Medium:
        """The medium below the surface: of a body of several, one of the refractive index that all of them share."""
        return self.boundary_condition.medium

    def exitance_at(self, points: FloatArray) -> NumberArray:
        """Exitance at the points of the surface nearest to given points.

        Parameters
        ----------
        points : (q, 3) array_like

        Returns
        -------
        (q,) ndarray
            W/unit²; nan at points that are not finite.
        """
        return self._at_nearest(points, self.exitance_on)

    def amplitude_at(self, points: FloatArray) -> FloatArray:
        """Modulus of `exitance_at`, (q,), W/unit²."""
        return np.abs(self.exitance_at(points))

    def phase_at(self, points: FloatArray) -> FloatArray:
        """Phase by which the exitance lags behind the light at points of the surface, (q,), degrees from -30 to 330."""
        return lag(self.exitance_at(points))

    def _at_nearest(self, points: FloatArray, values_on: Callable[[FloatArray], NumberArray]) -> NumberArray:
        """Values at the points of the surface nearest to given points; nan where those are not finite."""
        places = np.asarray(points, dtype=float).reshape(-1, 3)
        finite = np.isfinite(places).all(axis=1)
        found = values_on(self.surface.project(places[finite])[0])
        values = np.full(len(places), np.nan, found.dtype)
        values[finite] = found
        return values

    def exitance_on(self, queries: FloatArray) -> NumberArray:
        """Exitance at points (q, 3) that lie on the surface, (q,), W/unit².

        Between nodes see `tetlux.fem.outcome.between_nodes`; of each light by itself, so that lights add up.
        """
        if self.of_lights and not self.is_quadratic:
            return np.asarray(sum(light.exitance_on(queries) for light in self.of_lights))
        _, face, weights = self.mesh.closest_boundary(queries)
        weights = np.maximum(weights, 0.0)  # rounding
        cells, corners = self.mesh.boundary_cells[face], self.mesh.boundary_faces[face]
        transmitted = self.transmitted_irradiance
        if np.ndim(transmitted) > 0:
            transmitted = (np.asarray(transmitted)[self.mesh.boundary_triangles[face]] * weights).sum(axis=1)
        fluence = interpolate(self.fluence, self.patches, queries, cells, corners, weights)
        is_far = ~np.any([np.zeros(len(queries), bool), *(patch.cells[cells] for patch in self.patches)], axis=0)
        if is_far.any():
            fluence[is_far] = follow_fading(fluence[is_far], self.fluence[corners[is_far]], weights[is_far])
        linear = self.boundary_condition.exitance(fluence, transmitted)
        if not self.is_quadratic:
            return linear
        assert self.quadratic is not None
        return self.quadratic.exitance_on(queries, linear)

    @property
    def resolution(self) -> tuple[FloatArray, FloatArray]:
        """Points of the surface (n, 3), and how much space the exitance needs to change there, (n,), unit.

        Middles of boundary facets and their longest sides; and points where charges were fitted, and their spacing.
        """
        middles = self.mesh.points[self.mesh.boundary_faces].mean(axis=1)
        fitted = [patch.residual.points for patch in self.patches if isinstance(patch, FittedPatch)]
        places = np.vstack([middles, *(each.points for each in fitted)])
        return places, np.concatenate([self.mesh.boundary_sides, *(each.spacing for each in fitted)])

    def valid_at(self, points: FloatArray) -> FloatArray:
        """How far the diffusion approximation is to be trusted at the points of the surface nearest to given points.

        Parameters
        ----------
        points : (q, 3) array_like

        Returns
        -------
        (q,) ndarray
            1 less the expected relative error of diffusion itself, at least 0: see `tetlux.fem.validity.local`. The
            error by the mesh is `error_estimate`. nan at points that are not finite.
        """
        return self._at_nearest(points, self.valid_on)

    def valid_on(self, queries: FloatArray) -> FloatArray:
        """`valid_at` points (q, 3) that lie on the surface, (q,)."""
        if self.validity is None:
            raise InputError("validity is that of all lights together; ask the whole solution, not one of of_lights.")
        return self.validity.at(queries)

    def fluence_at(self, points: FloatArray) -> NumberArray:
        """Fluence at given points.

        Parameters
        ----------
        points : (q, 3) array_like

        Returns
        -------
        (q,) ndarray
            W/unit²; nan outside the body.
        """
        queries = np.asarray(points, dtype=float).reshape(-1, 3)
        cells, weights = self.mesh.locate(queries)
        lost = np.flatnonzero(cells < 0)
        if len(lost):
            # Between the facets and the surface that they stand for, the nearest tetrahedron goes on.
            lost = lost[self.surface.contains(queries[lost])]
            cells[lost] = self.mesh.boundary_cells[self.mesh.closest_boundary(queries[lost])[1]]
            weights[lost] = self.mesh.barycentric(queries[lost], cells[lost])
        fluence = np.full(len(queries), np.nan, self.fluence.dtype)

        def fill(places: IntArray) -> None:
            nodes = self.mesh.tetrahedra[cells[places]]
            fluence[places] = interpolate(
                self.fluence, self.patches, queries[places], cells[places], nodes, weights[places]
            )

        fill(np.flatnonzero(cells >= 0))
        # Extrapolation beyond the facets may not go below zero.
        below = lost[:0] if np.iscomplexobj(fluence) else lost[fluence[lost] < 0]
        weights[below] = np.maximum(weights[below], 0.0)
        weights[below] /= weights[below].sum(axis=1, keepdims=True)
        fill(below)
        if self.is_quadratic:
            assert self.quadratic is not None
            inside = np.flatnonzero(cells >= 0)
            fluence[inside] = self.quadratic.fluence_inside(queries[inside], fluence[inside])
        return fluence

    def fluence_with_error(self, points: npt.ArrayLike) -> tuple[NumberArray, FloatArray]:
        """Fluence by quadratic elements, and how far it may be off; each point needs a dual solution of its own.

        Parameters
        ----------
        points : (q, 3) array_like

        Returns
        -------
        fluence : (q,) ndarray
            W/unit²; nan outside the body.
        relative_error : (q,) ndarray
            Estimated numerical error, relative: see `tetlux.fem.quadratic.error`.
        """
        queries = np.asarray(points, dtype=float).reshape(-1, 3)
        found = np.full((2, len(queries)), np.nan, self.fluence.dtype)
        if self.quadratic is None:
            raise InputError("this solution was not made by solve, and has no errors of single points.")
        inside = np.flatnonzero(np.isfinite(queries).all(axis=1))
        inside = inside[self.surface.contains(queries[inside])]
        found[:, inside] = fluence_with_error(self.quadratic, queries[inside])
        return found[0], found[1].real

    def __repr__(self) -> str:
        modulated = np.iscomplexobj(self.exitance)
        exitance = np.abs(self.exitance) if modulated else self.exitance
        exited = abs(self.power.exited) if modulated else self.power.exited
        facts = [
            count(len(self.mesh.points), "node"),
            f"exitance {exitance.min():.3g} to {exitance.max():.3g} W/{self.mesh.unit}²",
            f"{exited:.4g} of {self.power.incident:.4g} W exited",
        ]
        if np.isfinite(self.error_estimate):
            facts.append(f"estimated error {self.error_estimate:.2%}")
        if self.of_lights:
            facts.append(count(len(self.of_lights), "light"))
        if self.warnings:
            facts.append(count(len(self.warnings), "warning"))
        return f"Solution({', '.join(facts)})"
