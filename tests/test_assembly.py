"""The system matrix in closed form against the weak form by scikit-fem, and what must hold of it."""

import numpy as np
import pytest
from scipy.sparse import csr_array
from scipy.spatial import Delaunay
from skfem import Basis as SkfemBasis
from skfem import BilinearForm, ElementTetP0, ElementTetP1, FacetBasis, MeshTet1
from skfem.helpers import dot, grad

from tests.conftest import TISSUE, block
from tetlux.fem import Medium
from tetlux.fem.media.coefficients import coefficients_of
from tetlux.fem.operators.assembly import Assembly, Lumping, system_matrix
from tetlux.fem.operators.forms import weak_form_matrix
from tetlux.meshing import TetMesh
from tetlux.meshing.tets.geometry import tetrahedron_volumes

CLEAR = Medium(sigma_a=0.0, sigma_s_prime=9.0, eta=2.0)
MASSES: tuple[Lumping, ...] = ("lumped", "consistent")


def random_mesh(seed: int, nodes: int = 400) -> TetMesh:
    """Delaunay tetrahedra of random points, far from the origin, without the flattest ones at the rim."""
    points = np.random.default_rng(seed).uniform(size=(nodes, 3)) * (3.0, 1.0, 0.5) + (5.0, -7.0, 2.0)
    cells = Delaunay(points).simplices.astype(np.int64)
    volumes = tetrahedron_volumes(points, cells)
    cells[volumes < 0] = cells[volumes < 0][:, [1, 0, 2, 3]]
    good = TetMesh(points, cells).quality > 1e-2
    used, cells = np.unique(cells[good], return_inverse=True)
    return TetMesh(points[used], cells.reshape(-1, 4))


def gap(a: csr_array, b: csr_array) -> float:
    """Largest difference of two matrices against the largest entry."""
    return float(abs(a - b).max() / abs(b).max())


@pytest.mark.parametrize("mass", MASSES)
@pytest.mark.parametrize("seed", range(3))
def test_it_is_the_matrix_of_the_weak_form(seed: int, mass: Lumping) -> None:
    mesh = random_mesh(seed)
    # Each term counts: none is lost in the rounding of another.
    for medium in (
        TISSUE,
        Medium(sigma_a=500.0, sigma_s_prime=1.0, eta=1.0),
        Medium(sigma_a=0, sigma_s_prime=9, eta=2),
    ):
        assert gap(system_matrix(mesh, medium, mass), weak_form_matrix(mesh, medium, mass)) < 1e-12


@pytest.mark.parametrize("mass", MASSES)
def test_it_is_that_of_a_mesh_from_the_mesher(ball_mesh: TetMesh, mass: Lumping) -> None:
    assert gap(system_matrix(ball_mesh, TISSUE, mass), weak_form_matrix(ball_mesh, TISSUE, mass)) < 1e-12


