"""`run_case`: solve a case and write its outputs, all or none."""

import json
import os
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

import numpy as np

from tetlux.cases.file.case import Case
from tetlux.cases.file.channels import ALL
from tetlux.cases.file.detectors import describe_readings, read_detectors, write_readings
from tetlux.cases.fitting.record import FIT_FILES, FitRecord
from tetlux.cases.fitting.solve import fit_case, with_fitted
from tetlux.cases.solve import solve_case, solve_pulse
from tetlux.cases.viewer import PAGE
from tetlux.cases.write.content import content_of_scene
from tetlux.cases.write.fields import volume_values
from tetlux.cases.write.publish import claim_folder, publish, write_error
from tetlux.cases.write.pulse import PULSE_FILES, PulseResults
from tetlux.cases.write.results import Results, collect_results, warnings_of
from tetlux.cases.write.summary import summarize
from tetlux.cases.write.surface_files import PLY, VTP, write_surface
from tetlux.fem.lights.arrows import HasArrows
from tetlux.fem.shared import SharedMesh
from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.errors import RunError, memory_ran_out
from tetlux.meshing.files.meshes import write_mesh

# Pictures and comparisons are imported where they are used: together they take as long as a small solve.
Report = Callable[[str], None]
FILES = {
    "surface": PLY,
    "volume": "volume.vtu",
    "picture": "picture.png",
    "viewer": PAGE,
    "glb": "surface.glb",
    "sensitivity": "sensitivity.npz",
}
MORE_PICTURES = ("picture-*.png", "picture.gif", "picture-*.gif")
READINGS = "detectors.csv"
# The picture of readings is drawn from this number of detectors on.
READINGS_PICTURE, ENOUGH_TO_DRAW = "readings.png", 3
FIGURES = ("figures.svg", "figures.pdf", "figures.png")
MITSUBA = ("emitter.ply", "emitter.pfm", "mitsuba.xml")
COMPARISON = ("compare.json", "compare.png")
SUMMARY = "summary.json"
# The summary is last, as `publish` needs it.
ALL_FILES = (
    *FILES.values(),
    *FIGURES,
    *MITSUBA,
    VTP,
    *PULSE_FILES,
    *FIT_FILES,
    READINGS,
    READINGS_PICTURE,
    *COMPARISON,
    SUMMARY,
)


@dataclass(frozen=True)
class FinishedCase:
    """What a finished run has to say.

    Attributes
    ----------
    folder : Path
        Of its results.
    summary : dict
        The content of ``summary.json``.
    warnings : list of str
    readings : list of str
        What its detectors read, in lines for people.
    """

    folder: Path
    summary: dict[str, Any]
    warnings: list[str]
    readings: list[str]


def run_case(
    case: Case,
    out: Path,
    report: Report = lambda _: None,
    *,
    cache: bool = True,
    note: Report | None = None,
) -> Path:
    """Solve a case and write its results.

    Files are written into a temporary folder and moved when all are complete, so a folder with a summary holds a
    finished run.

    Parameters
    ----------
    case : Case
    out : Path
        Folder of all results; this case's go to ``out / case.name``.
    report : callable
        Called with a line of text as each stage ends.
    cache : bool
        Whether the mesher's mesh is looked up and kept in the user's cache directory.
    note : callable, optional
        Called with each warning; by default they go to `report`.

    Returns
    -------
    Path
        The folder of this case's results.

    Raises
    ------
    RunError
        If the mesher or the solver fails, memory runs out, another run is writing to the same folder, or the results
        cannot be written.

    Examples
    --------
    >>> import tempfile
    >>> from dataclasses import replace
    >>> from tetlux.cases.file.load import load_cases
    >>> from tetlux.cases.shipped import find_case_file
    >>> (case,) = load_cases(find_case_file("sphere"))
    >>> with tempfile.TemporaryDirectory() as out:
    ...     folder = run_case(replace(case, outputs=()), Path(out))
    ...     sorted(path.name for path in folder.iterdir())
    ['compare.json', 'compare.png', 'summary.json']
    """
    finished = finish_case(case, out, report, cache=cache)
    for line in finished.readings:
        report(line)
    for warning in finished.warnings:
        if note is None:
            report(f"note: {warning}")
        else:
            note(warning)
    return finished.folder


def finish_case(
    case: Case, out: Path, report: Report, *, cache: bool = True, start: SharedMesh | None = None
) -> FinishedCase:
    """Solve a case and write its results, as `run_case` does; `start` is the mesh that it begins with."""
    started, target = time.perf_counter(), out / case.name
    try:
        with claim_folder(out, case.name) as folder:
            report(f"read in {case.start_seconds + case.reading_seconds:.2f} s")
            record = FitRecord(case, fit_case(case, report)) if case.fit else None
            case = with_fitted(case, record.found) if record else case
            transients = solve_pulse(case, report, cache=cache) if case.times else []
            solutions = [each.as_steady for each in transients] or solve_case(case, report, cache=cache, start=start)
            seconds = solutions[0].seconds
            report(f"meshed in {seconds['mesh']:.2f} s, solved in {seconds['total'] - seconds['mesh']:.2f} s")
            writing = time.perf_counter()
            try:
                results = replace(collect_results(case, solutions), transients=tuple(transients), fit=record)
                summary, warnings, readings = _write(results, folder, started, writing)
                publish(folder, target, [*_more_pictures(folder, target), *ALL_FILES])
                report(f"written in {time.perf_counter() - writing:.2f} s")
            except OSError as error:
                raise write_error(out, case.name, error) from error
    except (MemoryError, RuntimeError) as error:
        if not memory_ran_out(error):
            raise
        raise RunError("memory ran out; give a larger tolerance, or run it on a machine with more memory.") from error
    lines = [*(record.lines if record else []), *describe_readings(readings, case.surface.unit)]
    return FinishedCase(target, summary, warnings, lines)


