import numpy as np
import pytest
from scipy import integrate

from tetlux.fem import Medium
from tetlux.fem.exact import dipole, half_space
from tetlux.fem.exact.beam import Source
from tetlux.meshing.errors import InputError

TISSUE = Medium(sigma_a=0.01, sigma_s_prime=1.0, eta=1.4)
FORWARD = Medium(sigma_a=0.01, sigma_s=5.0, g=0.8, eta=1.4)


def over_surface(distance: np.ndarray, exitance: np.ndarray) -> float:
    """``∫ M 2 pi rho drho`` on logarithmic steps."""
    return float(integrate.simpson(2.0 * np.pi * distance**2 * exitance, x=np.log(distance)))


def test_exitance_and_dipole_of_the_table() -> None:
    depth = TISSUE.mean_free_path
    exitance = half_space.point_exitance(TISSUE, depth=depth, rho=[1.0, 5.0, 20.0])
    np.testing.assert_allclose(exitance, [2.37356e-2, 1.42241e-3, 6.94297e-6], rtol=3e-6)
    flux = dipole.flux(TISSUE, depth=depth, rho=[1.0, 5.0, 20.0])
    np.testing.assert_allclose(flux, [3.0013e-2, 1.2099e-3, 7.0172e-6], rtol=4e-5)
    reflectance = dipole.reflectance(TISSUE, rho=[1.0, 5.0, 20.0])
    np.testing.assert_allclose(reflectance, flux / 1.01, rtol=1e-14)


def test_exitance_is_the_textbook_integral() -> None:
    """The sink line before integration by parts, by another quadrature."""
    k, zb, z0 = TISSUE.sigma_tr, TISSUE.extrapolation_length, 0.3

    def sink(length: float) -> float:
        r = np.hypot(2.0, z0 + length)
        return float(np.exp(-length / zb - k * r) / r)

    integral, _ = integrate.quad(sink, 0.0, 60.0 * zb, epsrel=1e-12)
    r = np.hypot(2.0, z0)
    expected = 2.0 * (np.exp(-k * r) / r - integral / zb) / (4.0 * np.pi * zb)
    assert float(half_space.point_exitance(TISSUE, depth=z0, rho=2.0)) == pytest.approx(expected, rel=1e-10)


@pytest.mark.parametrize("sigma_a", [1e-3, 0.1, 3.0])
@pytest.mark.parametrize("depth", [1e-3, 1.0])
def test_exitance_adds_up_to_its_total(sigma_a: float, depth: float) -> None:
    medium = Medium(sigma_a=sigma_a, sigma_s_prime=1.0, eta=1.4)
    rho = np.geomspace(1e-6 * depth, 40.0 / medium.sigma_tr + 40.0 * depth, 3001)
    total = over_surface(rho, half_space.point_exitance(medium, depth=depth, rho=rho))
    assert total == pytest.approx(half_space.point_total(medium, depth=depth), rel=1e-7)


def test_exitance_and_absorption_add_up_to_one() -> None:
    depth = 0.8
    nodes, weights = np.polynomial.legendre.leggauss(40)
    rho = np.geomspace(1e-5, 300.0, 1201)
    absorbed = 0.0
    for low, high in ((0.0, depth), (depth, 3.0), (3.0, 20.0), (20.0, 150.0)):
        for node, weight in zip(nodes, weights, strict=True):
            z = 0.5 * (low + high) + 0.5 * (high - low) * node
            points = np.column_stack([rho, 0.0 * rho, np.full_like(rho, z)])
            sheet = over_surface(rho, half_space.point_fluence(TISSUE, depth=depth, points=points))
            absorbed += 0.5 * (high - low) * weight * TISSUE.sigma_a * sheet
    assert absorbed + half_space.point_total(TISSUE, depth=depth) == pytest.approx(1.0, abs=1e-6)


@pytest.mark.parametrize(("alpha", "eta"), [(0.5, 1.0), (0.9, 1.33), (0.99, 1.3), (1.0, 1.5)])
def test_plane_beam_reflectance(alpha: float, eta: float) -> None:
    medium = Medium(sigma_a=1.0 - alpha, sigma_s_prime=alpha, eta=eta)
    q = np.sqrt(3.0 * (1.0 - alpha))
    expected = alpha / ((1.0 + q) * (1.0 + 2.0 * medium.boundary_factor * q / 3.0))
    assert half_space.pencil_total(medium, source="similarity") == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("source", ["similarity", "delta-eddington"])
