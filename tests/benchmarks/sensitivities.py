"""What sensitivities and fits cost, and how good fits are: ``python -m tests.benchmarks.sensitivities [HALVINGS]``.

Sensitivities: a ball of three layers with 16 beams and 16 detectors, all 256 rows to both coefficients of each node, on
a mesh that is halved so often everywhere (0: 6,000 nodes, 1: 22,000, 2: 69,000; targets of 60,000 nodes: 12 s, 2 GB).
Fits: ten fibres on a ball, read by charges, from starts a factor of 3 off (targets .5 % in 15 times a solve), and
`TRIALS` fits to readings with 1 % of noise (60 to 75 % within one standard deviation). Processor seconds on two busy
cores: 13.4 with 6,000 nodes (.46 GB), 38 with 22,000 (1.0 GB), of which solves take 12 and charges 9; with 61,000 it
had not ended after 105, with 2.2 GB. Fits +.03 % and -.02 % in 12 solves.
"""

import resource
import sys
import time

import numpy as np

from tetlux.fem import FibreDetector, Medium, PencilBeam, PointDetector, Region, System, fit, sensitivity, solve
from tetlux.meshing import sphere, tetrahedralize
from tetlux.meshing.tets.refine import refine

TRIALS = 200
# Edges of the coarsest mesh, mm.
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
        values = fit(ball, [beam], there, readings, names, start, noise=0.01).values
        cost = (time.process_time() - started) / forward
        errors = np.array(list(values.values())) / truth - 1.0
        print(f"start {factor:.2g} off: {errors[0]:+.2%}, {errors[1]:+.2%} in {cost:.1f} solves of {forward:.1f} s")
    random, inside = np.random.default_rng(1), np.zeros(2)
    for _ in range(TRIALS):
        noisy = readings * np.exp(0.01 * random.standard_normal(10))
        result = fit(ball, [beam], there, noisy, names, TRUTH, noise=0.01)
        inside += np.abs(np.array(list(result.values.values())) - truth) < np.array(list(result.errors.values()))
    print(f"within one standard deviation: {inside[0] / TRIALS:.0%}, {inside[1] / TRIALS:.0%} of {TRIALS} fits")


def main() -> None:
    """Print all of it."""
    measure_rows(int(sys.argv[1]) if len(sys.argv) > 1 else 0)
    measure_fits()


if __name__ == "__main__":
    main()
