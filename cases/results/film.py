"""`film_results`: finished runs one after the other on one scale, such as those of a sweep."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from tetlux.cases.picture.draw import draw_film
from tetlux.cases.results.compare import FIELD, common_scale, field_values, scene_of_result
from tetlux.cases.results.load import RunResult, load_result
from tetlux.cases.run import SUMMARY
from tetlux.meshing.errors import InputError

# Pictures of a film at most: more take minutes and tens of megabytes.
MOST = 200
SUFFIXES = (".gif", ".webp")


def film_results(folders: Sequence[Path], film: Path, field: str = FIELD) -> int:
    """Draw finished runs one after the other, from one side and on one scale.

    Parameters
    ----------
    folders : sequence of Path
        Folders of runs, in this order; of the folder of a sweep all its runs, in the order of their swept values.
    film : Path
        The file to write: GIF, or WebP, which has all colours.
    field : str
        An array of ``surface.ply``.

    Returns
    -------
    int
        The number of runs.

    Raises
    ------
    InputError
        If there are no runs or too many, one has no surface or no such field, or they differ in unit.
    OSError
        If the film cannot be written.
    """
    if film.suffix.lower() not in SUFFIXES:
        raise InputError(f"{film} is neither .gif nor .webp; give --out one of these endings.")
    runs = [run for folder in folders for run in _runs_in(folder)]
    units = sorted({run.summary["unit"] for run in runs})
    if len(units) > 1:
        raise InputError(f"the runs are in {' and '.join(units)}; run all in one unit.")
    values = [field_values(run, field) for run in runs]
    scale = common_scale(values, field, units[0])
    scenes = [scene_of_result(run, each, _title(run)) for run, each in zip(runs, values, strict=True)]
    draw_film([replace(scene, scale=scale) for scene in scenes], film)
    return len(runs)


def _runs_in(folder: Path) -> list[RunResult]:
    """The run in a folder, or those below the folder of a sweep, in the order of their swept values."""
    if (folder / SUMMARY).is_file():
        return [load_result(folder)]
    found = [path.parent for path in folder.glob(f"*/{SUMMARY}")]
    if not found:
        raise InputError(f"{folder} holds no finished run; give the folder of a run, or that of a sweep.")
    if len(found) > MOST:
        raise InputError(f"{len(found)} runs are too many for a film of at most {MOST}; give the folders of some.")
    return sorted(map(load_result, found), key=lambda run: _order(run.summary["as_ran"]["sweep"]))


def _order(swept: dict[str, Any]) -> list[tuple[bool, float, str]]:
    """Numbers by their size, then words."""
    values = swept.values()
    return [(False, v, "") if isinstance(v, int | float) else (True, 0.0, str(v)) for v in values]


def _title(run: RunResult) -> str:
    swept = run.summary["as_ran"]["sweep"]
    values = {key: f"{value:.4g}" if isinstance(value, float) else value for key, value in swept.items()}
    return ", ".join(f"{key} = {value}" for key, value in values.items()) or str(run.summary["case"])
