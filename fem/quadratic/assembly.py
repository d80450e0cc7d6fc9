"""The matrix of the weak form in `tetlux.fem.operators.forms` for quadratic elements, and integrals of functions."""

import numpy as np
from scipy.sparse import coo_array, csr_array

from tetlux.fem.media.coefficients import Coefficients, at_cells
from tetlux.fem.models.boundary import boundary_condition_of
from tetlux.fem.quadratic.elements import MASS, STIFFNESS, TETRAHEDRON, TRIANGLE, TRIANGLE_EDGES, derivatives, functions
from tetlux.fem.quadratic.space import QuadraticSpace
from tetlux.meshing.arrays import FloatArray, IntArray, sum_by_index
from tetlux.meshing.host.blocks import run_in_blocks

# Curved tetrahedra that are integrated at once.
BLOCK = 2048


def matrix_of(space: QuadraticSpace, coefficients: Coefficients, elements: FloatArray) -> csr_array:
    """The matrix of a space, (size, size), symmetric, by its `element_matrices`."""
    faces = space.faces(space.mesh.boundary_faces)
    escaping = boundary_condition_of(coefficients.outer).robin * face_matrices(space, faces)
    return csr_array(_scattered(space.cells, elements, space.size) + _scattered(faces, escaping, space.size))


def _scattered(places: IntArray, values: FloatArray, size: int) -> csr_array:
    """The sum of element matrices (m, c, c) at places (m, c)."""
    count = places.shape[1]
    rows = np.repeat(places.astype(np.int32), count, axis=1).ravel()
    columns = np.tile(places.astype(np.int32), count).ravel()
    return csr_array(coo_array((values.ravel(), (rows, columns)), shape=(size, size)))


def element_matrices(space: QuadraticSpace, coefficients: Coefficients) -> FloatArray:
    """Matrices of the tetrahedra of a mesh, without its boundary, (m, 10, 10)."""
    mesh, curved = space.mesh, space.curved
    every = np.arange(len(mesh.tetrahedra))
    diffusion, sigma_a = (at_cells(value, every) for value in (coefficients.diffusion, coefficients.sigma_a))
    hats, volumes = mesh.hat_gradients, mesh.volumes
    products = (diffusion * volumes)[:, None] * np.einsum("mpi,mri->mpr", hats, hats).reshape(-1, 16)
    values = products @ STIFFNESS + (sigma_a * volumes)[:, None] * MASS
    values = values.reshape(-1, 10, 10)

    def integrate(block: slice) -> None:
        some = curved[block]
        slopes, weights = gradients(space, some, TETRAHEDRON[0], TETRAHEDRON[1])
        own = np.einsum("cq,cqai,cqbi->cab", diffusion[some, None] * weights, slopes, slopes, optimize=True)
        hats_there = functions(TETRAHEDRON[0])
        pairs = (hats_there[:, :, None] * hats_there[:, None, :]).reshape(-1, 100)
        values[some] = own + ((sigma_a[some, None] * weights) @ pairs).reshape(-1, 10, 10)

    run_in_blocks(integrate, len(curved), BLOCK)
    return np.asarray(values)


def gradients(
    space: QuadraticSpace, cells: IntArray, places: FloatArray, weights: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Gradients of the functions of tetrahedra, (c, q, 10, 3), and volumes, (c, q), at points of a rule (q,).

    The points are barycentric coordinates, (q, 4) for all tetrahedra or (c, q, 4) for each.
    """
    slopes = derivatives(places) @ space.mesh.hat_gradients[cells][:, None]
    bending = space.bending(cells, places)
    volumes = space.mesh.volumes[cells][:, None] * weights * np.linalg.det(bending)
    return slopes @ np.linalg.inv(bending), volumes


def face_matrices(space: QuadraticSpace, faces: IntArray) -> FloatArray:
    """Integrals of products of the functions over triangles (f, 6), (f, 6, 6)."""
    hats = functions(TRIANGLE[0], TRIANGLE_EDGES)
    areas = TRIANGLE[1] * np.linalg.norm(face_normals(space, faces, TRIANGLE[0]), axis=2)
    pairs = (hats[:, :, None] * hats[:, None, :]).reshape(-1, 36)
    return np.asarray((areas @ pairs).reshape(-1, 6, 6))


def face_normals(space: QuadraticSpace, faces: IntArray, places: FloatArray) -> FloatArray:
    """Normals of triangles (f, 6) at barycentric coordinates (q, 3), as long as their area, (f, q, 3)."""
    slopes = np.einsum("qap,fai->fqpi", derivatives(places, TRIANGLE_EDGES), space.corners_and_bends(faces))
    return np.asarray(0.5 * np.cross(slopes[:, :, 1] - slopes[:, :, 0], slopes[:, :, 2] - slopes[:, :, 0]))


def volume_load(space: QuadraticSpace, density: FloatArray) -> FloatArray:
    """``∫ Q0 v`` of densities in tetrahedra (m,), (size,)."""
    mesh = space.mesh
    means = np.full((len(density), 10), 0.25)
    means[:, 4:] = 0.2
    values = (density * mesh.volumes)[:, None] * means
    curved = space.curved
    volumes = mesh.volumes[curved][:, None] * TETRAHEDRON[1] * np.linalg.det(space.bending(curved, TETRAHEDRON[0]))
    values[curved] = density[curved, None] * (volumes @ functions(TETRAHEDRON[0]))
    return sum_by_index(space.cells, values, space.size)


def surface_load(space: QuadraticSpace, at_nodes: FloatArray) -> FloatArray:
    """``∮ q v`` of densities q that are linear on boundary triangles, by their values at all nodes (n,), (size,)."""
    corners = space.mesh.boundary_faces
    faces = space.faces(corners)
    areas = TRIANGLE[1] * np.linalg.norm(face_normals(space, faces, TRIANGLE[0]), axis=2)
    values = (areas * (at_nodes[corners] @ TRIANGLE[0].T)) @ functions(TRIANGLE[0], TRIANGLE_EDGES)
    return sum_by_index(faces, values, space.size)
