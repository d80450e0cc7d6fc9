"""Array types of all signatures, sums by index, frozen arrays, quotients, evenly spaced indices, perpendicular axes."""

from typing import Any

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
# Real or complex numbers, and one of them.
NumberArray = npt.NDArray[Any]
Number = Any
IntArray = npt.NDArray[np.int64]
# Half the memory of an IntArray, for large tables.
IndexArray = npt.NDArray[np.int32]
BoolArray = npt.NDArray[np.bool_]
Vector = tuple[float, float, float]


def sum_by_index(indices: npt.NDArray[np.integer], values: NumberArray, count: int) -> NumberArray:
    """Sum the values with each index 0, 1, ..., (count,); `indices` and `values` have the same shape."""
    if np.iscomplexobj(values):
        return sum_by_index(indices, values.real, count) + 1j * sum_by_index(indices, values.imag, count)
    return np.asarray(np.bincount(indices.reshape(-1), values.reshape(-1), count), dtype=np.float64)


def sum_columns(indices: npt.NDArray[np.integer], values: NumberArray, count: int) -> NumberArray:
    """`sum_by_index` of each of k columns of values, whose shape is that of `indices` and k, (count, k)."""
    return np.stack([sum_by_index(indices, values[..., column], count) for column in range(values.shape[-1])], axis=-1)


def freeze(array: FloatArray) -> FloatArray:
    """The array, or a copy if it is a view of another, that cannot be written to: what is found for it can be kept."""
    frozen = array if array.base is None else array.copy()
    frozen.setflags(write=False)
    return frozen


def divide_or_zero(a: NumberArray, b: NumberArray, smallest: float = 0.0) -> NumberArray:
    """``a/b``, and 0 where the modulus of b is not above `smallest`."""
    return np.divide(a, b, out=np.zeros_like(a), where=~(np.abs(b) <= smallest))


def spread_indices(count: int, most: int) -> IntArray:
    """Evenly spaced indices below `count`, at most `most` of them."""
    return np.arange(min(count, most)) * count // max(min(count, most), 1)


def perpendicular_axes(directions: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Two unit vectors perpendicular to each unit vector d, (..., 3) each: e and d x e."""
    first = np.cross(directions, np.eye(3)[np.abs(directions).argmin(axis=-1)])
    first /= np.linalg.norm(first, axis=-1, keepdims=True)
    return first, np.cross(directions, first)
