"""`System`: the diffusion equation on one mesh, assembled once and solved for as many lights as wanted."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from tetlux.fem.body.body import Body
from tetlux.fem.body.partition import MeshPartition
from tetlux.fem.error.estimate import Estimate, estimate_error
from tetlux.fem.known.patch import Patch, good_nodes, inherit_good_nodes, patch_of
from tetlux.fem.known.patch_terms import PatchTerms, patch_terms
from tetlux.fem.known.split import Sources, Subtract, sources_of
from tetlux.fem.linear.solver import LinearResult, Solver, solver_for
from tetlux.fem.media.coefficients import AnyMedium, Coefficients, MediaByLabel, coefficients_on
from tetlux.fem.media.region import Region, only_medium
from tetlux.fem.operators.assembly import Assembly, Mass
from tetlux.fem.operators.fitting import Fitting, fitting_of
from tetlux.fem.operators.limiter import nonnegative
from tetlux.fem.operators.loads import load_vector
from tetlux.fem.outcome.solution import Power, Solution, sum_solutions
from tetlux.fem.quadratic.operator import QuadraticOperator
from tetlux.fem.quadratic.solution import QuadraticLights, QuadraticSolution
from tetlux.fem.sources.deposit import Deposit, Light
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
    def plain(self) -> "Operator":
        """The operator for points and beams."""
        return self._operator(None)

    @cached_property
    def fitted(self) -> "Operator":
        """The operator for diffuse and emitted light: layers along the boundary are fitted where the mesh is coarse."""
        fitting = fitting_of(self.mesh, self.coefficients) if self.mass == "lumped" else None
        return self.plain if fitting is None else self._operator(fitting)

    @cached_property
    def quadratic(self) -> QuadraticOperator:
        """The operator that detectors are read by."""
        inner = tuple(region.surface for region in self.regions)
        return QuadraticOperator(self.mesh, self.body, inner, self.coefficients)

    def _operator(self, fitting: Fitting | None) -> "Operator":
        mesh, assembly, coefficients = self.mesh, self.assembly or Assembly(self.mesh), self.coefficients
        sigma_a, scale = coefficients.sigma_a, 1.0 if fitting is None else fitting.absorption_scale
        volumes = sigma_a * mesh.node_volumes if coefficients.uniform else mesh.to_nodes(sigma_a * mesh.volumes)
        loads = LOADS_OF_A_LIGHT * self.expected
        if fitting is None:
            solver = assembly.solver(coefficients, self.mass, loads)
        else:
            matrix = assembly.matrix(
                fitting.diffusion, sigma_a, coefficients.escape, self.mass, fitting.absorption_scale
            )
            solver = solver_for(matrix, loads)
        return Operator(solver, np.asarray(scale * volumes), fitting)

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
            sources = sources_of(lights, Body(self.body, self.media, MeshPartition(self.mesh)), subtract)
        solution, *_ = self._solved(sources, watch, None)
        return replace(solution, seconds=watch.read(), warnings=[*solution.warnings, *sources.warnings])

    def step(self, sources: Sources, watch: Stopwatch, before: Step | None = None) -> Step:
        """Solve, and estimate the error; `before` is a step on a coarser mesh that this one is a refinement of."""
        solution, good, parts = self._solved(sources, watch, before)
        with watch.stage("solve"):
            inner = tuple(region.surface for region in self.regions)
            estimates = [
                estimate_error(
                    part.solution,
                    solution,
                    self.coefficients,
                    part.operator.solver,
                    part.load,
                    part.emission,
                    inner,
                    part.operator.fitting,
                )
                for part in parts
            ]
        shares = np.sum([each.shares for each in estimates], axis=0)
        estimate = Estimate(shares, np.sum([each.power_shares for each in estimates], axis=0))
        return Step(replace(solution, error_estimate=estimate.error), estimate, good)

    def _solved(
        self, sources: Sources, watch: Stopwatch, before: Step | None
    ) -> "tuple[Solution, tuple[BoolArray, ...], list[_Part]]":
        """The solution, where its charges are good guesses, and its parts by the operators that they belong to."""
        mesh = self.mesh
        with watch.stage("assemble"):
            deposits, operators, loads = self._loads(sources)
            # A light whose points are all subtracted may have nothing on the mesh.
            lit = [light for light, load in enumerate(loads) if load.any()]
            patches = self._patches(sources, before)
            terms = [patch_terms(patch, self.mass) for patch in patches]
            of_columns = [*(self.plain for _ in terms), *(operators[light] for light in lit)]
        with watch.stage("solve"):
            # Every light has a fluence of its own, and a patch that depends on nothing else: so lights add up.
            columns = np.column_stack([*(term.load for term in terms), *(loads[light] for light in lit)] or loads[:1])
            parts, solved = _solve_columns(of_columns, columns)
        good = [good_nodes(patch, part) for patch, part in zip(patches, parts.T, strict=False)]
        if before is None:
            solved += self._shrink(patches, terms, good, parts, watch)
        owners = np.array([*sources.owners, *lit], dtype=np.int64)
        of_lights = []
        for light, deposit in enumerate(deposits):
            fluence = parts[:, : len(owners)][:, owners == light].sum(axis=1)
            own = [i for i, owner in enumerate(sources.owners) if owner == light]
            its_patches, its_terms = [patches[i] for i in own], [terms[i] for i in own]
            of_lights.append(self._solution(deposit, operators[light], fluence, its_patches, its_terms))
        read_by = QuadraticLights(self.quadratic, tuple(deposits), tuple(each.patches for each in of_lights))
        of_lights = [
            replace(each, quadratic=QuadraticSolution(read_by, (light,))) for light, each in enumerate(of_lights)
        ]
        solution = replace(
            sum_solutions(of_lights),
            quadratic=QuadraticSolution(read_by, tuple(range(len(of_lights)))),
            warnings=[operator.solver.note for operator in dict.fromkeys(operators) if operator.solver.note],
            validity=Validity(mesh, self.coefficients, sources.deposits),
            residual=max((result.residual for result in solved), default=0.0),
            iterations=max((result.iterations for result in solved), default=0),
        )
        return solution, tuple(good), _parts_by_operator(operators, deposits, loads, of_lights)

    def _loads(self, sources: Sources) -> "tuple[list[Deposit], list[Operator], list[FloatArray]]":
        """Of each light: its deposit on the mesh, its operator, and its load at the nodes (n,), W."""
        mesh = self.mesh
        deposits = [self._emitting(deposit.on(mesh, self.body, self.coefficients)) for deposit in sources.on_mesh]
        operators = [self._operator_of(light, deposit, sources) for light, deposit in enumerate(deposits)]
        loads = [load_vector(mesh, self.coefficients, deposit) for deposit in deposits]
        for light, (deposit, operator) in enumerate(zip(deposits, operators, strict=True)):
            if operator.fitting is not None and np.any(deposit.emission):
                emitted = mesh.to_nodes(deposit.emission * mesh.volumes)
                withheld = (1.0 - operator.fitting.absorption_scale) * emitted
                # The fitted operator absorbs only in the layer: the rest is absorbed where it is emitted.
                loads[light] -= withheld
                deposits[light] = replace(deposit, absorbed=deposit.absorbed + float(withheld.sum()))
        return deposits, operators, loads

    def _patches(self, sources: Sources, before: Step | None) -> list[Patch]:
        """The patch of each of the charges: where they were a good guess on the mesh before, or else everywhere."""
        mesh = self.mesh
        if before is None:
            everywhere = np.ones(len(mesh.points), dtype=bool)
            return [patch_of(mesh, charges, everywhere) for charges in sources.charges]
        coarse = before.solution.mesh.points
        return [
            patch_of(mesh, charges, inherit_good_nodes(good, coarse, mesh))
            for charges, good in zip(sources.charges, before.good, strict=True)
        ]

    def _shrink(
        self,
        patches: list[Patch],
        terms: list[PatchTerms],
        good: list[BoolArray],
        parts: FloatArray,
        watch: Stopwatch,
    ) -> list[LinearResult]:
        """Shrink patches to the good nodes and solve for them again, in place."""
        worse = [i for i in range(len(patches)) if not good[i].all()]
        if not worse:
            return []
        with watch.stage("assemble"):
            for i in worse:
                patches[i] = patch_of(self.mesh, patches[i].charges, good[i], patches[i].at_nodes)
                terms[i] = patch_terms(patches[i], self.mass)
        with watch.stage("solve"):
            result = self.plain.solver.solve(np.column_stack([terms[i].load for i in worse]))
            parts[:, worse] = result.x
        return [result]

    def _operator_of(self, light: int, deposit: Deposit, sources: Sources) -> "Operator":
        """The fitted operator for light that is spread evenly, the plain one for all other light."""
        return self.fitted if deposit.even and light not in sources.owners else self.plain

    def _solution(
        self,
        deposit: Deposit,
        operator: "Operator",
        fluence: FloatArray,
        patches: list[Patch],
        terms: list[PatchTerms],
    ) -> Solution:
        """The solution of one light, by its deposit on this mesh."""
        mesh, limited_power = self.mesh, 0.0
        if self.limit and not (self._has_first_moment(deposit) or any(patch.charges.dips for patch in patches)):
            fluence, limited_power = nonnegative(fluence, mesh.edges, self._losing(operator))
        outside = mesh.boundary_node_areas * deposit.irradiance
        transmitted = mesh.boundary_node_areas * deposit.transmitted_irradiance
        emitted = float((mesh.volumes * deposit.emission).sum())
        absorbed = float((operator.absorbing * fluence).sum())
        ledger = Power(
            incident=deposit.incident + float(outside.sum()) + emitted,
            specular=deposit.specular + float((outside - transmitted).sum()),
            absorbed=deposit.absorbed + absorbed + sum(term.absorbed for term in terms),
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
            limited_power=limited_power,
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

    def _losing(self, operator: "Operator") -> FloatArray:
        """What a fluence of 1 at each node loses by absorption and through the boundary, (n,), unit²."""
        losing = operator.absorbing.copy()
        losing[self.mesh.boundary_nodes] += self.coefficients.escape * self.mesh.boundary_node_areas
        return losing

    def __repr__(self) -> str:
        regions = f", {count(len(self.regions), 'region')}" if self.regions else ""
        return f"System({self.mesh!r}, {self.medium!r}{regions})"


@dataclass(frozen=True, eq=False)
class Operator:
    """A matrix on a mesh, and its solver.

    Attributes
    ----------
    solver : Solver
    absorbing : (n,) ndarray
        Power absorbed for a fluence of 1 at each node, unit².
    fitting : Fitting, optional
        The coefficients of the matrix where they are not those of the media.
    """

    solver: Solver
    absorbing: FloatArray
    fitting: Fitting | None

    __repr__ = one_line


def _solve_columns(operators: "Sequence[Operator]", loads: FloatArray) -> tuple[FloatArray, list[LinearResult]]:
    """Solve for the columns of loads (n, k), each with its own operator: (n, k), and the result of each solve."""
    parts, solved = np.zeros(loads.shape), []
    for some in dict.fromkeys(operators):
        columns = [i for i, each in enumerate(operators) if each is some]
        solved.append(some.solver.solve(loads[:, columns]))
        parts[:, columns] = solved[-1].x
    return parts, solved


@dataclass(frozen=True, eq=False)
class _Part:
    """The part of a solution that has one operator, its load at the nodes, and its emission in the volume."""

    operator: Operator
    solution: Solution
    load: FloatArray
    emission: float | FloatArray


def _parts_by_operator(
    operators: Sequence[Operator],
    deposits: Sequence[Deposit],
    loads: Sequence[FloatArray],
    of_lights: Sequence[Solution],
) -> list[_Part]:
    """The lights of each operator together."""
    found = []
    for operator in dict.fromkeys(operators):
        some = [light for light, each in enumerate(operators) if each is operator]
        emission = sum((deposits[light].emission for light in some), 0.0)
        # Only uneven deposits make the exitance ripple, and emission is even.
        uneven = [loads[light] for light in some if not deposits[light].even]
        load = np.sum([np.zeros_like(loads[0]), *uneven], axis=0)
        found.append(_Part(operator, sum_solutions([of_lights[light] for light in some]), load, emission))
    return found
