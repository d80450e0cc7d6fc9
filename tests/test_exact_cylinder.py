import numpy as np
import pytest

from tetlux.fem import Medium
from tetlux.fem.exact import cylinder, half_space
from tetlux.meshing.errors import InputError

TISSUE = Medium(sigma_a=0.01, sigma_s_prime=1.0, eta=1.4)


@pytest.mark.parametrize("size", [1e-3, 1.0, 30.0, 1000.0])
@pytest.mark.parametrize("fraction", [0.0, 0.5, 0.98])
def test_line_adds_up_to_its_total(size: float, fraction: float) -> None:
    sigma_tr = min(size, 0.3)
    medium = Medium(sigma_a=sigma_tr**2 / 3.0, sigma_s_prime=1.0 - sigma_tr**2 / 3.0, eta=1.4)
    a = size / sigma_tr
    theta = 2.0 * np.pi * np.arange(4096) / 4096
    exitance = cylinder.line_exitance(medium, radius=a, source_radius=fraction * a, theta=theta)
    total = cylinder.line_total(medium, radius=a, source_radius=fraction * a)
    assert 2.0 * np.pi * a * exitance.mean() == pytest.approx(total, rel=1e-9, abs=1e-14)


def test_point_adds_up_to_its_total() -> None:
    theta = 2.0 * np.pi * np.arange(64) / 64
    nodes, weights = np.polynomial.legendre.leggauss(120)
    z, step = 50.0 * (nodes + 1.0), 50.0 * weights
    exitance = cylinder.point_exitance(TISSUE, radius=4.0, source_radius=3.0, theta=theta, z=z[:, None])
    total = 2.0 * (step @ exitance.mean(axis=1)) * 2.0 * np.pi * 4.0
    assert total == pytest.approx(cylinder.line_total(TISSUE, radius=4.0, source_radius=3.0), rel=1e-8)


@pytest.mark.parametrize("sigma_a", [0.0, 0.01])
def test_points_along_a_line_are_the_line(sigma_a: float) -> None:
    medium = Medium(sigma_a=sigma_a, sigma_s_prime=1.0, eta=1.4)
    nodes, weights = np.polynomial.legendre.leggauss(120)
    z, step = 60.0 * (nodes + 1.0), 60.0 * weights
    theta = np.array([0.3, 2.0])
    points = cylinder.point_exitance(medium, radius=4.0, source_radius=3.0, theta=theta, z=z[:, None])
    line = cylinder.line_exitance(medium, radius=4.0, source_radius=3.0, theta=theta)
    np.testing.assert_allclose(2.0 * step @ points, line, rtol=1e-6)


@pytest.mark.parametrize("sigma_a", [0.0, 0.01, 0.3])
@pytest.mark.parametrize("source_radius", [0.0, 1.0, 2.5])
def test_fluence_at_the_surface_is_the_exitance(sigma_a: float, source_radius: float) -> None:
    """The point's two integrals over q are different sums, of different parts of the field."""
    medium = Medium(sigma_a=sigma_a, sigma_s_prime=1.0, eta=1.4)
    theta, z = np.array([0.0, 0.3, 1.0, 3.0]), np.array([0.0, 0.5, 2.0, 4.0])
    points = np.column_stack([3.0 * np.cos(theta), 3.0 * np.sin(theta), z])
    where = {"radius": 3.0, "source_radius": source_radius}
    phi = cylinder.point_fluence(medium, points=points, **where)
    exitance = cylinder.point_exitance(medium, theta=theta, z=z, **where)
    np.testing.assert_allclose(phi / (2.0 * medium.boundary_factor), exitance, rtol=1e-8)
    phi = cylinder.line_fluence(medium, points=points, **where)
    exitance = cylinder.line_exitance(medium, theta=theta, **where)
    np.testing.assert_allclose(phi / (2.0 * medium.boundary_factor), exitance, rtol=1e-11)


def test_line_on_the_axis_in_closed_form() -> None:
    lossless = Medium(sigma_a=0.0, sigma_s_prime=1.0, eta=1.4)
    exitance = cylinder.line_exitance(lossless, radius=3.0, source_radius=0.0, theta=[0.0, 2.0])
    np.testing.assert_allclose(exitance, 1.0 / (6.0 * np.pi), rtol=1e-14)
    phi = cylinder.line_fluence(lossless, radius=3.0, source_radius=0.0, points=[[1.5, 0.0, 7.0]])
    expected = (np.log(2.0) + lossless.extrapolation_length / 3.0) / (2.0 * np.pi * lossless.diffusion)
    np.testing.assert_allclose(phi, expected, rtol=1e-13)


def test_weak_absorption_tends_to_none() -> None:
    points = [[1.0, 1.0, 0.0], [-2.0, 0.5, 0.0]]
    none, weak = (
        cylinder.line_fluence(
            Medium(sigma_a=sigma_a, sigma_s_prime=1.0, eta=1.4), radius=3.0, source_radius=2.0, points=points
        )
        for sigma_a in (0.0, 1e-10)
    )
    np.testing.assert_allclose(weak, none, rtol=1e-7)


def test_large_cylinder_is_a_half_space() -> None:
    flat = half_space.point_exitance(TISSUE, depth=1.0, rho=[0.0, 2.0, 1.0])
    errors = []
    for a in (25.0, 100.0):
        found = cylinder.point_exitance(
            TISSUE, radius=a, source_radius=a - 1.0, theta=[0.0, 0.0, 1.0 / a], z=[0.0, 2.0, 0.0]
        )
        errors.append(np.abs(found / flat - 1.0))
    assert np.all(errors[1] < 0.008)
    np.testing.assert_allclose(errors[0] / errors[1], 4.0, rtol=0.15)


def test_what_is_outside_is_refused() -> None:
    with pytest.raises(InputError, match="source_radius is 3, which is not inside the cylinder"):
        cylinder.line_exitance(TISSUE, radius=3.0, source_radius=3.0, theta=0.0)
    with pytest.raises(InputError, match="too long a sum"):
        cylinder.point_exitance(TISSUE, radius=3.0, source_radius=2.998, theta=0.0, z=1e4)
    with pytest.raises(InputError, match="too close for its series"):
        cylinder.line_exitance(TISSUE, radius=3.0, source_radius=3.0 - 1e-6, theta=0.0)
    with pytest.raises(InputError, match="of points"):
        cylinder.line_fluence(TISSUE, radius=3.0, source_radius=1.0, points=[[4.0, 0.0, 0.0]])
    with pytest.raises(InputError, match="z holds a value that is not finite"):
        cylinder.point_exitance(TISSUE, radius=3.0, source_radius=1.0, theta=0.0, z=np.inf)
