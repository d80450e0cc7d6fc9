"""Edges, faces and neighbours of the tetrahedra of a mesh."""

import numpy as np
import numpy.typing as npt

from tetlux.meshing.arrays import FloatArray, IndexArray, IntArray
from tetlux.meshing.errors import InputError
from tetlux.meshing.host.blocks import find_single_keys, group_keys, run_in_blocks

# Faces of a positively oriented tetrahedron, each anticlockwise seen from outside.
FACES = np.array([[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]])
# The edges of the face opposite each corner.
EDGES_OF_FACES = np.array([[3, 4, 5], [1, 2, 5], [0, 2, 4], [0, 1, 3]])
# Corners of a tetrahedron's edges, in the order of `TetMesh.tetrahedron_edges`.
EDGES = np.array([[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]])
# Up to this many nodes, three node numbers fit into one 64-bit key.
MOST_NODES_OF_SHORT_KEYS = 2_600_000


def check_arrays(points: FloatArray, tetrahedra: IntArray) -> None:
    """Refuse points that are not (n, 3) or not finite, and tetrahedra that are not (m, 4) indices of points.

    Raises
    ------
    InputError
    """
    p, t = points, tetrahedra
    if p.ndim != 2 or p.shape[1] != 3 or t.ndim != 2 or t.shape[1] != 4 or len(t) == 0:
        raise InputError(f"a mesh needs (n, 3) points and (m, 4) tetrahedra, not {p.shape} and {t.shape}.")
    if t.min() < 0 or t.max() >= len(p):
        raise InputError("a tetrahedron names a node that does not exist.")
    if not np.isfinite(p).all():
        raise InputError("a node's coordinate is not finite.")


def number_edges(tetrahedra: IntArray, nodes: int) -> tuple[IntArray, IndexArray]:
    """Number the edges of a mesh.

    Parameters
    ----------
    tetrahedra : (m, 4) ndarray
    nodes : int
        Number of nodes of the mesh.

    Returns
    -------
    edges : (e, 2) ndarray
        Node numbers, the smaller first, in ascending order.
    tetrahedron_edges : (m, 6) ndarray
        The edges of each tetrahedron, in the order of `EDGES`.
    """
    keys = np.empty((6, len(tetrahedra)), dtype=np.uint64)

    def fill(block: slice) -> None:
        corners = np.ascontiguousarray(tetrahedra[block].T)
        for edge, (i, j) in enumerate(EDGES):
            low, high = np.minimum(corners[i], corners[j]), np.maximum(corners[i], corners[j])
            keys[edge, block] = low * nodes + high

    run_in_blocks(fill, len(tetrahedra))
    unique, inverse = group_keys(keys.reshape(-1))
    return np.stack(np.divmod(unique.view(np.int64), nodes), axis=1), inverse.reshape(6, -1).T


def face_keys(tetrahedra: IntArray, nodes: int) -> npt.NDArray[np.uint64]:
    """A key for each face of each tetrahedron, (4m,); faces with the same three corners have equal keys."""
    keys = np.empty((len(tetrahedra), 4), dtype=np.uint64)
    short = nodes <= MOST_NODES_OF_SHORT_KEYS
    # In larger meshes, the two smaller corners are replaced by the number of their pair.
    pairs = np.empty((0 if short else len(keys), 4), dtype=np.uint64)

    def fill(block: slice) -> None:
        corners = np.ascontiguousarray(tetrahedra[block].T)
        for face, (i, j, k) in enumerate(FACES):
            a, b, c = corners[i], corners[j], corners[k]
            low, high = np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c)
            pair = low * nodes + (a + b + c - low - high)
            if short:
                keys[block, face] = pair * nodes + high
            else:
                keys[block, face], pairs[block, face] = high, pair

    run_in_blocks(fill, len(keys))
    if not short:
        keys += (group_keys(pairs.reshape(-1))[1].astype(np.uint64) * np.uint64(nodes)).reshape(-1, 4)
    return keys.reshape(-1)


def find_neighbours(tetrahedra: IntArray, nodes: int) -> IndexArray:
    """Find the tetrahedron behind the face opposite each corner, (m, 4); -1 at the boundary."""
    unique, face = group_keys(face_keys(tetrahedra, nodes))
    owners = np.repeat(np.arange(len(tetrahedra)), 4)
    both = np.bincount(face, minlength=len(unique)) == 2
    # The sum of both owners of a face minus this tetrahedron is the neighbour.
    sums = np.bincount(face, owners, len(unique)).astype(np.int64)
    return np.where(both[face], sums[face] - owners, -1).astype(np.int32).reshape(-1, 4)


def find_shared_faces(tetrahedra: IntArray, nodes: int) -> tuple[IntArray, IntArray]:
    """Find the two tetrahedra at each inner face (p, 2), and the corners of the face (p, 3)."""
    face = group_keys(face_keys(tetrahedra, nodes))[1]
    order = np.argsort(face, kind="stable")
    pair = np.flatnonzero(np.diff(face[order]) == 0)
    first = order[pair]
    return np.column_stack([first, order[pair + 1]]) // 4, tetrahedra[first[:, None] // 4, FACES[first % 4]]


def find_boundary(tetrahedra: IntArray, nodes: int) -> tuple[IntArray, IntArray]:
    """Find the faces of only one tetrahedron: ``4 tetrahedron + face`` (f,), and their corners (f, 3)."""
    faces = find_single_keys(face_keys(tetrahedra, nodes))
    return faces, tetrahedra[faces[:, None] // 4, FACES[faces % 4]]


def find_interfaces(tetrahedra: IntArray, regions: IntArray, nodes: int) -> tuple[IntArray, IntArray, IntArray]:
    """Find the triangles between tetrahedra of different regions, as `TetMesh.interfaces` returns them."""
    regions_at = np.zeros(nodes, dtype=np.int64)
    for region in np.unique(regions):
        touched = np.zeros(nodes, dtype=bool)
        touched[tetrahedra[regions == region]] = True
        regions_at += touched
    # Every corner of such a triangle is a node of several regions.
    between = regions_at > 1
    cells = np.flatnonzero(between[tetrahedra].sum(axis=1) > 2)
    faces = tetrahedra[cells][:, FACES].reshape(-1, 3)
    chosen = between[faces].all(axis=1)
    faces, cells = faces[chosen], np.repeat(cells, 4)[chosen]
    region_of = regions[cells]
    key = np.sort(faces, axis=1)
    order = np.lexsort((region_of, key[:, 2], key[:, 1], key[:, 0]))
    first, second = order[:-1], order[1:]
    pair = (key[first] == key[second]).all(axis=1) & (region_of[first] != region_of[second])
    first, second = first[pair], second[pair]
    return (
        faces[first],
        np.column_stack([region_of[first], region_of[second]]),
        np.column_stack([cells[first], cells[second]]),
    )
