"""The linear solvers: one solution by all of them, true residuals, the ledger, and what happens when one fails."""

import sys
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.sparse import csr_array, diags_array
from scipy.sparse.linalg import spsolve

from tests.conftest import TISSUE, block, needs
from tetlux.fem import Medium, PointSource, solve
from tetlux.fem.linear import krylov
from tetlux.fem.linear import multigrid as multigrid_module
from tetlux.fem.linear import solver as linear
from tetlux.fem.linear.direct import direct
from tetlux.fem.linear.krylov import Method, Product, jacobi
from tetlux.fem.linear.multigrid import multigrid
from tetlux.fem.linear.solver import Solver, solver_for
from tetlux.fem.media.coefficients import Coefficients, coefficients_of
from tetlux.fem.models.diffusion import Diffusion
from tetlux.fem.operators.assembly import SHARE_PRECONDITIONER_BELOW, Assembly, condition_bound, system_matrix
from tetlux.meshing import RunError, TetMesh, refine
from tetlux.meshing.host import blocks

METHODS: list[Callable[[Product], Method]] = [jacobi, multigrid, direct]
PARAMETERS = [jacobi, pytest.param(multigrid, marks=needs("pyamg")), direct]
# Nearly singular; strongly absorbing.
CLEAR = Medium(sigma_a=1e-4, sigma_s_prime=0.9999, eta=1.5)
CLEAREST = Medium(sigma_a=1e-6, sigma_s_prime=1.0, eta=2.0)
DARK = Medium(sigma_a=3.0, sigma_s_prime=10.0, eta=1.4)


@pytest.fixture(scope="module")
def wide() -> TetMesh:
    """Edges that differ by a factor of sixty, towards a corner."""
    mesh = block((6, 6, 6), (20.0, 20.0, 20.0))
    for step in range(18):
        far = np.linalg.norm(mesh.points[mesh.tetrahedra].mean(axis=1) - mesh.points[0], axis=1)
        mesh = refine(mesh, far < 14.0 * 0.75**step)
    assert mesh.edge_lengths.max() > 60 * mesh.edge_lengths.min()
    return mesh


def loads_on(mesh: TetMesh, count: int = 3) -> np.ndarray:
    """Points of light at nodes here and there."""
    loads = np.zeros((len(mesh.points), count))
    loads[np.linspace(0, len(mesh.points) - 1, count).astype(int), np.arange(count)] = 1.0
    return loads


@pytest.mark.parametrize("medium", [TISSUE, CLEAR, DARK], ids=["tissue", "clear", "dark"])
@pytest.mark.parametrize("method", PARAMETERS)
def test_every_method_solves(method: Callable[[Product], Method], medium: Medium, wide: TetMesh) -> None:
    matrix, loads = system_matrix(wide, medium), loads_on(wide)
    found = Solver(matrix, [method]).solve(loads).x
    assert (np.linalg.norm(loads - matrix @ found, axis=0) < 2e-11).all()
    truth = spsolve(matrix.tocsc(), loads)
    # In a strong absorber the residual says less of the exitance, which is a billionth of the fluence at the source.
    exitance, expected = found[wide.boundary_nodes], truth[wide.boundary_nodes]
    assert (np.linalg.norm(exitance - expected, axis=0) < 1e-6 * np.linalg.norm(expected, axis=0)).all()


@pytest.mark.parametrize("medium", [TISSUE, CLEAR, DARK], ids=["tissue", "clear", "dark"])
@pytest.mark.parametrize("aim", [1e-3, 1e-11])
def test_the_ledger_closes_wherever_the_iteration_stops(
    monkeypatch: pytest.MonkeyPatch, aim: float, medium: Medium, wide: TetMesh
) -> None:
    monkeypatch.setattr(krylov, "STOP_RESIDUAL", aim)
    monkeypatch.setattr(linear, "REFUSED", 1.0)
    load = loads_on(wide, 1)[:, 0]
    matrix = system_matrix(wide, medium)
    fluence = Solver(matrix, [jacobi]).solve(load).x
    out = wide.boundary_node_areas @ fluence[wide.boundary_nodes] / (2.0 * medium.boundary_factor)
    assert out + medium.sigma_a * (wide.node_volumes @ fluence) == pytest.approx(1.0, abs=1e-12)


