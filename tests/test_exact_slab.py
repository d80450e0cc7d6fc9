import numpy as np
import pytest
from scipy import integrate

from tetlux.fem import Medium
from tetlux.fem.exact import dipole, half_space, slab, slab_plane
from tetlux.fem.exact.checks import Face
from tetlux.fem.exact.numerics.layer import Layer
from tetlux.meshing.errors import InputError

TISSUE = Medium(sigma_a=0.01, sigma_s_prime=1.0, eta=1.4)


@pytest.mark.parametrize("face", ["front", "back"])
@pytest.mark.parametrize("thickness", [0.01, 2.0, 20.0])
@pytest.mark.parametrize("sigma_a", [0.0, 0.01, 1.0])
def test_exitance_adds_up_to_its_total(sigma_a: float, thickness: float, face: Face) -> None:
    medium = Medium(sigma_a=sigma_a, sigma_s_prime=1.0, eta=1.4)
    reach = 60.0 * max(thickness, np.sqrt(thickness * medium.extrapolation_length))
    rho = np.geomspace(1e-6 * thickness, reach, 2001)
    exitance = slab.point_exitance(medium, thickness=thickness, depth=0.3 * thickness, rho=rho, face=face)
    total = integrate.simpson(2.0 * np.pi * rho**2 * exitance, x=np.log(rho))
    expected = slab.point_total(medium, thickness=thickness, depth=0.3 * thickness, face=face)
    assert total == pytest.approx(expected, rel=1e-7)


def test_both_faces_let_all_out_without_absorption() -> None:
    lossless = Medium(sigma_a=0.0, sigma_s_prime=1.0, eta=1.4)
    front = slab.point_total(lossless, thickness=3.0, depth=1.0)
    back = slab.point_total(lossless, thickness=3.0, depth=1.0, face="back")
    zb = lossless.extrapolation_length
    assert front == pytest.approx((2.0 + zb) / (3.0 + 2.0 * zb), rel=1e-14)
    assert front + back == pytest.approx(1.0, rel=1e-14)


@pytest.mark.parametrize("zb", [0.0, 0.3, 5.0])
@pytest.mark.parametrize("k", [0.0, 0.2, 3.0])
def test_images_and_modes_agree_where_they_meet(k: float, zb: float) -> None:
    layer = Layer(k, zb, 2.0)
    z = np.array([0.1, 1.0, 1.9])
    just_in, just_out = np.full(3, 2.0), np.full(3, np.nextafter(2.0, 3.0))
    np.testing.assert_allclose(layer.field(z, 0.7, just_in), layer.field(z, 0.7, just_out), rtol=1e-11)
    if zb == 0.0:
        np.testing.assert_allclose(layer.slope(z, 0.7, just_in), layer.slope(z, 0.7, just_out), rtol=1e-11)


@pytest.mark.parametrize("rho", [0.0, 3.0, 30.0])
@pytest.mark.parametrize("face", ["front", "back"])
def test_extrapolated_flux_is_the_sum_over_images(rho: float, face: Face) -> None:
    thickness, depth = 10.0, 1.0
    k, zb = TISSUE.sigma_tr, TISSUE.extrapolation_length
    period = 2.0 * (thickness + 2.0 * zb) * np.arange(-60, 61)
    plane, sign = (thickness, -1.0) if face == "back" else (0.0, 1.0)
    expected = 0.0
    for strength, z in ((1.0, period + depth), (-1.0, period - 2.0 * zb - depth)):
        r = np.hypot(rho, z - plane)
        expected += sign * strength * float(np.sum((z - plane) * (1.0 + k * r) * np.exp(-k * r) / r**3))
    found = slab.extrapolated_flux(TISSUE, thickness=thickness, depth=depth, rho=rho, face=face)
    assert float(found) == pytest.approx(expected / (4.0 * np.pi), rel=1e-9)


@pytest.mark.parametrize("face", ["front", "back"])
def test_extrapolated_flux_is_the_slope_of_its_fluence(face: Face) -> None:
    plane, outward, h = (2.0, 1.0, 1e-3) if face == "back" else (0.0, -1.0, 1e-3)
    for rho in (0.5, 9.0):
        points = np.array([[rho, 0.0, plane + h], [rho, 0.0, plane - h]])
        up, down = slab.extrapolated_fluence(TISSUE, thickness=2.0, depth=0.7, points=points)
        expected = -outward * TISSUE.diffusion * (up - down) / (2.0 * h)
        found = slab.extrapolated_flux(TISSUE, thickness=2.0, depth=0.7, rho=rho, face=face)
        assert float(found) == pytest.approx(expected, rel=1e-5)


