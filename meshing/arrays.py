"""Array types for all signatures, and the scatter-add that assembly uses."""

from typing import Any

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
# Real or complex numbers.
NumberArray = npt.NDArray[Any]
IntArray = npt.NDArray[np.int64]
# Half the memory of an IntArray, for large tables.
IndexArray = npt.NDArray[np.int32]
BoolArray = npt.NDArray[np.bool_]
Vector = tuple[float, float, float]


def summed(places: npt.NDArray[np.integer], values: FloatArray, count: int) -> FloatArray:
    """Sums (count,) of values by place; `places` and `values` have the same shape."""
    return np.asarray(np.bincount(places.reshape(-1), values.reshape(-1), count), dtype=np.float64)


def spread_indices(count: int, most: int) -> IntArray:
    """Evenly spaced indices below `count`, at most `most` of them."""
    return np.arange(min(count, most)) * count // max(min(count, most), 1)
