"""Light in time after a pulse, against the series of a ball (by Talbot's contour)."""

import numpy as np
import pytest

from tests.conftest import TISSUE
from tetlux.fem import DiscDetector, Medium, PointDetector, PointSource, Region, Transient, solve
from tetlux.fem.exact.modulated.sphere import pulse_exitance
from tetlux.fem.transient.contour import LONGEST_WINDOW, contour_for, windows_of
from tetlux.fem.transient.solve import slowest_decay
from tetlux.meshing import InputError, Surface, TetMesh, sphere

ANGLES = np.radians([30.0, 90.0, 180.0])
PLACES = 10.0 * np.column_stack([np.sin(ANGLES), 0.0 * ANGLES, np.cos(ANGLES)])
DETECTORS = [PointDetector((x, y, z)) for x, y, z in PLACES.tolist()]
SOURCE = PointSource((0.0, 0.0, 10.0 - TISSUE.mean_free_path))
# By time, ns: exitance at 30, 90 and 180 degrees, 1/mm² for each ns.
SERIES = {
    0.05: (1.73357193e-02, 4.95515856e-07, 0.0),
    0.1: (8.21996409e-03, 7.60779144e-05, 1.5533e-07),
    0.2: (1.89148950e-03, 3.01044439e-04, 2.15071359e-05),
    0.5: (9.25365448e-05, 6.71756601e-05, 4.38498220e-05),
    1.0: (2.26602834e-06, 2.21007288e-06, 2.14596283e-06),
    2.0: (2.32237704e-09, 2.32204801e-09, 2.32166748e-09),
}
STEADY, MEAN = (1.724342e-3, 8.764252e-5, 2.427919e-5), (1.00740e-10, 3.09261e-10, 4.512e-10)


@pytest.fixture(scope="module")
def found(ball: Surface, ball_mesh: TetMesh) -> Transient:
    """On a mesh of 700 nodes."""
    times = np.concatenate([1e-9 * np.array(list(SERIES)), np.geomspace(0.05e-9, 2.2e-9, 400)])
    return solve(ball, TISSUE, [SOURCE], times=np.unique(times).tolist(), detectors=DETECTORS, mesh=ball_mesh)


def rows(found: Transient) -> np.ndarray:
    return np.searchsorted(found.times, 0.999999e-9 * np.array(list(SERIES)))


def test_readings_in_time_are_those_of_the_series(found: Transient) -> None:
    """Measured on 2,100 nodes, refined for readings to .01: within .01 % at 30 degrees, over seven decades."""
    expected = 1e9 * np.array(list(SERIES.values()))
    readings, errors = found.readings[rows(found)], found.errors[rows(found)]
    assert readings[:, 0] == pytest.approx(expected[:, 0], rel=6e-3)  # measured: .2 %, of the last time
    assert readings[1:, 1] == pytest.approx(expected[1:, 1], rel=1e-2)  # .3 %, of the first
    assert readings[2:, 2] == pytest.approx(expected[2:, 2], rel=3e-3)  # .06 %
    resolved = found.resolved[rows(found)]
    assert (np.abs(readings - expected) <= 5.0 * errors)[resolved].all()
    assert (found.digits[rows(found)][1:-1, 0] > 1.5).all()


def test_what_has_not_arrived_is_not_resolved(found: Transient) -> None:
    """Of the far side at .05 ns, 1e-12 of its largest, no noise is shown; what is shown is above zero."""
    assert not found.resolved[rows(found)[0], 2]
    assert not found.resolved[0, 1:].any()
    assert (found.readings[found.resolved] > 0).all()
    assert np.isnan(found.digits[~found.resolved]).all()
    assert not (found.exitance <= 0).any()


