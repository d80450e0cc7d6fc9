"""`solve_truncated`: cut out the part of a body that light reaches, and solve on it by finite elements."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from tetlux.fem.body.body import Body
from tetlux.fem.media.coefficients import AnyMedium
from tetlux.fem.media.region import Region
from tetlux.fem.outcome.solution import Solution
from tetlux.fem.shared import SharedMesh
from tetlux.fem.sources.deposit import Deposit
from tetlux.fem.sources.light import Light
from tetlux.fem.stopwatch import Stopwatch
from tetlux.fem.truncated.part import Box, Part, cut_part
from tetlux.fem.truncated.solution import TruncatedSolution, estimate_cut_error, truncate
from tetlux.meshing.errors import InputError
from tetlux.meshing.mesher.api import tetrahedralize
from tetlux.meshing.mesher.lengths import default_lengths
from tetlux.meshing.notes import Note
from tetlux.meshing.surface.surface import Surface
from tetlux.meshing.tets.mesh import TetMesh

# Share of the tolerance that the cut may take, and how much farther away the next cut is.
SHARE_OF_TOLERANCE, ENLARGEMENT, MOST_CUTS = 0.1, 1.5, 3
# Entries of light may move by this share of the mean free path: more, and something that was cut off shades them.
SAME_ENTRY = 1e-2

# The mesher's boundary may be as far from a part as from the whole body, and this many times as far as from a body of
# the part's size: its rim need not be sharp, and nodes are moved back onto the surface. On nefertiti, 300 mm tall, with
# a spot, the mesher takes 3.2 s with a factor of 1, 1.8 with 2, and 1.1 with 3; with a ball in it 6.1 and 4.7.
DEVIATION_OF_PART = 3.0

# Solves on the surface of a part, given the media of each scene, the regions in it, and the mesh to begin with.
SolveOnPart = Callable[[Surface, Sequence[AnyMedium], Sequence[Region], SharedMesh], Sequence[Solution]]
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
    cache: bool = True,
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
    cache : bool
        Whether meshes are looked up and kept in the user's cache directory.

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
        watch = Stopwatch()
        part = cut_part(bodies[0], inner, box)
        media = [list(body.by_label.values()) for body in bodies]
        regions = [Region(surface, [each[number + 1] for each in media]) for number, surface in part.inner]
        _check_shade(bodies, lights, deposits, part)
        report(f"cut out {len(part.surface.faces):,} of {len(whole.faces):,} triangles around the light")
        start = SharedMesh(_mesh_part(whole, part, cache=cache))
        before = watch.read()["total"]
        found = solve_on_part(part.surface, [each[0] for each in media], regions, start)
        errors = [estimate_cut_error(solution, part) for solution in found]
        if max(errors) <= SHARE_OF_TOLERANCE * tolerance or attempt == MOST_CUTS - 1:
            break
        report(f"the cut may cause an error of {max(errors):.2%}: a larger part is cut out")
        box = box.enlarge(ENLARGEMENT)
    solutions = [truncate(solution, whole, part, error) for solution, error in zip(found, errors, strict=True)]
    return [_with_note(_with_seconds(solution, before), part) for solution in solutions]


def _mesh_part(whole: Surface, part: Part, *, cache: bool) -> TetMesh:
    """The mesher's mesh of a part: see `DEVIATION_OF_PART`."""
    own = default_lengths(part.surface)[1]
    deviation = max(own, min(DEVIATION_OF_PART * own, default_lengths(whole)[1]))
    return tetrahedralize(part.surface, [surface for _, surface in part.inner], deviation=deviation, cache=cache)


def _with_seconds(solution: TruncatedSolution, before: float) -> TruncatedSolution:
    """The solution with the seconds of cutting and meshing before it."""
    seconds = solution.seconds
    return replace(solution, seconds={**seconds, **{name: seconds[name] + before for name in ("mesh", "total")}})


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
