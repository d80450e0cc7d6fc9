"""Scenes with detectors of their own: each is read by these alone, and the mesh is refined for them."""

import pytest

from tests.conftest import TISSUE
from tetlux.fem import PointDetector, PointSource, solve_each
from tetlux.meshing import InputError, sphere


def test_each_scene_may_have_detectors_of_its_own() -> None:
    """Each scene is read by its own detectors only, and the mesh is refined for these."""
    ball, sources = sphere(10.0), [[PointSource((0.0, 0.0, z))] for z in (8.0, -8.0)]
    top, side, low = (PointDetector(place) for place in ((0.0, 6.0, 8.0), (10.0, 0.0, 0.0), (0.0, 6.0, -8.0)))
    one, two = solve_each(
        ball, TISSUE, sources, detectors=[[top, side], [low]], tolerance=None, detector_tolerance=0.02
    )
    assert [len(solution.readings) for solution in (one, two)] == [2, 1]
    assert two.readings[0].exitance == pytest.approx(one.readings[0].exitance, rel=0.02)
    assert all(reading.relative_error is not None and reading.relative_error < 0.02 for reading in one.readings)
    _, far = solve_each(ball, TISSUE, sources, detectors=[top], tolerance=None, detector_tolerance=0.02)
    assert far.readings[0].exitance < 0.1 * one.readings[0].exitance
    with pytest.raises(InputError, match="there are 1 lists of detectors for 2 scenes; give one for each, or one for"):
        solve_each(ball, TISSUE, sources, detectors=[[top]], tolerance=None, detector_tolerance=0.02)
