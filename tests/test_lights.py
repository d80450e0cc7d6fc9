"""Where lights put their power, and that nothing of it is lost on the way to the nodes."""

import math
from dataclasses import replace

import numpy as np
import pytest

from tests.conftest import TISSUE, block
from tetlux.fem import Deposit, DiffuseLight, Medium, PencilBeam, PointSource, Segments, SourceTerms, solve
from tetlux.fem.ballistic import follow as paths
from tetlux.fem.body.body import Body
from tetlux.fem.exact import sphere_light
from tetlux.fem.media.coefficients import coefficients_of
from tetlux.fem.media.fresnel import reflectance
from tetlux.fem.operators.loads import load_vector
from tetlux.meshing import InputError, Surface, TetMesh, box, slab, sphere, surface_from_arrays

FORWARD = Medium(sigma_a=0.05, sigma_s=10.0, g=0.9, eta=1.4)


def total(deposit: Deposit) -> float:
    """What a deposit accounts for, but for what it leaves to be scattered along segments."""
    return (
        deposit.ledger.specular + deposit.ledger.absorbed + deposit.ledger.ballistic + float(deposit.terms.powers.sum())
    )


def test_a_point_source_keeps_its_power(ball: Surface, ball_mesh: TetMesh) -> None:
    deposit = PointSource((1.0, 2.0, 3.0), power=2.5).deposit_in(Body(ball, (TISSUE,)))
    assert (deposit.ledger.incident, total(deposit)) == (2.5, 2.5)
    load = load_vector(ball_mesh, coefficients_of(TISSUE), deposit.terms)
    assert load.sum() == pytest.approx(2.5, rel=1e-14)
    # Linear functions see the source where it is.
    assert load @ ball_mesh.points == pytest.approx([2.5, 5.0, 7.5])


def test_a_pencil_beam_at_right_angles_puts_one_point_a_mean_free_path_deep() -> None:
    plate = slab(60.0, 10.0)
    deposit = PencilBeam((1.0, 2.0, 5.0), (0.0, 0.0, -2.0), power=3.0).deposit_in(Body(plate, (TISSUE,)))
    assert deposit.terms.points == pytest.approx(np.array([[1.0, 2.0, -TISSUE.mean_free_path]]))
    assert deposit.ledger.specular == pytest.approx(3 * (0.4 / 2.4) ** 2)
    assert deposit.terms.powers[0] == pytest.approx(TISSUE.albedo * (3 - deposit.ledger.specular))
    assert total(deposit) == pytest.approx(3.0)


def test_a_slanting_beam_refracts() -> None:
    angle = math.radians(50)
    direction = (math.sin(angle), 0.0, -math.cos(angle))
    deposit = PencilBeam((-5 * direction[0], 0.0, 5 * math.cos(angle)), direction).deposit_in(
        Body(slab(60.0, 10.0), (TISSUE,))
    )
    inside = math.asin(math.sin(angle) / 1.4)
    expected = TISSUE.mean_free_path * np.array([[math.sin(inside), 0, -math.cos(inside)]])
    assert deposit.terms.points == pytest.approx(expected, abs=1e-9)
    assert deposit.ledger.specular == pytest.approx(float(reflectance(math.cos(angle), 1 / 1.4)))


