"""Notes on a solution: each a sentence for the user with a stable code."""

from collections.abc import Iterator, Sequence

import numpy as np

from tetlux.fem.error.estimate import ROUNDING
from tetlux.fem.known.fitted_patch import FittedPatch
from tetlux.fem.known.split import SplitLights
from tetlux.fem.outcome.reading import Reading
from tetlux.fem.outcome.solution import Solution
from tetlux.fem.validity.notes import warnings_for
from tetlux.meshing.notes import Note

# A negative fluence or exitance is reported from this share of the maximum on.
NEGLIGIBLE_DIP = 1e-6
# Negative power, and power that the limiter moved, are reported from this share of the incident power on.
NEGLIGIBLE_POWER = 1e-4
# The change of the body's volume by curved triangles is reported from this share on.
LARGEST_BULGE = 0.015
# The change of a source's depth by flat facets is reported from this share of the depth on.
SHALLOW = 0.1


def notes_on(solution: Solution, split: SplitLights, tolerance: float | None, where: str) -> list[str]:
    """Collect the notes on a solution.

    Parameters
    ----------
    solution : Solution
    split : SplitLights
        The lights of the solution.
    tolerance : float, optional
        Of the exitance, if it has one.
    where : str
        Where refinement stopped, for the sentence that the tolerance was not met.

    Returns
    -------
    list of str
        Without repetitions.
    """
    notes = list(solution.surface.warnings)
    if solution.validity is not None:
        notes += warnings_for(solution.surface, solution.validity)
    notes += [*split.warnings, *solution.warnings]
    if tolerance is not None:
        notes += _on_tolerance(solution, tolerance, where)
    notes += _on_bulge(solution)
    notes += _on_power(solution)
    if not np.iscomplexobj(solution.fluence):
        notes += _on_fluence(solution, may_be_negative=split.has_negative_source)
        notes += _on_limited_power(solution)
        notes += _on_exitance(solution)
    notes += _on_shallow_sources(solution)
    return list(dict.fromkeys(notes))


def notes_on_readings(readings: Sequence[Reading], tolerance: float | None, where: str) -> list[Note]:
    """Notes on readings that are less than their error, and on others that miss their tolerance."""
    errors = [reading.relative_error for reading in readings]
    dark = [number for number, error in enumerate(errors, 1) if error is not None and not error < 1.0]
    notes = []
    if dark:
        is_, it, they = ("is", "it", "it") if len(dark) == 1 else ("are", "each", "them")
        remedy = "give a tolerance for detectors" if tolerance is None else f"leave {they} out"
        notes.append(
            Note(
                "reading-dark",
                f"{_numbered(dark)} {is_} in the dark: {it} is less than its estimated error; {remedy}, or bring light "
                f"nearer to {they}.",
                value=max(error for error in errors if error is not None),
            )
        )
    if tolerance is None:
        return notes
    missed = {
        number: error
        for number, error in enumerate(errors, 1)
        if number not in dark and (error is None or not error <= tolerance)
    }
    if missed:
        worst = max((error for error in missed.values() if error is not None), default=np.inf)
        notes.append(
            Note(
                "detector-tolerance-missed",
                f"the tolerance of {tolerance:g} for detectors was not met by "
                f"{_numbered(list(missed))}: the largest estimated error is {worst:.2g}, {where}.",
                value=float(worst),
            )
        )
    return notes


def _numbered(numbers: Sequence[int]) -> str:
    """Readings by their numbers, for a sentence."""
    return f"{'reading' if len(numbers) == 1 else 'readings'} {', '.join(map(str, numbers))}"


def notes_on_fields(solution: Solution, everywhere: float | None, volume: float | None, where: str) -> list[Note]:
    """Notes on tolerances of exitance and fluence everywhere that were missed."""
    found = (
        ("everywhere", "of the exitance everywhere", everywhere, solution.everywhere_error),
        ("volume", "of the fluence inside", volume, solution.volume_error),
    )
    return [
        Note(
            f"{name}-tolerance-missed",
            f"the tolerance of {tolerance:g} {what} was not met: the estimated error is {error:.2g}, {where}.",
            value=error,
        )
        for name, what, tolerance, error in found
        if tolerance is not None and not error <= tolerance
    ]


