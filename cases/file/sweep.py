"""Sweeps: one case file expanded into the runs of its grid."""

import copy
import itertools
import math
from typing import Any, NamedTuple

from tetlux.cases.file.document import Document, Key
from tetlux.cases.file.schema.case import CaseSpec

MOST_RUNS = 20_000
# The longest name of a folder that file systems allow, bytes.
LONGEST_NAME = 255


class SweepRun(NamedTuple):
    """One run of a sweep.

    Attributes
    ----------
    label : str or None
        The name of its folder; None without a sweep.
    values : dict of str to float or str
        The swept values, by dotted key.
    data : dict
        The data of the case file with these values, without the sweep.
    lines : dict of Key to int
        Lines of the swept keys in the case file.
    """

    label: str | None
    values: dict[str, float | str]
    data: dict[str, Any]
    lines: dict[Key, int]


def expand_sweep(document: Document, spec: CaseSpec) -> list[SweepRun]:
    """Make a run for each point of the sweep's grid; a single one without a sweep.

    Raises
    ------
    InputError
        If the sweep repeats a value, makes too many runs, or names a key that the case does not have.
    """
    if not spec.sweep:
        return [SweepRun(None, {}, document.data, {})]
    runs: list[SweepRun] = []
    for key, choices in spec.sweep.items():
        if len(set(map(repr, choices))) < len(choices):
            raise document.error(("sweep", key), "a value is given twice; give each once.")
    count = math.prod(len(choices) for choices in spec.sweep.values())
    if count > MOST_RUNS:
        raise document.error(("sweep",), f"this grid makes {count:,} runs; give at most {MOST_RUNS:,} at once.")
    labels: set[str] = set()
    for point in itertools.product(*spec.sweep.values()):
        values = dict(zip(spec.sweep, point, strict=True))
        data = copy.deepcopy(document.data)
        del data["sweep"]
        lines: dict[Key, int] = {}
        for key, value in values.items():
            lines[_assign(document, data, key, value)] = document.line(("sweep", key)) or 1
        label = _folder_name(values)
        if len(label.encode()) > LONGEST_NAME:
            raise document.error(
                ("sweep",),
                "the keys and values of a run make too long a folder name; sweep fewer keys.",
            )
        if label in labels:
            raise document.error(("sweep",), f'two runs would be written to one folder, "{label}"; change a value.')
        labels.add(label)
        runs.append(SweepRun(label, values, data, lines))
    return runs


def _folder_name(values: dict[str, Any]) -> str:
    """The name of the folder of a run: ``key=value,...`` without characters that file systems refuse."""
    label = ",".join(f"{key}={value}" for key, value in values.items())
    return "".join("_" if c in "/\\" or not c.isprintable() else c for c in label)


def _assign(document: Document, data: dict[str, Any], key: str, value: object) -> Key:
    """Set the value of a dotted key, with list items by number; all but the last part must exist already."""
    parts: Key = tuple(int(p) if p.isdecimal() else p for p in key.split("."))
    parent: Any = data
    try:
        for part in parts[:-1]:
            # A number is an index of a list, or a label of a mesh, whose key may be text.
            parent = parent[str(part) if isinstance(parent, dict) and part not in parent else part]
        parent[parts[-1]] = value
    except (KeyError, IndexError, TypeError) as error:
        raise document.error(
            ("sweep", key),
            f'"{key}" is no key of this case; write it as in medium.sigma_a or lights.0.pencil.power.',
        ) from error
    return parts
