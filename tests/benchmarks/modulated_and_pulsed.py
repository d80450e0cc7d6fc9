"""Modulated and pulsed light in a ball against its series: ``python -m tests.benchmarks.modulated_and_pulsed``.

A ball of radius 10 mm with a point source one mean free path below its surface (sigma_a .01, sigma_s' 1, n 1.4). The
series is `tetlux.fem.exact.modulated.sphere`.
CPU seconds are those of the process; wanted are amplitudes within .5 %, phases within .1 degrees and at most 1.8 times
the seconds of steady light, readings in time within 1 % over four decades or marked as not resolved (the largest of
these is printed as a share of the largest of all times), their integral and mean within .2 %. At
30 degrees 29 % of the light arrives before the first time, .05 ns: integral and mean there are with a pulse that is
followed from .005 ns.
"""

import time

import numpy as np

from tetlux.fem import Medium, PointDetector, PointSource, Solution, Transient, solve
from tetlux.fem.exact.modulated.sphere import point_exitance, pulse_exitance
from tetlux.fem.models.modulation import lag
from tetlux.meshing import sphere
from tetlux.meshing.arrays import FloatArray, NumberArray

RADIUS, TISSUE = 10.0, Medium(sigma_a=0.01, sigma_s_prime=1.0, eta=1.4)
# mm/ns.
SPEED = 299.792458 / TISSUE.eta
DEPTH = TISSUE.mean_free_path
ANGLES = (30.0, 60.0, 90.0, 180.0)


def series(rate: complex, angles: FloatArray) -> NumberArray:
    """Exitance at angles, degrees, of light with ``sigma_a + rate/v``, 1/mm²; the rate in 1/ns."""
    gamma = np.radians(angles)
    return point_exitance(TISSUE, radius=RADIUS, source_radius=RADIUS - DEPTH, gamma=gamma, shift=rate / SPEED)


def series_in_time(at: float, angles: FloatArray) -> FloatArray:
    """Exitance after a pulse of 1 J, 1/mm² for each ns, at a time in ns."""
    gamma = np.radians(angles)
    return SPEED * pulse_exitance(TISSUE, radius=RADIUS, source_radius=RADIUS - DEPTH, gamma=gamma, path=SPEED * at)


def main() -> None:
    """Print the errors."""
    angles = np.array(ANGLES)
    places = RADIUS * np.column_stack([np.sin(np.radians(angles)), 0 * angles, np.cos(np.radians(angles))])
    detectors = [PointDetector((x, y, z)) for x, y, z in places.tolist()]
    light = [PointSource((0.0, 0.0, RADIUS - TISSUE.mean_free_path))]
    ball = sphere(RADIUS)
    print(f"at {', '.join(f'{angle:g}' for angle in ANGLES)} degrees from the light")
    seconds = 0.0
    for frequency in (0.0, 100e6, 500e6):
        begin = time.process_time()
        lit = solve(ball, TISSUE, light, detectors=detectors, detector_tolerance=0.005, frequency=frequency)
        taken = time.process_time() - begin
        seconds = seconds or taken
        _print_modulated(lit, series(2j * np.pi * frequency * 1e-9, angles), taken / seconds)
    begin = time.process_time()
    times = np.union1d(np.geomspace(0.05, 2.2, 300), [0.05, 0.1, 0.2, 0.5, 1.0, 2.0])
    pulse = solve(
        ball,
        TISSUE,
        light,
        times=(1e-9 * times).tolist(),
        detectors=detectors,
        tolerance=None,
        detector_tolerance=0.003,
    )
    _print_pulse(pulse, times, angles, time.process_time() - begin)
    before = np.geomspace(0.005, 0.05, 80)
    near = detectors[:1]
    early = solve(
        ball, TISSUE, light, times=(1e-9 * before).tolist(), detectors=near, tolerance=None, detector_tolerance=0.01
    )
    found = np.concatenate([early.readings[:-1, 0], pulse.readings[:, 0]])
    _print_integrals("with light from .005 ns:", 1e-9 * found[:, None], np.union1d(before[:-1], times), angles[:1])


def _print_modulated(lit: Solution, exact: NumberArray, ratio: float) -> None:
    found = np.array([reading.exitance for reading in lit.readings])
    amplitude, phase = abs(found) / abs(exact) - 1, lag(found + 0j) - lag(exact)
    print(
        f"{lit.frequency / 1e6:4.0f} MHz: amplitudes off by {_percent(amplitude)} %, phases by "
        f"{np.array2string(phase, precision=4)} degrees, {ratio:.2f} of the CPU seconds of steady light"
    )


def _print_pulse(pulse: Transient, times: FloatArray, angles: FloatArray, seconds: float) -> None:
    exact = np.array([series_in_time(at, angles) for at in times])
    found = 1e-9 * pulse.readings
    for at in (0.05, 0.1, 0.2, 0.5, 1.0, 2.0):
        row = int(np.searchsorted(times, at - 1e-12))
        share = exact[row] / exact.max(axis=0)
        print(f"{at:4.2f} ns: off by {_percent(found[row] / exact[row] - 1)} %, at {share} of the largest")
    within = exact > 1e-4 * exact.max(axis=0)
    worst = np.where(within & pulse.resolved, np.abs(found / exact - 1), 0).max(axis=0)
    dark = np.where(within & ~pulse.resolved, exact / exact.max(axis=0), 0).max(axis=0)
    print(f"within four decades: largest error {_percent(worst)} %; not resolved up to {_percent(dark)} %")
    _print_integrals("over these times:", found, times, angles)
    solves = sum(len(contour.points) for contour in pulse.contours)
    print(f"{solves} complex solves, {len(pulse.mesh.points):,} nodes, {seconds:.1f} CPU seconds")


def _print_integrals(title: str, found: FloatArray, times: FloatArray, angles: FloatArray) -> None:
    known = np.nan_to_num(found)
    total = np.trapezoid(known, times, axis=0)
    mean = np.trapezoid(known * times[:, None], times, axis=0) / total
    steady, step = series(0.0, angles).real, 1e-3
    exact_mean = -(series(step, angles) - series(-step, angles)).real / (2 * step) / steady
    print(f"{title} integrals off by {_percent(total / steady - 1)} %, means by {_percent(mean / exact_mean - 1)} %")


def _percent(values: NumberArray) -> str:
    return np.array2string(100 * np.asarray(values), precision=3, suppress_small=True)


if __name__ == "__main__":
    main()