def test_pencil_is_its_point_sources(source: Source) -> None:
    """Sum point sources and, for the first moment, dipoles by a finite difference."""
    rho, h = np.array([0.5, 2.0, 10.0]), 1e-4
    if source == "similarity":
        extinction, isotropic, forward = 1.01, 1.0, 0.0
    else:
        scattering = 5.0 * (1.0 - 0.8**2)
        extinction, isotropic, forward = 0.01 + scattering, scattering, 0.8 / 1.8 * scattering / 1.01
    nodes, weights = np.polynomial.legendre.leggauss(80)
    reach = 30.0 / extinction
    expected = np.zeros(3)
    for z, w in zip(0.5 * reach * (nodes + 1.0), 0.5 * reach * weights, strict=True):
        step = min(h, 0.1 * z)
        up, here, down = (half_space.point_exitance(FORWARD, depth=z + s, rho=rho) for s in (step, 0.0, -step))
        expected += w * np.exp(-extinction * z) * (isotropic * here + forward * (up - down) / (2.0 * step))
    found = half_space.pencil_exitance(FORWARD, rho=rho, source=source)
    np.testing.assert_allclose(found, expected, rtol=1e-6)


@pytest.mark.parametrize("source", ["similarity", "delta-eddington"])
def test_pencil_adds_up_to_its_total(source: Source) -> None:
    rho = np.geomspace(1e-9, 150.0, 3001)
    total = over_surface(rho, half_space.pencil_exitance(FORWARD, rho=rho, source=source))
    assert total == pytest.approx(half_space.pencil_total(FORWARD, source=source), rel=1e-7)


def test_sources_agree_where_scattering_is_isotropic() -> None:
    medium = Medium(sigma_a=0.1, sigma_s=1.0, g=0.0, eta=1.3)
    assert half_space.pencil_total(medium) == half_space.pencil_total(medium, source="similarity")


def test_dipole_adds_up_to_its_total() -> None:
    classic = Medium(sigma_a=0.01, sigma_s_prime=1.0, eta=1.3, boundary="classic")
    rho = np.geomspace(1e-6, 200.0, 4001)
    total = over_surface(rho, dipole.reflectance(classic, rho=rho))
    assert total == pytest.approx(dipole.total_reflectance(classic), rel=1e-7)
    h = 1e-3
    points = np.array([[2.0, 0.0, h], [2.0, 0.0, -h]])
    up, down = dipole.fluence(classic, depth=0.7, points=points)
    expected = classic.diffusion * (up - down) / (2.0 * h)
    assert float(dipole.flux(classic, depth=0.7, rho=2.0)) == pytest.approx(expected, rel=1e-5)


def test_many_points_are_taken_in_chunks() -> None:
    rho = np.linspace(0.1, 10.0, 5000)
    many = half_space.point_exitance(TISSUE, depth=1.0, rho=rho)
    few = half_space.point_exitance(TISSUE, depth=1.0, rho=rho[::999])
    np.testing.assert_allclose(many[::999], few, rtol=1e-14)
    assert half_space.point_exitance(TISSUE, depth=1.0, rho=rho.reshape(50, 100)).shape == (50, 100)


def test_what_is_outside_is_refused() -> None:
    with pytest.raises(InputError, match="depth is 0"):
        half_space.point_total(TISSUE, depth=0.0)
    with pytest.raises(InputError, match="z of points holds -1"):
        half_space.point_fluence(TISSUE, depth=1.0, points=[[0.0, 0.0, -1.0]])
    with pytest.raises(InputError, match=r"shape \(3,\)"):
        half_space.point_fluence(TISSUE, depth=1.0, points=[0.0, 0.0, 1.0])
    with pytest.raises(InputError, match="rho holds -1"):
        half_space.point_exitance(TISSUE, depth=1.0, rho=-1.0)
    with pytest.raises(InputError, match="not finite"):
        dipole.flux(TISSUE, depth=1.0, rho=np.nan)
    with pytest.raises(InputError, match="rho holds 0"):
        half_space.pencil_exitance(TISSUE, rho=0.0)
