"""The case as it was run, as plain data: `as_ran` of a summary, from which the run can be understood and repeated."""

import os
from pathlib import Path
from typing import Any

from tetlux.cases.file.case import Case

# Keys whose values are paths, relative to the case file.
PATHS = ("file", "files")


def describe_run(case: Case) -> dict[str, Any]:
    """Describe a case with all its defaults written out.

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
        "sweep": dict(case.sweep_values),
        "scene": _case_file_of(case),
    }


def _case_file_of(case: Case) -> dict[str, Any]:
    """A case file of this run alone, with names and defaults written out and full paths."""
    scene: dict[str, Any] = case.spec.model_dump(mode="json", exclude_none=True)
    names = {"lights": case.light_names, "regions": tuple(region.surface.name for region in case.regions)}
    for section, names_of_section in names.items():
        for entry, name in zip(scene[section], names_of_section, strict=True):
            entry["name"] = name
    if len(case.channels) > 1 and not case.fluorophores:
        scene["channels"] = list(case.channel_names)
    _make_paths_absolute(scene, case.source.parent)
    return scene


def _make_paths_absolute(value: dict[str, Any] | list[Any], folder: Path) -> None:
    """Replace relative paths anywhere within plain data, in place."""
    if isinstance(value, dict):
        for key in PATHS:
            if isinstance(value.get(key), str):
                value[key] = os.path.abspath(folder / value[key])  # noqa: PTH100
        value = list(value.values())
    for entry in value:
        if isinstance(entry, dict | list):
            _make_paths_absolute(entry, folder)
