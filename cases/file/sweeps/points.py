"""The points of a sweep: grids, zipped lists, ranges, and samples."""

import itertools
import math
from typing import Any

import numpy as np

from tetlux.cases.file.documents.document import Document, Key
from tetlux.cases.file.schema.sweep import MOST_RUNS, RangeSpec, SampledRangeSpec, SampleSpec, SweepSpec
from tetlux.cases.file.sweeps.names import folder_names, identity
from tetlux.meshing.arrays import FloatArray

Point = dict[str, Any]
# Values of ranges are rounded to so many digits: they are the same on every machine, and short.
DIGITS = 12


def sweep_points(document: Document, sweep: SweepSpec) -> tuple[list[Point], list[str]]:
    """List the values of each run of a sweep, and the names of their folders.

    Parameters
    ----------
    document : Document
    sweep : SweepSpec

    Returns
    -------
    points : list of dict
        The values of each run by dotted key: the grid, times the zipped lists, times the sample.
    names : list of str
        Points of a sample are numbered in the names, since their values are long.

    Raises
    ------
    InputError
        If a value or a key is given twice, zipped lists differ in length, or there are too many runs.
    """
    _check_keys(document, sweep)
    axes = [
        [{key: value} for value in _values(document, (key,), axis)]
        for key, axis in sweep.axes.items()
    ]  # fmt: skip
    if sweep.zip:
        axes.append(_zipped(document, sweep))
    size = sweep.sample.size if sweep.sample else 1
    count = math.prod(map(len, axes)) * size
    if count > MOST_RUNS:
        raise document.error(("sweep",), f"this sweep makes {count:,} runs; give at most {MOST_RUNS:,} at once.")
    drawn: list[Point] = _draw(sweep.sample) if sweep.sample else [{}]
    width = len(str(size))
    points, labels = [], []
    for parts in itertools.product(*axes):
        point = {key: value for part in parts for key, value in part.items()}
        for number, sample in enumerate(drawn, 1):
            points.append(point | sample)
            labels.append(point | ({"sample": f"{number:0{width}d}"} if sample else {}))
    return points, folder_names(labels)


def _check_keys(document: Document, sweep: SweepSpec) -> None:
    """Refuse a key that is swept twice."""
    seen: dict[str, Key] = {key: (key,) for key in sweep.axes}
    inner = [
        *(("zip", key) for key in sweep.zip),
        *(("sample", key) for key in (sweep.sample.axes if sweep.sample else ())),
    ]
    for section, key in inner:
        if key in seen:
            raise document.error(("sweep", section, key), f"{key} is swept twice; give it once.")
        seen[key] = (section, key)


def _values(document: Document, key: Key, axis: list[Any] | RangeSpec) -> list[Any]:
    """The values of a list, none of them twice, or of a range."""
    if isinstance(axis, RangeSpec):
        return _evenly_spaced(axis)
    if len(set(map(identity, axis))) < len(axis):
        raise document.error(("sweep", *key), "a value is given twice; give each once.")
    return axis


def _zipped(document: Document, sweep: SweepSpec) -> list[Point]:
    """The points of lists and ranges of one length, whose values go together."""
    columns = {key: _evenly_spaced(axis) if isinstance(axis, RangeSpec) else axis for key, axis in sweep.zip.items()}
    first = next(iter(columns))
    for key, column in columns.items():
        if len(column) != len(columns[first]):
            raise document.error(
                ("sweep", "zip", key),
                f"this has {_count(column)}, and {first} has {len(columns[first])}; give lists of one length.",
            )
    rows = [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]
    if len(set(map(identity, rows))) < len(rows):
        raise document.error(("sweep", "zip"), "the same values are given twice; give each once.")
    return rows


def _count(values: list[Any]) -> str:
    return "1 value" if len(values) == 1 else f"{len(values)} values"


def _evenly_spaced(spec: RangeSpec) -> list[float]:
    return _between(spec, np.linspace(0.0, 1.0, spec.num))


def _between(spec: SampledRangeSpec, shares: FloatArray) -> list[float]:
    """The values at shares of a range, from 0 at its start to 1 at its stop."""
    start, stop = float(spec.start), float(spec.stop)
    if spec.scale == "log":
        values = np.exp(math.log(start) + (math.log(stop) - math.log(start)) * shares)
    else:
        # Without an overflow where the ends are far apart.
        values = start * (1.0 - shares) + stop * shares
    low, high = sorted((start, stop))
    rounded = [min(max(float(f"{value:.{DIGITS}g}"), low), high) for value in values]
    return [start if share == 0 else stop if share == 1 else v for share, v in zip(shares, rounded, strict=True)]


def _draw(spec: SampleSpec) -> list[Point]:
    """Draw the points of a sample."""
    from scipy.stats import qmc  # noqa: PLC0415 - takes half a second

    axes, generator = spec.axes, np.random.default_rng(spec.seed)
    if spec.method == "lhs":
        shares = qmc.LatinHypercube(len(axes), seed=generator).random(spec.size)
    else:
        shares = generator.random((spec.size, len(axes)))
    columns = [
        _between(axis, column)
        if isinstance(axis, SampledRangeSpec)
        else [axis[int(share * len(axis))] for share in column]
        for axis, column in zip(axes.values(), shares.T, strict=True)
    ]
    return [dict(zip(axes, row, strict=True)) for row in zip(*columns, strict=True)]