def test_a_line_fades_by_delta_eddington_and_leaves_the_rest_at_the_far_side() -> None:
    thin = slab(20.0, 0.5)
    beam = PencilBeam((0.1, 0.2, 5.0), (0.0, 0.0, -1.0), deposit="line")
    mesh = block((8, 8, 2), (20.0, 20.0, 0.5))
    deposit = beam.deposit_in(Body(thin, (FORWARD,))).evaluate_on(mesh, thin, coefficients_of(FORWARD))
    extinction = 0.05 + 10 * (1 - 0.81)
    lost = (0.4 / 2.4) ** 2
    through = (1 - lost) * math.exp(-extinction * 0.5)
    # The part that the far face reflects comes back once and again.
    passes = through * (1 - lost) / (1 - lost**2 * math.exp(-2 * extinction * 0.5))
    back = passes * lost * math.exp(-extinction * 0.5)
    assert deposit.ledger.specular == pytest.approx(lost)
    assert deposit.ledger.ballistic == pytest.approx(passes + back, rel=1e-9)
    # What is too faint to go on inside is a point already.
    scattered = (1 - lost - deposit.ledger.ballistic) * 1.9 / 1.95 - float(deposit.terms.powers.sum())
    assert deposit.ledger.absorbed == pytest.approx((1 - lost - deposit.ledger.ballistic) * 0.05 / 1.95, rel=1e-9)
    assert total(deposit) + scattered == pytest.approx(1.0, rel=1e-12)
    assert load_vector(mesh, coefficients_of(FORWARD), deposit.terms).sum() == pytest.approx(scattered)


@pytest.mark.parametrize("counts", [(1, 1, 1), (2, 2, 3), (3, 5, 7)])
def test_a_line_is_integrated_exactly_on_any_mesh(counts: tuple[int, int, int]) -> None:
    """A P1 mesh reproduces linear functions, so ``∫ Q0 z + (1/sigma_t') ∫ Q1 . grad z`` has a closed form on it."""
    depth, flux = 4.0, 2.0
    # Down an edge that many tetrahedra share: each stretch must count once.
    segments = Segments(np.zeros((1, 3)), np.array([[0.0, 0.0, -1.0]]), np.array([depth]), np.array([flux]))
    mesh = block(counts, (6.0, 6.0, depth))
    load = load_vector(mesh, coefficients_of(FORWARD), SourceTerms(segments=segments))
    scattering, cosine = FORWARD.delta_eddington
    mu = FORWARD.sigma_a + scattering
    decay = math.exp(-mu * depth)
    q0 = flux * scattering / mu * (1 - decay)
    q0_z = -flux * scattering * (1 - (1 + mu * depth) * decay) / mu**2
    q1_z = -cosine * q0 / FORWARD.sigma_t_prime
    assert load.sum() == pytest.approx(q0, rel=1e-12)
    assert load @ mesh.points[:, 2] == pytest.approx(q0_z + q1_z, rel=1e-10)
    assert load @ mesh.points[:, :2] == pytest.approx([0.0, 0.0], abs=1e-12)


def test_a_slanting_line_is_integrated_exactly() -> None:
    direction = np.array([[0.6, 0.0, -0.8]])
    segments = Segments(np.array([[-1.0, 0.3, 0.0]]), direction, np.array([5.0]), np.array([1.0]))
    mesh = block((5, 4, 6), (12.0, 12.0, 4.0))
    load = load_vector(mesh, coefficients_of(TISSUE), SourceTerms(segments=segments))
    mu = TISSUE.sigma_t_prime
    decay = math.exp(-mu * 5)
    power = TISSUE.albedo * (1 - decay)
    mean = TISSUE.albedo * (1 - (1 + mu * 5) * decay) / mu
    assert load.sum() == pytest.approx(power, rel=1e-12)
    assert load @ mesh.points == pytest.approx(power * segments.starts[0] + mean * direction[0], rel=1e-10)


def test_a_beam_with_a_radius_is_spread_evenly_over_its_disc() -> None:
    deposit = PencilBeam((0.0, 0.0, 5.0), (0.0, 0.0, -1.0), radius=2.0).deposit_in(Body(slab(60.0, 10.0), (TISSUE,)))
    distance = np.linalg.norm(deposit.terms.points[:, :2], axis=1)
    assert distance.max() < 2.0
    # Over a disc the mean square distance from the middle is half the radius squared.
    assert (distance**2).mean() == pytest.approx(2.0, rel=1e-9)
    assert deposit.terms.points[:, :2].mean(axis=0) == pytest.approx([0, 0], abs=0.05)
    assert total(deposit) == pytest.approx(1.0)


