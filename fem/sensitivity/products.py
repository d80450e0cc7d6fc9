"""Products of solutions and dual solutions in tetrahedra: ``∫ u z`` and ``∫ grad u . grad z``."""

from dataclasses import dataclass
from threading import Lock

import numpy as np
import numpy.typing as npt
from scipy.sparse import csr_array

from tetlux.fem.quadratic.assembly import element_matrices
from tetlux.fem.quadratic.space import QuadraticSpace
from tetlux.meshing.arrays import BoolArray, FloatArray, IntArray, NumberArray
from tetlux.meshing.describe import one_line
from tetlux.meshing.host.blocks import run_in_blocks

# Tetrahedra whose products are made at once.
BLOCK = 2048


@dataclass(frozen=True, eq=False)
class Sums:
    """Sums over parameters of products in tetrahedra.

    Attributes
    ----------
    mass, stiffness : (p, l, d) ndarray
        ``∫ u z`` and ``∫ 3 D² grad u . grad z``.
    mass_of_media : (r, l, d) ndarray
        ``∫ u z`` over each medium.
    """

    mass: NumberArray
    stiffness: NumberArray
    mass_of_media: NumberArray

    __repr__ = one_line


def multiply(
    space: QuadraticSpace,
    fluences: NumberArray,
    duals: NumberArray,
    factors: FloatArray,
    shares: csr_array,
    media: csr_array,
    dtype: npt.DTypeLike,
) -> Sums:
    """Multiply each of l fluences (size, l) by each of d dual solutions (size, d).

    Parameters
    ----------
    space : QuadraticSpace
    fluences, duals : (size, l), (size, d) ndarray
    factors : (m,) ndarray
        ``3 D²`` of each tetrahedron, unit².
    shares : (m, p) csr_array
        Of each parameter in each tetrahedron.
    media : (m, r) csr_array
        Whether each tetrahedron is of each medium.
    dtype : dtype
        Of the sums.

    Returns
    -------
    Sums
    """
    columns = fluences.shape[1] * duals.shape[1]
    mass, stiffness = np.zeros((2, shares.shape[1], columns), dtype)
    of_media, lock = np.zeros((media.shape[1], columns), np.result_type(fluences, duals)), Lock()
    every = np.arange(len(space.cells))

    def work(block: slice) -> None:
        cells, dofs = every[block], space.cells[block]
        lit, dual = fluences[dofs], np.ascontiguousarray(duals[dofs])
        parameters, local = _used_columns(shares[block])
        for target, diffusion, sigma in ((mass, 0.0, 1.0), (stiffness, factors[block], 0.0)):
            images = element_matrices(space, diffusion, sigma, cells) @ lit
            products = (images.swapaxes(1, 2) @ dual).reshape(len(cells), -1)
            sums = local.T @ products
            with lock:
                target[parameters] += sums
                if target is mass:
                    of_media[:] += media[block].T @ products

    run_in_blocks(work, len(every), BLOCK)
    shape = fluences.shape[1], duals.shape[1]
    return Sums(mass.reshape(-1, *shape), stiffness.reshape(-1, *shape), of_media.reshape(-1, *shape))


def multiply_on(
    space: QuadraticSpace, functions: NumberArray, within: BoolArray, duals: NumberArray, factors: FloatArray
) -> tuple[NumberArray, NumberArray]:
    """Multiply functions, each on some tetrahedra alone, by dual solutions.

    Parameters
    ----------
    space : QuadraticSpace
    functions, duals : (size, k), (size, d) ndarray
    within : (m, k) ndarray of bool
        Whether each tetrahedron counts for each function.
    factors : (m,) ndarray
        ``3 D²`` of each tetrahedron, unit².

    Returns
    -------
    mass, stiffness : (k, d) ndarray
        ``∫ u z`` and ``∫ 3 D² grad u . grad z``.
    """
    found, lock = np.zeros((2, functions.shape[1], duals.shape[1]), np.result_type(functions, duals)), Lock()
    every = np.flatnonzero(within.any(axis=1))

    def work(block: slice) -> None:
        cells = every[block]
        dofs = space.cells[cells]
        lit, dual = functions[dofs] * within[cells, None], duals[dofs].reshape(-1, duals.shape[1])
        for target, (diffusion, sigma) in enumerate(((0.0, 1.0), (factors[cells], 0.0))):
            images = (element_matrices(space, diffusion, sigma, cells) @ lit).reshape(-1, functions.shape[1])
            products = images.T @ dual
            with lock:
                found[target] += products

    run_in_blocks(work, len(every), BLOCK)
    return found[0], found[1]


def _used_columns(part: csr_array) -> tuple[IntArray, csr_array]:
    """The columns of a matrix that are not empty, (u,), and the matrix without the others."""
    columns, inverse = np.unique(part.indices, return_inverse=True)
    return np.asarray(columns, dtype=np.int64), csr_array(
        (part.data, inverse.reshape(-1), part.indptr), shape=(part.shape[0], len(columns))
    )
