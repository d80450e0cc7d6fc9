"""What sensitivities and fits cost, and how good fits are: ``python -m tests.benchmarks.sensitivities [N | fits]``.

Sensitivities: a ball of three layers with 16 beams and 16 detectors, all 256 rows to both coefficients of each node, on
a mesh that is halved N times everywhere (0: 6,000 nodes, 1: 22,000, 2: 69,000; targets of 60,000 nodes: 12 s, 2 GB).
Fits: ten fibres on a ball, read by charges, from starts a factor of 3 off (targets .5 % in 15 times a solve), and
`TRIALS` fits to readings with 1 % of noise (60 to 75 % within one standard deviation), by polynomials through what is
read on one mesh, and `WHOLE` of them as a whole. With the argument ``fits`` these alone. Times are processor seconds.
On a machine with a load of 7, one thread: 38 s with 22,000 nodes (.76 GB). With 68,800 nodes, two threads and the same
load it took 123 s of CPU (2.2 GB), before matrices were assembled in half of the memory; both targets are missed. A
quarter of it are the 32 solves of 511,000 unknowns, 31 iterations each, a third what is subtracted and its derivatives,
a seventh linear elements, by which patches are chosen, a ninth products, a fifteenth the matrix. Fits within .01 % in
11.9 and 13.3 solves of 1.6 s; 68 and 66 % of the 200 fits within one standard deviation, whole fits within .01 of it of
these.
"""

import itertools
import resource
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from tetlux.fem import (
    FibreDetector,
    FitProblem,
    Medium,
    PencilBeam,
    PointDetector,
    Region,
    System,
    fit,
    sensitivity,
    solve,
)
from tetlux.fem.inverse.parameters import unknowns_of
from tetlux.meshing import Surface, TetMesh, sphere, tetrahedralize
from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.tets.refine import refine

# Fits to readings with noise; those of them that are made as a whole, with meshes and solves.
TRIALS, WHOLE, NOISE = 200, 6, 0.01
# How far from the truth readings are tabulated, in logarithms of coefficients.
REACH = 0.1
# Edges of the coarsest mesh of sensitivities, mm.
EDGE = 2.1
RADII = (20.0, 17.0, 12.0)
COEFFICIENTS = ((0.012, 0.9), (0.008, 1.2), (0.02, 1.0))
MEDIA = [Medium(sigma_a=sigma_a, sigma_s_prime=reduced, eta=1.4) for sigma_a, reduced in COEFFICIENTS]
TRUTH = Medium(sigma_a=0.02, sigma_s_prime=1.1, eta=1.4)


def measure_rows(halvings: int) -> None:
    """Print the time and memory of all rows."""
    ball, inner = sphere(RADII[0]), [sphere(radius) for radius in RADII[1:]]
    number = np.arange(16) + 0.5
    height, angle = 1.0 - number / 10.0, np.pi * (1.0 + np.sqrt(5.0)) * number
    ring = np.sqrt(1.0 - height**2)
    places = np.column_stack([np.cos(angle) * ring, np.sin(angle) * ring, height])
    beams = [PencilBeam((1.5 * x, 1.5 * y, 1.5 * z), (-x, -y, -z)) for x, y, z in (RADII[0] * places).tolist()]
    there = [PointDetector((y, -z, x)) for x, y, z in (RADII[0] * places).tolist()]
    mesh = tetrahedralize(ball, edge_length=EDGE, regions=inner)
    for _ in range(halvings):
        mesh = refine(mesh, np.ones(len(mesh.tetrahedra), dtype=bool), ball, inner)
    regions = tuple(Region(surface, medium) for surface, medium in zip(inner, MEDIA[1:], strict=True))
    started, clock = time.process_time(), time.perf_counter()
    sensitivity(System(mesh, MEDIA[0], ball, regions=regions, expected=16), beams, there)
    seconds, most = time.process_time() - started, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
    clock = time.perf_counter() - clock
    print(f"{len(mesh.points):,} nodes: 256 rows to both coefficients in {clock:.1f} s,", end=" ")
    print(f"{seconds:.1f} s of CPU, {most:.2f} GB")