def test_what_misses_is_not_incident() -> None:
    deposit = PencilBeam((30.0, 0.0, 5.0), (0.0, 0.0, -1.0), radius=2.0).deposit_in(Body(slab(60.0, 10.0), (TISSUE,)))
    assert deposit.ledger.incident == pytest.approx(0.5, abs=0.05)
    assert "misses the body" in deposit.warnings[0]


def test_warnings_of_deposits() -> None:
    plate, thin = slab(60.0, 10.0), slab(60.0, 0.5)
    beam = PencilBeam((0.0, 0.0, 5.0), (0.0, 0.0, -1.0))
    assert beam.deposit_in(Body(plate, (TISSUE,))).warnings == ()
    assert "singular" in replace(beam, deposit="line").deposit_in(Body(plate, (TISSUE,))).warnings[0]
    assert "less than two mean free paths" in beam.deposit_in(Body(thin, (TISSUE,))).warnings[0]
    assert beam.deposit_in(Body(thin, (TISSUE,))).terms.points[0, 2] == pytest.approx(-0.25)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: PointSource((0.0, 0.0, 11.0)), r"point source at \(0, 0, 11\) lies outside"),
        (lambda: PencilBeam((0.0, 20.0, 20.0), (0.0, 0.0, -1.0)), "misses the body, which spans x -10"),
        (lambda: PencilBeam((0.0, 0.0, 20.0), (0.0, 0.0, 1.0)), "misses"),
        (lambda: PencilBeam((0.0, 0.0, 5.0), (0.0, 0.0, -1.0)), "starts inside"),
        (lambda: PencilBeam((0.0, 0.0, 20.0), (0.0, 0.0, 0.0)), "direction is zero"),
        (lambda: PencilBeam((0.0, 0.0, math.nan), (0.0, 0.0, 1.0)), "origin is"),
        (lambda: PencilBeam((0.0, 0.0, 20.0), (0.0, 0.0, -1.0), power=0.0), "power is 0"),
        (lambda: PencilBeam((0.0, 0.0, 20.0), (0.0, 0.0, -1.0), radius=-1.0), "radius is -1"),
        (lambda: PencilBeam((0.0, 0.0, 20.0), (0.0, 0.0, -1.0), deposit="dot"), 'deposit is "dot"'),  # type: ignore[arg-type]
        (lambda: PointSource((0.0, 0.0, 1.0), power=math.inf), "power is inf"),
    ],
)
def test_lights_that_cannot_be(make: object, message: str, ball: Surface) -> None:
    assert callable(make)
    with pytest.raises(InputError, match=message):
        make().deposit_in(Body(ball, (TISSUE,)))


@pytest.mark.parametrize("eta", [1.0, 1.4])
def test_diffuse_light_on_a_ball_against_its_closed_form(eta: float, ball: Surface) -> None:
    medium = Medium(sigma_a=0.05, sigma_s_prime=1.0, eta=eta)
    solution = solve(ball, medium, [DiffuseLight(3.0)], tolerance=0.01)
    transmitted = DiffuseLight(3.0).deposit_in(Body(ball, (medium,))).terms.transmitted_irradiance
    expected = transmitted * sphere_light.diffuse_exitance(medium, radius=10.0)
    # Three runs each: the power 0.19 to 0.32 % off, the worst node 1.5 to 1.8 %.
    assert solution.power.exited / solution.mesh.area == pytest.approx(expected, rel=0.005)
    assert solution.exitance == pytest.approx(expected, rel=0.03)
    assert solution.power.incident == pytest.approx(3.0 * 4 * np.pi * 100, rel=0.01)
    assert abs(solution.power.balance_error) < 1e-9
    assert solution.error_estimate <= 0.01


def test_diffuse_light_that_cannot_be(ball: Surface) -> None:
    with pytest.raises(InputError, match="irradiance is 0"):
        DiffuseLight(0.0)
    with pytest.raises(InputError, match='needs the boundary "exact"'):
        DiffuseLight(1.0).deposit_in(Body(ball, (replace(TISSUE, boundary="classic"),)))


