"""`make_plan`: which runs share a surface, a mesh and systems."""

import itertools
from collections.abc import Hashable, Iterator, Sequence

import numpy as np

from tetlux.cases.batch.plan import Plan, PlannedMesh, PlannedSurface, PlannedTask
from tetlux.cases.file.case import Case
from tetlux.fem.known.kept_fits import OTHER_DEPTH
from tetlux.fem.media.coefficients import AnyMedium
from tetlux.meshing.mesher.cache import mesh_key

# Fewer runs than this share no mesh: adapting one takes as long as a run or more.
FEWEST_TO_SHARE = 4
# A mesh is adapted for one run in so many, at most for MOST_PILOTS.
RUNS_PER_PILOT, MOST_PILOTS = 16, 3
# Runs of a task, at most; fewer if there would be fewer than FEWEST_TASKS.
MOST_RUNS_OF_TASK, FEWEST_TASKS = 50, 64
# Lights that a task has in all of its media.
LIGHTS_AT_ONCE = 4


def make_plan(cases: Sequence[Case]) -> Plan:
    """Group runs by what they share.

    Runs of one body, tolerance and detectors share a mesh. Such a group is divided into tasks of similar runs, which
    share places of charges and systems.

    Parameters
    ----------
    cases : sequence of Case

    Returns
    -------
    Plan
    """
    surfaces: dict[Hashable, PlannedSurface] = {}
    groups: dict[Hashable, list[int]] = {}
    surface_of: dict[Hashable, int] = {}
    keys = _BodyKeys()
    for number, case in enumerate(cases):
        body = keys.of(case)
        planned = surfaces.setdefault(body, PlannedSurface(len(surfaces), _name(case), len(case.surface.faces)))
        key: Hashable = (body, *_wanted(case)) if _makes_mesh(case) else (body, number)
        groups.setdefault(key, []).append(number)
        surface_of[key] = planned.number
    meshes: list[PlannedMesh] = []
    tasks: list[PlannedTask] = []
    leaders = list(range(len(cases)))
    longest = min(MOST_RUNS_OF_TASK, max(1, len(cases) // FEWEST_TASKS))
    for number, (key, runs) in enumerate(groups.items()):
        meshes.append(PlannedMesh(number, surface_of[key], _pilots(runs), len(runs)))
        for leader, followers in _leaders(cases, runs):
            for run in followers:
                leaders[run] = leader
        for some in _divide(_in_order(cases, runs), longest):
            tasks.append(PlannedTask(len(tasks), number, some, _systems(cases, some)))
    lights = sum(len(channel.lights) for case in cases for channel in case.channels)
    names = tuple(case.name for case in cases)
    return Plan(names, tuple(surfaces.values()), tuple(meshes), tuple(tasks), tuple(leaders), lights)


def spread(runs: Sequence[int], count: int) -> list[int]:
    """So many of the runs, evenly spread over their order, the first and the last among them."""
    chosen = np.linspace(0, len(runs) - 1, min(count, len(runs))).round().astype(int)
    return [runs[i] for i in dict.fromkeys(chosen.tolist())]


class _BodyKeys:
    """Keys of bodies by their content; each surface is hashed once."""

    def __init__(self) -> None:
        # Surfaces are kept too, so that no other object gets their id.
        self._known: dict[tuple[int, ...], tuple[str, tuple[object, ...]]] = {}

    def of(self, case: Case) -> str:
        inner = tuple(region.surface for region in case.regions)
        parts: tuple[object, ...] = (case.surface, case.mesh, *inner)
        key = tuple(map(id, parts))
        if key not in self._known:
            text = mesh_key(case.surface, inner) if case.mesh is None else f"mesh {id(case.mesh)}"
            self._known[key] = text, parts
        return self._known[key][0]


def _name(case: Case) -> str:
    if case.mesh is not None and case.spec.mesh is not None:
        return case.spec.mesh.file
    return case.surface.name


def _makes_mesh(case: Case) -> bool:
    """Whether the run makes a mesh that others can begin with."""
    model = case.spec.model if case.plan is None else case.plan.chosen
    return case.mesh is None and model == "full" and not case.fluorophores and case.fit is None


def _wanted(case: Case) -> tuple[Hashable, ...]:
    """What a mesh is refined for, besides lights and media."""
    detectors = tuple(repr(entry.detector) for entry in case.detectors) if case.detector_tolerance else ()
    tolerances = (case.tolerance, case.detector_tolerance, case.everywhere_tolerance, case.volume_tolerance)
    return case.surface.unit, *tolerances, detectors, case.frequencies, case.outside_index


def _pilots(runs: Sequence[int]) -> tuple[int, ...]:
    if len(runs) < FEWEST_TO_SHARE:
        return ()
    return tuple(spread(runs, min(MOST_PILOTS, 1 + len(runs) // RUNS_PER_PILOT)))


def _media(case: Case) -> tuple[Hashable, ...]:
    """Its media in each channel, as a key."""
    body = tuple(channel.medium for channel in case.channels)
    return (*body, *(tuple(_list_of(region.medium)) for region in case.regions))


def _list_of(medium: AnyMedium | Sequence[AnyMedium]) -> Sequence[AnyMedium]:
    return [medium] if isinstance(medium, AnyMedium) else medium


def _lights(case: Case) -> str:
    return repr([tuple(channel.lights.items()) for channel in case.channels])


def _in_order(cases: Sequence[Case], runs: Sequence[int]) -> list[int]:
    """Runs in an order in which those of the same lights and of similar media are near each other.

    A task has a few lights in many media; equal media follow each other, so that their system is assembled once.
    """
    lights: dict[str, int] = {}
    for run in runs:
        lights.setdefault(_lights(cases[run]), len(lights))
    media: dict[Hashable, int] = {}
    for run in sorted(runs, key=lambda run: _depth(cases[run])):
        media.setdefault(_media(cases[run]), len(media))

    def place(run: int) -> tuple[int, int, int]:
        light = lights[_lights(cases[run])]
        return light // LIGHTS_AT_ONCE, media[_media(cases[run])], light

    return sorted(runs, key=place)


def _depth(case: Case) -> float:
    """The length that the depth of its deposits is proportional to."""
    return case.medium.mean_free_path


def _leaders(cases: Sequence[Case], runs: Sequence[int]) -> Iterator[tuple[int, list[int]]]:
    """Leaders with the runs that follow them: those of the same lights, no more than `OTHER_DEPTH` deeper or less."""
    by_lights: dict[str, list[int]] = {}
    for run in runs:
        by_lights.setdefault(_lights(cases[run]), []).append(run)
    for some in by_lights.values():
        left = sorted(some, key=lambda run: _depth(cases[run]))
        while left:
            shallowest = _depth(cases[left[0]])
            leader = next(run for run in reversed(left) if _depth(cases[run]) <= OTHER_DEPTH * shallowest)
            count = sum(_depth(cases[run]) <= OTHER_DEPTH * _depth(cases[leader]) for run in left)
            yield leader, left[:count]
            left = left[count:]


def _divide(runs: Sequence[int], longest: int) -> list[tuple[int, ...]]:
    """Divide runs into tasks of nearly one length."""
    count = -(-len(runs) // longest)
    ends = [round(len(runs) * i / count) for i in range(count + 1)]
    return [tuple(runs[start:end]) for start, end in itertools.pairwise(ends)]


def _systems(cases: Sequence[Case], runs: Sequence[int]) -> int:
    """How many systems the runs have: one for each set of media, in each channel."""
    return len(
        {
            (
                channel.medium,
                *(_list_of(region.medium)[number % len(_list_of(region.medium))] for region in case.regions),
            )
            for case in (cases[run] for run in runs)
            for number, channel in enumerate(case.channels)
        }
    )
