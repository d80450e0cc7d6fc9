"""`Pattern`: where the matrices on a mesh have entries, which is on the diagonal and along edges."""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array

from tetlux.meshing.arrays import IndexArray, NumberArray
from tetlux.meshing.describe import one_line
from tetlux.meshing.tets.mesh import TetMesh


@dataclass(frozen=True, eq=False)
class Pattern:
    """The rows of symmetric matrices on the nodes of a mesh, in CSR form with sorted columns.

    Attributes
    ----------
    starts : (n + 1,) ndarray
        Where each row starts.
    columns : (z,) ndarray
    source : (z,) ndarray
        Where the value of each entry is among those of the edges followed by those of the diagonal.
    """

    starts: IndexArray
    columns: IndexArray
    source: IndexArray

    def matrix(self, edges: NumberArray, diagonal: NumberArray) -> csr_array:
        """The matrix (n, n) of given values of the edges (e,) and of the diagonal (n,)."""
        values = np.concatenate([edges, diagonal])[self.source]
        return csr_array((values, self.columns, self.starts), shape=(len(diagonal), len(diagonal)))

    __repr__ = one_line


def pattern_of(mesh: TetMesh) -> Pattern:
    """The pattern of all matrices on a mesh."""
    nodes, (low, high) = len(mesh.points), mesh.edges.T
    count = np.arange(len(low), dtype=np.int32)
    above = np.concatenate([[0], np.cumsum(np.bincount(low, minlength=nodes))])
    below = np.concatenate([[0], np.cumsum(np.bincount(high, minlength=nodes))])
    # Edges are sorted by their smaller node; sorted by their larger one they are the rows of the lower triangle.
    transposed = csr_array((count, high.astype(np.int32), above.astype(np.int32)), shape=(nodes, nodes)).tocsc()
    starts = above + below + np.arange(nodes + 1)
    middle = starts[:-1] + np.diff(below)
    columns, source = np.empty((2, starts[-1]), dtype=np.int32)
    place = middle[low] + 1 + count - above[low]
    columns[place], source[place] = high, count
    other = high[transposed.data]
    place = starts[other] + count - below[other]
    columns[place], source[place] = transposed.indices, transposed.data
    columns[middle], source[middle] = np.arange(nodes), len(low) + np.arange(nodes)
    return Pattern(starts.astype(np.int32), columns, source)
