"""From a body, a medium and lights to a `Solution`: mesh, assemble, solve, estimate, refine."""

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace

import numpy as np

from tetlux.fem.forms import Mass, node_volumes, system_matrix
from tetlux.fem.grading import graded, grading_for
from tetlux.fem.lights.deposit import Deposit, Light
from tetlux.fem.linear import MultigridSolver
from tetlux.fem.loads import load_vector
from tetlux.fem.medium import Medium
from tetlux.fem.solution import Power, Solution
from tetlux.fem.validity import check_scattering, check_size, warnings_for
from tetlux.meshing.errors import InputError
from tetlux.meshing.mesher import tetrahedralize
from tetlux.meshing.surface import Surface
from tetlux.meshing.tetmesh import TetMesh

# Edges in units of the grading's length, on the first mesh.
FIRST_FINENESS = 0.7
# A mesh is finer than another if it has this many times its tetrahedra.
LEAST_GROWTH = 2.0
# A fluence below zero by less than this share of its maximum is not worth a sentence.
NEGLIGIBLE_DIP = 1e-6
# The first mesh may use this part of the tetrahedra allowed, so that a second one can tell its error.
FIRST_SHARE = 8
# From mesh to mesh the fineness changes by no more and no less than these factors.
STEP_LIMITS = (0.5, 0.7)
MOST_TETRAHEDRA = 1_000_000


