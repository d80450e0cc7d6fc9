"""`System`: the diffusion equation on one mesh, assembled once and solved for as many lights as wanted."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from tetlux.fem.assembly import Mass, system_matrix
from tetlux.fem.estimate import Estimate, estimated
from tetlux.fem.lights.deposit import Light
from tetlux.fem.linear import Solver, solver_for
from tetlux.fem.loads import load_vector
from tetlux.fem.medium import Medium
from tetlux.fem.solution import Power, Solution
from tetlux.fem.sources import Sources, Subtract, sources_of
from tetlux.fem.stopwatch import Stopwatch
from tetlux.fem.subtraction import Patch, PatchTerms, good_nodes, inherited, patch_of, patch_terms
from tetlux.meshing.arrays import BoolArray, FloatArray
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
    """One medium on one mesh.

    Parameters
    ----------
    mesh : TetMesh
    medium : Medium
    surface : Surface, optional
        What the mesh stands for; its own boundary if not given.
    mass : {"lumped", "consistent"}
        Integration of the terms without derivatives, see `tetlux.fem.assembly.system_matrix`.
    expected : int
        How many lights are to be solved for, roughly: for many it pays to factorise the matrix.
    """

    mesh: TetMesh
    medium: Medium
    surface: Surface | None = None
    mass: Mass = "lumped"
    expected: int = 1

    @cached_property
    def solver(self) -> Solver:
        """The solver of its matrix."""
        return solver_for(system_matrix(self.mesh, self.medium, self.mass), LOADS_OF_A_LIGHT * self.expected)

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
            sources = sources_of(lights, self.body, self.medium, subtract)
        solution, _ = self._solved(sources, watch, None)
        return replace(solution, seconds=watch.read(), warnings=sources.warnings)

    def step(self, sources: Sources, watch: Stopwatch, before: Step | None = None) -> Step:
        """Solve, and estimate the error; `before` is a step on a coarser mesh that this one is a refinement of."""
        solution, good = self._solved(sources, watch, before)
        with watch.stage("solve"):
            estimate = estimated(solution, self.solver)
        return Step(replace(solution, error_estimate=estimate.error), estimate, good)

    def _solved(
        self, sources: Sources, watch: Stopwatch, before: Step | None
    ) -> tuple[Solution, tuple[BoolArray, ...]]:
        mesh, medium = self.mesh, self.medium
        with watch.stage("assemble"):
            load = np.sum([load_vector(mesh, medium, deposit) for deposit in sources.on_mesh], axis=0)
            if before is None:
                everywhere = np.ones(len(mesh.points), dtype=bool)
                patches = [patch_of(mesh, charges, everywhere) for charges in sources.charges]
            else:
                coarse = before.solution.mesh.points
                patches = [
                    patch_of(mesh, charges, inherited(good, coarse, mesh))
                    for charges, good in zip(sources.charges, before.good, strict=True)
                ]
            terms = [patch_terms(medium, patch, self.mass) for patch in patches]
            solver = self.solver
        with watch.stage("solve"):
            # Every light has a fluence of its own, and a patch that depends on nothing else: so lights add up.
            parts = solver.solve(np.column_stack([*(term.load for term in terms), load]))
        good = [good_nodes(patch, part) for patch, part in zip(patches, parts.T, strict=False)]
        worse = [i for i, patch in enumerate(patches) if before is None and not good[i].all()]
        if worse:
            with watch.stage("assemble"):
                for i in worse:
                    patches[i] = patch_of(mesh, patches[i].charges, good[i], patches[i].at_nodes)
                    terms[i] = patch_terms(medium, patches[i], self.mass)
            with watch.stage("solve"):
                parts[:, worse] = solver.solve(np.column_stack([terms[i].load for i in worse]))
        return self._solution(sources, parts.sum(axis=1), patches, terms), tuple(good)

    def _solution(
        self, sources: Sources, fluence: FloatArray, patches: list[Patch], terms: list[PatchTerms]
    ) -> Solution:
        mesh, medium, deposits = self.mesh, self.medium, sources.deposits
        transmitted = sum(d.transmitted_irradiance for d in deposits)
        outside = sum(d.irradiance for d in deposits) * mesh.area
        ledger = Power(
            incident=sum(d.incident for d in deposits) + outside,
            specular=sum(d.specular for d in deposits) + outside - transmitted * mesh.area,
            absorbed=sum(d.absorbed for d in deposits)
            + medium.sigma_a * float(mesh.node_volumes @ fluence)
            + sum(term.absorbed for term in terms),
            exited=0.0,
            ballistic=sum(d.ballistic for d in deposits),
        )
        solution = Solution(mesh, self.body, medium, fluence, ledger, tuple(patches), transmitted)
        exited = float(mesh.boundary_node_areas @ solution.exitance) + sum(term.exited for term in terms)
        return replace(solution, power=replace(ledger, exited=exited))
