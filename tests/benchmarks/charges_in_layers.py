"""Charges in layered bodies: how good, how fast? ``python -m tests.benchmarks.charges_in_layers``.

A point source one mean free path below the scalp. A head of four layers is compared with its series, nested ellipsoids
(40 x 36 x 34 mm, and 5 and 10 mm inside) with readings by finite elements, whose bars are printed. Seconds are of the
processor, of all threads.
"""

import time
from collections.abc import Iterator

import numpy as np

from tests.benchmarks.charges import ellipsoid
from tetlux.fem import Medium, PointDetector, PointSource, Power, Region, solve
from tetlux.fem.exact import layered_ball
from tetlux.fem.meshless.fit import charge_solution
from tetlux.fem.meshless.solution import LightLedger
from tetlux.meshing import Surface, sphere
from tetlux.meshing.arrays import FloatArray

# Scalp, skull, a clear layer .8 mm thin, and brain.
RADII = (36.8, 34.8, 32.0, 31.2)
LAYERS = [
    Medium(sigma_a=a, sigma_s_prime=s, eta=1.4) for a, s in ((0.018, 1.9), (0.016, 1.6), (0.004, 0.3), (0.036, 2.2))
]
ANGLES = np.radians([0.0, 10.0, 20.0, 30.0, 45.0])
AXES, INSET = np.array([40.0, 36.0, 34.0]), 5.0


def head_rows() -> Iterator[str]:
    """Lines of the table of a head of four layers against its series, for more and more charges."""
    depth = RADII[0] - LAYERS[0].mean_free_path
    points = RADII[0] * np.column_stack([np.sin(ANGLES), np.zeros(5), np.cos(ANGLES)])
    right = layered_ball.point_exitance(LAYERS[::-1], RADII[::-1], source_radius=depth, gamma=ANGLES)
    surfaces = [sphere(radius) for radius in RADII]
    for most in (700, 1050, 1400):
        yield layered_row("spheres", surfaces, LAYERS, depth, points, right, most)


def ellipsoid_rows() -> Iterator[str]:
    """Lines of the table of nested ellipsoids against finite elements with bars, for more and more charges."""
    surfaces = [ellipsoid(AXES - INSET * layer) for layer in range(3)]
    media = [LAYERS[0], LAYERS[1], LAYERS[3]]
    depth = float(AXES[2]) - media[0].mean_free_path
    above = 50.0 * np.column_stack([np.sin(ANGLES), np.zeros(5), np.cos(ANGLES)])
    points = surfaces[0].project(above)[0]
    started = time.process_time()
    solution = solve(
        surfaces[0],
        media[0],
        [PointSource((0.0, 0.0, depth))],
        regions=[Region(surface, medium) for surface, medium in zip(surfaces[1:], media[1:], strict=True)],
        tolerance=None,
        detectors=[PointDetector(tuple(point)) for point in points.tolist()],
        detector_tolerance=0.001,
    )
    right = np.array([reading.exitance for reading in solution.readings])
    bars = " | ".join(f"± {reading.relative_error:.3%}" for reading in solution.readings)
    seconds = time.process_time() - started
    yield f"| ellipsoids | finite elements, {len(solution.mesh.points):,} nodes | {seconds:.1f} | | {bars} |"
    for most in (700, 1050, 1400):
        yield layered_row("ellipsoids", surfaces, media, depth, points, right, most)


def layered_row(
    name: str,
    surfaces: list[Surface],
    media: list[Medium],
    depth: float,
    points: FloatArray,
    right: FloatArray,
    most: int,
) -> str:
    """What charges have at points, as a difference to what is right, for a source on the z axis."""
    started = time.process_time()
    solution = charge_solution(
        surfaces[0],
        media[0],
        np.array([[0.0, 0.0, depth]]),
        np.ones((1, 1)),
        [LightLedger(Power(1.0, 0.0, 0.0, 0.0, 0.0))],
        inner=list(zip(surfaces[1:], media[1:], strict=True)),
        tolerance=0.0,
        most=most,
    )
    seconds = time.process_time() - started
    off = " | ".join(f"{each:.3%}" for each in solution.exitance_on(points) / right - 1.0)
    return f"| {name} | {solution.charges} | {seconds:.1f} | {solution.error_estimate:.4%} | {off} |"


def main() -> None:
    """Print the table."""
    print("| body | charges | seconds | estimate | difference at 0° | 10° | 20° | 30° | 45° |")
    print("|---|---|---|---|---|---|---|---|---|")
    for rows in (head_rows(), ellipsoid_rows()):
        for text in rows:
            print(text, flush=True)


if __name__ == "__main__":
    main()
