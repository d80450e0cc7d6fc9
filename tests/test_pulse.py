"""What is read in time after a pulse, against the series of a ball (by Talbot's contour)."""

import numpy as np
import pytest

from tests.conftest import TISSUE
from tetlux.fem import PointDetector, PointSource, System, Transient, read_pulse
from tetlux.meshing import InputError, Surface, TetMesh

ANGLES = np.radians([90.0, 180.0])
PLACES = 10.0 * np.column_stack([np.sin(ANGLES), 0.0 * ANGLES, np.cos(ANGLES)])
DETECTORS = [PointDetector((x, y, z)) for x, y, z in PLACES.tolist()]
SOURCE = PointSource((0.0, 0.0, 10.0 - TISSUE.mean_free_path))
# By time, ns: exitance at 90 and 180 degrees, 1/mm² for each ns.
SERIES = {0.2: (3.010444e-4, 2.150710e-5), 0.5: (6.717566e-5, 4.384983e-5), 1.0: (2.21007e-6, 2.1459e-6)}


@pytest.fixture(scope="module")
def system(ball: Surface, ball_mesh: TetMesh) -> System:
    return System(ball_mesh, TISSUE, ball)


@pytest.fixture(scope="module")
def found(system: System) -> Transient:
    times = np.concatenate([np.geomspace(0.06e-9, 2.6e-9, 300), 1e-9 * np.array(list(SERIES))])
    return read_pulse(system, [SOURCE], DETECTORS, times.tolist())


def test_readings_in_time_are_those_of_the_series(found: Transient) -> None:
    """Measured on 700 nodes: within .1 %; on 3,400 nodes within .03 % from .05 ns on."""
    expected = 1e9 * np.array(list(SERIES.values()))
    assert found.exitance[300:, 0] == pytest.approx(expected, rel=0.01)
    assert (np.abs(found.exitance[300:, 0] - expected) <= 3.0 * found.error[300:, 0]).all()
    # No light has reached the far side by .06 ns.
    assert np.isnan(found.exitance[0, 0, 1])
    assert not (found.exitance < 0).any()


def test_the_integral_over_time_is_the_steady_reading(found: Transient) -> None:
    """And its mean is the mean time. Before and after the window there are some thousandths of the light."""
    times, values = found.times[:300], np.nan_to_num(found.exitance[:300, 0])
    total = np.trapezoid(values, times, axis=0)
    assert total == pytest.approx([8.764252e-5, 2.427919e-5], rel=0.005)
    assert np.trapezoid(values * times[:, None], times, axis=0) / total == pytest.approx(
        [3.09261e-10, 4.512e-10], rel=0.005
    )


@pytest.mark.parametrize(
    ("times", "words"),
    [
        ([], "times are in s after the pulse, each greater than 0; give at least one"),
        ([0.0, 1e-9], "each greater than 0"),
        ([np.nan], "each greater than 0"),
        ([1e-11, 1e-9], r"times reach from 1e-11 to 1e-09 s; give windows whose end is at most 50 times their begin"),
    ],
)
def test_what_are_no_times_is_refused(system: System, times: list[float], words: str) -> None:
    with pytest.raises(InputError, match=words):
        read_pulse(system, [SOURCE], DETECTORS, times)


def test_a_pulse_needs_a_detector(system: System) -> None:
    with pytest.raises(InputError, match="a pulse is read by detectors, and there is none"):
        read_pulse(system, [SOURCE], [], [1e-9])
