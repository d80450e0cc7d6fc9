"""`solve_truncated`: cut out the part of a body that light reaches, and solve on it by finite elements."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from tetlux.fem.body.body import Body
from tetlux.fem.media.coefficients import AnyMedium
from tetlux.fem.media.region import Region
from tetlux.fem.outcome.solution import Solution
from tetlux.fem.sources.deposit import Deposit
from tetlux.fem.sources.light import Light
from tetlux.fem.truncated.part import Box, Part, cut_part
from tetlux.fem.truncated.solution import TruncatedSolution, estimate_cut_error, truncate
from tetlux.meshing.errors import InputError
from tetlux.meshing.notes import Note
from tetlux.meshing.surface.surface import Surface

# Share of the tolerance that the cut may take, and how much farther away the next cut is.
SHARE_OF_TOLERANCE, ENLARGEMENT, MOST_CUTS = 0.1, 1.5, 3
# Entries of light may move by this share of the mean free path: more, and something that was cut off shades them.
SAME_ENTRY = 1e-2

# Solves on the surface of a part, given the media of each scene and the regions in it.
SolveOnPart = Callable[[Surface, Sequence[AnyMedium], Sequence[Region]], Sequence[Solution]]
Report = Callable[[str], None]


def solve_truncated(
    bodies: Sequence[Body],
    inner: Sequence[Surface],
    lights: Sequence[Sequence[Light]],
    deposits: Sequence[Sequence[Deposit]],
    box: Box,
    solve_on_part: SolveOnPart,
    *,
    tolerance: float,
    report: Report,
) -> list[TruncatedSolution]:
    """Solve on a part of a body, and on larger ones while the cut causes too large an error.

    Parameters
    ----------
    bodies : sequence of Body
        With the media of each scene.
    inner : sequence of Surface
        Of the regions.
    lights, deposits : sequence of sequences
        The lights of each scene, and what they leave in the whole body.
    box : Box
        Beyond which the body is dark.
    solve_on_part : callable
    tolerance : float
        Wanted relative L2 error of the exitance.
    report : callable

    Returns
    -------
    list of TruncatedSolution

    Raises
    ------
    InputError
        If what is cut off shades the light.
    """
    whole = bodies[0].surface
    for attempt in range(MOST_CUTS):
        part = cut_part(bodies[0], inner, box)
        media = [list(body.by_label.values()) for body in bodies]
        regions = [Region(surface, [each[number + 1] for each in media]) for number, surface in part.inner]
        _check_shade(bodies, lights, deposits, part)
        report(f"cut out {len(part.surface.faces):,} of {len(whole.faces):,} triangles around the light")
        found = solve_on_part(part.surface, [each[0] for each in media], regions)
        errors = [estimate_cut_error(solution, part) for solution in found]
        if max(errors) <= SHARE_OF_TOLERANCE * tolerance or attempt == MOST_CUTS - 1:
            break
        report(f"the cut may cause an error of {max(errors):.2%}: a larger part is cut out")
        box = box.enlarge(ENLARGEMENT)
    solutions = [truncate(solution, whole, part, error) for solution, error in zip(found, errors, strict=True)]
    return [_with_note(solution, part) for solution in solutions]


def _check_shade(
    bodies: Sequence[Body], lights: Sequence[Sequence[Light]], deposits: Sequence[Sequence[Deposit]], part: Part
) -> None:
    """Refuse a part on which light enters at other places than on the whole body."""
    for body, some, known in zip(bodies, lights, deposits, strict=True):
        of_part = Body(part.surface, [body.outer])
        for light, deposit in zip(some, known, strict=True):
            before, after = deposit.footprint.entries, light.deposit_in(of_part).footprint.entries
            allowed = SAME_ENTRY * body.shortest_mean_free_path
            if len(before) != len(after) or (len(before) and np.abs(before - after).max() > allowed):
                raise InputError("what would be cut off shades the light")


def _with_note(solution: TruncatedSolution, part: Part) -> TruncatedSolution:
    unit = solution.surface.unit
    note = Note(
        "truncated",
        f"only a part of the body, all within {part.distance:.3g} {unit} of the light, is modelled; beyond it the "
        "exitance is what the field at its rim decays to.",
        value=part.distance,
    )
    return replace(solution, warnings=[*solution.warnings, note])
