import numpy as np
import pytest

from tetlux.fem import Medium
from tetlux.fem.exact import half_space, sphere, sphere_light
from tetlux.fem.exact.beam import Source
from tetlux.fem.exact.numerics.bessel import inner_ratios, wall_rates
from tetlux.meshing.errors import InputError

TISSUE = Medium(sigma_a=0.01, sigma_s_prime=1.0, eta=1.4)
FORWARD = Medium(sigma_a=0.01, sigma_s=5.0, g=0.8, eta=1.4)
MATCHED = Medium(sigma_a=0.01, sigma_s_prime=0.99, eta=1.0)


def absorbing(sigma_tr: float) -> Medium:
    """Medium of sigma_t' = 1 with the given sigma_tr, up to sqrt(3)."""
    return Medium(sigma_a=sigma_tr**2 / 3.0, sigma_s_prime=1.0 - sigma_tr**2 / 3.0, eta=1.4)


def test_exitance_of_the_table() -> None:
    depth = TISSUE.mean_free_path
    gamma = np.radians([0.0, 10.0, 30.0, 60.0, 90.0, 180.0])
    exitance = sphere.point_exitance(TISSUE, radius=10.0, source_radius=10.0 - depth, gamma=gamma)
    expected = [4.351567e-2, 1.400624e-2, 1.724342e-3, 2.759599e-4, 8.764252e-5, 2.427919e-5]
    np.testing.assert_allclose(exitance, expected, rtol=4e-7)
    total = sphere.point_total(TISSUE, radius=10.0, source_radius=10.0 - depth)
    assert total == pytest.approx(0.79094984, abs=5e-9)


@pytest.mark.parametrize("size", [1e-3, 1.0, 30.0, 1000.0])
@pytest.mark.parametrize("fraction", [0.0, 0.5, 0.98])
def test_exitance_adds_up_to_its_total(size: float, fraction: float) -> None:
    sigma_tr = min(size, 0.3)
    medium, a = absorbing(sigma_tr), size / sigma_tr
    mu, weights = np.polynomial.legendre.leggauss(2000 if size > 100 else 600)
    exitance = sphere.point_exitance(medium, radius=a, source_radius=fraction * a, gamma=np.arccos(mu))
    total = sphere.point_total(medium, radius=a, source_radius=fraction * a)
    # The largest value times the rounding is what a sum over the sphere can miss.
    assert 2.0 * np.pi * a**2 * weights @ exitance == pytest.approx(total, rel=1e-9, abs=1e-14)
    assert 0.0 <= total < 1.0


def test_total_and_absorption_add_up_to_one() -> None:
    """Absorption by order 0 alone: the mean of phi over a shell, times its area."""
    a, r0 = 5.0, 3.0
    mu, mu_weights = np.polynomial.legendre.leggauss(200)
    x, w = np.polynomial.legendre.leggauss(60)
    absorbed = 0.0
    for low, high in ((0.0, 2.5), (2.5, r0), (r0, 3.5), (3.5, a)):
        for node, weight in zip(x, w, strict=True):
            r = 0.5 * (low + high) + 0.5 * (high - low) * node
            points = r * np.column_stack([np.sqrt(1.0 - mu**2), 0.0 * mu, mu])
            phi = sphere.point_fluence(TISSUE, radius=a, source_radius=r0, points=points)
            absorbed += 0.5 * (high - low) * weight * TISSUE.sigma_a * 2.0 * np.pi * r**2 * float(mu_weights @ phi)
    total = sphere.point_total(TISSUE, radius=a, source_radius=r0)
    assert absorbed == pytest.approx(1.0 - total, rel=2e-4)


def test_source_at_the_centre_in_closed_form() -> None:
    k, zb, a = TISSUE.sigma_tr, TISSUE.extrapolation_length, 4.0
    slope = np.cosh(k * a) / a - np.sinh(k * a) / (k * a**2)
    expected = 1.0 / (4.0 * np.pi * a**2) / (np.sinh(k * a) / (k * a) + zb * slope)
    found = sphere.point_exitance(TISSUE, radius=a, source_radius=0.0, gamma=[0.0, 1.0, 3.0])
    np.testing.assert_allclose(found, expected, rtol=1e-13)
    lossless = Medium(sigma_a=0.0, sigma_s_prime=1.0, eta=1.4)
    assert sphere.point_total(lossless, radius=a, source_radius=2.5) == 1.0


