"""Scenarios of modulated light, light in time, and sensitivities: a point source in a ball, lengths in mean free paths.

Each has a function that finds values with error bars, which are held against closed forms as readings are.
"""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from tetlux.cases.stress.scenes.readout import MOST_TETRAHEDRA, Readout, bars_of
from tetlux.cases.stress.scenes.scenarios import TOLERANCE, Scenario, medium_of_albedo, mesh_of_unit_edges
from tetlux.fem import Medium, PointSource, System, sensitivity, solve
from tetlux.fem.exact.modulated.sphere import point_exitance, pulse_exitance
from tetlux.fem.models.modulation import seconds_per_length
from tetlux.meshing import shapes
from tetlux.meshing.arrays import FloatArray, NumberArray

# Angles from the source at which readings are taken.
PLACES = {"near": (0.1, 0.3), "far": (1.0, 1.6), "behind": (2.6, math.pi)}
# Times of a pulse, as the way that light has come over the radius of the ball.
TIMES = {"early": (1.5, 2.0, 3.0), "late": (10.0, 30.0, 60.0)}
RADIUS, DEPTH, ALBEDO = 10.0, 1.0, 0.99
# Step of the differences of closed forms, as a share of a coefficient.
STEP = 1e-4
UNIT = "mm"


def modulated_by_wave_number_and_ratio(decay: float, ratio: float) -> Scenario:
    """A point in a ball on a mesh of mean edge length h = 1, by ``|k| h`` and ``omega/(v sigma_a)``."""
    mesh = mesh_of_unit_edges()
    radius = float(np.linalg.norm(mesh.points, axis=1).max())
    # |k|² is 3 sigma_a sigma_t' (1 + ratio²)^(1/2).
    sigma_tr, absorbed = decay / (1.0 + ratio**2) ** 0.25, 0.03 if decay < 1.0 else 0.1
    medium = medium_of_albedo(1.0 - absorbed, free_path=math.sqrt(3.0 * absorbed) / sigma_tr)
    made = _modulated(medium, radius, 1.5, ratio * medium.sigma_a, PLACES["near"] + PLACES["far"])
    return replace(made, mesh=mesh)


def modulated_by_frequency_and_place(frequency: float, place: str) -> Scenario:
    """A point in a ball, by ``omega/(v sigma_t')`` and where it is read."""
    medium = medium_of_albedo(ALBEDO)
    return _modulated(medium, RADIUS, DEPTH, frequency * medium.sigma_t_prime, PLACES[place])


def pulse_by_radius_and_time(radius: float, times: str) -> Scenario:
    """A point in a ball after a pulse, by its radius and how late it is read."""
    medium, angles = medium_of_albedo(ALBEDO), PLACES["near"] + PLACES["far"]
    paths = radius * np.array(TIMES[times])
    truth = np.array(
        [
            pulse_exitance(medium, radius=radius, source_radius=radius - DEPTH, gamma=angles, path=path)
            for path in paths.tolist()
        ]
    )
    seconds = seconds_per_length(medium, UNIT)

    def read(scenario: Scenario) -> Readout:
        found = solve(
            scenario.surface,
            scenario.medium,
            [scenario.light],
            times=(seconds * paths).tolist(),
            tolerance=None,
            detectors=scenario.detectors,
            detector_tolerance=TOLERANCE,
            most_tetrahedra=MOST_TETRAHEDRA,
        )
        # What is not resolved is nan, and claims nothing.
        known = np.isfinite(found.readings)
        values = np.where(known, found.readings * seconds, truth)
        bars = np.where(known, found.errors / np.abs(found.readings), 0.0)
        return Readout(values.ravel(), bars.ravel(), len(found.mesh.points), tuple(found.warnings))

    return _scenario(medium, radius, DEPTH, angles, truth.ravel(), read)


def sensitivity_by_albedo_and_place(albedo: float, place: str) -> Scenario:
    """Derivatives of what is read to both coefficients of a ball, summed over the nodes of its mesh."""
    medium, angles = medium_of_albedo(albedo), PLACES[place]
    truth = np.concatenate([_slopes(medium, name, angles) for name in ("sigma_a", "sigma_s_prime")])

    def read(scenario: Scenario) -> Readout:
        detectors = scenario.detectors
        solution = solve(
            scenario.surface,
            scenario.medium,
            [scenario.light],
            tolerance=None,
            detectors=detectors,
            detector_tolerance=TOLERANCE,
            most_tetrahedra=MOST_TETRAHEDRA,
        )
        found = sensitivity(System(solution.mesh, scenario.medium, scenario.surface), [scenario.light], detectors)
        values = np.concatenate([each[0].sum(axis=1) for each in found.derivatives.values()])
        return Readout(
            values, np.tile(bars_of(solution.readings), 2), len(solution.mesh.points), tuple(solution.warnings)
        )

    return _scenario(medium, RADIUS, DEPTH, angles, truth, read)


def _modulated(medium: Medium, radius: float, depth: float, shift: float, angles: tuple[float, ...]) -> Scenario:
    """A point in a ball of modulated light, ``omega/v`` given, 1/unit."""
    truth = point_exitance(medium, radius=radius, source_radius=radius - depth, gamma=angles, shift=1j * shift)

    def read(scenario: Scenario) -> Readout:
        found = solve(
            scenario.surface,
            scenario.medium,
            [scenario.light],
            mesh=scenario.mesh,
            tolerance=None,
            detectors=scenario.detectors,
            detector_tolerance=TOLERANCE,
            frequency=shift / (2.0 * math.pi * seconds_per_length(medium, UNIT)),
            most_tetrahedra=MOST_TETRAHEDRA,
        )
        values = np.array([reading.exitance for reading in found.readings])
        return Readout(values, bars_of(found.readings), len(found.mesh.points), tuple(found.warnings))

    return _scenario(medium, radius, depth, angles, truth, read)


def _scenario(
    medium: Medium,
    radius: float,
    depth: float,
    angles: tuple[float, ...],
    truth: NumberArray,
    read: Callable[[Scenario], Readout],
) -> Scenario:
    places = radius * np.column_stack([np.sin(angles), np.zeros(len(angles)), np.cos(angles)])
    light = PointSource((0.0, 0.0, radius - depth))
    return Scenario(shapes.sphere(radius), medium, light, readings=(places, truth), read=read)


def _slopes(medium: Medium, name: str, angles: tuple[float, ...]) -> FloatArray:
    """Derivatives of the closed form to a coefficient, the source staying where it is."""
    value = getattr(medium, name)
    sides = []
    for step in (1.0 + STEP, 1.0 - STEP):
        changed = replace(medium, **{name: step * value})
        sides.append(point_exitance(changed, radius=RADIUS, source_radius=RADIUS - DEPTH, gamma=angles).real)
    return np.asarray((sides[0] - sides[1]) / (2.0 * STEP * value))
