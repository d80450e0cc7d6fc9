"""What must not change, or must change in a known way, whatever the scene: properties of the solved system."""

import math

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from tests.conftest import TISSUE, block
from tests.convergence import ball_mesh
from tetlux.fem import DiffuseLight, Light, Medium, PencilBeam, PointSource, solve
from tetlux.fem.media.fresnel import reflectance
from tetlux.meshing import Surface, TetMesh, box
from tetlux.meshing.arrays import FloatArray, Vector

# The same examples on every machine, and few of them: each is at least one solve.
few = settings(max_examples=8, deadline=None, derandomize=True, database=None)

BLOCK = block((4, 5, 4), (4.0, 5.0, 4.0))
BALL = ball_mesh(3.0, 3)
MESHES = {"block": BLOCK, "ball": BALL}
# Both are about this place.
CENTRES = {"block": (0.0, 0.0, -2.0), "ball": (0.0, 0.0, 0.0)}


def numbers(low: float, high: float) -> st.SearchStrategy[float]:
    """Positive numbers, as many in each decade."""
    return st.floats(math.log(low), math.log(high)).map(math.exp)


media = st.builds(
    lambda a, s, eta: Medium(sigma_a=a, sigma_s_prime=s, eta=eta),
    numbers(0.001, 0.5),
    numbers(0.5, 3.0),
    numbers(1, 1.6),
)
# Within 1.4 of the centre of either body.
places = st.tuples(*[st.floats(-0.8, 0.8)] * 3)
turns = st.tuples(*[st.floats(-3.0, 3.0)] * 3).map(Rotation.from_rotvec)


def moved(place: Vector, to: str) -> Vector:
    x, y, z = np.add(place, CENTRES[to])
    return (float(x), float(y), float(z))


def beam_through(place: Vector, turn: Rotation, power: float = 1.0) -> PencilBeam:
    """A fading beam from outside through a place."""
    direction = turn.apply([0.48, 0.6, 0.64])
    x, y, z = np.array(place) - 20.0 * direction
    return PencilBeam((x, y, z), tuple(direction.tolist()), power=power, deposit="line")


@few
@given(medium=media, place=places, scale=numbers(1e-3, 1e3), name=st.sampled_from(sorted(MESHES)))
def test_lengths_times_s_and_coefficients_over_s_make_exitance_over_s_squared(
    medium: Medium, place: Vector, scale: float, name: str
) -> None:
    mesh, (x, y, z) = MESHES[name], moved(place, name)
    plain = solve(mesh, medium, [PointSource((x, y, z))])
    assert medium.sigma_s_prime is not None
    thin = Medium(sigma_a=medium.sigma_a / scale, sigma_s_prime=medium.sigma_s_prime / scale, eta=medium.eta)
    grown = TetMesh(mesh.points * scale, mesh.tetrahedra)
    scaled = solve(grown, thin, [PointSource((x * scale, y * scale, z * scale))])
    np.testing.assert_allclose(scaled.exitance * scale**2, plain.exitance, rtol=1e-8)
    np.testing.assert_allclose(scaled.fluence * scale**2, plain.fluence, rtol=1e-8)
    assert scaled.power.exited == pytest.approx(plain.power.exited, rel=1e-9)


@few
@given(medium=media, place=places, turn=turns, aim=turns, shift=st.tuples(*[st.floats(-50.0, 50.0)] * 3))
def test_a_mesh_and_its_lights_may_be_turned_and_moved(
    medium: Medium, place: Vector, turn: Rotation, aim: Rotation, shift: Vector
) -> None:
    def there(points: FloatArray | Vector) -> FloatArray:
        return np.asarray(turn.apply(points) + shift)

    point, beam = PointSource(moved(place, "block")), beam_through(moved(place, "block"), aim)
    here = solve(BLOCK, medium, [point, beam])
    x, y, z = there(point.position)
    a, b, c = there(beam.origin)
    u, v, w = turn.apply(beam.direction)
    mesh = TetMesh(there(BLOCK.points), BLOCK.tetrahedra)
    moved_beam = PencilBeam((a, b, c), (u, v, w), deposit="line")
    away = solve(mesh, medium, [PointSource((x, y, z)), moved_beam])
    # Coordinates of up to 50 carry rounding of 1e-14 into elements of size 1.
    np.testing.assert_allclose(away.exitance, here.exitance, rtol=1e-8)
    np.testing.assert_allclose(away.fluence, here.fluence, rtol=1e-8)
    assert away.power.ballistic == pytest.approx(here.power.ballistic, rel=1e-9)


