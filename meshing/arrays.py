"""The array types that all signatures share."""

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]
# Half the memory of an IntArray, for what there is a lot of.
IndexArray = npt.NDArray[np.int32]
BoolArray = npt.NDArray[np.bool_]
Vector = tuple[float, float, float]
