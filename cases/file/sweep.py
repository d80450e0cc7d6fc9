"""Sweeps: one case file, many runs."""

import copy
import itertools
import math
from typing import Any

from tetlux.cases.file.document import Document, Key
from tetlux.cases.file.schema.case import CaseSpec

MOST_RUNS = 20_000
# Of folders, in bytes: what file systems hold.
LONGEST_NAME = 255


Run = tuple[str | None, dict[str, float | str], dict[str, Any], dict[Key, int]]


def swept(document: Document, spec: CaseSpec) -> list[Run]:
    """The case's data once for each point of its sweep's grid: label and values of the point, data, lines of keys."""
    if not spec.sweep:
        return [(None, {}, document.data, {})]
    runs: list[Run] = []
    for key, listed in spec.sweep.items():
        if len(set(map(repr, listed))) < len(listed):
            raise document.error(("sweep", key), "a value stands here twice; give each once.")
    count = math.prod(len(listed) for listed in spec.sweep.values())
    if count > MOST_RUNS:
        raise document.error(("sweep",), f"this grid makes {count:,} runs; give at most {MOST_RUNS:,} at once.")
    labels: set[str] = set()
    for point in itertools.product(*spec.sweep.values()):
        values = dict(zip(spec.sweep, point, strict=True))
        data = copy.deepcopy(document.data)
        del data["sweep"]
        keys: dict[Key, int] = {}
        for key, value in values.items():
            keys[_assign(document, data, key, value)] = document.line(("sweep", key)) or 1
        label = _label(values)
        if len(label.encode()) > LONGEST_NAME:
            raise document.error(
                ("sweep",),
                "the keys and values of a run make too long a name of a folder; sweep fewer keys.",
            )
        if label in labels:
            raise document.error(("sweep",), f'two runs would be written to one folder, "{label}"; change a value.')
        labels.add(label)
        runs.append((label, values, data, keys))
    return runs


def _label(values: dict[str, Any]) -> str:
    """A name for the folder of a run."""
    label = ",".join(f"{key}={value}" for key, value in values.items())
    return "".join("_" if c in "/\\" or not c.isprintable() else c for c in label)


def _assign(document: Document, data: dict[str, Any], key: str, value: object) -> Key:
    """Set a dotted key (list items by their number); it may be new, what holds it may not."""
    parts: Key = tuple(int(p) if p.isdecimal() else p for p in key.split("."))
    holder: Any = data
    try:
        for part in parts[:-1]:
            # The number of an item of a list, or of a label, which may be written as a word.
            holder = holder[str(part) if isinstance(holder, dict) and part not in holder else part]
        holder[parts[-1]] = value
    except (KeyError, IndexError, TypeError) as error:
        raise document.error(
            ("sweep", key),
            f'"{key}" is no key of this case; write it as in medium.sigma_a or lights.0.pencil.power.',
        ) from error
    return parts
