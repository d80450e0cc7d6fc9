"""`System`: the diffusion equation on one mesh, assembled once and solved for as many lights as wanted."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from tetlux.fem.body.body import Body
from tetlux.fem.body.partition import MeshPartition
from tetlux.fem.error.by_operator import estimate_by_operator
from tetlux.fem.error.estimate import Estimate
from tetlux.fem.known.kept import kept_on
from tetlux.fem.known.patch import good_nodes, inherit_good_nodes
from tetlux.fem.known.split import Sources, Subtract, sources_of, without_fit
from tetlux.fem.known.subtraction import Subtraction, subtract_fitted, subtract_on
from tetlux.fem.linear.solver import LinearResult
from tetlux.fem.media.coefficients import AnyMedium, Coefficients, MediaByLabel, coefficients_on
from tetlux.fem.media.region import Region, only_medium
from tetlux.fem.models.diffusion import Diffusion
from tetlux.fem.models.model import Model
from tetlux.fem.operators.assembly import Assembly, Mass
from tetlux.fem.operators.fitting import fitting_of
from tetlux.fem.operators.loads import Load, load_of
from tetlux.fem.operators.operator import Operator, operator_of, solve_columns
from tetlux.fem.outcome.of_light import solution_of_light
from tetlux.fem.outcome.solution import Solution, sum_solutions
from tetlux.fem.quadratic.operator import QuadraticOperator
from tetlux.fem.quadratic.solution import QuadraticScene, QuadraticSolution
from tetlux.fem.sources.deposit import Deposit
from tetlux.fem.sources.light import Light
from tetlux.fem.stopwatch import Stopwatch
from tetlux.fem.validity.local import Validity
from tetlux.meshing.arrays import BoolArray, FloatArray
from tetlux.meshing.describe import count, one_line
from tetlux.meshing.surface.surface import Surface
from tetlux.meshing.tets.mesh import TetMesh
from tetlux.meshing.tets.regions import own_volumes

# A light needs its own, once more where its patch shrinks, and two to estimate the error.
LOADS_OF_A_LIGHT = 4


@dataclass(frozen=True, eq=False)
class Step:
    """A solution on one mesh, its error, and at which nodes each of its charges is a good guess."""

    solution: Solution
    estimate: Estimate
    good: tuple[BoolArray, ...]

    __repr__ = one_line


@dataclass(frozen=True, eq=False)
class System:
    """The media of a body on one mesh.

    Parameters
    ----------
    mesh : TetMesh
    medium : Medium, VaryingMedium, or mapping of int to these
        Of the body; or the medium of each label of the mesh, that of the outermost first.
    surface : Surface, optional
        What the mesh stands for; its own boundary if not given.
    mass : {"lumped", "consistent"}
        Integration of the terms without derivatives, see `tetlux.fem.operators.assembly.system_matrix`.
    expected : int
        How many lights are to be solved for, roughly: for many it pays to factorise the matrix.
    regions : tuple of Region
        The mesh's regions 1, 2, ..., each with one medium.
    assembly : Assembly, optional
        That of another system on the same mesh, to share what does not depend on the media.
    limit : bool
        Whether the fluence is kept from going below zero, see `tetlux.fem.operators.limiter`; not under a light for
        which the diffusion equation itself does.
    """

    mesh: TetMesh
    medium: AnyMedium | MediaByLabel
    surface: Surface | None = None
    mass: Mass = "lumped"
    expected: int = 1
    regions: tuple[Region, ...] = ()
    assembly: Assembly | None = None
    limit: bool = True

    @property
    def media(self) -> MediaByLabel | tuple[AnyMedium, ...]:
        """Those of the body and of its regions, or those of labels."""
        if isinstance(self.medium, AnyMedium):
            return (self.medium, *(only_medium(region) for region in self.regions))
        return self.medium

    @cached_property
    def coefficients(self) -> Coefficients:
        """Those of its tetrahedra."""
        return coefficients_on(self.mesh, self.media)

    @cached_property
    def model(self) -> Model:
        """The equation that is solved."""
        return Diffusion(self.coefficients)

    @property
    def true_surface(self) -> Surface:
        """What the mesh stands for."""
        return self.surface or self.mesh.surface

    @cached_property
    def plain(self) -> Operator:
        """The operator for points and beams."""
        return operator_of(self._assembly, self.model, self.mass, self._loads_expected)

    @cached_property
    def fitted(self) -> Operator:
        """The operator for diffuse and emitted light: layers along the boundary are fitted where the mesh is coarse."""
        fitting = fitting_of(self.mesh, self.coefficients) if self.mass == "lumped" else None
        if fitting is None:
            return self.plain
        return operator_of(self._assembly, self.model, self.mass, self._loads_expected, fitting)

    @cached_property
    def quadratic(self) -> QuadraticOperator:
        """The operator that detectors are read by."""
        inner = tuple(region.surface for region in self.regions)
        return QuadraticOperator(self.mesh, self.true_surface, inner, self.coefficients)

    @cached_property
    def _assembly(self) -> Assembly:
        return self.assembly or Assembly(self.mesh)

    @property
    def _loads_expected(self) -> int:
        return LOADS_OF_A_LIGHT * self.expected

    def solve(self, lights: Sequence[Light], *, subtract: Subtract = "fitted") -> Solution:
        """Solve for lights on the mesh as it is, without an estimate of the error.

        Parameters
        ----------
        lights : sequence of Light
            At least one; they add up.
        subtract : {"fitted", "half-space", "free-space", "nothing"}
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
            body = Body(self.true_surface, self.media, MeshPartition(self.mesh))
            if self.surface is None or self.surface is self.mesh.surface:
                subtract = without_fit(subtract)
            sources = sources_of(lights, body, subtract, kept=kept_on(self.mesh))
        solution = self._solve(sources, watch, None).whole
        return replace(solution, seconds=watch.read(), warnings=[*solution.warnings, *sources.warnings])

    def step(self, sources: Sources, watch: Stopwatch, before: Step | None = None) -> Step:
        """Solve, and estimate the error; `before` is a step on a coarser mesh that this one is a refinement of."""
        solved = self._solve(sources, watch, before)
        with watch.stage("solve"):
            inner = [region.surface for region in self.regions]
            estimate = estimate_by_operator(solved.loads, solved.of_lights, solved.whole, inner)
        return Step(replace(solved.whole, error_estimate=estimate.error), estimate, solved.good)

    def _solve(self, sources: Sources, watch: Stopwatch, before: Step | None) -> "_Solved":
        """From deposits to loads and patches, to one linear system for all of them, to a solution for each light."""
        with watch.stage("assemble"):
            loads = self._loads(sources)
            subtractions = self._subtractions(sources, before)
            # A light whose points are all subtracted may have nothing on the mesh.
            lit = [light for light, load in enumerate(loads) if load.at_nodes.any()]
            coarse = () if before is None else before.solution.patches
            fitted = [
                subtract_fitted(light, each, self.plain, self.mass, coarse) for light, each in sources.fitted.items()
            ]
            operators = [*(self.plain for _ in [*subtractions, *fitted]), *(loads[light].operator for light in lit)]
        with watch.stage("solve"):
            # Every light has a fluence of its own, and a patch that depends on nothing else: so lights add up.
            columns = [each.terms.load for each in [*subtractions, *fitted]] + [loads[light].at_nodes for light in lit]
            fluences, results = solve_columns(operators, columns, len(self.mesh.points))
            for column, each in enumerate(fitted, len(subtractions)):
                if each.patch.cells.all():
                    fluences[:, column] += each.patch.at_nodes
        good = tuple(good_nodes(each.patch, fluence) for each, fluence in zip(subtractions, fluences.T, strict=False))
        if before is None:
            results += self._shrink(subtractions, good, fluences, watch)
        owners = np.array([*sources.owners, *sources.fitted, *lit], dtype=np.int64)
        of_lights = []
        for light, load in enumerate(loads):
            fluence = fluences[:, owners == light].sum(axis=1)
            own = [each for each in [*subtractions, *fitted] if each.light == light]
            of_lights.append(solution_of_light(load, fluence, own, self.true_surface, limit=self.limit))
        quadratic = QuadraticScene(
            self.quadratic,
            tuple(load.deposit for load in loads),
            tuple(solution.patches for solution in of_lights),
            tuple(solution.fluence for solution in of_lights),
        )
        of_lights = [
            replace(solution, quadratic=QuadraticSolution(quadratic, (light,)))
            for light, solution in enumerate(of_lights)
        ]
        whole = self._sum(of_lights, loads, results, sources)
        whole = replace(whole, quadratic=QuadraticSolution(quadratic, tuple(range(len(loads)))))
        return _Solved(loads, of_lights, whole, good)

    def _loads(self, sources: Sources) -> list[Load]:
        """The load of each light: with the fitted operator where it is spread evenly, else with the plain one."""
        loads = []
        for light, deposit in enumerate(sources.remaining):
            on_mesh = self._scale_emission(deposit.evaluate_on(self.mesh, self.true_surface, self.coefficients))
            known = light in sources.owners or light in sources.fitted
            operator = self.fitted if on_mesh.terms.is_distributed and not known else self.plain
            loads.append(load_of(on_mesh, operator))
        return loads

    def _scale_emission(self, deposit: Deposit) -> Deposit:
        """Scale what regions emit to their true volumes: the facets of a round region lie inside it."""
        if np.ndim(deposit.terms.emission) == 0 or not self.regions:
            return deposit
        held = np.bincount(self.mesh.regions, self.mesh.volumes, minlength=len(self.regions) + 1)
        share = own_volumes(self.true_surface, tuple(region.surface for region in self.regions)) / held
        emission = deposit.terms.emission * share[self.mesh.regions]
        return replace(deposit, terms=replace(deposit.terms, emission=emission))

    def _subtractions(self, sources: Sources, before: Step | None) -> list[Subtraction]:
        """What is subtracted: the charges, each where it was a good guess on the mesh before, or else everywhere."""
        mesh = self.mesh
        good: Sequence[BoolArray | None] = [None] * len(sources.charges)
        if before is not None:
            coarse = before.solution.mesh.points
            good = [inherit_good_nodes(each, coarse, mesh) for each in before.good]
        return [
            subtract_on(mesh, light, charges, self.mass, nodes)
            for light, charges, nodes in zip(sources.owners, sources.charges, good, strict=True)
        ]

    def _shrink(
        self, subtractions: list[Subtraction], good: Sequence[BoolArray], fluences: FloatArray, watch: Stopwatch
    ) -> list[LinearResult]:
        """Shrink patches to the good nodes and solve for them again, in place."""
        worse = [i for i in range(len(subtractions)) if not good[i].all()]
        if not worse:
            return []
        with watch.stage("assemble"):
            for i in worse:
                subtractions[i] = subtractions[i].shrink_to(good[i])
        with watch.stage("solve"):
            result = self.plain.solver.solve(np.column_stack([subtractions[i].terms.load for i in worse]))
            fluences[:, worse] = result.x
        return [result]

    def _sum(
        self,
        of_lights: Sequence[Solution],
        loads: Sequence[Load],
        results: Sequence[LinearResult],
        sources: Sources,
    ) -> Solution:
        """The solution of all lights together, with what the linear solver says of itself."""
        solvers = [operator.solver for operator in dict.fromkeys(load.operator for load in loads)]
        return replace(
            sum_solutions(of_lights),
            warnings=[solver.note for solver in solvers if solver.note],
            validity=Validity(self.mesh, self.coefficients, sources.deposits),
            residual=max((result.residual for result in results), default=0.0),
            iterations=max((result.iterations for result in results), default=0),
        )

    def __repr__(self) -> str:
        regions = f", {count(len(self.regions), 'region')}" if self.regions else ""
        return f"System({self.mesh!r}, {self.medium!r}{regions})"


@dataclass(frozen=True, eq=False)
class _Solved:
    """Loads and solutions of the lights, the sum of these, and where each of the charges is a good guess."""

    loads: list[Load]
    of_lights: list[Solution]
    whole: Solution
    good: tuple[BoolArray, ...]
