"""Sweeps: one case file expanded into its runs."""

from typing import Any, NamedTuple

from tetlux.cases.file.documents.document import Document, Key, Place
from tetlux.cases.file.schema.case import CaseSpec
from tetlux.cases.file.sweeps.keys import check_key, split_key, with_value
from tetlux.cases.file.sweeps.points import sweep_points


class SweepRun(NamedTuple):
    """One run of a sweep.

    Attributes
    ----------
    label : str or None
        The name of its folder; None without a sweep.
    values : dict
        The swept values, plain data by dotted key.
    data : dict
        The data of the case file with these values, without the sweep.
    places : dict of Key to Place
        Places of the swept keys in the case file.
    """

    label: str | None
    values: dict[str, Any]
    data: dict[str, Any]
    places: dict[Key, Place]


def expand_sweep(document: Document, spec: CaseSpec) -> list[SweepRun]:
    """Make a run for each point of the sweep; a single one without a sweep.

    Raises
    ------
    InputError
        If the sweep is empty, repeats a value, makes too many runs, or names a key that the case does not have.
    """
    if spec.sweep is None:
        return [SweepRun(None, {}, document.data, {})]
    points, names = sweep_points(document, spec.sweep)
    if not points[0]:
        return [SweepRun(None, {}, {key: value for key, value in document.data.items() if key != "sweep"}, {})]
    given = _keys_given(spec)
    for key, at in given.items():
        check_key(document, at, key)
    rest = {key: value for key, value in document.data.items() if key != "sweep"}
    swept = [split_key(key) for key in given]
    # What is within a section that is swept as a whole stands elsewhere.
    places = {
        key: place for key, place in document.places.items() if not any(key[: len(whole)] == whole for whole in swept)
    }
    for key, at in given.items():
        place = document.place(at)
        for depth in range(1, len(split_key(key)) + 1):
            part = split_key(key)[:depth]
            if place and (part not in places or part == split_key(key)):
                places[part] = place
    # A section that is swept as a whole is set before its keys.
    order = sorted(given, key=lambda key: len(split_key(key)))
    runs = []
    for name, point in zip(names, points, strict=True):
        data = rest
        for key in order:
            data = with_value(document, given[key], data, key, point[key])
        runs.append(SweepRun(name, point, data, places))
    return runs


def _keys_given(spec: CaseSpec) -> dict[str, Key]:
    """Where each swept key is given in the case file."""
    assert spec.sweep is not None
    sample = spec.sweep.sample.axes if spec.sweep.sample else {}
    return {
        **{key: ("sweep", key) for key in spec.sweep.axes},
        **{key: ("sweep", "zip", key) for key in spec.sweep.zip},
        **{key: ("sweep", "sample", key) for key in sample},
    }