@pytest.mark.slow
def test_the_integral_over_time_is_the_steady_reading(found: Transient) -> None:
    """And its mean is the mean time. At 30 degrees 29 % of the light arrives before the window.

    What is not resolved counts as the series has it: at 180 degrees .2 % on so few nodes.
    """
    times, shown = found.times, found.resolved[:, 1:]
    speed = 299.792458e9 / TISSUE.eta  # mm/s
    series = np.full(shown.shape, np.nan)
    for row in np.flatnonzero(~shown.all(axis=1)):
        series[row] = speed * pulse_exitance(
            TISSUE, radius=10.0, source_radius=SOURCE.position[2], gamma=ANGLES[1:], path=speed * float(times[row])
        )
    lacking = np.trapezoid(np.where(shown, 0.0, series), times, axis=0)
    assert (lacking < 4e-3 * np.array(STEADY[1:])).all()
    values = np.where(shown, found.readings[:, 1:], series)
    total = np.trapezoid(values, times, axis=0)
    assert total == pytest.approx(STEADY[1:], rel=2e-3)
    assert total == pytest.approx([reading.exitance for reading in found.steady.readings[1:]], rel=2e-3)
    assert np.trapezoid(values * times[:, None], times, axis=0) / total == pytest.approx(MEAN[1:], rel=2e-3)


def test_exitance_at_points_is_what_detectors_there_read(found: Transient) -> None:
    at = found.exitance_at([*PLACES.tolist(), [np.nan, 0.0, 0.0]])
    both = np.isfinite(at[:, :3]) & found.resolved
    assert both[rows(found)[1:], :2].all()
    assert at[:, :3][both] == pytest.approx(found.readings[both], rel=3e-3)
    assert np.isnan(at[:, 3]).all()
    # And at nodes: those that lie on the surface of the ball.
    at_nodes = found.exitance_at(found.mesh.points[found.mesh.boundary_nodes])
    row = rows(found)[2]
    assert found.exitance[row] == pytest.approx(at_nodes[row], rel=1e-3)


