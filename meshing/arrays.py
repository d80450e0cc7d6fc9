"""Array types of all signatures, sums by index, and evenly spaced indices."""

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]
# Half the memory of an IntArray, for large tables.
IndexArray = npt.NDArray[np.int32]
BoolArray = npt.NDArray[np.bool_]
Vector = tuple[float, float, float]


def sum_by_index(indices: npt.NDArray[np.integer], values: FloatArray, count: int) -> FloatArray:
    """Sum the values with each index 0, 1, ..., (count,); `indices` and `values` have the same shape."""
    return np.asarray(np.bincount(indices.reshape(-1), values.reshape(-1), count), dtype=np.float64)


def spread_indices(count: int, most: int) -> IntArray:
    """Evenly spaced indices below `count`, at most `most` of them."""
    return np.arange(min(count, most)) * count // max(min(count, most), 1)
