"""A head-like body, read by a pad of fibres: ``python -m tests.benchmarks.head``.

An ellipsoid of five shells (scalp, skull, a clear layer, grey and white matter) with 24 sources and 28 detectors on a
pad, at two wavelengths. Every detector within 40 mm of a source reads it to 2 %, so that each of the 48 scenes has
detectors of its own. From surfaces to readings, the mesher included; nothing is remembered. `--truth` solves once more
with a tolerance of .005, and compares.

The mesher is what takes longest: more than 110 s of CPU, for the clear layer of 2 mm. fTetWild has one envelope for all
surfaces, so that of the thinnest layer is that of all; moving nodes within it takes three quarters of a pass, of which
it needs several, and probably more the narrower it is. `stop_energy` 30 did not end in 285 s on a busy machine either.
With twice the deviation, half of the thickness of a layer (`DEVIATION_OF_THICKNESS`), it took 56 s, for 8,100 nodes; on
that mesh two of the sources at both wavelengths took 22 s of CPU on a busy machine, with 9,400 nodes and bars of .5 %
at most for 30 readings 14 to 36 mm away (all pairs within 40 mm are 214 a wavelength). Charges fitted without a mesh do
not reach 2 % here: for one source, readings from 900 and 1,300 charges (5 and 15 s of CPU) differ by 1 % at 14 mm, and
by up to 12 % at 32 to 34 mm.
"""

import argparse
import time

import numpy as np

from tests.benchmarks.mesher import cpu_seconds, ellipsoid
from tetlux.fem import Medium, PencilBeam, PointDetector, Region, Solution, solve_each
from tetlux.meshing import Surface

# Half axes of the head, mm, and how deep each shell begins.
AXES, DEPTHS = np.array([75.0, 95.0, 85.0]), (0.0, 5.0, 11.0, 13.0, 17.0)
# Absorption and reduced scattering of each shell, 1/mm, at 690 and 830 nm.
COEFFICIENTS = (
    ((0.0159, 0.80), (0.0191, 0.66)),
    ((0.0101, 1.00), (0.0136, 0.86)),
    ((0.0040, 0.30), (0.0040, 0.30)),
    ((0.0178, 1.25), (0.0186, 1.11)),
    ((0.0120, 1.80), (0.0130, 1.60)),
)
FARTHEST, TOLERANCE, SPACING = 40.0, 0.02, 20.0


def scene() -> tuple[list[Surface], list[list[Medium]], list[PencilBeam], list[PointDetector], np.ndarray]:
    """Surfaces from outside in, the media of each at both wavelengths, beams, detectors, and their distances."""
    surfaces = [ellipsoid(*(AXES - depth)) for depth in DEPTHS]
    media = [[Medium(sigma_a=a, sigma_s_prime=s, eta=1.4) for a, s in shell] for shell in COEFFICIENTS]
    sources, detectors = on_pad(4, 6), on_pad(4, 7)
    beams = [
        PencilBeam(tuple((place + 20.0 * normal).tolist()), tuple((-normal).tolist()))
        for place, normal in zip(sources, normals(sources), strict=True)
    ]
    points = [PointDetector((x, y, z)) for x, y, z in detectors.tolist()]
    return surfaces, media, beams, points, np.linalg.norm(sources[:, None] - detectors, axis=2)


def on_pad(rows: int, columns: int) -> np.ndarray:
    """Places of a grid on the top of the head; detectors, with a column more, lie between sources."""
    shift = 0.25 * SPACING * (1 if columns % 2 else -1)
    x = SPACING * (np.arange(rows) - 0.5 * (rows - 1)) + shift
    y = SPACING * (np.arange(columns) - 0.5 * (columns - 1))
    x, y = (each.ravel() for each in np.meshgrid(x, y, indexing="ij"))
    z = AXES[2] * np.sqrt(1.0 - (x / AXES[0]) ** 2 - (y / AXES[1]) ** 2)
    return np.column_stack([x, y, z])


def normals(places: np.ndarray) -> np.ndarray:
    """Outward unit normals of the head."""
    found = places / AXES**2
    return np.asarray(found / np.linalg.norm(found, axis=1, keepdims=True))


def solve_head(tolerance: float, *, say: bool = True) -> list[Solution]:
    """Solve for all sources at both wavelengths, each with the detectors near it."""
    (outer, *inner), (body, *shells), beams, points, distances = scene()
    near = [[point for point, far in zip(points, row, strict=True) if far <= FARTHEST] for row in distances]
    count = len(beams)
    started = time.perf_counter(), cpu_seconds()

    def report(line: str) -> None:
        if say:
            print(
                f"  {time.perf_counter() - started[0]:6.1f} s, CPU {cpu_seconds() - started[1]:6.1f} s: {line}",
                flush=True,
            )

    return solve_each(
        outer,
        [body[i] for i in (0, 1) for _ in beams],
        [[beam] for _ in (0, 1) for beam in beams],
        regions=[
            Region(surface, [medium[i] for i in (0, 1) for _ in range(count)])
            for surface, medium in zip(inner, shells, strict=True)
        ],
        tolerance=None,
        detectors=near * 2,
        detector_tolerance=tolerance,
        cache=False,
        report=report,
    )


def main() -> None:
    """Print the seconds, the size of the mesh, and the errors of readings."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--truth", action="store_true", help="compare with a tolerance of .005")
    arguments = parser.parse_args()
    started, cpu = time.perf_counter(), cpu_seconds()
    found = solve_head(TOLERANCE)
    readings = [reading for solution in found for reading in solution.readings]
    bars = np.array([reading.relative_error for reading in readings], dtype=float)
    print(f"{time.perf_counter() - started:.1f} s, {cpu_seconds() - cpu:.1f} s of CPU; {found[0].mesh}")
    print(f"{len(readings)} readings; bars: median {np.median(bars):.2%}, largest {bars.max():.2%}")
    if arguments.truth:
        finer = [reading for solution in solve_head(0.25 * TOLERANCE) for reading in solution.readings]
        off = np.abs([a.exitance / b.exitance - 1.0 for a, b in zip(readings, finer, strict=True)])
        print(f"off a tolerance of {0.25 * TOLERANCE:g}: median {np.median(off):.2%}, largest {off.max():.2%}")


if __name__ == "__main__":
    main()