@pytest.mark.slow
def test_a_body_that_is_turned_and_meshed_anew_exits_the_same() -> None:
    body = box((8.0, 5.0, 6.0))
    turn, shift = Rotation.from_rotvec([0.4, 1.1, -0.7]), np.array([3.0, -20.0, 7.0])
    turned = Surface(turn.apply(body.points) + shift, body.faces)
    x, y, z = turn.apply([1.0, 0.5, 1.5]) + shift
    here = solve(body, TISSUE, [PointSource((1.0, 0.5, 1.5))], tolerance=0.05)
    away = solve(turned, TISSUE, [PointSource((x, y, z))], tolerance=0.05)
    # Four turns: 0.00008 to 0.00015 of the power, and 0.0141 to 0.0151 of the exitance.
    assert away.power.exited == pytest.approx(here.power.exited, rel=0.0006)
    weights, points = here.mesh.boundary_node_areas, here.mesh.boundary_points
    gap = away.exitance_at(turn.apply(points) + shift) - here.exitance
    assert math.sqrt((weights @ gap**2) / (weights @ here.exitance**2)) < 0.03


@few
@given(
    medium=media,
    place=places,
    aim=turns,
    powers=st.tuples(*[numbers(1e-3, 1e3)] * 3),
    name=st.sampled_from(sorted(MESHES)),
)
def test_lights_add_up_each_by_its_power(
    medium: Medium, place: Vector, aim: Rotation, powers: tuple[float, float, float], name: str
) -> None:
    mesh, where = MESHES[name], moved(place, name)

    def lights(p: float, q: float, r: float) -> list[Light]:
        return [PointSource(where, power=p), beam_through(where, aim, power=q), DiffuseLight(irradiance=r)]

    alone = [solve(mesh, medium, [light]) for light in lights(1.0, 1.0, 1.0)]
    all_of_them = solve(mesh, medium, lights(*powers))
    for quantity in ("fluence", "exitance"):
        expected = sum(p * getattr(s, quantity) for p, s in zip(powers, alone, strict=True))
        np.testing.assert_allclose(getattr(all_of_them, quantity), expected, rtol=1e-7)
    for share in ("incident", "specular", "absorbed", "exited", "ballistic"):
        sent = sum(p * getattr(s.power, share) for p, s in zip(powers, alone, strict=True))
        assert getattr(all_of_them.power, share) == pytest.approx(sent, rel=1e-8, abs=1e-12)


@few
@given(medium=media, one=places, other=places, name=st.sampled_from(sorted(MESHES)))
def test_source_and_detector_may_change_places(medium: Medium, one: Vector, other: Vector, name: str) -> None:
    mesh, here, there = MESHES[name], moved(one, name), moved(other, name)
    forth = solve(mesh, medium, [PointSource(here)], subtract="nothing").fluence_at(np.array([there]))
    back = solve(mesh, medium, [PointSource(there)], subtract="nothing").fluence_at(np.array([here]))
    # To rounding for plain P1; what is subtracted is different at either end.
    np.testing.assert_allclose(forth, back, rtol=1e-8)