def test_a_slanting_line_beam_meets_the_far_face_at_its_angle() -> None:
    angle = math.radians(60)
    direction = (math.sin(angle), 0.0, -math.cos(angle))
    clear = Medium(sigma_a=0.0, sigma_s=0.1, g=0.0, eta=1.4)
    beam = PencilBeam((-3 * direction[0], 0.1, 3 * math.cos(angle)), direction, deposit="line")
    plate, mesh = slab(400.0, 4.0), block((4, 4, 2), (400.0, 400.0, 4.0))
    deposit = beam.deposit_in(Body(plate, (clear,))).evaluate_on(mesh, plate, coefficients_of(clear))
    segments = deposit.terms.segments
    inside = math.asin(math.sin(angle) / 1.4)
    assert segments.lengths[:3] == pytest.approx(4 / math.cos(inside))
    # Stokes: the same share is reflected from inside at the refracted angle as from outside at the first.
    lost = float(reflectance(math.cos(angle), 1 / 1.4))
    fading = math.exp(-0.1 * 4 / math.cos(inside))
    assert segments.fluxes[:3] == pytest.approx((1 - lost) * np.array([1, lost * fading, (lost * fading) ** 2]))
    # A beam of 3e-8 is not followed any more.
    assert deposit.ledger.ballistic == pytest.approx((1 - lost) ** 2 * fading / (1 - lost * fading), rel=1e-8)
    assert segments.directions[1] == pytest.approx([math.sin(inside), 0, math.cos(inside)])


