"""The matrix of the weak form in `tetlux.fem.operators.forms` for quadratic elements, and integrals of loads."""

import numpy as np
import numpy.typing as npt
from scipy.sparse import coo_array, csr_array

from tetlux.fem.media.coefficients import Coefficients
from tetlux.fem.models.boundary import boundary_condition_of
from tetlux.fem.quadratic.elements import (
    TRIANGLE_EDGES,
    cell_rule,
    face_rule,
    reference_mass,
    reference_stiffness,
    shape_derivatives,
    shape_functions,
)
from tetlux.fem.quadratic.space import QuadraticSpace
from tetlux.meshing.arrays import FloatArray, IntArray, Number, NumberArray, sum_by_index
from tetlux.meshing.host.blocks import run_in_blocks

# Number of tetrahedra that are integrated at once.
BLOCK = 2048

Indices = npt.NDArray[np.int32]


def matrix_of(space: QuadraticSpace, coefficients: Coefficients) -> csr_array:
    """The symmetric matrix of a space, (size, size)."""
    robin = boundary_condition_of(coefficients.outer).robin
    return assemble(
        space, coefficients.diffusion, coefficients.sigma, robin * face_matrices(space, space.boundary_faces)
    )


def assemble(
    space: QuadraticSpace,
    diffusion: Number | NumberArray,
    sigma: Number | NumberArray,
    boundary: FloatArray | None = None,
) -> csr_array:
    """The matrix of a space, (size, size), by `element_matrices` and those of its boundary triangles (f, 6, 6).

    The upper triangle alone is summed, which takes a third of the memory, and mirrored.
    """
    cells, faces = space.cells, space.boundary_faces[: 0 if boundary is None else None]
    each_cell, each_face = (len(np.triu_indices(dofs.shape[1])[0]) for dofs in (cells, faces))
    of_cells, of_faces = len(cells) * each_cell, len(faces) * each_face
    values = np.empty(of_cells + of_faces, np.result_type(diffusion, sigma, np.float64))
    rows, columns = np.empty((2, len(values)), dtype=np.int32)
    _curved_elements(space)  # before threads ask for them

    def work(block: slice) -> None:
        some = np.arange(block.start, block.stop)
        own = [each if np.ndim(each) == 0 else np.asarray(each)[block] for each in (diffusion, sigma)]
        place = slice(block.start * each_cell, block.stop * each_cell)
        _fill(cells[block], element_matrices(space, own[0], own[1], some), values[place], rows[place], columns[place])

    run_in_blocks(work, len(cells), BLOCK)
    if boundary is not None:
        _fill(faces, boundary, values[of_cells:], rows[of_cells:], columns[of_cells:])
    upper = csr_array(coo_array((values, (rows, columns)), shape=(space.size, space.size)))
    return csr_array(upper + csr_array(upper.T))


def _fill(dofs: IntArray, matrices: NumberArray, values: NumberArray, rows: Indices, columns: Indices) -> None:
    """Put the upper triangles of matrices (m, c, c), and half of their diagonals, into parts of a `coo_array`."""
    first, second = np.triu_indices(dofs.shape[1])
    values[:] = (matrices[:, first, second] * np.where(first == second, 0.5, 1.0)).ravel()
    rows[:] = np.minimum(dofs[:, first], dofs[:, second]).ravel()
    columns[:] = np.maximum(dofs[:, first], dofs[:, second]).ravel()


def element_matrices(
    space: QuadraticSpace, diffusion: Number | NumberArray, sigma: Number | NumberArray, cells: IntArray
) -> NumberArray:
    """Matrices of tetrahedra without boundary terms.

    Parameters
    ----------
    space : QuadraticSpace
    diffusion, sigma : number or (c,) ndarray
        D, unit, and the coefficient of the fluence, 1/unit, of each; complex matrices if they are.
    cells : (c,) ndarray
        Numbers of the tetrahedra, ascending.

    Returns
    -------
    (c, 10, 10) ndarray
    """
    mesh = space.mesh
    each_diffusion, each_sigma = (np.broadcast_to(value, len(cells)) for value in (diffusion, sigma))
    hats, volumes = mesh.hat_gradients[cells], mesh.volumes[cells]
    products = (each_diffusion * volumes)[:, None] * np.einsum("mpi,mri->mpr", hats, hats).reshape(-1, 16)
    values = products @ reference_stiffness() + (each_sigma * volumes)[:, None] * reference_mass()
    values = values.reshape(-1, 10, 10)
    places = space.places_of_curved[cells]
    curved = np.flatnonzero(places >= 0)
    stiffness, mass = _curved_elements(space)
    own = each_diffusion[curved, None, None] * stiffness[places[curved]]
    values[curved] = own + each_sigma[curved, None, None] * mass[places[curved]]
    return np.asarray(values)


