"""The fluence stays at or above zero on any mesh, and the ledger stays closed."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.conftest import block
from tetlux.fem import CollimatedBeam, DiffuseLight, Emission, Light, Medium, PencilBeam, PointSource, System, solve
from tetlux.fem.operators.limiter import limit_to_nonnegative
from tetlux.meshing import TetMesh, box, slab, sphere, tetrahedralize

DARK = Medium(sigma_a=3.0, sigma_s_prime=1.0, eta=1.4)
LIGHTS: dict[str, Light] = {
    "point": PointSource((0.0, 0.0, 8.0), 1.0),
    "pencil": PencilBeam((0.0, 0.0, 20.0), (0.0, 0.0, -1.0)),
    "diffuse": DiffuseLight(1.0),
    "emission": Emission(1.0),
    "isotropic beam": CollimatedBeam((0.0, 0.0, -1.0)),
}


@pytest.fixture(scope="module")
def flat() -> TetMesh:
    """A ball whose tetrahedra are a fifth as high as wide: obtuse angles everywhere."""
    mesh = tetrahedralize(sphere(10.0), edge_length=3.0)
    squashed = mesh.points * (1.0, 1.0, 0.2)
    return TetMesh(squashed, mesh.tetrahedra, mesh.unit)


@pytest.mark.parametrize("name", LIGHTS)
@pytest.mark.parametrize("subtract", ["half-space", "nothing"])
def test_no_fluence_below_zero(flat: TetMesh, name: str, subtract: str) -> None:
    """Without the limiter the fluence of the point dips to -3 % of its maximum here, that of the pencil to -1 %."""
    light = LIGHTS[name]
    if name == "point":
        light = PointSource((0.0, 0.0, 1.6), 1.0)
    found = System(flat, DARK).solve([light], subtract=subtract)  # type: ignore[arg-type]
    raw = System(flat, DARK, limit=False).solve([light], subtract=subtract)  # type: ignore[arg-type]
    assert raw.fluence.min() < -1e-3 * raw.fluence.max() or name not in ("point", "pencil")
    assert found.fluence.min() >= 0
    assert found.exitance.min() >= 0 or name == "diffuse"
    assert abs(found.power.balance_error) < 1e-12
    assert found.power.absorbed + found.power.exited == pytest.approx(raw.power.absorbed + raw.power.exited, rel=1e-12)
    # Nothing else changes much: where it was bright it stays as it was.
    bright = raw.fluence > 0.3 * raw.fluence.max()
    np.testing.assert_allclose(found.fluence[bright], raw.fluence[bright], rtol=0.1)


@pytest.mark.parametrize("light", [PencilBeam((0.0, 0.0, 50.0), (0.0, 0.0, -1.0)), PointSource((0.0, 0.0, 9.0), 1.0)])
def test_no_fluence_below_zero_between_the_nodes(light: Light) -> None:
    """Also where a subtracted source fades to nothing across one tetrahedron: without its share -7e-8 to -1e-7."""
    body = box((20.0, 20.0, 20.0))
    solution = solve(body, DARK, [light], tolerance=0.05)
    rng = np.random.default_rng(0)
    near = solution.mesh.points[rng.integers(len(solution.mesh.points), size=20_000)]
    fluence = solution.fluence_at(near + rng.normal(0.0, 0.3, near.shape))
    brightest = float(solution.fluence.max())
    assert np.nanmin(fluence) >= -1e-12 * brightest
    assert solution.exitance_at(near).min() >= -1e-12 * float(solution.exitance.max())


def test_a_beam_of_a_first_moment_is_not_limited(flat: TetMesh) -> None:
    """The diffusion equation itself is below zero beside it: that is reported and not hidden."""
    forward = Medium(sigma_a=3.0, sigma_s=5.0, g=0.8, eta=1.4)
    light = CollimatedBeam((0.0, 0.0, -1.0))
    found = System(flat, forward).solve([light])
    raw = System(flat, forward, limit=False).solve([light])
    np.testing.assert_array_equal(found.fluence, raw.fluence)
    assert found.limited_power == 0


def test_what_was_moved_is_told() -> None:
    """A mesh that is far too coarse, and leans over, so that its angles are obtuse."""
    upright = block((5, 5, 5), (20.0, 20.0, 20.0))
    leaning = upright.points + np.outer(upright.points[:, 2], (1.5, 0.0, 0.0))
    mesh = TetMesh(leaning, upright.tetrahedra, upright.unit)
    solution = solve(mesh, DARK, [PointSource((-15.0, 0.0, -10.0), 1.0)], subtract="nothing", tolerance=0.5)
    assert solution.limited_power == pytest.approx(3.28e-3, rel=0.01)
    assert any("0.33% of the power was moved between nodes to keep the fluence" in w for w in solution.warnings)


def test_no_fluence_below_zero_where_all_nodes_together_lack_power() -> None:
    """Light that is subtracted, and fades to nothing before the first node: what is left at the nodes is an error."""
    mesh, medium = block((5, 5, 6), (60.0, 60.0, 100.0)), Medium(sigma_a=0.999, sigma_s_prime=0.001, eta=1.4)
    lights = [PointSource((0.7, 0.4, -1.0), 1.0)]
    raw, found = (
        solve(slab(60.0, 100.0), medium, lights, mesh=mesh, tolerance=0.05, limit=limit) for limit in (False, True)
    )
    assert medium.sigma_a * float(mesh.node_volumes @ raw.fluence) < -1e-4
    assert found.fluence.min() >= 0 < found.fluence.max()
    assert abs(found.power.balance_error) < 1e-12
    assert found.power.exited == pytest.approx(raw.power.exited, rel=0.02)


@settings(max_examples=200, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(2, 60), st.floats(0.0, 0.9))
def test_the_limiter_keeps_power(seed: int, count: int, dark: float) -> None:
    rng = np.random.default_rng(seed)
    fluence = rng.normal(size=count) * 10.0 ** rng.uniform(-200, 3, count)
    fluence[rng.uniform(size=count) < dark] *= -1.0
    weights = rng.uniform(size=count) * (rng.uniform(size=count) < 0.8)
    edges = rng.integers(count, size=(3 * count, 2))
    power = float(weights @ fluence)
    found, moved = limit_to_nonnegative(fluence, edges, weights)
    assert found.min() >= 0
    if power < 1e-250:
        np.testing.assert_array_equal(found, np.maximum(fluence, 0.0))
        return
    assert float(weights @ found) == pytest.approx(power, rel=1e-12, abs=1e-300)
    assert moved >= 0
    if fluence.min() >= 0:
        np.testing.assert_array_equal(found, fluence)


def test_what_is_lacking_comes_from_next_door() -> None:
    """A chain: nodes far from the dark one keep what they have."""
    fluence = np.array([1.0, 1.0, 1.0, -0.5, 1.0, 1.0])
    edges = np.array([[i, i + 1] for i in range(5)])
    found, moved = limit_to_nonnegative(fluence, edges, np.ones(6))
    np.testing.assert_allclose(found, [1.0, 1.0, 0.75, 0.0, 0.75, 1.0], rtol=1e-14)
    assert moved == 0.5