def test_what_is_still_caught_after_many_reflections_is_booked(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(paths, "MOST_FACETS", 2)
    clear = Medium(sigma_a=0.001, sigma_s=0.1, g=0.5, eta=4.0)
    beam = PencilBeam((0.2, 0.1, 2.0), (0.3, 0.2, -1.0), deposit="line")
    cube, mesh = box((2.0, 2.0, 2.0)), block((2, 2, 2), (2.0, 2.0, 2.0))
    mesh = TetMesh(mesh.points + np.array([0.0, 0.0, 1.0]), mesh.tetrahedra)
    deposit = beam.deposit_in(Body(cube, (clear,))).evaluate_on(mesh, cube, coefficients_of(clear))
    segments = deposit.terms.segments
    scattered = load_vector(mesh, coefficients_of(clear), deposit.terms).sum()
    # The first way, and of each of the others what is reflected.
    assert len(segments.lengths) == 3
    # What it still carries then is a point, and part of the load.
    assert len(deposit.terms.points) == 1
    assert total(deposit) + scattered - deposit.terms.powers.sum() == pytest.approx(1.0, rel=1e-10)


@pytest.mark.parametrize("seed", range(6))
def test_a_line_along_edges_and_faces_of_a_turned_mesh_loses_nothing(seed: int) -> None:
    """Rounded coordinates leave it to chance which tetrahedra a path along an edge is in."""
    random = np.random.default_rng(seed)
    turn, _ = np.linalg.qr(random.normal(size=(3, 3)))
    turn *= np.sign(np.linalg.det(turn))
    straight = block((3, 3, 4), (3.0, 3.0, 4.0))
    mesh = TetMesh(straight.points @ turn.T, straight.tetrahedra)
    for x, y in ((0.5, 0.5), (0.5, 0.1), (0.2, 0.2), (1.5, 0.5), (1.5, 1.5)):
        start, direction = turn @ np.array([x, y, 0.0]), turn @ np.array([0.0, 0.0, -1.0])
        segments = Segments(start[None], direction[None], np.array([4.0]), np.ones(1))
        load = load_vector(mesh, coefficients_of(TISSUE), SourceTerms(segments=segments))
        mu, decay = TISSUE.sigma_t_prime, math.exp(-4 * TISSUE.sigma_t_prime)
        assert load.sum() == pytest.approx(TISSUE.albedo * (1 - decay), rel=1e-12)
        mean = TISSUE.albedo * (1 - (1 + 4 * mu) * decay) / mu
        assert load @ (mesh.points - start) @ direction == pytest.approx(mean, rel=1e-6)


def test_surfaces_inside_the_body_do_not_stop_a_beam() -> None:
    outer, inner = box((20.0, 20.0, 20.0)), box((4.0, 4.0, 4.0))
    shells = surface_from_arrays(np.vstack([outer.points, inner.points]), np.vstack([outer.faces, inner.faces + 8]))
    beam = PencilBeam((0.3, 0.4, 30.0), (0.0, 0.0, -1.0), deposit="line")
    assert beam.deposit_in(Body(shells, (FORWARD,))).terms.segments.lengths[0] == pytest.approx(20.0)
    overlapping = box((20.0, 20.0, 20.0), center=(0.0, 0.0, 15.0))
    both = surface_from_arrays(
        np.vstack([outer.points, overlapping.points]), np.vstack([outer.faces, overlapping.faces + 8])
    )
    assert beam.deposit_in(Body(both, (FORWARD,))).terms.segments.lengths[0] == pytest.approx(35.0)


def test_a_beam_that_touches_an_edge_from_outside_is_outside() -> None:
    for side in (1.0, -1.0):
        beam = PencilBeam((0.0, 0.0, 2.0), (side, 0.0, -1.0))
        with pytest.raises(InputError, match="misses"):
            beam.deposit_in(Body(box((1.99, 2.0, 2.0)), (TISSUE,)))
        # On the edge itself it may or may not enter; that it starts inside would be wrong.
        cube = box((2.0, 2.0, 2.0))
        assert not cube.contains(np.array([beam.origin]))[0]
        distances, _ = cube.crossings(np.array(beam.origin), np.array([side, 0.0, -1.0]) / math.sqrt(2))
        assert distances == pytest.approx(math.sqrt(2))


def test_light_that_is_all_reflected_is_said() -> None:
    glancing = PencilBeam((-20.0, 0.0, 15.0), (2.0, 0.0, -1.0))
    hollow = Medium(sigma_a=0.01, sigma_s_prime=1.0, eta=0.7)
    solution = solve(box((10.0, 10.0, 10.0)), hollow, [glancing], tolerance=0.2)
    assert solution.power.specular == 1.0
    assert solution.power.exited == 0.0
    assert "no light leaves the body" in solution.warnings[-1]


def test_beams_enter_the_smooth_surface_that_triangles_stand_for() -> None:
    """On 320 triangles, as on the sphere itself: the flat ones lie 0.16 inside it, tilted by up to 10 degrees."""
    ball = sphere(10.0, subdivisions=2)
    for x, y in ((0.3, 0.2), (2.0, 3.0), (5.0, -4.0)):
        (found,) = (
            PencilBeam((x, y, 20.0), (0.0, 0.0, -1.0))
            .deposit_in(Body(ball, (Medium(sigma_a=0.01, sigma_s_prime=1.0, eta=1.4),)))
            .terms.points
        )
        entry = np.array([x, y, math.sqrt(100.0 - x**2 - y**2)])
        cosine, normal = entry[2] / 10.0, entry / 10.0
        inside = math.sqrt(1.0 - (1.0 - cosine**2) / 1.4**2)
        refracted = np.array([0.0, 0.0, -1.0]) / 1.4 + (cosine / 1.4 - inside) * normal
        assert found == pytest.approx(entry + refracted / 1.01, abs=0.02)


@pytest.mark.parametrize("far", [(0.0, 1.7e308, 2.0), (0.0, 0.0, 1.7e308), (1e200, 1e200, 1e200)])
def test_a_place_beyond_the_range_of_products_is_refused(far: tuple[float, float, float]) -> None:
    with pytest.raises(InputError, match=r"origin is \[.*\]; coordinates reach from -1e\+30 to 1e\+30"):
        PencilBeam(far, (0.0, 0.0, -1.0))
    with pytest.raises(InputError, match="position is"):
        PointSource(far)
    # A direction may have any length.
    assert PencilBeam((0.0, 0.0, 20.0), (0.0, 0.0, -1.7e308)).power == 1.0