@dataclass
class Stopwatch:
    """Seconds by stage."""

    seconds: dict[str, float] = field(
        default_factory=lambda: dict.fromkeys(("surface", "mesh", "assemble", "solve", "total"), 0.0)
    )

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Add the time of the block to a stage."""
        start = time.perf_counter()
        try:
            yield
        finally:
            self.seconds[name] += time.perf_counter() - start


def solve(
    body: Surface | TetMesh,
    medium: Medium,
    lights: Sequence[Light],
    *,
    tolerance: float = 0.02,
    mesh: TetMesh | None = None,
    mass: Mass = "lumped",
    most_tetrahedra: int = MOST_TETRAHEDRA,
    report: Callable[[str], None] = lambda _: None,
) -> Solution:
    """Solve for the light in a body.

    A `Surface` is tetrahedralized and refined towards the lights until the estimated error of the exitance
    is within the tolerance; a `TetMesh` is used as it is.

    Parameters
    ----------
    body : Surface or TetMesh
    medium : Medium
    lights : sequence of Light
        At least one; they add up.
    tolerance : float
        Wanted relative L2 error of the exitance over the surface.
    mesh : TetMesh, optional
        Use this mesh of the body as it is.
    mass : {"lumped", "consistent"}
        Integration of the terms without derivatives, see `tetlux.fem.forms.system_matrix`.
    most_tetrahedra : int
        Where refinement stops even if the tolerance is not met; the solution then carries a warning. The
        mesher's own mesh, of some thousands, is the least.
    report : callable
        Called with a line of text as each stage ends.

    Returns
    -------
    Solution

    Raises
    ------
    InputError
        If the tolerance, the body's size or a light is not sensible: see each light.
    RunError
        If the mesher or the linear solver fails.

    Notes
    -----
    The estimate compares two meshes: exitance converges at second order in the mesh's fineness c, so that
    ``e_fine = |M_fine - M_coarse| r/(1 - r)`` with ``r = (c_fine/c_coarse)²``, measured at the surface where the
    light leaves. It knows the error of the mesh, not that of the diffusion approximation.
    """
    if not 1e-4 <= tolerance < 1:
        raise InputError(f"tolerance is {tolerance:g}; give a relative error between 0.0001 and 1, such as 0.02.")
    if len(lights) == 0:
        raise InputError("there is no light; give at least one.")
    if isinstance(body, TetMesh):
        if mesh is not None:
            raise InputError("a mesh is given twice; give it as the body, or a surface and its mesh.")
        mesh = body
    watch = Stopwatch()
    started = time.perf_counter()
    with watch.stage("surface"):
        surface = body.surface if isinstance(body, TetMesh) else body
        check_scattering(medium)
        check_size(surface, medium)
        deposits = [light.deposit_in(surface, medium) for light in lights]
    problem = _Problem(medium, deposits, mass, watch, report)
    warnings = list(surface.warnings) + warnings_for(surface, medium)
    warnings += [w for d in deposits for w in d.warnings]
    if mesh is not None:
        solution = problem.solved_on(mesh)
    else:
        solution = _refined_until(problem, surface, tolerance, most_tetrahedra)
        if not solution.error_estimate <= tolerance:
            known = np.isfinite(solution.error_estimate)
            found = f"the estimated error is {solution.error_estimate:.2g}" if known else "the error is not known"
            warnings.append(
                f"the tolerance of {tolerance:g} was not met: {found}, at the limit of {most_tetrahedra:,} tetrahedra."
            )
    if solution.power.exited == 0.0:
        warnings.append(
            "no light leaves the body: all of it is reflected at its surface, passes through or is absorbed."
        )
    lowest = float(solution.fluence.min())
    if lowest < -NEGLIGIBLE_DIP * float(solution.fluence.max()):
        warnings.append(
            f"the fluence dips below zero, to {lowest / float(solution.fluence.max()):.1e} of its largest value, where "
            "tetrahedra are obtuse and light is scarce; ask for a smaller tolerance."
        )
    watch.seconds["total"] = time.perf_counter() - started
    return replace(solution, seconds=dict(watch.seconds), warnings=list(dict.fromkeys(warnings)))


@dataclass(frozen=True, eq=False)
class _Problem:
    """What is solved, on whichever mesh."""

    medium: Medium
    deposits: list[Deposit]
    mass: Mass
    watch: Stopwatch
    report: Callable[[str], None]

    def solved_on(self, mesh: TetMesh) -> Solution:
        medium, deposits = self.medium, self.deposits
        with self.watch.stage("assemble"):
            matrix = system_matrix(mesh, medium, self.mass)
            load = np.sum([load_vector(mesh, medium, d) for d in deposits], axis=0)
        with self.watch.stage("solve"):
            fluence = MultigridSolver(matrix).solve(load)
        transmitted = sum(d.transmitted_irradiance for d in deposits)
        outside = sum(d.irradiance for d in deposits) * mesh.area
        ledger = Power(
            incident=sum(d.incident for d in deposits) + outside,
            specular=sum(d.specular for d in deposits) + outside - transmitted * mesh.area,
            absorbed=sum(d.absorbed for d in deposits) + medium.sigma_a * float(node_volumes(mesh) @ fluence),
            exited=0.0,
            ballistic=sum(d.ballistic for d in deposits),
        )
        solution = Solution(mesh, medium, fluence, ledger, transmitted)
        return replace(solution, power=replace(ledger, exited=float(mesh.boundary_node_areas @ solution.exitance)))


def _refined_until(problem: _Problem, surface: Surface, tolerance: float, most: int) -> Solution:
    """Refine towards the lights, in steps, until two meshes agree to the tolerance or one is too large."""
    grading = grading_for(problem.deposits, problem.medium, surface)
    fineness, factor = FIRST_FINENESS, STEP_LIMITS[0]
    with problem.watch.stage("mesh"):
        base = tetrahedralize(surface)
        problem.report(f"tetrahedralized: {len(base.tetrahedra):,} tetrahedra")
        mesh, reached = graded(base, surface, grading, fineness, most // FIRST_SHARE)
        while not reached:
            fineness *= 1.5
            mesh, reached = graded(base, surface, grading, fineness, most // FIRST_SHARE)
    solution = problem.solved_on(mesh)
    problem.report(f"solved on {len(mesh.tetrahedra):,} tetrahedra")
    while reached:
        fineness *= factor
        with problem.watch.stage("mesh"):
            mesh, reached = graded(mesh, surface, grading, fineness, most)
        if len(mesh.tetrahedra) < LEAST_GROWTH * len(solution.mesh.tetrahedra):
            # Not a finer mesh yet, and two that are alike tell nothing.
            factor = STEP_LIMITS[0]
            continue
        finer = problem.solved_on(mesh)
        # A step is never worth more than a halving of the edges: a coarse mesh is not yet of second order.
        shrunk = float(np.clip(lit_size(finer) / lit_size(solution), 0.25, 0.8))
        estimate = difference(finer, solution) * shrunk / (1.0 - shrunk)
        solution = replace(finer, error_estimate=estimate)
        problem.report(f"solved on {len(mesh.tetrahedra):,} tetrahedra: estimated error {estimate:.2%}")
        if not estimate > tolerance:
            break
        factor = float(np.clip(0.95 * np.sqrt(tolerance / estimate), *STEP_LIMITS))
    return solution


def lit_size(solution: Solution) -> float:
    """Mean squared size of the tetrahedra that light leaves through, unit²."""
    mesh = solution.mesh
    weights = mesh.boundary_areas * (solution.exitance[mesh.boundary_triangles] ** 2).mean(axis=1)
    return float(weights @ mesh.volumes[mesh.boundary_cells] ** (2 / 3) / weights.sum()) if weights.any() else 1.0


def difference(fine: Solution, coarse: Solution) -> float:
    """Relative L2 difference of two exitances over the surface of the finer one's mesh."""
    weights = fine.mesh.boundary_node_areas
    gap = fine.exitance - coarse.exitance_at(fine.mesh.boundary_points)
    size = float(weights @ fine.exitance**2)
    # Where no light leaves at all, there is nothing to be wrong about.
    return float(np.sqrt(weights @ gap**2 / size)) if size > 0 else 0.0