@few
@given(
    absorption=numbers(1e-3, 30.0),
    scattering=numbers(0.05, 30.0),
    eta=numbers(1.0, 1.6),
    place=st.tuples(st.floats(-1.9, 1.9), st.floats(-2.4, 2.4), st.floats(-3.9, -0.1)),
)
@example(absorption=0.01, scattering=30.0, eta=1.0, place=(-1.7, -2.2, -0.2))
@example(absorption=30.0, scattering=1.0, eta=1.5, place=(0.1, 0.2, -2.1))
def test_light_is_nowhere_negative_on_a_mesh_without_obtuse_angles(
    absorption: float, scattering: float, eta: float, place: Vector
) -> None:
    """Lumping in the volume and on the boundary, and not one of them alone, makes the inverse non-negative."""
    medium = Medium(sigma_a=absorption, sigma_s_prime=scattering, eta=eta)
    solution = solve(BLOCK, medium, [PointSource(place)], subtract="nothing", limit=False)
    # Down to the solver's own residual, which is 1e-12 of the load.
    assert solution.fluence.min() > -1e-10 * solution.fluence.max()


@few
@given(medium=media, place=places, aim=turns, name=st.sampled_from(sorted(MESHES)), share=st.floats(0.0, 1.0))
def test_all_power_is_accounted_for(medium: Medium, place: Vector, aim: Rotation, name: str, share: float) -> None:
    where = moved(place, name)
    lights: list[Light] = [
        PointSource(where),
        beam_through(where, aim, power=1.0 + share),
        DiffuseLight(irradiance=0.1 + share),
    ]
    for some in (lights[:1], lights[1:2], lights[2:], lights):
        power = solve(MESHES[name], medium, some).power
        assert abs(power.balance_error) < 1e-9
        assert min(power.specular, power.absorbed, power.exited, power.ballistic) >= 0


@few
@given(medium=media, place=places, factor=st.floats(1.05, 3.0), name=st.sampled_from(sorted(MESHES)))
def test_a_darker_body_lets_less_out(medium: Medium, place: Vector, factor: float, name: str) -> None:
    darker = Medium(sigma_a=medium.sigma_a * factor, sigma_s_prime=medium.sigma_s_prime, eta=medium.eta)
    source = [PointSource(moved(place, name))]
    bright, dark = (solve(MESHES[name], m, source, subtract="nothing") for m in (medium, darker))
    assert dark.power.exited < bright.power.exited
    assert dark.power.absorbed > bright.power.absorbed
    # Both are 0 where too coarse a mesh would have them below it.
    assert ((dark.exitance < bright.exitance) | (bright.exitance == 0)).all()


@pytest.mark.parametrize("eta", [1.0, 1.4])
@pytest.mark.parametrize("name", MESHES)
def test_white_furnace(name: str, eta: float) -> None:
    """Nothing absorbs, and the same light comes from all directions: then it is the same inside.

    Outside the radiance is I/pi for an irradiance I. Inside, an isotropic radiance is eta² times that (it is
    radiance over eta² that is kept in refraction), and the fluence 4 pi times it: ``phi = 4 eta² I``. That is
    ``4 E_t/(1 - 2 C1)``: from the outside E_t/I of the light passes, from inside 1 - 2 C1 of it, and what
    passes one way in equilibrium passes the other.
    """
    irradiance = 0.7
    medium = Medium(sigma_a=0.0, sigma_s_prime=1.3, eta=eta)
    solution = solve(MESHES[name], medium, [DiffuseLight(irradiance=irradiance)])
    np.testing.assert_allclose(solution.fluence, 4.0 * eta**2 * irradiance, rtol=1e-8)

    # The share of diffuse light that the outside of the surface passes, 2 ∫ (1 - F) mu dmu.
    nodes, weights = np.polynomial.legendre.leggauss(200)
    cosine = 0.5 * (nodes + 1.0)
    passed = irradiance * float(weights @ ((1.0 - reflectance(cosine, 1.0 / eta)) * cosine))
    np.testing.assert_allclose(solution.exitance, passed, rtol=1e-6)
    # What was reflected and what exits make up for what comes.
    area = MESHES[name].area
    power = solution.power
    assert power.incident == pytest.approx(irradiance * area, rel=1e-12)
    assert power.specular == pytest.approx((irradiance - passed) * area, rel=1e-5, abs=1e-10)
    assert power.exited + power.specular == pytest.approx(irradiance * area, rel=1e-9)
    assert power.absorbed == 0.0
