"""Tetrahedra that tests make themselves."""

import numpy as np

from tetlux.meshing.arrays import FloatArray, IntArray

# A cube's corners by their bits along x, y and z; six tetrahedra, all round one diagonal.
KUHN = ((0, 1, 3, 7), (0, 5, 1, 7), (0, 3, 2, 7), (0, 2, 6, 7), (0, 4, 5, 7), (0, 6, 4, 7))


def cube_of_cubes(cubes: int, size: float) -> tuple[FloatArray, IntArray, IntArray]:
    """A cube from the origin, of so many cubes along each edge, in six positive tetrahedra each.

    Returns
    -------
    points : (n, 3) ndarray
    tetrahedra : (m, 4) ndarray
    places : (m, 3) ndarray
        Which cube each is in, along x, y and z.
    """
    count = cubes + 1
    z, y, x = np.meshgrid(*[np.arange(count)] * 3, indexing="ij")
    points = size * np.column_stack([x.ravel(), y.ravel(), z.ravel()]).astype(np.float64)
    k, j, i = (each.ravel() for each in np.meshgrid(*[np.arange(cubes)] * 3, indexing="ij"))
    corners = np.stack(
        [((k + (bit >> 2)) * count + j + (bit >> 1 & 1)) * count + i + (bit & 1) for bit in range(8)], axis=1
    )
    tetrahedra = corners[:, np.array(KUHN)].reshape(-1, 4)
    places = np.repeat(np.column_stack([i, j, k]), len(KUHN), axis=0)
    a, b, c, d = points[tetrahedra].transpose(1, 0, 2)
    inverted = np.einsum("ij,ij->i", b - a, np.cross(c - a, d - a)) < 0
    tetrahedra[inverted] = tetrahedra[inverted][:, [1, 0, 2, 3]]
    return points, tetrahedra, places
