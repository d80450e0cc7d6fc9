"""``results.parquet``: the table of results with types, for pandas, Polars, DuckDB and others."""

import io
from collections.abc import Sequence
from typing import Any

from tetlux.cases.results.rows import FIGURES, Row, cell


def parquet_of(rows: Sequence[Row], columns: Sequence[str]) -> bytes | None:
    """The content of a Parquet file; None if pyarrow is not installed.

    Parameters
    ----------
    rows : sequence of dict
        Columns whose values are all numbers become numbers, others text.
    columns : sequence of str

    Returns
    -------
    bytes or None
        Fields have their units as metadata.
    """
    try:
        import pyarrow  # noqa: PLC0415 - an extra
        from pyarrow import parquet  # noqa: PLC0415
    except ImportError:
        return None
    arrays, fields = [], []
    for name in columns:
        values = [row.get(name) for row in rows]
        kind = _kind(values) or ("float64" if name in FIGURES and not any(values) else None)
        cells = values if kind else [None if value is None else cell(value) for value in values]
        arrays.append(pyarrow.array(cells, type=getattr(pyarrow, kind or "string")()))
        fields.append(pyarrow.field(name, arrays[-1].type, metadata={"unit": FIGURES.get(name, "")}))
    target = io.BytesIO()
    parquet.write_table(pyarrow.table(arrays, schema=pyarrow.schema(fields)), target)
    return target.getvalue()


def _kind(values: Sequence[Any]) -> str | None:
    """The type of a column of numbers; None if it has others, or only empty ones."""
    given = {type(value) for value in values if value is not None}
    if given == {int}:
        return "int64"
    return "float64" if given and given <= {int, float} else None