def test_lights_add_up_and_a_region_of_the_same_medium_changes_nothing(
    ball: Surface, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With images on patches in place of fitted charges. A power of 3 W is a pulse of 3 J."""
    monkeypatch.setattr("tetlux.fem.transient.contour.POINTS", 12)
    disc = DiscDetector((10.0, 0.0, 0.0), radius=1.0)
    lights = [SOURCE, PointSource((0.0, 0.0, -9.0), power=3.0)]
    found = solve(
        ball,
        TISSUE,
        lights,
        times=[2e-10, 5e-10],
        regions=[Region(sphere(5.0), TISSUE)],
        tolerance=None,
        detectors=[DETECTORS[1], disc],
        detector_tolerance=0.05,
    )
    one, other = found.of_lights
    assert one.readings + other.readings == pytest.approx(found.readings, rel=1e-9)
    expected = 1e9 * np.array([SERIES[0.2][1], SERIES[0.5][1]])
    assert one.readings[:, 0] == pytest.approx(expected, rel=0.01)
    assert other.readings[:, 0] == pytest.approx(3.0 * expected, rel=0.1)  # .1 mm nearer to the detector
    assert found.powers[:, 1] == pytest.approx(np.pi * found.readings[:, 1])
    assert np.isnan(found.powers[:, 0]).all()


def test_channels_have_a_transient_each(ball: Surface, ball_mesh: TetMesh, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tetlux.fem.transient.contour.POINTS", 8)
    darker = Medium(sigma_a=0.02, sigma_s_prime=1.0, eta=1.4)
    pair = solve(ball, [TISSUE, darker], [SOURCE], times=[3e-10], mesh=ball_mesh, detectors=DETECTORS)
    first, second = pair
    assert first.mesh is second.mesh is ball_mesh
    # D changes by 1 % too.
    expected = np.exp(-0.01 * 299.792458 / 1.4 * 0.3)
    assert second.readings / first.readings == pytest.approx(expected, rel=0.05)


def test_contours_invert_what_is_known() -> None:
    """``1/(s + a)^2`` is the transform of ``t exp(-a t)``, ``exp(-sqrt(s r))`` that of a front that is late."""
    for ratio in (1.0, 5.0, LONGEST_WINDOW):
        times = np.geomspace(1.0 / ratio, 1.0, 9)
        contour = contour_for(times, -2.0)
        values = 1.0 / (contour.points + 3.0) ** 2
        assert contour.invert(values) == pytest.approx(times * np.exp(-3.0 * times), rel=1e-4)
        assert contour.slopes(values) == pytest.approx((1.0 - 3.0 * times) * np.exp(-3.0 * times), rel=1e-4, abs=1e-4)
        off = np.abs(contour.invert(values) - times * np.exp(-3.0 * times))
        assert (off <= contour.error(values)).all()
        assert (contour.error(values) <= 2e-3 * times * np.exp(-3.0 * times)).all()
        contour = contour_for(times)
        front = np.exp(-np.sqrt(40.0 * contour.points))
        known = np.sqrt(10.0 / np.pi / times**3) * np.exp(-10.0 / times)
        assert (np.abs(contour.invert(front) - known) <= contour.error(front)).all()


def test_the_guard_sees_a_contour_of_too_few_points(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tetlux.fem.transient.contour.POINTS", 7)
    times = np.geomspace(0.02, 1.0, 30)
    contour = contour_for(times)
    values = 1.0 / (contour.points + 3.0)
    off = np.abs(contour.invert(values) - np.exp(-3.0 * times))
    assert off.max() > 1e-4
    assert (off <= contour.error(values)).all()


def test_windows_hold_all_times_once() -> None:
    times = np.geomspace(1e-11, 1e-8, 50)
    windows = windows_of(times)
    assert len(windows) == 2
    assert np.concatenate([times[window] for window in windows]).tolist() == times.tolist()
    assert all(times[window][-1] <= 1.001 * LONGEST_WINDOW * times[window][0] for window in windows)


def test_light_decays_at_last_as_the_slowest_mode(found: Transient) -> None:
    quadratic = found.steady.quadratic
    assert quadratic is not None
    decay = slowest_decay(quadratic.operator)
    late = found.readings[-1, 1] / found.readings[-2, 1]
    gone = (found.times[-1] - found.times[-2]) * 299.792458e9 / 1.4
    assert decay == pytest.approx(-np.log(late) / gone, rel=2e-3)


@pytest.mark.parametrize(
    ("times", "words"),
    [
        ([], "times are in s after the pulse, each greater than 0; give a list with at least one"),
        ([0.0, 1e-9], "each greater than 0"),
        ([np.nan], "each greater than 0"),
        (1e-9, "each greater than 0; give a list"),
        (["soon"], "times are not a list of numbers"),
        ([2e-9, 1e-9], "times do not rise; sort them, and give each once"),
        ([1e-9, 1e-9], "times do not rise"),
        (
            [1e-12],
            r"the first time is 1e-12 s, when light has gone 0\.22 mean free paths .* begin at 4\.6e-11 s or later",
        ),
    ],
)
def test_what_are_no_times_is_refused(times: list[float], words: str, ball: Surface) -> None:
    with pytest.raises(InputError, match=words):
        solve(ball, TISSUE, [SOURCE], times=times)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"frequency": 1e8}, "there are times and a frequency; give one of the two"),
        ({"model": "truncated"}, 'model "truncated" does not take times'),
        ({"everywhere_tolerance": 0.1}, "everywhere_tolerance and volume_tolerance are not for light in time"),
    ],
)
def test_what_does_not_go_with_times_is_refused(options: dict[str, object], words: str, ball: Surface) -> None:
    with pytest.raises(InputError, match=words):
        solve(ball, TISSUE, [SOURCE], times=[1e-9], **options)  # type: ignore[call-overload]


def test_times_before_light_diffuses_are_reported(
    ball: Surface, ball_mesh: TetMesh, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("tetlux.fem.transient.contour.POINTS", 1)
    early = solve(ball, TISSUE, [SOURCE], times=[2e-11, 1e-9], mesh=ball_mesh)
    assert any(note.startswith("at the first time, 2e-11 s, light has gone 4.3 mean free") for note in early.warnings)
    later = solve(ball, TISSUE, [SOURCE], times=[6e-11, 1e-9], mesh=ball_mesh)
    assert not any(note.startswith("at the first time") for note in later.warnings)


def test_late_light_of_the_series_is_its_slowest_mode() -> None:
    """The same everywhere but for a factor, however much is absorbed meanwhile; the next mode is .3 % of it then."""
    gamma, medium = np.linspace(0.1, 3.0, 5), Medium(sigma_a=0.01, sigma_s_prime=0.99, eta=1.4)
    earlier, later = (
        pulse_exitance(medium, radius=30.0, source_radius=29.0, gamma=gamma, path=path) for path in (2400.0, 3000.0)
    )
    np.testing.assert_allclose(later / earlier, later[-1] / earlier[-1], rtol=0.005)
    assert (earlier > 0).all()
