"""The array types that all signatures share, and the sum that all assemblies do."""

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]
# Half the memory of an IntArray, for what there is a lot of.
IndexArray = npt.NDArray[np.int32]
BoolArray = npt.NDArray[np.bool_]
Vector = tuple[float, float, float]


def summed(places: npt.NDArray[np.integer], values: FloatArray, count: int) -> FloatArray:
    """Sums (count,) of the values that belong to each place; arrays of one shape, whatever it is."""
    return np.asarray(np.bincount(places.reshape(-1), values.reshape(-1), count), dtype=np.float64)
