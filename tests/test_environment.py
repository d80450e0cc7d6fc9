"""Light from all around: white furnaces on concave bodies, even environments, and where the bright part is."""

import math

import numpy as np
import pytest

from tests.conftest import block
from tests.lights_made import deposit_on_mesh
from tests.test_paths import carved
from tetlux.fem import CollimatedBeam, DiffuseLight, EnvironmentLight, Medium, Solution, System, solve
from tetlux.fem.media.fresnel import moments, reflectance
from tetlux.meshing import InputError, TetMesh, box, tetrahedralize, torus
from tetlux.meshing.arrays import FloatArray, Vector


def medium(eta: float, sigma_a: float = 0.01) -> Medium:
    return Medium(sigma_a=sigma_a, sigma_s_prime=1.0, eta=eta)


def two_balls() -> TetMesh:
    """Two balls of radius 2 that touch, in steps of cubes: they meet in a neck of some facets."""
    whole = block((16, 8, 8), (8.0, 4.0, 4.0))
    middles = whole.points[whole.tetrahedra].mean(axis=1)
    apart = [np.linalg.norm(middles - [side, 0.0, -2.0], axis=1) for side in (-1.9, 1.9)]
    return carved(whole, np.minimum(*apart) < 2.0)


def corner() -> TetMesh:
    """An L of three cubes' length."""
    whole = block((6, 3, 6), (6.0, 3.0, 6.0))
    middles = whole.points[whole.tetrahedra].mean(axis=1)
    return carved(whole, (middles[:, 0] < -1.0) | (middles[:, 2] < -4.0))


CONCAVE = {"two balls": two_balls(), "corner": corner(), "cube": block((4, 4, 4), (4.0, 4.0, 4.0))}


@pytest.fixture(scope="module")
def ring() -> TetMesh:
    return tetrahedralize(torus(6.0, 2.0))


@pytest.mark.parametrize("eta", [1.0, 1.3, 1.5])
@pytest.mark.parametrize("name", ["two balls", "corner", "torus"])
def test_a_white_furnace_of_any_shape(name: str, eta: float, ring: TetMesh) -> None:
    """Where nothing is absorbed, all that comes in goes out again where it came in: exitance is what passed in."""
    mesh = ring if name == "torus" else CONCAVE[name]
    solution = System(mesh, medium(eta, sigma_a=0.0)).solve([DiffuseLight(1.0)])
    c1, _ = moments(eta)
    passed = eta**2 * (1.0 - 2.0 * c1)
    assert solution.exitance == pytest.approx(np.full(len(mesh.boundary_nodes), passed), rel=1e-8)
    assert solution.fluence == pytest.approx(np.full(len(mesh.points), 4.0 * eta**2), rel=1e-8)
    assert solution.power.incident == pytest.approx(mesh.area, rel=1e-12)
    assert abs(solution.power.balance_error) < 1e-9


def norm_apart(one: Solution, other: Solution) -> float:
    areas = one.mesh.boundary_node_areas
    gap = areas @ (one.exitance - other.exitance) ** 2
    return float(np.sqrt(gap / (areas @ other.exitance**2)))


@pytest.mark.parametrize("name", ["ball", "cube"])
@pytest.mark.parametrize("eta", [1.0, 1.4])
def test_an_even_environment_is_diffuse_light(name: str, eta: float, ball_mesh: TetMesh) -> None:
    """Radiance 1/pi is irradiance 1; measured .01 % on the ball and on the cube."""
    mesh = ball_mesh if name == "ball" else CONCAVE["cube"]
    system = System(mesh, medium(eta), expected=3)
    diffuse = system.solve([DiffuseLight(1.0)])
    for shape in ((64, 128), (30, 47), (200, 400)):
        even = system.solve([EnvironmentLight(np.full(shape, 1.0 / math.pi), up=(0.3, 0.2, 1.0))])
        assert norm_apart(even, diffuse) < 5e-4
        assert even.power.incident == pytest.approx(diffuse.power.incident, rel=5e-4)
        assert even.power.specular == pytest.approx(diffuse.power.specular, rel=5e-3, abs=1e-9)
        assert abs(even.power.balance_error) < 1e-9


def test_a_coarse_environment_is_even_too(ball_mesh: TetMesh) -> None:
    """Pixels are areas of the sky, and not the directions of their middles: one of a single pixel was a sun."""
    system = System(ball_mesh, medium(1.4), expected=3)
    diffuse = system.solve([DiffuseLight(1.0)])
    for shape in ((1, 1), (2, 4), (4, 8), (16, 32)):
        even = system.solve([EnvironmentLight(np.full(shape, 1.0 / math.pi))])
        assert norm_apart(even, diffuse) < 5e-4


def test_a_concave_body_keeps_light_off_itself(ring: TetMesh) -> None:
    """Of the mesh's nodes those at the middle of the hole see part of the sky, and those outermost all of it."""
    light = EnvironmentLight(np.full((32, 64), 1.0 / math.pi))
    irradiance = deposit_on_mesh(light, ring, medium(1.0)).terms.irradiance
    assert isinstance(irradiance, np.ndarray)
    distance = np.hypot(*ring.boundary_points.T[:2])
    assert irradiance[distance > 7.9] == pytest.approx(1.0, abs=0.03)
    innermost = irradiance[distance < 4.1]
    assert len(innermost) > 5
    # A band of 37 degrees to either side is clear at most, and of the rest what is above and below the far side.
    assert 0.3 < innermost.min() <= innermost.max() < 0.9