@pytest.mark.parametrize("mass", MASSES)
def test_coefficients_may_differ_from_tetrahedron_to_tetrahedron(mass: Lumping) -> None:
    """Against scikit-fem with coefficients that are constant on each tetrahedron."""
    mesh = random_mesh(3)
    rng = np.random.default_rng(4)
    diffusion, sigma_a = rng.uniform(0.1, 9.0, (2, len(mesh.tetrahedra)))
    robin = rng.uniform(0.1, 0.5, len(mesh.boundary_faces))
    body = MeshTet1(np.ascontiguousarray(mesh.points.T), np.ascontiguousarray(mesh.tetrahedra.T))
    corners = (np.array([[0.0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]), np.full(4, 1 / 24))
    rule = {"quadrature": corners} if mass == "lumped" else {"intorder": 2}
    inside = SkfemBasis(body, ElementTetP1(), **rule)
    constants = inside.with_element(ElementTetP0())
    values = {"D": constants.interpolate(diffusion), "sigma_a": constants.interpolate(sigma_a)}
    form = BilinearForm(lambda u, v, w: w.D * dot(grad(u), grad(v)) + w.sigma_a * u * v)
    expected = csr_array(form.assemble(inside, **values))
    found = Assembly(mesh).matrix(diffusion, sigma_a, np.zeros(len(robin)), mass)
    assert gap(found, expected) < 1e-12
    # The boundary alone, triangle by triangle.
    boundary = Assembly(mesh).matrix(np.zeros(len(diffusion)), 0.0, robin, mass).toarray()
    triangle = np.eye(3) / 3.0 if mass == "lumped" else (np.ones((3, 3)) + np.eye(3)) / 12.0
    by_hand = np.zeros_like(boundary)
    for face, area, value in zip(mesh.boundary_faces, mesh.boundary_areas, robin, strict=True):
        by_hand[np.ix_(face, face)] += value * area * triangle
    assert np.abs(boundary - by_hand).max() < 1e-12 * by_hand.max()
    # A constant array and a number are the same thing.
    one = Assembly(mesh)
    same = one.matrix(np.full(len(diffusion), 0.3), np.full(len(diffusion), 0.2), np.full(len(robin), 0.1), mass)
    assert gap(one.matrix(0.3, 0.2, 0.1, mass), same) < 1e-13


@pytest.mark.parametrize("mass", MASSES)
def test_a_shift_adds_to_the_absorption_coefficient(mass: Lumping) -> None:
    mesh = random_mesh(6)
    sigma_a = np.random.default_rng(7).uniform(0.1, 9.0, len(mesh.tetrahedra))
    assembly = Assembly(mesh)
    terms = assembly.terms(0.3, sigma_a, 0.1, mass)
    assert gap(terms.combine(2.5), assembly.matrix(0.3, sigma_a + 2.5, 0.1, mass)) < 1e-13
    shifted = terms.combine(0.5 + 2.5j)
    assert gap(shifted.real, assembly.matrix(0.3, sigma_a + 0.5, 0.1, mass)) < 1e-13
    # Absorption alone, by scikit-fem: D next to nothing.
    alone = weak_form_matrix(mesh, Medium(sigma_a=2.5, sigma_s_prime=1e30, eta=1.0), mass)
    boundary = assembly.matrix(0.0, 0.0, 0.5, mass)
    assert gap(csr_array(shifted.imag), csr_array(alone - boundary)) < 1e-13


@pytest.mark.parametrize("mass", MASSES)
def test_terms_say_what_is_absorbed_and_what_leaves(ball_mesh: TetMesh, mass: Lumping) -> None:
    sigma_a = np.linspace(0.1, 0.2, len(ball_mesh.tetrahedra))
    terms = Assembly(ball_mesh).terms(0.3, sigma_a, 0.1, mass)
    absorbed, leaving = terms.absorption.row_sums(ball_mesh), terms.boundary_term.row_sums(ball_mesh)
    assert absorbed.sum() == pytest.approx(sigma_a @ ball_mesh.volumes, rel=1e-12)
    assert leaving.sum() == pytest.approx(0.1 * ball_mesh.area, rel=1e-12)
    assert np.abs(terms.stiffness.row_sums(ball_mesh)).max() < 1e-14


@pytest.mark.parametrize("mass", MASSES)
def test_power_is_kept(ball_mesh: TetMesh, mass: Lumping) -> None:
    """Constants do not diffuse: the matrix times one is what absorbs and what lets out, node by node."""
    matrix = system_matrix(ball_mesh, TISSUE, mass)
    expected = TISSUE.sigma_a * ball_mesh.node_volumes
    expected[ball_mesh.boundary_nodes] += ball_mesh.boundary_node_areas / (2.0 * TISSUE.boundary_factor)
    # Diffusion is many times larger than what it has to leave over: its rounding is what is allowed.
    assert np.abs(matrix.sum(axis=1) - expected).max() < 1e-14 * abs(matrix).max()
    assert abs(matrix - matrix.T).max() == 0.0
    assert matrix.has_canonical_format


def test_linear_functions_are_exact() -> None:
    """``∫ D |grad phi|²`` of a linear function is D |slope|² times the volume."""
    mesh = random_mesh(5)
    slope = np.array([1.0, -2.0, 0.5])
    values = mesh.points @ slope
    matrix = Assembly(mesh).matrix(0.7, 0.0, 0.0)
    assert values @ (matrix @ values) == pytest.approx(0.7 * slope @ slope * mesh.volume, rel=1e-12)
    # In a patch test no node inside feels a linear function.
    inner = np.setdiff1d(np.arange(len(values)), mesh.boundary_nodes)
    assert np.abs((matrix @ values)[inner]).max() < 1e-12


def test_matrices_of_one_assembly_share_their_pattern_and_nothing_else() -> None:
    assembly = Assembly(block((4, 4, 4), (1.0, 1.0, 1.0)))
    first = assembly.assemble(coefficients_of(TISSUE))
    before = first.toarray()
    second = assembly.assemble(coefficients_of(Medium(sigma_a=3.0, sigma_s_prime=10.0, eta=1.2)))
    assert np.shares_memory(first.indices, second.indices)
    assert not np.shares_memory(first.data, second.data)
    assert (first.toarray() == before).all()
    assert gap(second, system_matrix(assembly.mesh, Medium(sigma_a=3.0, sigma_s_prime=10.0, eta=1.2))) == 0.0


def test_blocks_leave_nothing_out() -> None:
    """A mesh of several blocks of tetrahedra, of which the last is not full."""
    mesh = block((13, 14, 15), (1.0, 1.1, 1.2))
    assert len(mesh.tetrahedra) > 8192
    assert gap(system_matrix(mesh, TISSUE), weak_form_matrix(mesh, TISSUE)) < 1e-12


def test_boundary_of_the_skfem_basis_is_ours(ball_mesh: TetMesh) -> None:
    """The boundary that the exitance is integrated over is scikit-fem's."""
    body = MeshTet1(np.ascontiguousarray(ball_mesh.points.T), np.ascontiguousarray(ball_mesh.tetrahedra.T))
    area = FacetBasis(body, ElementTetP1()).dx.sum()
    assert ball_mesh.area == pytest.approx(area, rel=1e-12)