def test_fluence_at_the_surface_is_the_exitance() -> None:
    gamma = np.array([0.0, 0.3, 1.0, 3.0])
    points = 10.0 * np.column_stack([np.sin(gamma), 0.0 * gamma, np.cos(gamma)])
    phi = sphere.point_fluence(TISSUE, radius=10.0, source_radius=9.0, points=points)
    exitance = sphere.point_exitance(TISSUE, radius=10.0, source_radius=9.0, gamma=gamma)
    np.testing.assert_allclose(phi / (2.0 * TISSUE.boundary_factor), exitance, rtol=1e-12)


def test_fluence_is_symmetric_in_source_and_point() -> None:
    there = sphere.point_fluence(TISSUE, radius=5.0, source_radius=4.5, points=[[0.0, 0.0, 1.0]])
    back = sphere.point_fluence(TISSUE, radius=5.0, source_radius=1.0, points=[[0.0, 0.0, 4.5]])
    np.testing.assert_allclose(there, back, rtol=1e-12)


@pytest.mark.parametrize(("a", "bound"), [(1e3, 4e-3), (1e4, 4e-4)])
def test_large_sphere_is_a_half_space(a: float, bound: float) -> None:
    rho = np.array([0.0, 0.5, 2.0])
    ball = sphere.point_exitance(TISSUE, radius=a, source_radius=a - 1.0, gamma=rho / a)
    flat = half_space.point_exitance(TISSUE, depth=1.0, rho=rho)
    deviation = np.abs(ball / flat - 1.0)
    assert np.all(deviation < bound)
    assert deviation[-1] > bound / 100.0  # curvature is still to be seen


@pytest.mark.parametrize("depth", [0.1, 0.01])
def test_split_series_is_the_direct_one(depth: float, monkeypatch: pytest.MonkeyPatch) -> None:
    gamma = np.array([0.0, 1e-3, 0.1, 1.0, np.pi])
    direct = sphere.point_exitance(TISSUE, radius=20.0, source_radius=20.0 - depth, gamma=gamma)
    monkeypatch.setattr(sphere, "DIRECT_ORDERS", 0)
    split = sphere.point_exitance(TISSUE, radius=20.0, source_radius=20.0 - depth, gamma=gamma)
    np.testing.assert_allclose(split, direct, rtol=1e-8, atol=1e-13 * direct[0])


def test_source_just_below_the_surface() -> None:
    """No series could end there; the split one sees the half-space that the ball is on that scale."""
    found = sphere.point_exitance(TISSUE, radius=10.0, source_radius=10.0 - 1e-7, gamma=[1e-8, 1e-7])
    flat = half_space.point_exitance(TISSUE, depth=1e-7, rho=[1e-7, 1e-6])
    np.testing.assert_allclose(found, flat, rtol=1e-4)


def test_uniform_beam_of_the_table() -> None:
    expected = {10.0: (0.66115, 0.12402, 0.00586), 5.0: (0.54469, 0.19250, 0.02352), 2.0: (0.34877, 0.21906, 0.08039)}
    for a, values in expected.items():
        found = sphere_light.beam_exitance(MATCHED, radius=a, gamma=np.radians([0.0, 90.0, 180.0]), source="similarity")
        np.testing.assert_allclose(found, values, atol=3e-5)


@pytest.mark.parametrize("source", ["similarity", "delta-eddington"])
def test_uniform_beam_adds_up_and_meets_the_half_space(source: Source) -> None:
    medium = Medium(sigma_a=0.05, sigma_s=5.0, g=0.8, eta=1.0)
    mu, weights = np.polynomial.legendre.leggauss(300)
    exitance = sphere_light.beam_exitance(medium, radius=4.0, gamma=np.arccos(mu), source=source)
    total = sphere_light.beam_total(medium, radius=4.0, source=source)
    assert 2.0 * np.pi * 16.0 * weights @ exitance == pytest.approx(total, rel=1e-10)
    large = sphere_light.beam_exitance(medium, radius=300.0, gamma=0.0, source=source)
    assert float(large) == pytest.approx(half_space.pencil_total(medium, source=source), rel=0.01)


