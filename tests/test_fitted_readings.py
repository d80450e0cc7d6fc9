"""Charges that finite elements subtract, fitted for what detectors read; bars of what their ripples do there."""

import numpy as np

from tests.benchmarks.reading_scenes import Scene, random_scene
from tetlux.fem import PointDetector, PointSource, solve
from tetlux.fem.known.split import Subtract
from tetlux.fem.outcome.detectors import read_all
from tetlux.meshing.arrays import FloatArray


def solve_scene(
    scene: Scene, *, asked: bool, subtract: Subtract = "fitted", cache: bool = True
) -> tuple[FloatArray, FloatArray]:
    """True relative errors of readings and their bars, of a run for detectors alone or for the exitance."""
    detectors = [PointDetector(tuple(place)) for place in scene.places.tolist()]
    light = [PointSource(scene.source)]
    if asked:
        solution = solve(
            scene.surface,
            scene.medium,
            light,
            tolerance=None,
            detectors=detectors,
            detector_tolerance=0.01,
            subtract=subtract,
            cache=cache,
        )
    else:
        solution = solve(scene.surface, scene.medium, light)
    found = read_all(detectors, solution)
    errors = np.abs(np.array([reading.exitance for reading in found]) / scene.truth - 1.0)
    return errors, np.array([reading.relative_error for reading in found], dtype=float)


def test_charges_are_fitted_where_detectors_need_them() -> None:
    """Half of the readings of a plate are off by .014 to .036 % where charges are fitted for the exitance."""
    errors, bars = solve_scene(random_scene(61), asked=True)
    # Measured on 12 meshes: .0006 to .008 %, and at most 1.8 bars.
    assert np.median(errors) < 1.1e-4
    assert (errors <= 2.5 * bars).all()
    assert bars.max() <= 0.01


def test_bars_hold_what_ripples_of_charges_do_at_a_detector() -> None:
    """Without their part two of ten readings of a ball that was solved for its exitance are off by four bars."""
    errors, bars = solve_scene(random_scene(56), asked=False)
    # Measured: at most 1.5.
    assert (errors / bars).max() < 2.5
    assert errors.max() > 2e-3


def test_bars_are_as_large_as_what_elements_are_off_by() -> None:
    """Of a plate, which has no gaps, and with images in place of fitted charges, which have no ripples."""
    # Each time the mesher makes another mesh.
    runs = [solve_scene(random_scene(607), asked=True, subtract="half-space", cache=False) for _ in range(3)]
    ratios = np.concatenate([errors / bars for errors, bars in runs])
    # Measured on 30 meshes: .22 to .99, and .37 to .89 of any three of them.
    assert 0.3 < np.sqrt(np.mean(ratios**2)) < 0.95
