"""The case as it ran, as plain data: what a summary repeats, so that a run can be understood and repeated."""

import os
from pathlib import Path
from typing import Any

from tetlux.cases.file.case import Case

# Keys whose values are paths, relative to the case file.
PATHS = ("file", "files")


def as_ran(case: Case) -> dict[str, Any]:
    """A case with all that was left to defaults.

    Parameters
    ----------
    case : Case

    Returns
    -------
    dict
        ``source``, the path of the case file; ``sweep``, the values of this run; ``scene``, a case file of this run
        alone, with full paths, which can be run as it is.
    """
    return {
        "source": os.path.abspath(case.source),  # noqa: PTH100
        "sweep": dict(case.swept),
        "scene": scene_of(case),
    }


def scene_of(case: Case) -> dict[str, Any]:
    """The case file of this run alone: names and defaults written out, paths in full."""
    scene: dict[str, Any] = case.spec.model_dump(mode="json", exclude_none=True)
    names = {"lights": case.light_names, "regions": tuple(region.surface.name for region in case.regions)}
    for section, given in names.items():
        for entry, name in zip(scene[section], given, strict=True):
            entry["name"] = name
    if len(case.channels) > 1:
        scene["channels"] = list(case.channel_names)
    _write_paths_in_full(scene, case.source.parent)
    return scene


def _write_paths_in_full(value: object, folder: Path) -> None:
    if isinstance(value, dict):
        for key, one in value.items():
            if key in PATHS and isinstance(one, str):
                value[key] = os.path.abspath(folder / one)  # noqa: PTH100
            else:
                _write_paths_in_full(one, folder)
    elif isinstance(value, list):
        for one in value:
            _write_paths_in_full(one, folder)
