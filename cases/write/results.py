"""`Results`: the solutions of all channels of a run, and their exitance at the vertices of one surface."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, reduce

import numpy as np

from tetlux.cases.file.case import Case
from tetlux.cases.file.channels import ALL
from tetlux.cases.file.colours import RGB, Bytes, preview
from tetlux.cases.fitting.record import FitRecord
from tetlux.fem.media.medium import Medium
from tetlux.fem.models.modulation import lag, modulus
from tetlux.fem.outcome.exitance_field import ResolvedField
from tetlux.fem.outcome.extremes import extremes
from tetlux.fem.outcome.solution import Solution
from tetlux.fem.outcome.surface_exitance import surface_exitance
from tetlux.fem.planner.solve import AnySolution
from tetlux.fem.transient.transient import Transient
from tetlux.meshing.arrays import FloatArray, NumberArray, freeze
from tetlux.meshing.describe import one_line
from tetlux.meshing.notes import add_prefix
from tetlux.meshing.surface.surface import Surface


@dataclass(frozen=True, eq=False)
class _ChannelSum:
    """The exitance summed over channels, as a `ResolvedField`: of modulated light its modulus; media may differ."""

    channels: tuple[AnySolution, ...]

    @property
    def surface(self) -> Surface:
        return self.channels[0].surface

    @property
    def medium(self) -> Medium:
        return self.channels[0].medium

    @property
    def resolution(self) -> tuple[FloatArray, FloatArray]:
        # The nearest of these points to any place belongs mostly to the channel that is resolved finest there.
        places, sizes = zip(*(channel.resolution for channel in self.channels), strict=True)
        return np.vstack(places), np.concatenate(sizes)

    @property
    def error_estimate(self) -> float:
        return min(channel.error_estimate for channel in self.channels)

    def exitance_on(self, queries: FloatArray) -> FloatArray:
        return np.asarray(sum(modulus(channel.exitance_on(queries)) for channel in self.channels))


@dataclass(frozen=True, eq=False)
class Results:
    """A case, solved.

    Attributes
    ----------
    case : Case
    solutions : tuple of Solution, ChargeSolution or ClosedFormSolution
        One for each channel.
    surface : Surface
        The case's surface, with vertices added where its triangles are too large to show the exitance.
    parts : dict of (v,) ndarray
        Exitance at the surface's vertices by channel and light, W/unit²; complex of modulated light.
    transients : tuple of Transient
        Of a pulse, one for each channel, of which `solutions` are the integrals over time.
    fit : FitRecord, optional
        What was fitted; `case` has the media that were found.
    """

    case: Case
    solutions: tuple[AnySolution, ...]
    surface: Surface
    parts: dict[tuple[str, str], NumberArray]
    transients: tuple[Transient, ...] = ()
    fit: FitRecord | None = None

    def exitance(self, channel: str = ALL, light: str = ALL) -> FloatArray:
        """Exitance (v,) of a channel and a light, or summed over all channels or lights, W/unit².

        Of modulated light it is the modulus of each channel, in which lights interfere.
        """
        names = self.case.channel_names if channel == ALL else (channel,)
        of_channels = [modulus(self._amplitude(name, light)) for name in names]
        return reduce(np.add, of_channels, np.zeros(len(self.surface.points)))

    def shown(self) -> FloatArray:
        """What pictures show at the vertices, (v,), W/unit²: all channels, or of a case with dyes what these emit."""
        case = self.case
        if not case.fluorophores:
            return self.exitance()
        emitted = case.channel_names[len(case.excitations) :]
        return reduce(np.add, [self.exitance(name) for name in emitted])

    def phase(self, channel: str, light: str = ALL) -> FloatArray:
        """How far the exitance of a channel and a light, or of all lights, lags at the vertices, (v,), degrees."""
        return lag(self._amplitude(channel, light))

    def _amplitude(self, channel: str, light: str) -> NumberArray:
        chosen = [part for (c, name), part in self.parts.items() if channel == c and light in (name, ALL)]
        return reduce(np.add, chosen, np.zeros(len(self.surface.points)))

    @property
    def mesh_solutions(self) -> tuple[Solution, ...]:
        """The solutions that have a mesh: all, or none without a mesh."""
        return tuple(solution for solution in self.solutions if isinstance(solution, Solution))

    @property
    def has_colours(self) -> bool:
        """Whether its channels are red, green and blue."""
        return self.case.channel_names == RGB

    @cached_property
    def preview(self) -> tuple[Bytes, float]:
        """Colours (v, 3) of the surface, and the luminance of white, W/unit²; see `cases.file.colours.preview`."""
        return preview(self.surface, np.column_stack([self.exitance(channel) for channel in RGB]))

    def by_channel_and_light(self) -> list[tuple[str, str, AnySolution]]:
        """All solutions with names of channel and light: the sum of lights and, if there are several, each light."""
        found: list[tuple[str, str, AnySolution]] = []
        for channel, solution in zip(self.case.channels, self.solutions, strict=True):
            found.append((channel.name, ALL, solution))
            if len(self.case.light_names) > 1:
                found += [(channel.name, *part) for part in solutions_by_light(list(channel.lights), solution)]
        return found

    __repr__ = one_line


def solutions_by_light(names: list[str], solution: AnySolution) -> list[tuple[str, AnySolution]]:
    """The part of each light in a solution, with the name of the light."""
    return list(zip(names, solution.of_lights or (solution,), strict=True))


def collect_results(case: Case, solutions: Sequence[AnySolution]) -> Results:
    """Choose vertices that resolve the summed exitance, and evaluate the exitance of each channel and light there."""
    simple = len(solutions) == 1 and not case.frequencies[0]
    whole: ResolvedField = solutions[0] if simple else _ChannelSum(tuple(solutions))
    parts = {}
    if not _shows_surface(case) and all(isinstance(solution, Solution) for solution in solutions):
        surface, total = _extremes([solution for solution in solutions if isinstance(solution, Solution)])
    else:
        surface, total = surface_exitance(whole)
    for channel, solution in zip(case.channels, solutions, strict=True):
        for name, part in solutions_by_light(list(channel.lights), solution):
            parts[channel.name, name] = total if part is whole else part.exitance_on(surface.points)
    return Results(case, tuple(solutions), surface, parts)


def _shows_surface(case: Case) -> bool:
    """Whether the exitance is written or drawn, or an even preview of it needs vertices everywhere."""
    return bool(set(case.outputs) - {"volume"}) or case.channel_names == RGB


def _extremes(solutions: list[Solution]) -> tuple[Surface, FloatArray]:
    """The surface with loose vertices where the exitance is largest and least, and the summed exitance there."""
    found = [extremes(solution) for solution in solutions]
    points, total = found[0]
    if len(solutions) > 1:
        points = freeze(np.vstack([each for each, _ in found]))
        total = np.asarray(sum(modulus(solution.exitance_on(points)) for solution in solutions))
    return replace(solutions[0].surface, points=points, repairs=(), warnings=(), shape=None), total


def warnings_of(results: Results) -> list[str]:
    """The warnings of all channels; one that holds for some channels only names them."""
    names, solutions = results.case.channel_names, results.solutions
    channels_by_warning: dict[str, list[str]] = {}
    for name, solution in zip(names, solutions, strict=True):
        # Repairs are reported when the case is read.
        for warning in (each for each in solution.warnings if each not in results.case.repairs):
            channels_by_warning.setdefault(results.case.name_region(warning), []).append(name)
    return [
        *(results.fit.warnings if results.fit else []),
        *results.case.region_warnings,
        *(
            warning if len(channels) == len(names) else add_prefix(warning, f"in {' and '.join(channels)}: ")
            for warning, channels in channels_by_warning.items()
        ),
    ]
