"""What is measured of one scene of the stress map and one method."""

import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any
from unittest.mock import patch

import numpy as np

from tetlux.cases.chart.measure import relative_error
from tetlux.cases.stress.scenes import TOLERANCE, Scene
from tetlux.fem import linear
from tetlux.fem.solution import Solution
from tetlux.fem.solve import solve
from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.mesher import tetrahedralize

# Where the adaptive runs stop: the map is of what breaks, not of how fine a mesh can get.
MOST_TETRAHEDRA = 30_000


@dataclass(frozen=True)
class Method:
    """A way to solve a scene.

    Attributes
    ----------
    name : str
    options : dict
        Keywords of `tetlux.fem.solve`.
    adaptive : bool
        Whether the mesh is refined until the estimated error is within the tolerance, where no mesh is given.
    counts : bool
        Whether what breaks with it is a violation: else it is there to be compared with.
    """

    name: str
    options: Mapping[str, Any] = field(default_factory=dict)
    adaptive: bool = True
    counts: bool = False


DEFAULT = Method("default", counts=True)
PLAIN = Method("default, not refined", adaptive=False, counts=True)
CONSISTENT = Method("consistent mass, no limiter", {"mass": "consistent", "limit": False})
FREE_SPACE = Method("free space subtracted", {"subtract": "free-space"})
NOTHING = Method("nothing subtracted", {"subtract": "nothing"})
# What bears on the sign of the fluence, one beside the other.
OF_SIGN = (DEFAULT, Method("no limiter", {"limit": False}), CONSISTENT)


@dataclass(frozen=True)
class Figures:
    """What a run came to.

    Attributes
    ----------
    lowest : float
        Least fluence at a node, by the largest.
    overshoot : float or None
        Largest fluence at a node over the bound of the maximum principle, less 1.
    ledger : float
        Power that is missing, by the incident.
    residual : float
        Largest relative residual of the linear systems, computed anew from their solutions.
    iterations : int
        Most that one of them took.
    estimate : float
        Estimated relative L2 error of the exitance.
    error : float or None
        The true one, where there is a closed form.
    scaling : float or None
        Largest difference from the exitance of the same scene at scale 1, by the largest exitance.
    finite : bool
        Whether fluence and exitance are numbers throughout.
    dips : bool
        Whether the equation itself may dip below zero.
    nodes : int
    seconds : float
    warnings : tuple of str
    """

    lowest: float
    overshoot: float | None
    ledger: float
    residual: float
    iterations: int
    estimate: float
    error: float | None
    scaling: float | None
    finite: bool
    dips: bool
    nodes: int
    seconds: float
    warnings: tuple[str, ...]


def measured(scene: Scene, method: Method) -> Figures:
    """Solve a scene and measure what came of it."""
    started = time.perf_counter()
    with _watched() as seen:
        solution = _solved(scene, method)
    seconds = time.perf_counter() - started
    error = scaling = None
    if scene.truth is not None:
        samples, exitance = scene.truth
        # In units of its own, for the squares of what is left of light in an opaque body.
        largest = float(exitance.max())
        values = solution.exitance_at(samples.points)
        with np.errstate(over="ignore"):
            error = relative_error(values / largest, exitance / largest, samples.weights)
    if scene.alike is not None:
        here, there = _free_of_scale(solution), _free_of_scale(_solved(scene.alike, method))
        scaling = float(np.abs(here - there).max() / np.abs(there).max())
    highest = float(solution.fluence.max())
    return Figures(
        lowest=float(solution.fluence.min()) / highest,
        overshoot=None if scene.bound is None else highest / scene.bound - 1.0,
        ledger=solution.power.balance_error,
        residual=seen.residual,
        iterations=seen.iterations,
        estimate=solution.error_estimate,
        error=error,
        scaling=scaling,
        finite=bool(np.isfinite(solution.fluence).all() and np.isfinite(solution.exitance).all()),
        dips=scene.dips,
        nodes=len(solution.mesh.points),
        seconds=seconds,
        warnings=tuple(solution.warnings),
    )


def _solved(scene: Scene, method: Method) -> Solution:
    mesh = scene.mesh
    if mesh is None and not method.adaptive:
        mesh = tetrahedralize(scene.surface, [region.surface for region in scene.regions])
    return solve(
        scene.surface,
        scene.medium,
        [scene.light],
        regions=scene.regions,
        mesh=mesh,
        tolerance=TOLERANCE,
        most_tetrahedra=MOST_TETRAHEDRA,
        **method.options,
    )


def _free_of_scale(solution: Solution) -> FloatArray:
    """Exitance at the nodes, by the mean that it would have if all power left."""
    return np.asarray(solution.exitance * (solution.mesh.area / solution.power.incident))


@dataclass
class _Seen:
    residual: float = 0.0
    iterations: int = 0


@contextmanager
def _watched() -> Iterator[_Seen]:
    """Note what the linear solver does; its residuals are computed anew."""
    seen = _Seen()
    solve_system, iterate = linear.Solver.solve, linear.conjugate_gradients

    def solve_and_check(solver: linear.Solver, load: FloatArray) -> FloatArray:
        result = solve_system(solver, load)
        loads = load.reshape(len(load), -1)
        left = np.linalg.norm(loads - solver.matrix @ result.reshape(loads.shape), axis=0)
        size = np.linalg.norm(loads, axis=0)
        # nan is the larger one too.
        seen.residual = float(np.max([seen.residual, *(left / np.where(size > 0, size, 1.0))]))
        return result

    def iterate_and_count(product: linear.Product, precondition: linear.Method, loads: FloatArray) -> FloatArray:
        count = 0

        def counted(rest: FloatArray) -> FloatArray:
            nonlocal count
            count += 1
            return precondition(rest)

        result = iterate(product, counted, loads)
        seen.iterations = max(seen.iterations, count)
        return result

    with (
        patch.object(linear.Solver, "solve", solve_and_check),
        patch.object(linear, "conjugate_gradients", iterate_and_count),
    ):
        yield seen
