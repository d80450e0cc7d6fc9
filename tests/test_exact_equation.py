"""Every closed form for a fluence must meet the diffusion equation inside and its boundary condition outside."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest

from tetlux.fem import Medium
from tetlux.fem.exact import cylinder, dipole, half_space, slab, sphere, sphere_light
from tetlux.meshing.arrays import FloatArray

MEDIA = [
    Medium(sigma_a=0.0, sigma_s_prime=1.0, eta=1.4),
    Medium(sigma_a=0.05, sigma_s_prime=1.0, eta=1.0),
    Medium(sigma_a=1.0, sigma_s_prime=1.0, eta=1.5),
]
RADIUS = 3.0


@dataclass(frozen=True)
class Field:
    """A fluence, points inside, and boundary points with their outward normals."""

    fluence: Callable[[Medium, FloatArray], FloatArray]
    inside: list[list[float]]
    boundary: list[list[float]]
    normals: list[list[float]]


def on_ball(angles: list[float]) -> list[list[float]]:
    return [[np.sin(t), 0.0, np.cos(t)] for t in angles]


def on_cylinder(angles: list[float]) -> list[list[float]]:
    return [[np.cos(t), np.sin(t), 0.0] for t in angles]


FACES = [[0.4, 0.0, 0.0], [1.0, 2.0, 0.0]]
UP, DOWN = [0.0, 0.0, -1.0], [0.0, 0.0, 1.0]
BALL = on_ball([0.2, 1.0, 2.5])
ROUND = on_cylinder([0.1, 1.0, 2.5])

FIELDS = {
    "half-space": Field(
        lambda m, x: half_space.point_fluence(m, depth=1.2, points=x),
        [[0.3, 0.0, 0.4], [1.0, 1.0, 2.0], [4.0, 0.0, 0.2]],
        FACES,
        [UP, UP],
    ),
    "slab, near and far from the axis": Field(
        lambda m, x: slab.point_fluence(m, thickness=2.0, depth=0.7, points=x),
        [[0.3, 0.0, 0.4], [1.0, 0.0, 1.5], [4.0, 0.0, 0.3]],
        [*FACES, [0.4, 0.0, 2.0], [3.0, 1.0, 2.0]],
        [UP, UP, DOWN, DOWN],
    ),
    "sphere": Field(
        lambda m, x: sphere.point_fluence(m, radius=RADIUS, source_radius=2.0, points=x),
        [[0.3, 0.0, 1.1], [0.0, 0.0, -2.0], [1.0, 2.0, 1.0]],
        [[RADIUS * c for c in p] for p in BALL],
        BALL,
    ),
    "cylinder with a point": Field(
        lambda m, x: cylinder.point_fluence(m, radius=RADIUS, source_radius=2.0, points=x),
        [[1.1, 0.3, 0.0], [-2.0, 0.0, 1.0]],
        [[RADIUS * p[0], RADIUS * p[1], 0.5] for p in ROUND],
        ROUND,
    ),
    "cylinder with a line": Field(
        lambda m, x: cylinder.line_fluence(m, radius=RADIUS, source_radius=2.0, points=x),
        [[1.1, 0.3, 0.0], [-2.0, 0.0, 1.0]],
        [[RADIUS * p[0], RADIUS * p[1], 0.5] for p in ROUND],
        ROUND,
    ),
    "dipole": Field(lambda m, x: dipole.fluence(m, depth=1.2, points=x), [[0.3, 0.0, 0.4], [4.0, 0.0, 0.2]], [], []),
    "slab, extrapolated": Field(
        lambda m, x: slab.extrapolated_fluence(m, thickness=2.0, depth=0.7, points=x),
        [[0.3, 0.0, 0.4], [7.0, 0.0, 0.3]],
        [],
        [],
    ),
    "sphere in diffuse light": Field(
        lambda m, x: sphere_light.diffuse_fluence(m, radius=RADIUS, distance=np.linalg.norm(x, axis=1)),
        [[0.3, 0.0, 1.1], [0.0, 0.0, -2.0]],
        [],
        [],
    ),
}
WITH_ROBIN = [name for name, field in FIELDS.items() if field.boundary]


@pytest.mark.parametrize("medium", MEDIA)
@pytest.mark.parametrize("name", FIELDS)
def test_fluence_meets_the_diffusion_equation(name: str, medium: Medium) -> None:
    field = FIELDS[name]
    x = np.array(field.inside)
    h = 0.02
    # Fourth-order second differences along each axis.
    laplacian = np.zeros(len(x))
    scale = np.zeros(len(x))
    for axis in np.eye(3):
        samples = [field.fluence(medium, x + step * h * axis) for step in (-2, -1, 0, 1, 2)]
        second = np.array([-1.0, 16.0, -30.0, 16.0, -1.0]) @ np.array(samples) / (12.0 * h**2)
        laplacian += second
        scale += np.abs(second)
    absorbed = medium.sigma_a * field.fluence(medium, x)
    residual = medium.diffusion * laplacian - absorbed
    # Rounding of the differences, for the one fluence that is constant.
    noise = 1e-14 * field.fluence(medium, x) / h**2
    assert np.all(np.abs(residual) < 1e-4 * medium.diffusion * scale + noise)
    if medium.sigma_a:
        # A truncation error of (h/distance from the source)^4 of second derivatives that nearly cancel.
        np.testing.assert_allclose(medium.diffusion * laplacian, absorbed, rtol=2e-3)


@pytest.mark.parametrize("medium", MEDIA)
@pytest.mark.parametrize("name", WITH_ROBIN)
def test_fluence_meets_the_robin_condition(name: str, medium: Medium) -> None:
    field = FIELDS[name]
    x, normal = np.array(field.boundary), np.array(field.normals)
    h = 0.01
    samples = np.array([field.fluence(medium, x - step * h * normal) for step in range(5)])
    outward = np.array([25.0, -48.0, 36.0, -16.0, 3.0]) @ samples / (12.0 * h)
    np.testing.assert_allclose(medium.extrapolation_length * outward, -samples[0], rtol=1e-5)


@pytest.mark.parametrize("medium", MEDIA)
def test_extrapolated_fluence_is_zero_on_its_planes(medium: Medium) -> None:
    zb = medium.extrapolation_length
    x = np.array([[0.5, 0.0, -zb], [30.0, 0.0, -zb], [0.5, 0.0, 2.0 + zb], [30.0, 0.0, 2.0 + zb]])
    inside = x * [1.0, 1.0, 0.0] + [0.0, 0.0, 1.0]
    outer = slab.extrapolated_fluence(medium, thickness=2.0, depth=0.7, points=x)
    inner = slab.extrapolated_fluence(medium, thickness=2.0, depth=0.7, points=inside)
    assert np.all(np.abs(outer) < 1e-11 * inner)
    assert np.all(np.abs(dipole.fluence(medium, depth=0.7, points=x[:2])) == 0.0)


@pytest.mark.parametrize("medium", MEDIA)
def test_diffuse_light_meets_its_boundary_condition(medium: Medium) -> None:
    r = RADIUS - 0.01 * np.arange(5)
    phi = sphere_light.diffuse_fluence(medium, radius=RADIUS, distance=r)
    slope = np.array([25.0, -48.0, 36.0, -16.0, 3.0]) @ phi / 0.12
    centre = sphere_light.diffuse_fluence(
        Medium(sigma_a=0.0, sigma_s_prime=1.0, eta=medium.eta), radius=RADIUS, distance=0.0
    )
    # Without absorption phi is 4/(1 - 2 C1) everywhere, the right side of the condition.
    assert phi[0] + medium.extrapolation_length * slope == pytest.approx(float(centre), rel=1e-6)
    leaving = sphere_light.diffuse_exitance(medium, radius=RADIUS)
    assert leaving == pytest.approx(1.0 - medium.diffusion * slope, abs=1e-6)