def test_uniform_beam_is_its_point_sources() -> None:
    """The far pole's exitance, summed over the points of all chords."""
    a = 2.0
    nodes, weights = np.polynomial.legendre.leggauss(10)
    u, w = 0.5 * (nodes + 1.0), 0.5 * weights
    total = 0.0
    # Chords by the cosine at which they enter, of length 2 a cosine; squares make nodes dense at the far pole.
    for cosine, cosine_weight in zip(1.0 - u**2, 2.0 * u * w, strict=True):
        length = 2.0 * a * cosine
        for depth, step in zip(length * (1.0 - u**2), length * 2.0 * u * w, strict=True):
            height = a * cosine - depth
            r = float(np.sqrt(height**2 + a**2 * (1.0 - cosine**2)))
            seen = sphere.point_exitance(MATCHED, radius=a, source_radius=r, gamma=np.pi - np.arccos(height / r))
            total += 2.0 * np.pi * a**2 * cosine * cosine_weight * step * 0.99 * np.exp(-depth) * float(seen)
    found = sphere_light.beam_exitance(MATCHED, radius=a, gamma=np.pi, source="similarity")
    assert float(found) == pytest.approx(total, rel=1e-4)


@pytest.mark.parametrize("source", ["similarity", "delta-eddington"])
def test_pencil_is_its_point_sources(source: Source) -> None:
    gamma, a = np.array([0.2, 1.0, 3.0]), 4.0
    if source == "similarity":
        extinction, isotropic, forward = 1.01, 1.0, 0.0
    else:
        scattering = 5.0 * (1.0 - 0.8**2)
        extinction, isotropic, forward = 0.01 + scattering, scattering, 0.8 / 1.8 * scattering / 1.01

    def point(s: float) -> np.ndarray:
        angle = gamma if s < a else np.pi - gamma
        return sphere.point_exitance(FORWARD, radius=a, source_radius=abs(a - s), gamma=angle)

    nodes, weights = np.polynomial.legendre.leggauss(8)
    expected = np.zeros(3)
    for low, high in ((0.0, 0.2), (0.2, 1.0), (1.0, 2.5), (2.5, 5.0), (5.0, 7.0), (7.0, 8.0)):
        for node, weight in zip(nodes, 0.5 * (high - low) * weights, strict=True):
            s = 0.5 * (low + high) + 0.5 * (high - low) * node
            h = min(1e-3, 0.05 * s, 0.05 * (2.0 * a - s))
            density = isotropic * point(s)
            if forward:
                density += forward * (point(s + h) - point(s - h)) / (2.0 * h)
            expected += weight * np.exp(-extinction * s) * density
    found = sphere_light.pencil_exitance(FORWARD, radius=a, gamma=gamma, source=source)
    np.testing.assert_allclose(found, expected, rtol=1e-5)


@pytest.mark.parametrize("source", ["similarity", "delta-eddington"])
def test_pencil_adds_up_to_its_total(source: Source) -> None:
    # gamma = pi/(1 + e^-t) is fine at both ends.
    t = np.linspace(-25.0, 25.0, 1201)
    gamma = np.pi / (1.0 + np.exp(-t))
    area = 2.0 * np.pi * 100.0 * np.sin(gamma) * gamma * (1.0 - gamma / np.pi) * (t[1] - t[0])
    exitance = sphere_light.pencil_exitance(FORWARD, radius=10.0, gamma=gamma, source=source)
    total = sphere_light.pencil_total(FORWARD, radius=10.0, source=source)
    assert area @ exitance == pytest.approx(total, rel=1e-6)


@pytest.mark.parametrize("source", ["similarity", "delta-eddington"])
def test_pencil_on_a_large_sphere_is_on_a_half_space(source: Source) -> None:
    a, rho = 1000.0, np.array([0.01, 0.3, 2.0])
    ball = sphere_light.pencil_exitance(FORWARD, radius=a, gamma=rho / a, source=source)
    flat = half_space.pencil_exitance(FORWARD, rho=rho, source=source)
    np.testing.assert_allclose(ball, flat, rtol=5e-3)
    total = sphere_light.pencil_total(FORWARD, radius=a, source=source)
    assert total == pytest.approx(half_space.pencil_total(FORWARD, source=source), rel=5e-3)


