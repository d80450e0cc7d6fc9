"""Solve for each channel of a body: in time, or by one of the models."""

from collections.abc import Sequence
from typing import Literal

from tetlux.fem.assessment import Tolerances
from tetlux.fem.labels import GivenMedia
from tetlux.fem.media.coefficients import AnyMedium
from tetlux.fem.planner.options import Options
from tetlux.fem.planner.request import make_request
from tetlux.fem.planner.solve import AnySolution, FiniteElements, solve_by_plan, solve_closed_forms, solve_on_part
from tetlux.fem.scenes import media_by_channel
from tetlux.fem.solve_scenes import solve_each
from tetlux.fem.sources.light import Light
from tetlux.fem.transient.solve import solve_in_time
from tetlux.fem.transient.transient import Transient
from tetlux.meshing.errors import InputError
from tetlux.meshing.surface.surface import Surface
from tetlux.meshing.tets.mesh import TetMesh


def solve_times(
    body: Surface | TetMesh,
    medium: AnyMedium | GivenMedia | Sequence[AnyMedium | GivenMedia],
    lights: Sequence[Light],
    times: Sequence[float],
    model: str,
    options: Options,
) -> Transient | Sequence[Transient]:
    """Solve each channel in time, all on one mesh.

    Raises
    ------
    InputError
        If what is asked for is not for light in time.
    """
    if options["frequency"] != 0:
        raise InputError("there are times and a frequency; give one of the two.", field="times")
    if model not in ("full", "auto"):
        raise InputError(f'model "{model}" does not take times; leave it out, or give model="full".')
    if options["everywhere_tolerance"] is not None or options["volume_tolerance"] is not None:
        raise InputError(
            "everywhere_tolerance and volume_tolerance are not for light in time; give tolerance, or detectors and a "
            "detector_tolerance."
        )
    channels, several = media_by_channel(body, options["mesh"], medium)
    found = solve_in_time(body, channels, [lights] * len(channels), times, options)
    return found if several else found[0]


def solve_channels(
    body: Surface | TetMesh,
    medium: AnyMedium | GivenMedia | Sequence[AnyMedium | GivenMedia],
    lights: Sequence[Light],
    model: Literal["full", "auto", "truncated", "closed-form"],
    options: Options,
) -> AnySolution | Sequence[AnySolution]:
    """Solve each channel: all on one mesh, or all by one closed form."""
    channels, several = media_by_channel(body, options["mesh"], medium)
    scenes = [lights] * len(channels)
    solutions: Sequence[AnySolution]
    if model == "full":
        solutions = solve_each(body, channels, scenes, **options)
    else:
        request = make_request(
            body,
            channels,
            scenes,
            regions=options["regions"],
            tolerances=Tolerances(
                options["tolerance"],
                options["detector_tolerance"],
                everywhere=options["everywhere_tolerance"],
                volume=options["volume_tolerance"],
            ),
            detectors=options["detectors"],
            mesh=options["mesh"],
            cache=options["cache"],
            frequency=options["frequency"],
            outside_index=options["outside_index"],
        )
        elements = FiniteElements(
            lambda: solve_each(body, channels, scenes, **options),
            lambda part, media, inside, start: solve_each(
                part, media, scenes, start=start, **options | {"regions": inside}
            ),
            options["cache"],
        )
        if model == "closed-form":
            solutions = solve_closed_forms(request)
        elif model == "truncated":
            solutions = solve_on_part(request, elements, options["report"])
        else:
            solutions = solve_by_plan(request, elements, options["report"])
    return solutions if several else solutions[0]
