"""Conjugate gradients in single precision, whose true residuals are those of double precision."""

import numpy as np
import pytest

from tests.conftest import TISSUE, block
from tetlux.fem import Medium, Region, System
from tetlux.fem.linear import mixed
from tetlux.fem.linear.krylov import STOP_RESIDUAL, Preconditioner, Product, conjugate_gradients
from tetlux.fem.linear.mixed import _in_double, mixed_conjugate_gradients
from tetlux.fem.operators.assembly import system_matrix
from tetlux.meshing import Surface, sphere, tetrahedralize
from tetlux.meshing.arrays import NumberArray

COLUMNS = 5


def jacobi_of(product: Product) -> Preconditioner:
    inverse = (1.0 / np.abs(product.matrix.diagonal())[:, None]).astype(np.float32)
    return lambda rest: inverse * rest


def problem() -> tuple[Product, NumberArray]:
    """A matrix, and loads of the same size."""
    matrix = system_matrix(block((12, 12, 12), (20.0,) * 3), TISSUE)
    random = np.random.default_rng(2)
    loads = random.normal(size=(matrix.shape[0], COLUMNS))
    return Product(matrix), 0.1 * loads / np.linalg.norm(loads, axis=0)


def test_residuals_are_those_of_double_precision_in_as_many_iterations() -> None:
    product, loads = problem()
    precondition = jacobi_of(product)
    found, iterations = mixed_conjugate_gradients(product, product.single, precondition, loads)
    known, expected = conjugate_gradients(product, precondition, loads)
    assert np.linalg.norm(loads - product.matrix @ found, axis=0).max() <= STOP_RESIDUAL
    assert found == pytest.approx(known, rel=1e-7, abs=1e-9 * np.abs(known).max())
    assert iterations <= 1.35 * expected


def test_what_single_precision_cannot_solve_is_left_to_double_precision(monkeypatch: pytest.MonkeyPatch) -> None:
    """Here its products are off by more than the replaced residual is to decrease by."""
    product, loads = problem()
    single = product.single
    single.matrix.data[:] *= 1.0 + 0.9 * np.random.default_rng(5).uniform(-1.0, 1.0, len(single.matrix.data))
    monkeypatch.setattr(mixed, "MOST_BETWEEN", 20)
    found, _ = mixed_conjugate_gradients(product, single, jacobi_of(product), loads)
    assert np.linalg.norm(loads - product.matrix @ found, axis=0).max() <= STOP_RESIDUAL


def test_columns_of_zeros_stay_zero_and_others_are_solved() -> None:
    product, loads = problem()
    loads[:, 1] = 0.0
    found, _ = mixed_conjugate_gradients(product, product.single, jacobi_of(product), loads)
    assert (found[:, 1] == 0.0).all()
    assert np.linalg.norm(loads - product.matrix @ found, axis=0).max() <= STOP_RESIDUAL


@pytest.mark.parametrize("shift", [0.0, 0.002j])
def test_media_that_hardly_scatter_beside_others_take_no_more_iterations(ball: Surface, shift: complex) -> None:
    """With directions that go on as residuals are replaced, 5 to 10 times as many."""
    core, thin = sphere(5.0), Medium(sigma_a=0.0, sigma_s_prime=0.01, eta=1.4)
    mesh = tetrahedralize(ball, regions=[core])
    medium = Medium(sigma_a=0.0, sigma_s_prime=10.0, eta=1.4)
    system = System(mesh, medium, ball, regions=(Region(core, thin),), shift=shift)
    operator = system.quadratic
    nodes = np.arange(0, len(mesh.points), len(mesh.points) // 8)
    loads = np.zeros((operator.space.size, len(nodes)), complex if shift else float)
    loads[nodes, np.arange(len(nodes))] = 0.1
    loads = loads[operator._order]
    found, iterations = mixed_conjugate_gradients(operator._product, operator._single, operator._precondition, loads)
    _, expected = conjugate_gradients(operator._product, _in_double(operator._precondition), loads)
    assert np.linalg.norm(loads - operator._product(found), axis=0).max() <= STOP_RESIDUAL
    assert iterations <= 1.35 * expected
