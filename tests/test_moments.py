"""Moments of times of flight, against the series of a ball and moments of what is read at a frequency."""

from dataclasses import replace

import numpy as np
import pytest

from tests.conftest import TISSUE
from tetlux.fem import Medium, PointDetector, PointSource, System, moments
from tetlux.fem.models.modulation import shift_of_frequency
from tetlux.fem.outcome.detectors import read_all
from tetlux.meshing import InputError, Surface, TetMesh

ANGLES = np.radians([30.0, 60.0, 90.0, 180.0])
PLACES = 10.0 * np.column_stack([np.sin(ANGLES), 0.0 * ANGLES, np.cos(ANGLES)])
DETECTORS = [PointDetector((x, y, z)) for x, y, z in PLACES.tolist()]
SOURCE = PointSource((0.0, 0.0, 10.0 - TISSUE.mean_free_path))
# By the series of the ball: mean times, s, and amplitudes of light of 100 MHz over those of steady light.
MEANS = 1e-9 * np.array([0.100740, 0.210647, 0.309261, 0.451200])
RATIOS = np.array([1.721679e-3, 2.750002e-4, 8.720126e-5, 2.411768e-5])
RATIOS /= np.array([1.724342e-3, 2.759599e-4, 8.764252e-5, 2.427919e-5])


@pytest.fixture(scope="module")
def system(ball: Surface, ball_mesh: TetMesh) -> System:
    return System(ball_mesh, TISSUE, ball)


def test_mean_times_and_variances_are_those_of_the_series(system: System) -> None:
    """Measured: means within .05 %; amplitudes fall by ``exp(-omega² variance/2)``, but for fourth cumulants."""
    found = moments(system, [SOURCE, PointSource((0.0, 0.0, -10.0 + TISSUE.mean_free_path))], DETECTORS)
    assert found.mean.shape == (2, 4)
    assert found.mean[0] == pytest.approx(MEANS, rel=0.002)
    assert found.variance[0] == pytest.approx(-2.0 * np.log(RATIOS) / (2e8 * np.pi) ** 2, rel=0.01)
    # The other light is at the place opposite: what reads it at 180 degrees is as near as 0 degrees.
    assert found.mean[1, 2] == pytest.approx(found.mean[0, 2], rel=0.002)
    assert found.raw[0] == pytest.approx(np.ones((2, 4)))


def test_moments_are_derivatives_at_zero_shift(system: System) -> None:
    """By central differences of readings with real shifts."""
    step = 1e-4
    values = np.array(
        [
            [reading.exitance for reading in read_all(DETECTORS, replace(system, shift=shift).solve([SOURCE]))]
            for shift in (-step, 0.0, step)
        ]
    )
    found = moments(system, [SOURCE], DETECTORS, order=3)
    seconds = shift_of_frequency(1.0, TISSUE, "mm").imag / (2.0 * np.pi)
    assert found.readings[0] == pytest.approx(values[1], rel=1e-5)
    assert found.mean[0] == pytest.approx(seconds * (values[0] - values[2]) / (2 * step) / values[1], rel=1e-3)
    second = (values[0] - 2 * values[1] + values[2]) / step**2 / values[1]
    assert found.raw[2, 0] == pytest.approx(seconds**2 * second, rel=1e-2)


def test_light_that_is_not_absorbed_has_moments(ball: Surface, ball_mesh: TetMesh) -> None:
    """It stays longest; the time is as long again in twice the index."""
    clear = Medium(sigma_a=0.0, sigma_s_prime=1.0, eta=1.4)
    system = System(ball_mesh, clear, ball)
    found = moments(system, [SOURCE], DETECTORS, order=1)
    assert (found.mean[0] > 1.1 * MEANS).all()
    assert moments(system, [SOURCE], DETECTORS, order=1, outside_index=2.0).mean == pytest.approx(2 * found.mean)
    with pytest.raises(InputError, match="the variance needs moments of order 2; give order=2"):
        _ = found.variance


def test_what_has_no_moments_is_refused(system: System) -> None:
    for order in (0, 5, 1.5):
        with pytest.raises(InputError, match=rf"order is {order}; give a whole number from 1 to 4"):
            moments(system, [SOURCE], DETECTORS, order=order)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="moments are of what detectors read, and there is none"):
        moments(system, [SOURCE], [])
    with pytest.raises(InputError, match="the system is that of modulated light; give one with shift=0"):
        moments(replace(system, shift=0.01j), [SOURCE], DETECTORS)
    with pytest.raises(InputError, match=r"outside_index is 0\.5; give 1 or more"):
        moments(system, [SOURCE], DETECTORS, outside_index=0.5)
