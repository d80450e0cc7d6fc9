"""`System`: one model on one mesh, assembled once and solved for as many lights as wanted."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from tetlux.fem.body.body import Body
from tetlux.fem.body.partition import MeshPartition
from tetlux.fem.error.by_operator import estimate_by_operator
from tetlux.fem.error.estimate import Estimate
from tetlux.fem.known.kept_fits import fits_of
from tetlux.fem.known.kept_patches import keep_patch
from tetlux.fem.known.patch import find_accurate_nodes, inherit_accurate_nodes
from tetlux.fem.known.split import SplitLights, Subtract, replace_fitted, split_lights
from tetlux.fem.known.subtraction import Subtraction, subtract_as_before, subtract_fitted, subtract_on
from tetlux.fem.linear.solver import LinearResult
from tetlux.fem.media.coefficients import AnyMedium, Coefficients, MediaByLabel, coefficients_on
from tetlux.fem.media.region import Region, only_medium
from tetlux.fem.models.diffusion import Diffusion, is_diffusion
from tetlux.fem.models.model import Model
from tetlux.fem.operators.assembly import Assembly, Lumping
from tetlux.fem.operators.fitting import fitting_of
from tetlux.fem.operators.loads import Load, load_of
from tetlux.fem.operators.operator import Operator, operator_of, solve_columns
from tetlux.fem.outcome.of_light import attach_quadratic, solution_of_light
from tetlux.fem.outcome.solution import Solution
from tetlux.fem.outcome.sums import sum_solutions
from tetlux.fem.quadratic.operator import QuadraticOperator
from tetlux.fem.sources.deposit import Deposit
from tetlux.fem.sources.light import Light
from tetlux.fem.stopwatch import Stopwatch
from tetlux.fem.validity.local import Validity
from tetlux.meshing.arrays import BoolArray, NumberArray
from tetlux.meshing.describe import count, one_line
from tetlux.meshing.errors import InputError
from tetlux.meshing.host.blocks import map_in_threads
from tetlux.meshing.surface.surface import Surface
from tetlux.meshing.tets.mesh import TetMesh
from tetlux.meshing.tets.regions import own_volumes

RIGHT_HAND_SIDES_PER_LIGHT = 4  # its load, one more if its patch shrinks, and two dual loads to estimate the error


@dataclass(frozen=True, eq=False)
class MeshSolution:
    """The solution on one mesh, its estimated error, and the nodes (n,) at which each patch of charges is accurate."""

    solution: Solution
    estimate: Estimate
    accurate_nodes: tuple[BoolArray, ...]

    __repr__ = one_line


@dataclass(frozen=True, eq=False)
class System:
    """A body on one mesh: its matrix is assembled once, and solved for as many lights as wanted.

    Parameters
    ----------
    mesh : TetMesh
    medium : Medium, VaryingMedium, or mapping of int to these
        Of the body; or the medium of each label of the mesh, that of the outermost first.
    surface : Surface, optional
        The surface that the mesh approximates; the boundary of the mesh if not given.
    mass : {"lumped", "consistent"}
        Integration of the terms without derivatives, see `tetlux.fem.operators.assembly.system_matrix`.
    expected : int
        Number of lights to come, roughly: for many the matrix is factorised.
    regions : tuple of Region
        The mesh's regions 1, 2, ..., each with one medium.
    assembly : Assembly, optional
        That of another system on the same mesh, to share what does not depend on the media.
    limit : bool
        Whether the fluence is limited to be nonnegative, where that of the equation itself is.
    model_of : callable
        Makes the equation from the coefficients. One other than `Diffusion` needs ``subtract="nothing"`` in `solve`.
    shift : complex
        Added to sigma_a, 1/unit: ``i omega n/c`` makes it light modulated at omega, see `tetlux.fem.models.model`.

    Examples
    --------
    >>> from tetlux.fem import Medium, PointSource, System
    >>> from tetlux.meshing import sphere, tetrahedralize
    >>> system = System(tetrahedralize(sphere(10.0)), Medium(sigma_a=0.01, sigma_s_prime=1.0, eta=1.4))
    >>> [round(system.solve([PointSource((0, 0, z))]).power.exited, 1) for z in (0.0, 9.0)]  # of 1 W each, W
    [0.5, 0.8]
    """

    mesh: TetMesh
    medium: AnyMedium | MediaByLabel
    surface: Surface | None = None
    mass: Lumping = "lumped"
    expected: int = 1
    regions: tuple[Region, ...] = ()
    assembly: Assembly | None = None
    limit: bool = True
    model_of: Callable[[Coefficients], Model] = Diffusion
    shift: complex = 0.0

    @property
    def media(self) -> MediaByLabel | tuple[AnyMedium, ...]:
        """The media of the body and of its regions, or of each label."""
        return (self.medium, *map(only_medium, self.regions)) if isinstance(self.medium, AnyMedium) else self.medium

    @cached_property
    def coefficients(self) -> Coefficients:
        """The coefficients of each tetrahedron."""
        return replace(coefficients_on(self.mesh, self.media), shift=self.shift)

    @cached_property
    def model(self) -> Model:
        """The equation that is solved."""
        return self.model_of(self.coefficients)

    @property
    def true_surface(self) -> Surface:
        """The surface that the mesh approximates."""
        return self.surface or self.mesh.surface

    @cached_property
    def plain(self) -> Operator:
        """The operator for points and beams."""
        return operator_of(self._assembly, self.model, self.mass, self._expected_right_hand_sides)

    @cached_property
    def layer_operator(self) -> Operator:
        """The operator for diffuse and emitted light: on coarse meshes its coefficients fit layers at the boundary."""
        fits = self.mass == "lumped" and is_diffusion(self.model) and self.model.shift == 0
        fitting = fitting_of(self.mesh, self.coefficients) if fits else None
        if fitting is None:
            return self.plain
        return operator_of(self._assembly, self.model, self.mass, self._expected_right_hand_sides, fitting)

    @cached_property
    def quadratic(self) -> QuadraticOperator:
        """The operator of quadratic elements, by which detectors are read; for diffusion only."""
        inner = tuple(region.surface for region in self.regions)
        return QuadraticOperator(self.mesh, self.true_surface, inner, self.coefficients)

    @cached_property
    def _assembly(self) -> Assembly:
        return self.assembly or Assembly(self.mesh)

    def _require_diffusion(self, remedy: str) -> None:
        if not is_diffusion(self.model):
            raise InputError(f"the model is not diffusion, for which alone {remedy}.")

    @property
    def _expected_right_hand_sides(self) -> int:
        return RIGHT_HAND_SIDES_PER_LIGHT * self.expected

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
            If a light does not go with the body, or `subtract` with the model.
        RunError
            If the linear solver fails.
        """
        if subtract != "nothing":
            self._require_diffusion('charges are subtracted; give subtract="nothing"')
        watch = Stopwatch()
        with watch.stage("surface"):
            body = Body(self.true_surface, self.media, MeshPartition(self.mesh))
            if self.surface is None or self.surface is self.mesh.surface:
                subtract = replace_fitted(subtract)
            split = split_lights(lights, body, subtract, kept=fits_of(self.mesh), shift=self.shift)
        solution = self._solve(split, watch, None).whole
        return replace(solution, seconds=watch.read(), warnings=[*solution.warnings, *split.warnings])

    def step(self, split: SplitLights, watch: Stopwatch, coarser: MeshSolution | None = None) -> MeshSolution:
        """Solve, and estimate the error; `coarser` is the solution on a mesh that this one is a refinement of."""
        self._require_diffusion("errors are estimated; call System.solve")
        solved = self._solve(split, watch, coarser)
        with watch.stage("solve"):
            estimate = estimate_by_operator(solved.loads, solved.of_lights, solved.whole, self.quadratic.inner)
        return MeshSolution(replace(solved.whole, error_estimate=estimate.error), estimate, solved.accurate_nodes)

    def _solve(self, split: SplitLights, watch: Stopwatch, coarser: MeshSolution | None) -> "_Solved":
        """Turn deposits into loads and patches, solve one linear system for all, and make a solution of each light."""
        with watch.stage("assemble"):
            loads = self._loads(split)
            subtractions = self._subtractions(split, coarser)
            # A light whose points are all subtracted may have nothing on the mesh.
            lit = [light for light, load in enumerate(loads) if load.at_nodes.any()]
            coarse = () if coarser is None else coarser.solution.patches
            fitted = [
                subtract_fitted(light, each, self.plain, self.mass, coarse) for light, each in split.fitted.items()
            ]
            operators = [*(self.plain for _ in [*subtractions, *fitted]), *(loads[light].operator for light in lit)]
        with watch.stage("solve"):
            # Each light is solved for by itself, with patches that depend on it alone, so that lights add up.
            columns = [each.terms.load for each in [*subtractions, *fitted]] + [loads[light].at_nodes for light in lit]
            fluences, results = solve_columns(operators, columns, len(self.mesh.points))
            for column, each in enumerate(fitted, len(subtractions)):
                fluences[:, column] = each.fluence_of(fluences[:, column])
        accurate = tuple(
            find_accurate_nodes(each.patch, fluence) for each, fluence in zip(subtractions, fluences.T, strict=False)
        )
        if coarser is None:
            results += self._shrink_patches(subtractions, accurate, fluences, watch)
        for each in subtractions:
            keep_patch(each.patch, "linear")
        owners = np.array([*split.owners, *split.fitted, *lit], dtype=np.int64)
        of_lights = []
        for light, load in enumerate(loads):
            fluence = fluences[:, owners == light].sum(axis=1)
            own = [each for each in [*subtractions, *fitted] if each.light == light]
            of_lights.append(solution_of_light(load, fluence, own, self.true_surface, limit=self.limit))
        quadratic = None
        if is_diffusion(self.model):
            of_lights, quadratic = attach_quadratic(of_lights, loads, self.quadratic)
        whole = replace(self._sum(of_lights, loads, results, split), quadratic=quadratic)
        return _Solved(loads, of_lights, whole, accurate)

    def _loads(self, split: SplitLights) -> list[Load]:
        """The load of each light: of distributed light with `layer_operator`, else with the plain operator."""
        loads = []
        for light, deposit in enumerate(split.remaining):
            on_mesh = self._scale_emission(deposit.evaluate_on(self.mesh, self.true_surface, self.coefficients))
            is_subtracted = light in split.owners or light in split.fitted
            operator = self.layer_operator if on_mesh.terms.is_distributed and not is_subtracted else self.plain
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

    def _subtractions(self, split: SplitLights, coarser: MeshSolution | None) -> list[Subtraction]:
        """Subtract charges where they were accurate on the coarser mesh, or as before on this one, or everywhere."""
        lights = zip(split.owners, split.charges, strict=True)
        if coarser is None:
            return map_in_threads(lambda light: subtract_as_before(self.mesh, *light, self.mass), list(lights))
        coarse = coarser.solution.mesh.points
        accurate = [inherit_accurate_nodes(each, coarse, self.mesh) for each in coarser.accurate_nodes]
        return [subtract_on(self.mesh, *light, self.mass, nodes) for light, nodes in zip(lights, accurate, strict=True)]

    def _shrink_patches(
        self, subtractions: list[Subtraction], accurate: Sequence[BoolArray], fluences: NumberArray, watch: Stopwatch
    ) -> list[LinearResult]:
        """Shrink patches to their accurate nodes and solve for them again, in place."""
        shrinking = [i for i, each in enumerate(subtractions) if not each.is_kept and not accurate[i].all()]
        if not shrinking:
            return []
        with watch.stage("assemble"):
            for n, each in enumerate(map_in_threads(lambda i: subtractions[i].shrink_to(accurate[i]), shrinking)):
                subtractions[shrinking[n]] = each
        with watch.stage("solve"):
            result = self.plain.solver.solve(np.column_stack([subtractions[i].terms.load for i in shrinking]))
            fluences[:, shrinking] = result.x
        return [result]

    def _sum(
        self, of_lights: Sequence[Solution], loads: Sequence[Load], results: Sequence[LinearResult], split: SplitLights
    ) -> Solution:
        """The solution of all lights together, with residual, iterations and notes of the linear solver."""
        solvers = [operator.solver for operator in dict.fromkeys(load.operator for load in loads)]
        return replace(
            sum_solutions(of_lights),
            warnings=[solver.note for solver in solvers if solver.note],
            validity=Validity(self.mesh, self.coefficients, split.deposits),
            residual=max((result.residual for result in results), default=0.0),
            iterations=max((result.iterations for result in results), default=0),
        )

    def __repr__(self) -> str:
        regions = f", {count(len(self.regions), 'region')}" if self.regions else ""
        return f"System({self.mesh!r}, {self.medium!r}{regions})"


@dataclass(frozen=True, eq=False)
class _Solved:
    """Loads and solutions of the lights, the sum of these, and the accurate nodes as in `MeshSolution`."""

    loads: list[Load]
    of_lights: list[Solution]
    whole: Solution
    accurate_nodes: tuple[BoolArray, ...]