def test_diffuse_light_without_absorption_comes_back() -> None:
    lossless = Medium(sigma_a=0.0, sigma_s_prime=1.0, eta=1.4)
    assert sphere_light.diffuse_exitance(lossless, radius=3.0) == 1.0
    # 4 in matched indices: E_t = phi/4.
    clear = Medium(sigma_a=0.0, sigma_s_prime=1.0, eta=1.0)
    np.testing.assert_allclose(sphere_light.diffuse_fluence(clear, radius=3.0, distance=[0.0, 3.0]), 4.0, rtol=1e-12)
    # What is absorbed inside does not come back.
    r, w = np.polynomial.legendre.leggauss(40)
    radii = 1.5 * (r + 1.0)
    phi = sphere_light.diffuse_fluence(TISSUE, radius=3.0, distance=radii)
    absorbed = TISSUE.sigma_a * np.sum(1.5 * w * 4.0 * np.pi * radii**2 * phi)
    leaving = 4.0 * np.pi * 9.0 * sphere_light.diffuse_exitance(TISSUE, radius=3.0)
    assert absorbed + leaving == pytest.approx(4.0 * np.pi * 9.0, rel=1e-12)


@pytest.mark.parametrize("x", [0.0, 1e-3, 1.0, 50.0, 1e3])
def test_bessel_ratios_meet_the_wronskian_and_the_equation(x: float) -> None:
    """``u' = (l(l+1) + x² - u - u²)/x`` for u = x i'/i, and the same with -v for u."""
    order = 30
    h = 1e-4 * max(x, 1.0)
    if x == 0.0:
        rates = wall_rates(order, np.zeros(1), 0.5)
        np.testing.assert_array_equal(rates.growth[:, 0], np.arange(order + 1))
        np.testing.assert_array_equal(rates.decay[:, 0], np.arange(order + 1) + 1)
        np.testing.assert_allclose(inner_ratios(order, 0.0, np.array([0.5]), 0.5)[:, 0], 0.5 ** np.arange(order + 1))
        return
    h = 1e-3 * x
    low, here, high = (wall_rates(order, np.array([at]), 0.5) for at in (x - h, x, x + h))
    l = np.arange(order + 1)[:, None]  # noqa: E741
    for sign, values in ((1.0, [low.growth, here.growth, high.growth]), (-1.0, [low.decay, here.decay, high.decay])):
        below, at, above = (sign * value for value in values)
        equation = l * (l + 1) + x**2 - at - at**2
        np.testing.assert_allclose((above - below) / (2e-3), equation, rtol=1e-4, atol=1e-4 * max(1.0, x))


def test_what_is_outside_is_refused() -> None:
    with pytest.raises(InputError, match="source_radius is 10, which is not inside the ball"):
        sphere.point_exitance(TISSUE, radius=10.0, source_radius=10.0, gamma=0.0)
    with pytest.raises(InputError, match="source_radius is -1"):
        sphere.point_total(TISSUE, radius=10.0, source_radius=-1.0)
    with pytest.raises(InputError, match="radius is 0"):
        sphere.point_total(TISSUE, radius=0.0, source_radius=0.0)
    with pytest.raises(InputError, match="points"):
        sphere.point_fluence(TISSUE, radius=1.0, source_radius=0.0, points=[[0.0, 0.0, 1.1]])
    with pytest.raises(InputError, match="too close"):
        sphere.point_fluence(TISSUE, radius=1.0, source_radius=1.0 - 1e-6, points=[[0.0, 0.0, 0.0]])
    with pytest.raises(InputError, match=r"eta is 1\.4"):
        sphere_light.beam_exitance(TISSUE, radius=1.0, gamma=0.0)
    with pytest.raises(InputError, match="gamma"):
        sphere_light.pencil_exitance(TISSUE, radius=1.0, gamma=0.0)
    with pytest.raises(InputError, match="distance"):
        sphere_light.diffuse_fluence(TISSUE, radius=1.0, distance=2.0)
    with pytest.raises(InputError, match='source is "point"'):
        sphere_light.pencil_total(TISSUE, radius=1.0, source="point")  # type: ignore[arg-type]
