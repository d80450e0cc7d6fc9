"""The readings of the shipped case ``finger-fit``: ``python -m tests.benchmarks.finger_readings``; needs NGSolve.

Two beams, ten fibres on a finger with a bone, by NGSolve with elements of third order on the exact cylinders, which
knows nothing of what tetlux subtracts, on two meshes, of which the finer counts; and 1 % of noise of a fixed seed.
Prints the rows of ``finger-fit.csv`` and the largest difference between the two meshes, .23 %.
"""

import csv
import sys

import numpy as np

from tetlux.cases.chart.peers import exact_shapes, run_peer
from tetlux.cases.file.case import Case
from tetlux.cases.file.load import load_cases
from tetlux.cases.shipped import find_case_file
from tetlux.fem import FibreDetector, Medium
from tetlux.fem.body.body import Body
from tetlux.fem.body.partition import SurfacePartition
from tetlux.meshing.arrays import FloatArray

# Sigma_a and sigma_s' of the finger and its bone, 1/mm.
TRUTH, BONE = (0.02, 1.0), (0.03, 1.6)
NOISE, SEED = 0.01, 7
GRADINGS = (0.3, 0.2)
# Points on the end of a fibre.
SAMPLES = 32


def exact_readings(case: Case, resolution: float) -> FloatArray:
    """Exitance at the fibres of each beam, (l, d), W/mm²."""
    media = [Medium(sigma_a=sigma_a, sigma_s_prime=reduced, eta=1.4) for sigma_a, reduced in (TRUTH, BONE)]
    inner = [region.surface for region in case.regions]
    body = Body(case.surface, dict(enumerate(media)), SurfacePartition(inner))
    samples = np.vstack(
        [end_of(entry.detector) for entry in case.detectors if isinstance(entry.detector, FibreDetector)]
    )
    rows = []
    for light in case.lights:
        terms = light.deposit_in(body).terms
        job = exact_shapes(case.surface, inner) | {
            "order": 3,
            "diffusion": np.array([each.diffusion for each in media]),
            "sigma_a": np.array([each.sigma_a for each in media]),
            "robin": 1.0 / (2.0 * media[0].boundary_factor),
            "points": terms.points,
            "powers": terms.powers,
            "lengths_to_resolve": np.ones(1),
            "samples": samples,
            "repeats": 1,
            "repeat_seconds": 0.0,
            "resolution": resolution,
        }
        rows.append(run_peer("_peer_ngsolve.py", job)["exitance"].reshape(-1, SAMPLES).mean(axis=1))
    return np.array(rows)


def end_of(fibre: FibreDetector) -> FloatArray:
    """Points spread evenly over the end of a fibre and taken to the cylinder, whose axis is z, (s, 3)."""
    number = np.arange(SAMPLES) + 0.5
    radius, angle = fibre.radius * np.sqrt(number / SAMPLES), np.pi * (1.0 + np.sqrt(5.0)) * number
    center = np.array(fibre.center)
    outward = center * (1.0, 1.0, 0.0) / np.hypot(*center[:2])
    sideways = np.cross((0.0, 0.0, 1.0), outward)
    points = center + radius[:, None] * (
        np.cos(angle)[:, None] * sideways + np.sin(angle)[:, None] * np.array([0.0, 0.0, 1.0])
    )
    points[:, :2] *= (np.hypot(*center[:2]) / np.hypot(points[:, 0], points[:, 1]))[:, None]
    return np.asarray(points)


def main() -> None:
    """Print the rows, and how sure they are."""
    (case,) = load_cases(find_case_file("finger-fit"))
    coarse, fine = (exact_readings(case, each) for each in GRADINGS)
    noisy = fine * (1.0 + NOISE * np.random.default_rng(SEED).standard_normal(fine.shape))
    writer = csv.writer(sys.stdout)
    writer.writerow(["name", "light", "exitance [W/mm²]"])
    for light, row in zip(case.light_names, noisy.tolist(), strict=True):
        writer.writerows([entry.name, light, f"{value:.6g}"] for entry, value in zip(case.detectors, row, strict=True))
    print(f"two meshes differ by {np.abs(coarse / fine - 1.0).max():.2%}", file=sys.stderr)


if __name__ == "__main__":
    main()
