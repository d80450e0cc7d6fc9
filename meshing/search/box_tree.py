"""A tree of boxes that is searched for thousands of queries at once."""

from collections.abc import Callable, Iterator

import numpy as np
from scipy.spatial import cKDTree

from tetlux.meshing.arrays import BoolArray, FloatArray, IntArray

# Children per box of the tree, and pairs of a query and a box that are processed at once (some megabytes).
CHILDREN = 8
PAIRS_AT_ONCE = 1 << 13
# Whether each of some queries (k,) meets any of the boxes next to it: centres and half sides, (k, 6, CHILDREN).
Meets = Callable[[IntArray, FloatArray], BoolArray]


class BoxTree:
    """Boxes, each around a triangle or a tetrahedron, in a tree of larger boxes.

    Parameters
    ----------
    low, high : (3, m) ndarray
        Corners of the boxes.
    """

    def __init__(self, low: FloatArray, high: FloatArray) -> None:
        # The leaf order of a k-d tree keeps neighbours together, also in graded meshes.
        leaves = cKDTree((0.5 * (low + high)).T, balanced_tree=False, compact_nodes=False)
        self._order = np.asarray(leaves.indices, dtype=np.int64)
        low, high = low.take(self._order, axis=1), high.take(self._order, axis=1)
        # From the given boxes up to the root: centres and half sides (boxes, 6, CHILDREN) of each box's children.
        self._levels: list[FloatArray] = []
        while not self._levels or len(self._levels[-1]) > 1:
            # Padded with empty boxes.
            padding = ((0, 0), (0, -low.shape[1] % CHILDREN))
            low = np.pad(low, padding, constant_values=1e100).reshape(3, -1, CHILDREN)
            high = np.pad(high, padding, constant_values=-1e100).reshape(3, -1, CHILDREN)
            boxes = np.concatenate([0.5 * (low + high), 0.5 * (high - low)])
            self._levels.append(np.ascontiguousarray(boxes.swapaxes(0, 1)))
            # NumPy is slow along short axes, so loop over them.
            low = np.minimum.reduce([low[:, :, part] for part in range(CHILDREN)])
            high = np.maximum.reduce([high[:, :, part] for part in range(CHILDREN)])

    def pairs(self, count: int, meets: Meets) -> Iterator[tuple[slice, IntArray, IntArray]]:
        """Find the pairs of a query and a box that meet.

        Parameters
        ----------
        count : int
            Number of queries.
        meets : callable
            Must hold for a box if it holds for a box within it.

        Yields
        ------
        some : slice
            Of the queries.
        queries, boxes : (k,) ndarray
            Their pairs, in ascending order of queries.
        """
        everything = np.arange(count)
        todo = [(0, count, len(self._levels) - 1, everything, np.zeros_like(everything))]
        while todo:
            first, last, level, queries, boxes = todo.pop()
            if len(queries) > PAIRS_AT_ONCE and last - first > 1:
                middle = (first + last) // 2
                half = int(np.searchsorted(queries, middle))
                todo.append((middle, last, level, queries[half:], boxes[half:]))
                todo.append((first, middle, level, queries[:half], boxes[:half]))
            elif level < 0:
                yield slice(first, last), queries, self._order[boxes]
            else:
                pair, part = np.nonzero(meets(queries, self._levels[level][boxes]))
                todo.append((first, last, level - 1, queries[pair], boxes[pair] * CHILDREN + part))
