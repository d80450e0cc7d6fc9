"""`System`: the diffusion equation on one mesh, assembled once and solved for as many lights as wanted."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from tetlux.fem.assembly import Assembly, Mass
from tetlux.fem.coefficients import AnyMedium, Coefficients, base_of, coefficients_on
from tetlux.fem.estimate import Estimate, estimated
from tetlux.fem.fitting import Fitting, fitting_of
from tetlux.fem.lights.deposit import Deposit, Light
from tetlux.fem.limiter import nonnegative
from tetlux.fem.linear import Solver, solver_for
from tetlux.fem.loads import load_vector
from tetlux.fem.local_validity import Validity
from tetlux.fem.region import Region, only_medium
from tetlux.fem.solution import Power, Solution, added
from tetlux.fem.sources import Sources, Subtract, sources_of
from tetlux.fem.stopwatch import Stopwatch
from tetlux.fem.subtraction import Patch, PatchTerms, good_nodes, inherited, patch_of, patch_terms
from tetlux.meshing.arrays import BoolArray, FloatArray, IntArray
from tetlux.meshing.regions import own_volumes
from tetlux.meshing.surface import Surface
from tetlux.meshing.tetmesh import TetMesh

# A light needs its own, once more where its patch shrinks, and two to estimate the error.
LOADS_OF_A_LIGHT = 4


@dataclass(frozen=True, eq=False)
class Step:
    """A solution on one mesh, its error, and at which nodes each of its charges is a good guess."""

    solution: Solution
    estimate: Estimate
    good: tuple[BoolArray, ...]


@dataclass(frozen=True, eq=False)
class System:
    """The media of a body on one mesh.

    Parameters
    ----------
    mesh : TetMesh
    medium : Medium or VaryingMedium
        Of the body.
    surface : Surface, optional
        What the mesh stands for; its own boundary if not given.
    mass : {"lumped", "consistent"}
        Integration of the terms without derivatives, see `tetlux.fem.assembly.system_matrix`.
    expected : int
        How many lights are to be solved for, roughly: for many it pays to factorise the matrix.
    regions : tuple of Region
        The mesh's regions 1, 2, ..., each with one medium.
    assembly : Assembly, optional
        That of another system on the same mesh, to share what does not depend on the media.
    limit : bool
        Whether the fluence is kept from going below zero, see `tetlux.fem.limiter`; not under a light for which the
        diffusion equation itself does.
    """

    mesh: TetMesh
    medium: AnyMedium
    surface: Surface | None = None
    mass: Mass = "lumped"
    expected: int = 1
    regions: tuple[Region, ...] = ()
    assembly: Assembly | None = None
    limit: bool = True

    @property
    def media(self) -> tuple[AnyMedium, ...]:
        """Those of the body and of its regions."""
        return (self.medium, *(only_medium(region) for region in self.regions))

    @cached_property
    def coefficients(self) -> Coefficients:
        """Those of its tetrahedra."""
        return coefficients_on(self.mesh, self.media)

    @cached_property
    def solver(self) -> Solver:
        """The solver of its matrix."""
        assembly = self.assembly or Assembly(self.mesh)
        coefficients, fitting = self.coefficients, self.fitting
        if fitting is None:
            matrix = assembly.of(coefficients, self.mass)
        else:
            escape = coefficients.escape
            matrix = assembly.matrix(fitting.diffusion, coefficients.sigma_a, escape, self.mass, fitting.kept)
        return solver_for(matrix, LOADS_OF_A_LIGHT * self.expected)

    @cached_property
    def fitting(self) -> Fitting | None:
        """What its matrix has in place of some coefficients."""
        return fitting_of(self.mesh, self.coefficients) if self.mass == "lumped" else None

    @property
    def body(self) -> Surface:
        """What the mesh stands for."""
        return self.surface or self.mesh.surface

    def solve(self, lights: Sequence[Light], *, subtract: Subtract = "half-space") -> Solution:
        """Solve for lights on the mesh as it is, without an estimate of the error.

        Parameters
        ----------
        lights : sequence of Light
            At least one; they add up.
        subtract : {"half-space", "free-space", "nothing"}
            See `tetlux.fem.solve`.

        Returns
        -------
        Solution

        Raises
        ------
        InputError
            If a light does not go with the body.
        RunError
            If the linear solver fails.
        """
        watch = Stopwatch()
        with watch.stage("surface"):
            sources = sources_of(lights, self.body, self.media, subtract, self._region_of)
        solution, *_ = self._solved(sources, watch, None)
        warnings = [*solution.warnings, *sources.warnings]
        validity = Validity(self.mesh, base_of(self.medium), lights, sources.deposits)
        return replace(solution, seconds=watch.read(), warnings=warnings, validity=validity)

    def step(self, sources: Sources, watch: Stopwatch, before: Step | None = None) -> Step:
        """Solve, and estimate the error; `before` is a step on a coarser mesh that this one is a refinement of."""
        solution, good, load, emission = self._solved(sources, watch, before)
        with watch.stage("solve"):
            inner = tuple(region.surface for region in self.regions)
            estimate = estimated(solution, self.coefficients, self.solver, load, emission, inner, self.fitting)
        return Step(replace(solution, error_estimate=estimate.error), estimate, good)

    def _solved(
        self, sources: Sources, watch: Stopwatch, before: Step | None
    ) -> tuple[Solution, tuple[BoolArray, ...], FloatArray, float | FloatArray]:
        """The solution, where its charges are good guesses, what was put on the nodes, and the emission."""
        mesh = self.mesh
        with watch.stage("assemble"):
            deposits = [self._emitting(deposit.on(mesh, self.body, self.coefficients)) for deposit in sources.on_mesh]
            loads = [load_vector(mesh, self.coefficients, deposit) for deposit in deposits]
            # A light whose points are all subtracted may have nothing on the mesh.
            lit = [light for light, load in enumerate(loads) if load.any()]
            if before is None:
                everywhere = np.ones(len(mesh.points), dtype=bool)
                patches = [patch_of(mesh, charges, everywhere) for charges in sources.charges]
            else:
                coarse = before.solution.mesh.points
                patches = [
                    patch_of(mesh, charges, inherited(good, coarse, mesh))
                    for charges, good in zip(sources.charges, before.good, strict=True)
                ]
            terms = [patch_terms(patch, self.mass, self.fitting) for patch in patches]
            solver = self.solver
        with watch.stage("solve"):
            # Every light has a fluence of its own, and a patch that depends on nothing else: so lights add up.
            columns = [*(term.load for term in terms), *(loads[light] for light in lit)]
            parts = solver.solve(np.column_stack(columns or loads))
        good = [good_nodes(patch, part) for patch, part in zip(patches, parts.T, strict=False)]
        worse = [i for i, patch in enumerate(patches) if before is None and not good[i].all()]
        if worse:
            with watch.stage("assemble"):
                for i in worse:
                    patches[i] = patch_of(mesh, patches[i].charges, good[i], patches[i].at_nodes)
                    terms[i] = patch_terms(patches[i], self.mass, self.fitting)
            with watch.stage("solve"):
                parts[:, worse] = solver.solve(np.column_stack([terms[i].load for i in worse]))
        owners = np.array([*sources.owners, *lit], dtype=np.int64)
        of_lights = []
        for light, deposit in enumerate(deposits):
            fluence = parts[:, : len(owners)][:, owners == light].sum(axis=1)
            own = [i for i, owner in enumerate(sources.owners) if owner == light]
            of_lights.append(self._solution(deposit, fluence, [patches[i] for i in own], [terms[i] for i in own]))
        emission = sum((deposit.emission for deposit in deposits), 0.0)
        solution = replace(added(of_lights), warnings=[solver.note] if solver.note else [])
        return solution, tuple(good), np.sum(loads, axis=0), emission

    def _solution(
        self, deposit: Deposit, fluence: FloatArray, patches: list[Patch], terms: list[PatchTerms]
    ) -> Solution:
        """The solution of one light, by its deposit on this mesh."""
        mesh, moved = self.mesh, 0.0
        if self.limit and not (self._has_first_moment(deposit) or any(patch.charges.dips for patch in patches)):
            fluence, moved = nonnegative(fluence, mesh.edges, self._losing)
        outside = mesh.boundary_node_areas * deposit.irradiance
        transmitted = mesh.boundary_node_areas * deposit.transmitted_irradiance
        emitted = float((mesh.volumes * deposit.emission).sum())
        ledger = Power(
            incident=deposit.incident + float(outside.sum()) + emitted,
            specular=deposit.specular + float((outside - transmitted).sum()),
            absorbed=deposit.absorbed + float((self._absorbing * fluence).sum()) + sum(term.absorbed for term in terms),
            exited=0.0,
            ballistic=deposit.ballistic,
        )
        solution = Solution(
            mesh,
            self.body,
            self.coefficients.outer,
            fluence,
            ledger,
            tuple(patches),
            deposit.transmitted_irradiance,
            moved=moved,
        )
        exited = float(mesh.boundary_node_areas @ solution.exitance) + sum(term.exited for term in terms)
        return replace(solution, power=replace(ledger, exited=exited))

    def _has_first_moment(self, deposit: Deposit) -> bool:
        """Whether it has a Q1, beside which the diffusion equation itself may have a fluence below zero."""
        return len(deposit.starts) > 0 and bool(np.any(self.coefficients.cosine != 0))

    def _emitting(self, deposit: Deposit) -> Deposit:
        """What regions emit, as it is of their true volume: facets of a round one lie inside it."""
        if np.ndim(deposit.emission) == 0 or not self.regions:
            return deposit
        held = np.bincount(self.mesh.regions, self.mesh.volumes, minlength=len(self.regions) + 1)
        share = own_volumes(self.body, tuple(region.surface for region in self.regions)) / held
        return replace(deposit, emission=deposit.emission * share[self.mesh.regions])

    def _region_of(self, points: FloatArray) -> IntArray:
        """The regions that points inside lie in, (q,)."""
        cells, _ = self.mesh.locate(points)
        return np.asarray(np.where(cells >= 0, self.mesh.regions[cells], 0))

    @cached_property
    def _absorbing(self) -> FloatArray:
        """What a fluence of 1 at each node loses, (n,), unit²."""
        sigma_a, kept = self.coefficients.sigma_a, 1.0 if self.fitting is None else self.fitting.kept
        if self.coefficients.uniform:
            return np.asarray(kept * (sigma_a * self.mesh.node_volumes))
        return np.asarray(kept * self.mesh.to_nodes(sigma_a * self.mesh.volumes))

    @cached_property
    def _losing(self) -> FloatArray:
        """The same, and what leaves for it through the boundary, (n,), unit²."""
        losing = self._absorbing.copy()
        losing[self.mesh.boundary_nodes] += self.coefficients.escape * self.mesh.boundary_node_areas
        return losing
