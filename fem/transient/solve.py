"""`solve_in_time`: light in time after a short pulse, by contours in the Laplace domain.

The mesh is refined for steady light and for light that is modulated as fast as the first time asks for. On it, 24
solves with complex shifts serve all times of a window (`tetlux.fem.transient.contour`). They are made by quadratic
elements and share the assembled matrices, deposits, patches and the places of charges of steady light; fitted charges
have new strengths for each shift.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tetlux.fem.body.body import Body
from tetlux.fem.charges.kernel import equation_of
from tetlux.fem.known.charges import Charges
from tetlux.fem.known.fitted import FittedLight
from tetlux.fem.known.kept_fits import fits_of
from tetlux.fem.known.split import replace_fitted, split_lights
from tetlux.fem.labels import GivenMedia
from tetlux.fem.media.coefficients import AnyMedium, base_of
from tetlux.fem.media.region import Region
from tetlux.fem.models.modulation import seconds_per_length
from tetlux.fem.outcome.detector_kinds import Detector
from tetlux.fem.outcome.detectors import place_detector
from tetlux.fem.outcome.solution import Solution
from tetlux.fem.quadratic.operator import STOP_RESIDUAL, QuadraticOperator
from tetlux.fem.quadratic.scene import QuadraticScene
from tetlux.fem.scenes import build_scenes
from tetlux.fem.solve_scenes import solve_each
from tetlux.fem.sources.light import Light
from tetlux.fem.stopwatch import Stopwatch
from tetlux.fem.transient.contour import contour_for, windows_of
from tetlux.fem.transient.times import DIFFUSE_AFTER, check_times
from tetlux.fem.transient.transient import MeshError, Transient
from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.describe import one_line
from tetlux.meshing.notes import Note
from tetlux.meshing.surface.surface import Surface
from tetlux.meshing.tets.mesh import TetMesh

# The mesh is refined for steady light and for light of this angular frequency times the first time.
FASTEST = 2.5
# Steps of the inverse iteration for the slowest decay, and the share of it up to which contours reach.
STEPS, SAFE_SHARE = 5, 0.9
# Solutions at points before on a contour with which one begins.
NEIGHBOURS = 8
# The largest relative residual at points that hardly count.
ROUGHEST = 1e-3


def solve_in_time(
    body: Surface | TetMesh,
    channels: Sequence[AnyMedium | GivenMedia],
    lights: Sequence[Sequence[Light]],
    times: Sequence[float],
    options: Mapping[str, Any],
) -> list[Transient]:
    """Solve for light in time in each channel: see `tetlux.fem.solve`.

    Parameters
    ----------
    body : Surface or TetMesh
    channels : sequence of medium or mapping
        The medium, or media by label, of each channel.
    lights : sequence of sequences of Light
        Of each channel.
    times : sequence of float
        s, rising.
    options : mapping of str
        Other arguments of `tetlux.fem.solve_each`; the frequency is not used.

    Returns
    -------
    list of Transient

    Raises
    ------
    InputError, RunError
        As `tetlux.fem.solve`.
    """
    watch = Stopwatch()
    given = body if isinstance(body, TetMesh) else options.get("mesh")
    index = options.get("outside_index", 1.0)
    with watch.stage("surface"):
        scenes = build_scenes(body, given, channels, options.get("regions", ()), len(channels), 0.0, index)
        for each in scenes.bodies:
            at = check_times(times, each.outer, scenes.surface.unit, index)
    rate = FASTEST / float(at[0])
    frequencies = [0.0] * len(channels) + [rate / (2.0 * math.pi)] * len(channels)
    regions = [_twice(region) for region in options.get("regions", ())]
    others: dict[str, Any] = {**options, "regions": regions, "frequency": frequencies}
    solutions = solve_each(body, [*channels, *channels], [*lights, *lights], **others)
    subtract = options.get("subtract", "fitted")
    if isinstance(body, TetMesh):
        subtract = replace_fitted(subtract)
    found = []
    for number, each in enumerate(scenes.bodies):
        steady, fast = solutions[number], solutions[number + len(channels)]
        with watch.stage("solve"):
            split = split_lights(lights[number], each, subtract, kept=fits_of(steady.mesh), scene=number)
            delay = seconds_per_length(each.outer, scenes.surface.unit, index)
            pulse = _Pulse(at, delay, rate, tuple(options.get("detectors", ())))
            transient = _follow_contours(pulse, steady, fast, split.fitted)
        found.append(replace(transient, warnings=_notes(transient, fast, each, delay)))
    seconds = watch.read()
    for name, value in solutions[0].seconds.items():
        seconds[name] = seconds.get(name, 0.0) + value
    return [replace(transient, seconds=seconds) for transient in found]


def _twice(region: Region) -> Region:
    """A region with its channels' media repeated, for steady and modulated light."""
    if isinstance(region.medium, AnyMedium):
        return region
    return replace(region, medium=[*region.medium, *region.medium])


