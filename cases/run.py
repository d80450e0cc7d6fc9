"""One run: solve a case and write what it asks for, whole or not at all."""

import json
import time
from collections.abc import Callable
from pathlib import Path

from tetlux.cases.case import Case
from tetlux.cases.compare.differences import as_json, compare
from tetlux.cases.compare.picture import draw_comparison
from tetlux.cases.picture import Scene, draw
from tetlux.cases.picture_rays import rays
from tetlux.cases.ply import write_ply
from tetlux.cases.publish import cannot_write, claimed, publish
from tetlux.cases.results import Results, results_of, surface_values, volume_values
from tetlux.cases.sensors import readings, write_readings
from tetlux.cases.summary import summarize
from tetlux.fem.solve import solve_each
from tetlux.meshing.errors import RunError, memory_ran_out
from tetlux.meshing.files import write_mesh
from tetlux.meshing.notes import prefixed

Report = Callable[[str], None]
FILES = {"surface": "surface.ply", "volume": "volume.vtu", "picture": "picture.png"}
READINGS = "detectors.csv"
COMPARISON = ("compare.json", "compare.png")
SUMMARY = "summary.json"
# The summary last: see `publish`.
ALL_FILES = (*FILES.values(), READINGS, *COMPARISON, SUMMARY)


def run_case(case: Case, out: Path, report: Report = lambda _: None, *, cache: bool = True) -> Path:
    """Solve a case and write its results.

    They are written into a folder beside the final one, which they replace when all are complete: where there is a
    summary, the run was finished.

    Parameters
    ----------
    case : Case
    out : Path
        Folder of all results; this case's go to ``out / case.name``.
    report : callable
        Called with a line of text as each stage ends.
    cache : bool
        Whether the mesher's mesh is looked up and kept in the user's cache directory.

    Returns
    -------
    Path
        The folder of this case's results.

    Raises
    ------
    RunError
        If the mesher or the solver fails, memory runs out, another run is at work on the same case, or the results
        cannot be written.
    """
    started, target = time.perf_counter(), out / case.name
    try:
        with claimed(out, case.name) as folder:
            solutions = solve_each(
                case.surface,
                [channel.medium for channel in case.channels],
                [list(channel.lights.values()) for channel in case.channels],
                regions=case.regions,
                tolerance=case.tolerance,
                cache=cache,
                report=report,
            )
            try:
                warnings = _write(results_of(case, solutions), folder, started)
                publish(folder, target, ALL_FILES)
            except OSError as error:
                raise cannot_write(target, error) from error
    except (MemoryError, RuntimeError) as error:
        if not memory_ran_out(error):
            raise
        raise RunError("memory ran out; give a larger tolerance, or run it where there is more memory.") from error
    for warning in warnings:
        report(f"note: {warning}")
    return target


def _write(results: Results, folder: Path, started: float) -> list[str]:
    """Write all files of a run into a folder, and return its warnings."""
    writing = time.perf_counter()
    case, first = results.case, results.solutions[0]
    unit = case.surface.unit
    warnings = _warnings(results)
    if "surface" in case.outputs:
        comments = [f"lengths in {unit}, exitance in W/{unit}^2"]
        if results.has_colours:
            comments.append(f"red, green, blue: sRGB preview, white is {results.preview[1]:.6g} W/{unit}^2")
        write_ply(results.surface, folder / FILES["surface"], surface_values(results), comments)
    if "volume" in case.outputs:
        write_mesh(first.mesh, folder / FILES["volume"], volume_values(results))
    if "picture" in case.outputs:
        # One that is dark in the first channel may be bright in another.
        lights = {name: light for channel in case.channels for name, light in channel.lights.items()}
        scene = Scene(
            points=results.surface.points,
            triangles=results.surface.faces,
            exitance=results.exitance(),
            unit=unit,
            title=case.name,
            lights=tuple(ray for light in lights.values() for ray in rays(light, case.surface)),
            colours=results.preview if results.has_colours else None,
        )
        warnings += draw(scene, folder / FILES["picture"])
    found = readings(case.sensors, results.by_light())
    if found:
        write_readings(found, unit, folder / READINGS)
    compared = None
    if case.comparison is not None:
        compared = compare(case.comparison, first)
        data, image = (folder / name for name in COMPARISON)
        data.write_text(json.dumps(as_json(compared), allow_nan=False) + "\n", encoding="utf-8")
        draw_comparison(compared, case.name, unit, image)
    now = time.perf_counter()
    seconds = {**first.seconds, "write": now - writing, "total": now - started + case.reading_seconds}
    seconds["surface"] += case.reading_seconds
    figures = summarize(results, found, seconds, warnings)
    if compared is not None:
        figures["compare"] = compared.differences
    summary = json.dumps(figures, indent=2, allow_nan=False)
    (folder / SUMMARY).write_text(summary + "\n", encoding="utf-8")
    return warnings


def _warnings(results: Results) -> list[str]:
    """Those of all channels; a sentence that holds for some of several channels names them."""
    names, solutions = results.case.channel_names, results.solutions
    told: dict[str, list[str]] = {}
    for name, solution in zip(names, solutions, strict=True):
        for warning in solution.warnings:
            told.setdefault(results.case.named(warning), []).append(name)
    return [
        *results.case.region_warnings,
        *(
            warning if len(whose) == len(names) else prefixed(warning, f"in {' and '.join(whose)}: ")
            for warning, whose in told.items()
        ),
    ]