def measure_fits() -> None:
    """Print the errors of fits, their cost, and how often the truth is within one standard deviation."""
    ball, beam = sphere(15.0), PencilBeam((0.0, 0.0, 30.0), (0.0, 0.0, -1.0))
    there = [
        FibreDetector((15.0 * float(np.sin(a)), 0.0, 15.0 * float(np.cos(a))), radius=0.5, numerical_aperture=0.5)
        for a in np.linspace(3.0, 21.0, 10) / 15.0
    ]
    started = time.process_time()
    solve(ball, TRUTH, [beam], tolerance=None, detectors=there, detector_tolerance=0.005)
    forward = time.process_time() - started
    found = solve(ball, TRUTH, [beam], model="charges", detectors=there, detector_tolerance=0.001)
    readings = np.array([reading.exitance for reading in found.readings])
    names, truth = ["sigma_a", "sigma_s_prime"], np.array([TRUTH.sigma_a, TRUTH.reduced_scattering])
    for factor in (3.0, 1.0 / 3.0):
        start = Medium(sigma_a=factor * truth[0], sigma_s_prime=truth[1] / factor, eta=1.4)
        started = time.process_time()
        values = fit(ball, [beam], there, readings, names, start, noise=NOISE).values
        cost = (time.process_time() - started) / forward
        errors = np.array(list(values.values())) / truth - 1.0
        print(f"start {factor:.2g} off: {errors[0]:+.2%}, {errors[1]:+.2%} in {cost:.1f} solves of {forward:.1f} s")
    measure_coverage(ball, beam, there, readings)


def measure_coverage(ball: Surface, beam: PencilBeam, there: Sequence[FibreDetector], readings: FloatArray) -> None:
    """Print how often the truth is within one standard deviation, and how whole fits differ from tabulated ones."""
    names, truth = ["sigma_a", "sigma_s_prime"], np.array([TRUTH.sigma_a, TRUTH.reduced_scattering])
    exact = fit(ball, [beam], there, readings, names, TRUTH, noise=NOISE)
    table = Tabulated.of(ball, exact.mesh, beam, there, truth)
    random, inside, differences = np.random.default_rng(1), np.zeros(2), []
    for trial in range(TRIALS):
        noisy = readings * np.exp(NOISE * random.standard_normal(len(there)))
        logarithms, deviations = table.fit(noisy)
        inside += np.abs(np.exp(logarithms) / truth - 1.0) < deviations
        if trial < WHOLE:
            whole = np.array(list(fit(ball, [beam], there, noisy, names, TRUTH, noise=NOISE).values.values()))
            differences.append(np.abs(whole / np.exp(logarithms) - 1.0) / deviations)
    print(f"within one standard deviation: {inside[0] / TRIALS:.0%}, {inside[1] / TRIALS:.0%} of {TRIALS} fits")
    print(f"{WHOLE} whole fits are within {np.max(differences):.2f} standard deviations of these")


@dataclass(frozen=True)
class Tabulated:
    """Logarithms of readings as polynomials of second degree in those of two coefficients, about the truth.

    Attributes
    ----------
    center : (2,) ndarray
        Logarithms of the coefficients.
    polynomial : (6, d) ndarray
    """

    center: FloatArray
    polynomial: FloatArray

    @classmethod
    def of(
        cls, ball: Surface, mesh: TetMesh, beam: PencilBeam, there: Sequence[FibreDetector], truth: FloatArray
    ) -> "Tabulated":
        """By nine evaluations of a `FitProblem` on one mesh; prints what the polynomials leave."""
        names, ones = ["sigma_a", "sigma_s_prime"], np.ones((1, 1, len(there)))
        problem = FitProblem(ball, mesh, [beam], there, (), unknowns_of(names, TRUTH, ()), ones, ones)
        steps = REACH * np.array(list(itertools.product((-1.0, 0.0, 1.0), repeat=2)))
        rows = np.array([np.log(problem.fitted(np.log(truth) + step)[0, 0]) for step in steps])
        polynomial = np.linalg.lstsq(_terms(steps), rows, rcond=None)[0]
        print(f"polynomials are within {np.abs(_terms(steps) @ polynomial - rows).max():.1e} of readings")
        return cls(np.log(truth), polynomial)

    def fit(self, readings: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Logarithms of coefficients, and their standard deviations, by readings (d,) with noise."""

        def residuals(step: FloatArray) -> FloatArray:
            return np.asarray((_terms(step[None])[0] @ self.polynomial - np.log(readings)) / NOISE)

        found = least_squares(residuals, np.zeros(2))
        jacobian = np.asarray(found.jac)
        deviations = np.sqrt(np.diag(np.linalg.inv(jacobian.T @ jacobian)))
        return self.center + found.x, deviations


def _terms(steps: FloatArray) -> FloatArray:
    x, y = steps.T
    return np.column_stack([np.ones_like(x), x, y, x * x, x * y, y * y])


def main() -> None:
    """Print all of it."""
    if sys.argv[1:] != ["fits"]:
        measure_rows(int(sys.argv[1]) if len(sys.argv) > 1 else 0)
    measure_fits()


if __name__ == "__main__":
    main()
