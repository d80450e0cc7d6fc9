"""Arrays as compressed text, which the script of the viewer reads (``source/arrays.js``)."""

import base64
import gzip
from typing import Any

import numpy as np
import numpy.typing as npt

Packed = dict[str, Any]
# Of gzip: higher levels save 1 % and take three times as long.
LEVEL = 6


def pack_floats(values: npt.ArrayLike) -> Packed:
    """Pack numbers (n, ...) as 32-bit floats and a factor; nan and infinity are kept.

    The factor is the largest absolute value, so that no unit of length makes values that 32 bits cannot hold.
    """
    numbers = np.asarray(values, dtype=np.float64)
    factor = float(np.abs(numbers[np.isfinite(numbers)]).max(initial=0.0)) or 1.0
    return {"factor": factor, **_pack((numbers / factor).astype("<f4"))}


def pack_indices(indices: npt.ArrayLike) -> Packed:
    """Pack indices (n, k) as the differences from row to row, which repeat more often than the indices do."""
    numbers = np.asarray(indices).astype("<u4")
    differences = np.diff(numbers, axis=0, prepend=np.zeros((1, *numbers.shape[1:]), "<u4"))
    return {"differences": True, **_pack(differences.astype("<u4"))}


def pack_bytes(values: npt.NDArray[np.uint8]) -> Packed:
    """Pack bytes (n, k)."""
    return _pack(values)


def _pack(numbers: npt.NDArray[np.generic]) -> Packed:
    """Pack the first bytes of all numbers, then the second ones and so on, which compresses better than in turn."""
    planes = np.ascontiguousarray(numbers).view(np.uint8).reshape(-1, numbers.dtype.itemsize).T
    # Without the time, so that the same run gives the same file.
    packed = gzip.compress(planes.tobytes(), LEVEL, mtime=0)
    return {"type": numbers.dtype.name, "shape": list(numbers.shape), "data": base64.b64encode(packed).decode()}
