"""``results.parquet``: the table of results with types, for pandas, Polars, DuckDB and others."""

import io
from collections.abc import Sequence
from typing import Any

import numpy as np

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
        kind = _kind(values) or ("float64" if name in FIGURES and not any(values) else "string")
        buffers = [pyarrow.py_buffer(part) for part in _buffers(values, kind)]
        arrays.append(pyarrow.Array.from_buffers(getattr(pyarrow, kind)(), len(values), buffers))
        fields.append(pyarrow.field(name, arrays[-1].type, metadata={"unit": FIGURES.get(name, "")}))
    target = io.BytesIO()
    parquet.write_table(pyarrow.table(arrays, schema=pyarrow.schema(fields)), target)
    return target.getvalue()


def _buffers(values: Sequence[Any], kind: str) -> list[Any]:
    """A column as Arrow keeps it: which values there are, bit by bit, ends of texts, and the values.

    ``pyarrow.array`` would import pandas, which takes a quarter of a second.
    """
    given = np.packbits(np.array([value is not None for value in values], bool), bitorder="little")
    if kind != "string":
        return [given, np.array([0 if value is None else value for value in values], kind)]
    texts = ["" if value is None else cell(value) for value in values]
    content = [text.encode("utf-8", "replace") for text in texts]
    return [given, np.cumsum([0, *map(len, content)], dtype=np.int32), b"".join(content)]


def _kind(values: Sequence[Any]) -> str | None:
    """The type of a column of numbers; None if it has others, or only empty ones."""
    given = {type(value) for value in values if value is not None}
    if given == {int}:
        return "int64"
    return "float64" if given and given <= {int, float} else None