def sky(rows: int, columns: int, row: int, column: int) -> FloatArray:
    image = np.zeros((rows, columns))
    image[row, column] = 1.0
    return image


@pytest.mark.parametrize(
    ("row", "column", "up", "front", "towards"),
    [
        # Looking to +y with +z up, +x is to the right; the middle of an even image lies between two pixels.
        (45, 45, (0, 0, 1), (0, 1, 0), (0.0, 1.0, 0.0)),
        (45, 68, (0, 0, 1), (0, 1, 0), (1.0, 0.0, 0.0)),
        (45, 22, (0, 0, 1), (0, 1, 0), (-1.0, 0.0, 0.0)),
        (0, 10, (0, 0, 1), (0, 1, 0), (0.0, 0.0, 1.0)),
        (90, 10, (0, 0, 1), (0, 1, 0), (0.0, 0.0, -1.0)),
        (45, 68, (0, 1, 0), (1, 0, 0), (0.0, 0.0, 1.0)),
        (22, 45, (0, 0, 1), (0, 1, 1), (0.0, math.sqrt(0.5), math.sqrt(0.5))),
    ],
)
def test_a_bright_pixel_is_where_the_image_has_it(
    row: int, column: int, up: Vector, front: Vector, towards: Vector
) -> None:
    light = EnvironmentLight(sky(91, 91, row, column), up=up, front=front)
    directions, power = light.directions
    # A pixel of two or four degrees, in one direction or shared by two.
    assert power @ directions / power.sum() == pytest.approx(towards, abs=0.04)
    polar = np.array([row, row + 1]) * np.pi / 91
    assert power.sum() == pytest.approx(-np.diff(np.cos(polar))[0] * 2.0 * np.pi / 91, rel=1e-9)


def test_a_small_sun_lights_what_a_beam_lights() -> None:
    """The same irradiance, shadows and Fresnel losses as those of parallel light from there, by where it passes in."""
    mesh, of = CONCAVE["corner"], medium(1.4)
    light = EnvironmentLight(sky(64, 128, 20, 38))
    (towards,), (across,) = light.directions
    x, y, z = (-float(part) for part in towards)
    beam = CollimatedBeam((x, y, z), float(across))
    of_sky, of_beam = deposit_on_mesh(light, mesh, of), deposit_on_mesh(beam, mesh, of)
    incident = float(mesh.boundary_node_areas @ of_sky.terms.irradiance)
    assert incident == pytest.approx(of_beam.ledger.incident, rel=1e-9)
    facing = mesh.surface.normals @ towards
    # Where the L is hidden from its own upright part it is dark.
    assert incident < 0.95 * across * float(mesh.boundary_areas @ np.maximum(facing, 0.0))
    lit = facing > 0
    lost = float(reflectance(facing[lit], 1.0 / 1.4).min())
    passed = float(mesh.boundary_node_areas @ of_sky.terms.transmitted_irradiance)
    assert passed < (1.0 - lost) * incident * (1.0 + 1e-12)


def test_environments_add_up(ball_mesh: TetMesh) -> None:
    rng = np.random.default_rng(2)
    one, two = rng.random((20, 40)), rng.random((20, 40))
    system = System(ball_mesh, medium(1.4), expected=3)
    both = system.solve([EnvironmentLight(one), EnvironmentLight(2.0 * two)])
    apart = [system.solve([EnvironmentLight(image)]) for image in (one, two)]
    assert both.exitance == pytest.approx(apart[0].exitance + 2.0 * apart[1].exitance, rel=1e-9)
    assert both.power.incident == pytest.approx(apart[0].power.incident + 2.0 * apart[1].power.incident, rel=1e-12)


@pytest.mark.parametrize(
    ("image", "message"),
    [
        (np.zeros((4, 8)), "black all over"),
        (np.full((4, 8), np.nan), "not a number or negative"),
        (np.ones((4, 8, 3)), r"shape \(4, 8, 3\); give rows and columns"),
    ],
)
def test_environments_that_cannot_be(image: FloatArray, message: str) -> None:
    with pytest.raises(InputError, match=message):
        EnvironmentLight(image)


def test_directions_that_do_not_go_together() -> None:
    with pytest.raises(InputError, match=r"up and front of the environment are both along \(0, 0, 1\)"):
        EnvironmentLight(np.ones((2, 2)), front=(0.0, 0.0, -3.0))
    with pytest.raises(InputError, match="up is zero"):
        EnvironmentLight(np.ones((2, 2)), up=(0.0, 0.0, 0.0))
    classic = Medium(sigma_a=0.01, sigma_s_prime=1.0, eta=1.4, boundary="classic")
    with pytest.raises(InputError, match='environment light needs the boundary "exact"'):
        solve(box((10.0, 10.0, 10.0)), classic, [EnvironmentLight(np.ones((2, 2)))])