def _curved_elements(space: QuadraticSpace) -> FloatArray:
    """Stiffness and mass matrices of curved tetrahedra for coefficients of 1, (2, c, 10, 10); made once for a mesh."""
    return space.mesh.cache.get(("curved elements", space), lambda: _integrate_curved(space))


def _integrate_curved(space: QuadraticSpace) -> FloatArray:
    curved = space.curved
    values = np.empty((2, len(curved), 10, 10))
    shape_values = shape_functions(cell_rule().points)
    pairs = (shape_values[:, :, None] * shape_values[:, None, :]).reshape(-1, 100)

    def integrate(block: slice) -> None:
        slopes, weights = gradients(space, curved[block], cell_rule().points, cell_rule().weights)
        values[0, block] = np.einsum("cq,cqai,cqbi->cab", weights, slopes, slopes, optimize=True)
        values[1, block] = (weights @ pairs).reshape(-1, 10, 10)

    run_in_blocks(integrate, len(curved), BLOCK)
    return values


def gradients(
    space: QuadraticSpace, cells: IntArray, barycentric: FloatArray, weights: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Gradients of shape functions, (c, q, 10, 3), and volumes, (c, q), at quadrature points of tetrahedra.

    The barycentric coordinates of the points are (q, 4) for all tetrahedra or (c, q, 4) for each; weights are (q,).
    """
    slopes = shape_derivatives(barycentric) @ space.mesh.hat_gradients[cells][:, None]
    jacobians = space.jacobians(cells, barycentric)
    volumes = space.mesh.volumes[cells][:, None] * weights * np.linalg.det(jacobians)
    return slopes @ np.linalg.inv(jacobians), volumes


def face_matrices(space: QuadraticSpace, faces: IntArray) -> FloatArray:
    """Integrals of products of shape functions over triangles with DOF numbers (f, 6), (f, 6, 6)."""
    shape_values = shape_functions(face_rule().points, TRIANGLE_EDGES)
    areas = face_rule().weights * np.linalg.norm(face_normals(space, faces, face_rule().points), axis=2)
    pairs = (shape_values[:, :, None] * shape_values[:, None, :]).reshape(-1, 36)
    return np.asarray((areas @ pairs).reshape(-1, 6, 6))


def face_normals(space: QuadraticSpace, faces: IntArray, barycentric: FloatArray) -> FloatArray:
    """Normals of triangles (f, 6) at barycentric coordinates (q, 3), with the area as length, (f, q, 3)."""
    slopes = np.einsum("qap,fai->fqpi", shape_derivatives(barycentric, TRIANGLE_EDGES), space.corners_and_bends(faces))
    return np.asarray(0.5 * np.cross(slopes[:, :, 1] - slopes[:, :, 0], slopes[:, :, 2] - slopes[:, :, 0]))


def weighted_product(space: QuadraticSpace, weights: NumberArray, function: NumberArray) -> NumberArray:
    """``∫ w u v`` of weights in tetrahedra (m,) and a function (size,), (size,)."""
    mesh, curved = space.mesh, space.curved
    at_dofs = function[space.cells]
    values = (weights * mesh.volumes)[:, None] * (at_dofs @ reference_mass().reshape(10, 10))
    shape_values = shape_functions(cell_rule().points)
    volumes = mesh.volumes[curved, None] * cell_rule().weights * space.curved_determinants
    values[curved] = (weights[curved, None] * volumes * (at_dofs[curved] @ shape_values.T)) @ shape_values
    return sum_by_index(space.cells, values, space.size)


def volume_load(space: QuadraticSpace, density: FloatArray) -> FloatArray:
    """``∫ Q0 v`` of densities in tetrahedra (m,), (size,)."""
    mesh = space.mesh
    means = np.full((len(density), 10), 0.25)
    means[:, 4:] = 0.2
    values = (density * mesh.volumes)[:, None] * means
    curved = space.curved
    volumes = mesh.volumes[curved, None] * cell_rule().weights * space.curved_determinants
    values[curved] = density[curved, None] * (volumes @ shape_functions(cell_rule().points))
    return sum_by_index(space.cells, values, space.size)


def surface_load(space: QuadraticSpace, at_nodes: FloatArray) -> FloatArray:
    """``∮ q v`` of densities q that are linear on boundary triangles, by their values at all nodes (n,), (size,)."""
    corners = space.mesh.boundary_faces
    faces = space.faces(corners)
    areas = face_rule().weights * np.linalg.norm(face_normals(space, faces, face_rule().points), axis=2)
    values = (areas * (at_nodes[corners] @ face_rule().points.T)) @ shape_functions(face_rule().points, TRIANGLE_EDGES)
    return sum_by_index(faces, values, space.size)