@needs("pyamg")
@pytest.mark.parametrize("cores", [1, 3])
@pytest.mark.parametrize("count", [3, 11, 50])
@pytest.mark.parametrize("large", [False, True])
def test_many_loads_are_solved_as_one_by_one(
    large: bool, count: int, cores: int, wide: TetMesh, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In groups where there are many, and one by one where a single product has all cores at work."""
    for module in (krylov, linear, blocks):
        monkeypatch.setattr(module, "THREADS", cores)
    if large:
        monkeypatch.setattr(krylov, "ENTRIES_FOR_THREADS", 1)
    loads = loads_on(wide, count)
    loads[:, 1] = 0.0
    loads[:, 2] *= 1e6
    solver = Solver(system_matrix(wide, TISSUE), [multigrid])
    together = solver.solve(loads).x
    assert together.shape == loads.shape
    assert (together[:, 1] == 0.0).all()
    for column in range(count):
        alone = solver.solve(loads[:, column]).x
        assert alone.shape == (len(loads),)
        assert np.linalg.norm(alone - together[:, column]) <= 1e-9 * np.linalg.norm(alone)


@needs("pyamg")
def test_multigrid_does_not_slow_down_as_the_mesh_grows(monkeypatch: pytest.MonkeyPatch) -> None:
    """Iterations of Jacobi grow with the number of nodes along an edge, those of multigrid hardly."""
    iterations: dict[str, list[int]] = {"jacobi": [], "multigrid": []}
    for count in (10, 40):
        mesh = block((count,) * 3, (20.0,) * 3)
        matrix, load = system_matrix(mesh, TISSUE), loads_on(mesh, 2)[:, 1]
        for method in (jacobi, multigrid):
            solver, seen = Solver(matrix, [method]), 0

            class Counted(Product):
                def __call__(self, x: np.ndarray, whole: int = len(load)) -> np.ndarray:
                    nonlocal seen
                    seen += self.matrix.shape == (whole, whole)
                    return super().__call__(x)

            monkeypatch.setattr(solver._product, "__class__", Counted)
            solver.solve(load)
            iterations[method.__name__].append(seen)
    assert iterations["jacobi"][1] > 2.5 * iterations["jacobi"][0]
    assert iterations["multigrid"][1] < 1.6 * iterations["multigrid"][0]


@needs("pyamg")
@pytest.mark.parametrize("count", [None, 1, 3, 50])
def test_a_result_says_what_it_took(count: int | None, wide: TetMesh) -> None:
    matrix, load = system_matrix(wide, TISSUE), loads_on(wide, count or 1)
    if count is None:
        load = load[:, 0]
    found = {method.__name__: Solver(matrix, [method]).solve(load) for method in METHODS}
    for name, result in found.items():
        left = np.linalg.norm(load - matrix @ result.x, axis=0) / np.linalg.norm(load, axis=0)
        assert result.x.shape == load.shape
        assert result.residual == pytest.approx(np.max(left), rel=0.01, abs=1e-14)
        assert result.method == name
    assert found["direct"].iterations == 0
    assert 5 < found["multigrid"].iterations < 0.5 * found["jacobi"].iterations
    rough = Solver(matrix, [jacobi]).solve_to_low_accuracy(loads_on(wide))
    left = np.linalg.norm(loads_on(wide) - matrix @ rough.x, axis=0)
    assert rough.residual == pytest.approx(left.max(), rel=0.01)
    assert 5 < rough.iterations < 0.7 * found["jacobi"].iterations


def test_what_one_method_leaves_the_next_one_solves(wide: TetMesh) -> None:
    matrix, load = system_matrix(wide, TISSUE), loads_on(wide, 1)[:, 0]
    prepared = []

    def helpless(product: Product) -> Method:
        return lambda rest: (np.full_like(rest, np.nan), 1)

    def rough(product: Product) -> Method:
        inverse = 1.0 / product.matrix.diagonal()[:, None]
        return lambda rest: (0.1 * inverse * rest, 1)

    def thorough(product: Product) -> Method:
        prepared.append(product)
        return direct(product)

    solver = Solver(matrix, [helpless, rough, thorough])
    found = solver.solve(load).x
    assert solver.note.startswith("the linear solver had to fall back from helpless to thorough")
    assert np.linalg.norm(load - matrix @ found) < 2e-11
    assert len(prepared) == 1
    assert solver.solve(load).method == "thorough"
    enough = Solver(matrix, [direct, thorough])
    enough.solve(load)
    assert enough.note == ""
    assert len(prepared) == 1, "a method that is not needed is not prepared"
    with pytest.raises(RunError, match="stopped at a relative residual of"):
        Solver(matrix, [helpless, rough]).solve(load)


def test_what_is_left_is_solved_for_again(wide: TetMesh) -> None:
    """As long as it helps: an iteration's own idea of its residual is not the true one."""
    matrix, load = system_matrix(wide, TISSUE), loads_on(wide, 1)[:, 0]

    def short(product: Product) -> Method:
        method = direct(product)
        return lambda rest: (0.999 * method(rest)[0], 0)

    assert np.linalg.norm(load - matrix @ Solver(matrix, [short]).solve(load).x) < 2e-11


def test_products_on_several_threads(monkeypatch: pytest.MonkeyPatch, wide: TetMesh) -> None:
    matrix = system_matrix(wide, TISSUE)
    monkeypatch.setattr(krylov, "ENTRIES_FOR_THREADS", 1)
    monkeypatch.setattr(krylov, "THREADS", 3)
    x = np.random.default_rng(0).normal(size=(matrix.shape[0], 2))
    product = Product(matrix)
    assert len(product._blocks) == 3
    assert (product(x) == matrix @ x).all()
    assert (product(x[:, :1]) == matrix @ x[:, :1]).all()


@needs("pyamg")
def test_nodes_without_neighbours_are_no_obstacle() -> None:
    """Where absorption outweighs everything there is nothing to aggregate."""
    matrix = csr_array(diags_array(np.linspace(1.0, 2.0, 1000)))
    assert Solver(matrix, [multigrid]).solve(np.ones(1000)).x == pytest.approx(1.0 / np.linspace(1.0, 2.0, 1000))


@pytest.mark.parametrize(
    ("cells", "loads", "expected"),
    [
        (5, 1, jacobi),
        (5, 100, direct),
        pytest.param(30, 1, multigrid, marks=needs("pyamg")),
        pytest.param(30, 100, multigrid, marks=needs("pyamg")),
    ],
)
def test_the_solver_goes_by_size(cells: int, loads: int, expected: Callable[[Product], Method]) -> None:
    mesh = block((cells,) * 3, (20.0,) * 3)
    solver = solver_for(system_matrix(mesh, TISSUE), loads)
    assert solver._methods[0] is expected
    load = loads_on(mesh, 1)
    assert np.linalg.norm(load - solver.matrix @ solver.solve(load).x) < 2e-11


# Regions a thousandfold and more apart: absorption and reduced scattering of the inner one.
CORES = [(100.0, 1.0), (0.01, 1e-4), (0.01, 1e4), (100.0, 1e4), (1e-6, 1e-4)]


def matrix_with_a_core(mesh: TetMesh, sigma_a: float, sigma_s_prime: float) -> csr_array:
    """Tissue, and other coefficients within a ball in its middle."""
    core = Medium(sigma_a=sigma_a, sigma_s_prime=sigma_s_prime, eta=TISSUE.eta)
    centres = mesh.points[mesh.tetrahedra].mean(axis=1)
    inside = np.linalg.norm(centres - mesh.points.mean(axis=0), axis=1) < 5.0
    return Assembly(mesh).assemble(
        replace(
            coefficients_of(TISSUE),
            sigma_a=np.where(inside, core.sigma_a, TISSUE.sigma_a),
            sigma_t_prime=np.where(inside, core.sigma_t_prime, TISSUE.sigma_t_prime),
        )
    )


@pytest.mark.parametrize(("cells", "count", "first"), [(16, 1, jacobi), (26, 3, jacobi), (12, 20, direct)])
def test_without_pyamg_residuals_are_as_small(
    cells: int, count: int, first: Callable[[Product], Method], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Strong internal reflection, strong absorption, and regions 1e4 apart."""
    monkeypatch.setattr(linear, "HAS_PYAMG", False)
    monkeypatch.setitem(sys.modules, "pyamg.aggregation", None)
    mesh = block((cells,) * 3, (20.0,) * 3)
    matrices = [system_matrix(mesh, medium) for medium in (CLEAR, DARK, CLEAREST)]
    matrices += [matrix_with_a_core(mesh, *core) for core in CORES]
    for matrix in matrices:
        solver, loads = solver_for(matrix, count), loads_on(mesh, count)
        assert solver._methods[0] is first
        assert multigrid not in solver._methods
        assert (np.linalg.norm(loads - matrix @ solver.solve(loads).x, axis=0) < 2e-11).all()
        assert solver.note == ""


@pytest.mark.parametrize("medium", [TISSUE, CLEAR, DARK], ids=["tissue", "clear", "dark"])
@pytest.mark.parametrize("method", PARAMETERS)
def test_a_rough_solution_is_good_to_a_few_digits(
    method: Callable[[Product], Method], medium: Medium, wide: TetMesh
) -> None:
    matrix, loads = system_matrix(wide, medium), loads_on(wide)
    # Of any size, and one that is nothing.
    loads = np.column_stack([1e6 * loads[:, :1], 1e-6 * loads[:, 1:], np.zeros(len(loads))])
    solver = Solver(matrix, [method])
    found = solver.solve_to_low_accuracy(loads).x
    assert (np.linalg.norm(loads - matrix @ found, axis=0) <= 1e-3 * np.linalg.norm(loads, axis=0)).all()
    assert not found[:, -1].any()


def test_a_rough_solution_that_is_too_rough_is_solved_in_full(wide: TetMesh) -> None:
    matrix, loads = system_matrix(wide, TISSUE), loads_on(wide)

    def useless(_: Product) -> Method:
        return lambda rest: (np.zeros_like(rest), 1)

    found = Solver(matrix, [useless, direct]).solve_to_low_accuracy(loads).x
    assert (np.linalg.norm(loads - matrix @ found, axis=0) < 2e-11).all()


def test_a_run_says_that_its_solver_fell_back(wide: TetMesh, monkeypatch: pytest.MonkeyPatch) -> None:
    def helpless(product: Product) -> Method:
        return lambda rest: (0.0 * rest, 1)

    monkeypatch.setattr(
        "tetlux.fem.operators.assembly.solver_for", lambda matrix, *_: Solver(matrix, [helpless, direct])
    )
    solution = solve(wide, TISSUE, [PointSource((0.0, 0.0, -1.0))])
    assert any("had to fall back from helpless to a direct solution" in warning for warning in solution.warnings)
    assert abs(solution.power.balance_error) < 1e-12


def bound_of(one: Coefficients, other: Coefficients) -> float:
    return condition_bound(Diffusion(one), Diffusion(other))


@needs("pyamg")
def test_matrices_much_alike_share_what_is_prepared(monkeypatch: pytest.MonkeyPatch) -> None:
    mesh, prepared, level = block((16, 16, 16), (20.0, 20.0, 20.0)), [], multigrid_module._level

    def counting(product: Product) -> multigrid_module._Level | None:
        prepared.append(product.matrix.shape[0])
        return level(product)

    monkeypatch.setattr(multigrid_module, "_level", counting)
    assembly, loads = Assembly(mesh), loads_on(mesh)
    base, near, beyond, far = (
        coefficients_of(Medium(sigma_a=sigma_a, sigma_s_prime=1.0, eta=1.4)) for sigma_a in (0.02, 0.05, 0.125, 0.9)
    )
    assert bound_of(beyond, near) < SHARE_PRECONDITIONER_BELOW
    # What is like one that only borrowed is not like what that was prepared for.
    for coefficients, anew in ((base, True), (near, False), (beyond, True), (far, True), (near, False)):
        prepared.clear()
        matrix = assembly.assemble(coefficients)
        solver = assembly.solver(Diffusion(coefficients), matrix, 4)
        assert (len(mesh.points) in prepared) == anew
        assert np.array_equal(solver.matrix.data, matrix.data)
        assert (np.linalg.norm(loads - matrix @ solver.solve(loads).x, axis=0) < 2e-11).all()
        assert solver.note == ""


def test_how_far_apart_coefficients_are() -> None:
    base = coefficients_of(TISSUE)
    assert bound_of(base, base) == 1.0
    darker = coefficients_of(replace(TISSUE, sigma_a=3.0 * TISSUE.sigma_a))
    # Diffusion is a little less there.
    ratio = 3.0 * (TISSUE.sigma_t_prime + 2.0 * TISSUE.sigma_a) / TISSUE.sigma_t_prime
    assert bound_of(darker, base) == pytest.approx(ratio)
    assert bound_of(base, darker) == pytest.approx(ratio)
    varying = replace(base, sigma_a=np.array([0.5, 1.0, 2.0]) * TISSUE.sigma_a)
    assert bound_of(varying, base) == pytest.approx(4.0)
    clear = coefficients_of(replace(TISSUE, sigma_a=0.0))
    assert bound_of(clear, clear) == 1.0
    assert bound_of(clear, base) == bound_of(base, clear) == np.inf
    assert ratio < SHARE_PRECONDITIONER_BELOW < np.inf