@dataclass(frozen=True, eq=False)
class _Pulse:
    """What is asked for.

    Attributes
    ----------
    times : (t,) ndarray
        s.
    delay : float
        The time that light takes for a unit of length, s/unit.
    rate : float
        Angular frequency of the fast light that the mesh was refined for, 1/s.
    detectors : tuple of Detector
    """

    times: FloatArray
    delay: float
    rate: float
    detectors: tuple[Detector, ...]

    __repr__ = one_line


def _follow_contours(pulse: _Pulse, steady: Solution, fast: Solution, fitted: Mapping[int, FittedLight]) -> Transient:
    """Light in time from that at the points of contours."""
    quadratic = steady.quadratic
    assert quadratic is not None
    leftmost = -SAFE_SHARE * slowest_decay(quadratic.operator) / pulse.delay
    contours = tuple(contour_for(pulse.times[window], leftmost) for window in windows_of(pulse.times))
    scenes = []
    for contour in contours:
        solved: list[QuadraticScene] = []
        for point, weight in zip(contour.points.tolist(), contour.weights.tolist(), strict=True):
            stop = min(STOP_RESIDUAL / weight, ROUGHEST)
            solved.append(_solve_shifted(quadratic.scene, fitted, point * pulse.delay, solved[-NEIGHBOURS:], stop))
        scenes.append(tuple(solved))
    of_surface = MeshError(float(np.fmax(steady.error_estimate, fast.error_estimate)), pulse.rate)
    errors = np.array(
        [[reading.relative_error for reading in each.readings] for each in (steady, fast)], dtype=float
    ).reshape(2, -1)
    of_readings = MeshError(errors.max(axis=0), pulse.rate)
    lights = tuple(range(len(quadratic.scene.deposits)))
    placed = tuple(place_detector(detector, steady) for detector in pulse.detectors)
    whole = Transient(pulse.times, steady, placed, contours, tuple(scenes), of_surface, of_readings, lights)
    if len(lights) == 1:
        return whole
    return replace(whole, of_lights=tuple(replace(whole, lights=(light,)) for light in lights))


def _solve_shifted(
    steady: QuadraticScene,
    fitted: Mapping[int, FittedLight],
    shift: complex,
    before: Sequence[QuadraticScene],
    stop_residual: float,
) -> QuadraticScene:
    """The scene with a shift, solved to a relative residual, given some with the shifts before."""
    charges: list[tuple[Charges, ...]] = []
    for light, patches in enumerate(steady.patches):
        own = (
            fitted[light].refit(shift)
            if each.is_fitted
            else replace(each.patch.charges, equation=equation_of(each.patch.charges.medium, shift))
            for each in patches
        )
        charges.append(tuple(own))
    scene = steady.shifted(shift, tuple(charges), tuple(each.solved for each in before), stop_residual)
    _ = scene.solved
    scene.operator.release()
    return scene


def slowest_decay(operator: QuadraticOperator) -> float:
    """The smallest eigenvalue of the matrix of steady light by the mass matrix, 1/unit.

    After a pulse, light decays with this times the speed of light in the end, and no mode decays more slowly.
    """
    modes = np.zeros((operator.space.size, 1))
    modes[: len(operator.mesh.points)] = 1.0
    for _ in range(STEPS):
        modes = operator.solve(operator.mass @ modes, 1e-4)
        modes /= np.abs(modes).max()
    return float(np.vdot(modes, operator.matrix @ modes) / np.vdot(modes, operator.mass @ modes))


def _notes(transient: Transient, fast: Solution, body: Body, delay: float) -> list[str]:
    """Notes of steady and of fast light, and on times and readings."""
    notes = [*transient.steady.warnings]
    notes += [note for note in fast.warnings if getattr(note, "code", "") != "frequency-high" and note not in notes]
    shortest = min(base_of(medium).sigma_t_prime for medium in body.by_label.values())
    gone = float(transient.times[0]) / delay * shortest
    if gone < DIFFUSE_AFTER:
        notes.append(
            Note(
                "times-early",
                f"at the first time, {transient.times[0]:g} s, light has gone {gone:.2g} mean free paths, and diffuses "
                f"after some {DIFFUSE_AFTER:g}; do not rely on what is earlier than that.",
                value=gone,
            )
        )
    return notes