def _write(
    results: Results, folder: Path, started: float, writing: float
) -> tuple[dict[str, Any], list[str], list[dict[str, Any]]]:
    """Write all files of a run into a folder, and return its summary, warnings and readings."""
    case = results.case
    unit = case.surface.unit
    warnings = warnings_of(results)
    pulse = PulseResults(results) if results.transients else None
    if results.fit is not None:
        results.fit.write(folder)
    if "surface" in case.outputs:
        write_surface(results, folder, {} if pulse is None else pulse.arrays())
    readings = read_detectors(case.detectors, results.by_channel_and_light())
    _write_on_mesh(results, readings, folder)
    _draw(results, readings, folder, pulse)
    if pulse is not None:
        pulse.write(readings, folder)
    if readings:
        write_readings(readings, unit, folder / READINGS)
        if len(case.detectors) >= ENOUGH_TO_DRAW:
            from tetlux.cases.picture.readings import draw_readings  # noqa: PLC0415

            whole = [row for row in readings if row["light"] == ALL]
            draw_readings(whole, _places_lit(case), case.name, unit, folder / READINGS_PICTURE)
    compared = None
    if case.comparison is not None:
        from tetlux.cases.compare.differences import as_data, compare  # noqa: PLC0415
        from tetlux.cases.compare.picture import draw_comparison  # noqa: PLC0415

        compared = compare(case.comparison, results.mesh_solutions[0])
        data, image = (folder / name for name in COMPARISON)
        data.write_text(json.dumps(as_data(compared), allow_nan=False) + "\n", encoding="utf-8")
        draw_comparison(compared, case.name, unit, image)
    figures = summarize(results, readings, warnings)
    figures["content"] = content_of_scene(figures["as_ran"]["scene"])
    if compared is not None:
        figures["compare"] = compared.differences
    figures["seconds"] = _seconds(results, started, writing)
    (folder / SUMMARY).write_text(_a_key_a_line(figures), encoding="utf-8")
    return figures, warnings, readings


def _write_on_mesh(results: Results, readings: list[dict[str, Any]], folder: Path) -> None:
    """Write the volume and sensitivities, and add path lengths to readings."""
    outputs, fields = results.case.outputs, {}
    if "sensitivity" in outputs:
        from tetlux.cases.write.sensitivities import Sensitivities  # noqa: PLC0415

        found = Sensitivities(results)
        found.write(folder / FILES["sensitivity"])
        found.add_path_lengths(readings)
        fields = found.fields()
    if "volume" in outputs:
        write_mesh(results.mesh_solutions[0].mesh, folder / FILES["volume"], volume_values(results) | fields)


def _a_key_a_line(figures: dict[str, Any]) -> str:
    """JSON with a line for each key of the first level; `indent` would take twenty times as long."""
    lines = (f"{json.dumps(key)}: {json.dumps(value, allow_nan=False)}" for key, value in figures.items())
    return "{\n" + ",\n".join(lines) + "\n}\n"


def _more_pictures(*folders: Path) -> set[str]:
    """Pictures beside the first one, of this run and of an earlier one."""
    names: set[str] = set()
    for folder in folders:
        with suppress(FileNotFoundError):
            names.update(os.listdir(folder))  # noqa: PTH208 - quick
    return {name for name in names if any(fnmatchcase(name, pattern) for pattern in MORE_PICTURES)}


def _seconds(results: Results, started: float, writing: float) -> dict[str, float]:
    """Seconds by stage, from the start of the command until now, of a run that began and was written at some time."""
    case, of_solve, now = results.case, results.solutions[0].seconds, time.perf_counter()
    seconds = {
        "start": case.start_seconds,
        "surface": case.reading_seconds + of_solve["surface"],
        "mesh": of_solve["mesh"],
        "assemble": of_solve["assemble"],
        # With what is between the stages of the solver.
        "solve": of_solve["solve"] + writing - started - of_solve["total"],
        "write": now - writing,
        "total": case.start_seconds + case.reading_seconds + now - started,
    }
    return {stage: round(value, 4) for stage, value in seconds.items()}


def _places_lit(case: Case) -> FloatArray:
    """Where the lights of a case meet the body, or shine from, (p, 3)."""
    lights = {name: light for channel in case.channels for name, light in channel.lights.items()}
    places = [light.arrows(case.surface).places for light in lights.values() if isinstance(light, HasArrows)]
    return np.vstack([np.zeros((0, 3)), *places])


def _draw(results: Results, readings: list[dict[str, Any]], folder: Path, pulse: PulseResults | None) -> None:
    """Draw pictures and figures, and write the viewer and what renderers read."""
    outputs = set(results.case.outputs)
    if "figures" in outputs:
        from tetlux.cases.write.figures import write_figures  # noqa: PLC0415

        write_figures(results, _places_lit(results.case), folder)
    if not outputs & {"picture", "viewer", "glb", "mitsuba"}:
        return
    from tetlux.cases.write.pictures import draw_pictures, picture_scene  # noqa: PLC0415

    if "picture" in outputs:
        draw_pictures(results, readings, folder)
    scene = picture_scene(results, readings)
    if "viewer" in outputs:
        from tetlux.cases.viewer.write import write_viewer  # noqa: PLC0415

        write_viewer(results, readings, scene, folder / FILES["viewer"], pulse)
    if outputs & {"glb", "mitsuba"}:
        from tetlux.cases.renderers.write import write_for_renderers  # noqa: PLC0415

        write_for_renderers(results, scene, folder)