def test_thick_slab_is_a_half_space() -> None:
    rho = np.array([0.0, 1.0, 5.0, 20.0])
    exact = slab.point_exitance(TISSUE, thickness=200.0, depth=1.0, rho=rho)
    np.testing.assert_allclose(exact, half_space.point_exitance(TISSUE, depth=1.0, rho=rho), rtol=1e-12)
    classic = slab.extrapolated_flux(TISSUE, thickness=200.0, depth=1.0, rho=rho)
    np.testing.assert_allclose(classic, dipole.flux(TISSUE, depth=1.0, rho=rho), rtol=1e-12)


def test_slab_turned_over_is_the_same() -> None:
    rho = np.array([0.5, 5.0, 15.0])
    front = slab.point_exitance(TISSUE, thickness=4.0, depth=1.0, rho=rho)
    back = slab.point_exitance(TISSUE, thickness=4.0, depth=3.0, rho=rho, face="back")
    np.testing.assert_allclose(front, back, rtol=1e-11)


@pytest.mark.parametrize(
    ("eta", "thickness", "reflected", "passed"),
    [
        (1.3, 1.0, 0.317431, 0.292591),
        (1.3, 2.0, 0.457166, 0.353342),
        (1.3, 5.0, 0.603381, 0.244341),
        (1.3, 10.0, 0.654112, 0.100247),
        (1.0, 5.0, 0.682037, 0.216794),
    ],
)
def test_plane_beam_of_the_table(eta: float, thickness: float, reflected: float, passed: float) -> None:
    medium = Medium(sigma_a=0.01, sigma_s_prime=0.99, eta=eta)
    found = slab_plane.beam_reflectance(medium, thickness=thickness, source="similarity")
    assert found == pytest.approx(reflected, abs=6e-7)
    found = slab_plane.beam_transmittance(medium, thickness=thickness, source="similarity")
    assert found == pytest.approx(passed, abs=6e-7)


def test_van_de_hulst_slab() -> None:
    """Radiative transfer has R .09739; delta-Eddington comes closest of what diffusion has."""
    medium = Medium(sigma_a=0.1, sigma_s=0.9, g=0.75, eta=1.0)
    assert slab_plane.beam_reflectance(medium, thickness=2.0) == pytest.approx(0.10597, abs=1e-5)
    assert slab_plane.beam_reflectance(medium, thickness=2.0, source="similarity") == pytest.approx(0.13996, abs=1e-5)
    passed = slab_plane.beam_transmittance(medium, thickness=2.0)
    passed += slab_plane.ballistic_transmittance(medium, thickness=2.0)
    assert passed == pytest.approx(0.66442, abs=1e-5)


@pytest.mark.parametrize("thickness", [1e-3, 1.0, 100.0])
def test_plane_beam_without_absorption_loses_nothing(thickness: float) -> None:
    lossless = Medium(sigma_a=0.0, sigma_s=3.0, g=0.6, eta=1.3)
    total = slab_plane.beam_reflectance(lossless, thickness=thickness)
    total += slab_plane.beam_transmittance(lossless, thickness=thickness)
    total += slab_plane.ballistic_transmittance(lossless, thickness=thickness)
    assert total == pytest.approx(1.0, rel=1e-12)


def test_plane_beam_on_a_thick_slab_is_on_a_half_space() -> None:
    medium = Medium(sigma_a=0.1, sigma_s=3.0, g=0.6, eta=1.3)
    found = slab_plane.beam_reflectance(medium, thickness=100.0)
    assert found == pytest.approx(half_space.pencil_total(medium), rel=1e-12)
    assert slab_plane.beam_transmittance(medium, thickness=2000.0) == pytest.approx(0.0, abs=1e-30)


def test_what_is_outside_is_refused() -> None:
    with pytest.raises(InputError, match="depth is 2, which is not inside the slab"):
        slab.point_exitance(TISSUE, thickness=2.0, depth=2.0, rho=1.0)
    with pytest.raises(InputError, match="thickness is -1"):
        slab_plane.beam_reflectance(TISSUE, thickness=-1.0)
    with pytest.raises(InputError, match="z of points holds 3"):
        slab.point_fluence(TISSUE, thickness=2.0, depth=1.0, points=[[0.0, 0.0, 3.0]])
    with pytest.raises(InputError, match='face is "side"'):
        slab.point_total(TISSUE, thickness=2.0, depth=1.0, face="side")  # type: ignore[arg-type]