def _on_tolerance(solution: Solution, tolerance: float, where: str) -> Iterator[Note]:
    if not solution.error_estimate <= tolerance:
        yield Note(
            "tolerance-missed",
            f"the tolerance of {tolerance:g} was not met: the estimated error is {solution.error_estimate:.2g}, "
            f"{where}.",
            value=solution.error_estimate,
        )


def _on_bulge(solution: Solution) -> Iterator[Note]:
    bulge = solution.surface.bulge
    if abs(bulge) > LARGEST_BULGE:
        yield Note(
            "surface-bulges",
            f"the body is taken as smooth, which changes its volume by about {bulge:+.1%}; give it more triangles, "
            "or a crease_angle of 0 if they are meant to be flat.",
            value=bulge,
        )


def _on_power(solution: Solution) -> Iterator[Note]:
    power = solution.power
    modulated = np.iscomplexobj(solution.fluence)
    if not modulated and min(power.absorbed, power.exited) < -NEGLIGIBLE_POWER * power.incident:
        yield Note(
            "power-negative",
            "absorbed or exited power is negative: the mesh is far too coarse for this light; ask for a smaller "
            "tolerance, or give a finer mesh.",
        )
    if abs(power.exited) <= ROUNDING * abs(power.incident):
        yield Note(
            "no-light-leaves",
            "no light leaves the body: all of it is reflected at its surface, passes through or is absorbed.",
        )


def _on_fluence(solution: Solution, *, may_be_negative: bool) -> Iterator[Note]:
    lowest, highest = float(solution.fluence.min()), float(solution.fluence.max())
    if lowest < -NEGLIGIBLE_DIP * highest:
        cause = (
            "beside where a thin beam enters, as the diffusion equation itself has it; read it a mean free path away."
            if may_be_negative
            else "where tetrahedra are obtuse and light is scarce; ask for a smaller tolerance."
        )
        share = lowest / highest
        yield Note(
            "fluence-negative",
            f"the fluence dips below zero, to {share:.1e} of its largest value, {cause}",
            value=share,
        )


def _on_limited_power(solution: Solution) -> Iterator[Note]:
    limited, incident = solution.limited_power, solution.power.incident
    if limited > NEGLIGIBLE_POWER * incident:
        yield Note(
            "power-moved",
            f"{limited / incident:.2%} of the power was moved between nodes to keep the fluence from "
            "going below zero, where tetrahedra are too coarse or too flat for light that fades so fast; ask for a "
            "smaller tolerance, or give a finer mesh.",
            value=limited / incident,
        )


def _on_exitance(solution: Solution) -> Iterator[Note]:
    brightest = float(np.max(solution.transmitted_irradiance))
    if brightest > 0 and solution.exitance.min() < -NEGLIGIBLE_DIP * brightest:
        shallowest = 1.0 / solution.validity.steepest if solution.validity else np.nan
        yield Note(
            "exitance-negative",
            "the exitance is below zero in places: the layer in which diffuse light is absorbed, "
            f"{shallowest:.2g} {solution.surface.unit} deep, is finer than the tetrahedra, or the "
            "medium absorbs so much that light does not diffuse in it; do not rely on what leaves.",
        )


def _on_shallow_sources(solution: Solution) -> Iterator[Note]:
    """Report the first source whose depth below the facets differs much from that below the surface."""
    for patch in solution.patches:
        sources = patch.charges.positions[: patch.charges.sources]
        if len(sources) == 0 or isinstance(patch, FittedPatch):
            continue
        depths = np.linalg.norm(solution.surface.closest(sources)[0] - sources, axis=1)
        below_facets = np.linalg.norm(solution.mesh.closest_boundary(sources)[0] - sources, axis=1)
        off = np.abs(below_facets - depths)
        worst = int(np.argmax(off / depths))
        if off[worst] > SHALLOW * depths[worst]:
            yield Note(
                "source-depth-off",
                f"a source {depths[worst]:.2g} {solution.mesh.unit} below the surface is {below_facets[worst]:.2g} "
                "below the mesh's facets, and what leaves above it may be off by as much; give a finer mesh, or "
                "put it deeper.",
            )
            return
