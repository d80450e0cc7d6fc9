"""Short texts for messages and representations: counts, sizes with units, vectors, objects with arrays."""

from collections.abc import Iterable, Mapping
from dataclasses import MISSING, Field, fields
from typing import Any

import numpy as np

from tetlux.meshing.arrays import FloatArray

# Labels that a message lists; it counts the others.
MOST_LABELS_NAMED = 8
# Largest number of characters of one value and of a line.
LONGEST_VALUE, LONGEST_LINE = 90, 180


def count(number: int, thing: str, several: str | None = None) -> str:
    """A number with its noun, such as ``1 node`` or ``6,966 triangles``."""
    return f"{number:,} {thing if number == 1 else several or thing + 's'}"


def size(points: FloatArray, unit: str) -> str:
    """Side lengths of the bounding box of points (n, 3), such as ``34.2 x 30 x 26 mm``."""
    lengths = np.ptp(points, axis=0) if len(points) else np.zeros(3)
    return f"{' x '.join(f'{length:.3g}' for length in lengths)} {unit}"


def label_text(labels: Iterable[int], names: Mapping[int, str]) -> str:
    """Labels as text, with their names: ``1 (scalp) and 2 (skull)``."""
    texts = [f"{label} ({names[label]})" if label in names else str(label) for label in labels]
    more = len(texts) - MOST_LABELS_NAMED
    shown = texts if more <= 0 else [*texts[:MOST_LABELS_NAMED], f"{more} more"]
    return " and ".join([", ".join(shown[:-1]), shown[-1]] if len(shown) > 1 else shown)


def as_text(vector: Iterable[float], size: float = 0.0) -> str:
    """A point or a direction as text, such as ``(1, 2.5, 0)``.

    Coordinates below 1e-6 of `size`, the size of the body, are rounding errors and are written as 0.
    """
    return "(" + ", ".join(f"{0.0 if abs(x) <= 1e-6 * size else x:.4g}" for x in vector) + ")"


def one_line(self: Any) -> str:
    """A ``__repr__`` for dataclasses with arrays: types and shapes of arrays, other values, no defaults."""
    shown = [
        f"{item.name}={_summarize(getattr(self, item.name))}" for item in fields(self) if not _is_default(self, item)
    ]
    return _truncate(f"{type(self).__name__}({', '.join(shown)})", LONGEST_LINE)


def _is_default(self: Any, item: "Field[Any]") -> bool:
    value = getattr(self, item.name)
    default = item.default_factory() if item.default_factory is not MISSING else item.default
    if isinstance(value, np.ndarray) or isinstance(default, np.ndarray):
        return isinstance(value, np.ndarray) and value.size == 0
    return bool(value is default or value == default)


def _summarize(value: object) -> str:
    if isinstance(value, np.ndarray):
        return f"{value.dtype} {value.shape}"
    if isinstance(value, list | tuple):
        text = f"({', '.join(map(_summarize, value))})"
        return text if len(text) <= LONGEST_VALUE else count(len(value), "value")
    if isinstance(value, dict):
        return f"{{{', '.join(map(str, value))}}}"
    if callable(value) and hasattr(value, "__name__"):
        return str(value.__name__)
    return _truncate(repr(value), LONGEST_VALUE)


def _truncate(text: str, longest: int) -> str:
    line = " ".join(text.split())
    return line if len(line) <= longest else f"{line[: longest - 3]}..."


def percent(share: float) -> str:
    """A share in per cent with two digits, such as ``2 %``, ``1e-6 %`` or ``130 %``."""
    figure = 100.0 * share
    return f"{figure:.2g} %" if figure < 99.5 else f"{figure:.0f} %"
