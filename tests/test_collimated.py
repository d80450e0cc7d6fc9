"""Parallel light over a whole body: against closed forms and Monte Carlo, and the shadows that the body casts."""

import math

import numpy as np
import pytest

from tests.benchmarks.scenes import lit_ball, turbid
from tests.conftest import block
from tests.lights_made import deposit_on_mesh
from tetlux.fem import CollimatedBeam, Disc, Medium, Solution, System, solve
from tetlux.fem.exact import slab_plane, sphere_light
from tetlux.fem.media.fresnel import reflectance
from tetlux.meshing import InputError, TetMesh, box, sphere, tetrahedralize, torus
from tetlux.meshing.arrays import BoolArray, FloatArray, Vector

DOWN = (0.0, 0.0, -1.0)
TURN = np.pi * (3.0 - np.sqrt(5.0))


def ring(middle: float, half: float = 5.0, count: int = 400) -> FloatArray:
    """Angles from a pole (count,), radians: evenly over the part of a sphere that is so many degrees from it."""
    low, high = (math.cos(math.radians(min(max(middle + side, 0.0), 180.0))) for side in (half, -half))
    return np.arccos(low + (high - low) * (np.arange(count) + 0.5) / count)


def on_sphere(radius: float, gamma: FloatArray) -> FloatArray:
    around = TURN * np.arange(len(gamma))
    out = [np.sin(gamma) * np.cos(around), np.sin(gamma) * np.sin(around), np.cos(gamma)]
    return radius * np.column_stack(out)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("radius", "given"),
    [(10.0, (0.66115, 0.12402, 0.00586)), (5.0, (0.54469, 0.19250, 0.02352)), (2.0, (0.34877, 0.21906, 0.08039))],
)
def test_a_ball_in_a_beam_against_its_series(radius: float, given: tuple[float, float, float]) -> None:
    """Exitance within five degrees of 0, 90 and 180 degrees: single nodes ripple by some per cent as tetrahedra do.

    Measured: .2 % at 0, .5 % at 90 degrees, and at 180 degrees, in the dark, .7 to 1.2 %, with radius 10 1.7 to 2.7 %.
    The estimate was 1.25 to 1.35 times the error.
    """
    scene = lit_ball("", turbid(0.99, 1.0), radius=radius)
    solution = solve(scene.surface, scene.medium, [scene.light], tolerance=0.02)
    error = scene.error(solution)
    assert error <= 0.02
    assert 0.5 < solution.error_estimate / error < 3.0
    for middle, expected, within in zip((0.0, 90.0, 180.0), given, (0.01, 0.015, 0.05), strict=True):
        gamma = ring(middle)
        series = sphere_light.beam_exitance(scene.medium, radius=radius, gamma=gamma).mean()
        # The figure at the very point: over five degrees the mean differs by 1 % at most.
        assert series == pytest.approx(expected, rel=0.012)
        allowed = within if radius == 10.0 else min(within, 0.02)
        assert solution.exitance_at(on_sphere(radius, gamma)).mean() == pytest.approx(series, rel=allowed)
    total = sphere_light.beam_total(scene.medium, radius=radius)
    # Both are shares of what falls on the mesh, which is a little smaller than the ball.
    assert solution.power.exited / solution.power.incident == pytest.approx(total / (math.pi * radius**2), rel=5e-3)
    assert abs(solution.power.balance_error) < 1e-9


# Radiative transfer by Monte Carlo: radius 5, sigma_a .01, sigma_s .99, g 0, n 1.3, unit irradiance, 6.4 million
# photons, from another program. Mean exitance over each ten degrees from the middle of the lit side, and its standard
# error.
TRANSFER = np.array([0.50260, 0.49061, 0.47349, 0.44799, 0.41291, 0.36743, 0.31323, 0.25075, 0.18590])
TRANSFER_DARK = np.array([0.13488, 0.10322, 0.08310, 0.06870, 0.05920, 0.05211, 0.04795, 0.04421, 0.04274])
STANDARD_ERRORS = np.array([15, 9, 7, 5, 5, 4, 4, 3, 3, 2, 2, 2, 2, 2, 2, 2, 3, 4]) * 1e-4


@pytest.mark.slow
def test_a_ball_of_another_index_against_monte_carlo() -> None:
    """Ten mean free paths across: diffusion itself is off by up to 1 % on the lit side and 2 to 5 % on the dark one.

    Measured: -.6 to +.2 % from 0 to 70 degrees, -1 % at 70 to 80, then +1.2 to 4.4 %, of which 1 % is Monte Carlo's
    own error near 180 degrees.
    """
    medium = Medium(sigma_a=0.01, sigma_s=0.99, g=0.0, eta=1.3)
    solution = solve(sphere(5.0), medium, [CollimatedBeam(DOWN)], tolerance=0.02)
    middles = np.arange(5.0, 180.0, 10.0)
    found = np.array([solution.exitance_at(on_sphere(5.0, ring(middle))).mean() for middle in middles])
    lit, dark = found[:9], found[9:]
    assert (np.abs(lit - TRANSFER) < 0.015 * TRANSFER + 2.0 * STANDARD_ERRORS[:9]).all()
    assert (np.abs(dark - TRANSFER_DARK) < 0.05 * TRANSFER_DARK + 2.0 * STANDARD_ERRORS[9:]).all()
    # Of what falls on the ball: the flat facets' share differs by some per mille.
    power, whole = solution.power, math.pi * 25.0
    assert power.specular / whole == pytest.approx(0.06111, rel=0.01)
    assert power.absorbed / whole == pytest.approx(0.10018, rel=0.03)
    assert power.exited / whole == pytest.approx(0.83841, rel=0.01)
    assert power.ballistic / whole == pytest.approx(0.000295, rel=0.15)


def middle_of_faces(solution: Solution, width: float) -> tuple[float, float]:
    """Mean exitance in the middle of the upper and of the lower face of a plate."""
    mesh = solution.mesh
    points, areas = mesh.boundary_points, mesh.boundary_node_areas
    bottom = float(points[:, 2].min())
    middle = np.abs(points[:, :2]).max(axis=1) < width / 8.0
    over, under = (middle & (np.abs(points[:, 2] - height) < 1e-9) for height in (0.0, bottom))

    def mean(some: BoolArray) -> float:
        return float(areas[some] @ solution.exitance[some] / areas[some].sum())

    return mean(over), mean(under)


@pytest.mark.parametrize(
    ("eta", "thickness", "reflected", "through"),
    [(1.0, 2.0, None, None), (1.0, 5.0, 0.682037, 0.216794), (1.3, 5.0, 0.603381, 0.244341)],
)
def test_a_plate_against_its_closed_form(
    eta: float, thickness: float, reflected: float | None, through: float | None
) -> None:
    """Two elements a mean free path: measured .05 %, .06 % and .02 %. The closed form leaves out what is reflected
    where the beam leaves, 1e-4 of the power at a thickness of 5 and an index of 1.3."""
    medium = turbid(0.99, eta)
    mesh = block((40, 40, int(2 * thickness)), (40.0, 40.0, thickness))
    solution = System(mesh, medium).solve([CollimatedBeam(DOWN)])
    exact = [form(medium, thickness=thickness) for form in (slab_plane.beam_reflectance, slab_plane.beam_transmittance)]
    if reflected is not None:
        assert exact == pytest.approx([reflected, through], rel=1e-5)
    passed = 1.0 - float(reflectance(np.ones(1), 1.0 / eta)[0])
    assert middle_of_faces(solution, 40.0) == pytest.approx(passed * np.array(exact), rel=2e-3)
    assert solution.power.incident == pytest.approx(1600.0, rel=1e-12)
    assert solution.power.specular == pytest.approx((1.0 - passed) * 1600.0, rel=1e-9)


def test_van_de_hulsts_slab() -> None:
    """Optical depth 2, albedo .9, g .75, n 1: R .09739 and T .66096 by radiative transfer.

    Delta-Eddington's R is .10597, 8.8 % above it; this is diffusion's error and not the mesh's, which adds .2 %. With
    sigma_s' exp(-sigma_t' z) instead it would be .140, 44 % above. T, ballistic light with it, is .5 % above.
    """
    medium = Medium(sigma_a=0.1, sigma_s=0.9, g=0.75, eta=1.0)
    solution = System(block((30, 30, 8), (30.0, 30.0, 2.0)), medium).solve([CollimatedBeam(DOWN)])
    reflected, through = middle_of_faces(solution, 30.0)
    assert reflected == pytest.approx(0.10597, rel=5e-3)
    assert reflected == pytest.approx(0.09739, rel=0.10)
    ballistic = solution.power.ballistic / solution.power.incident
    assert ballistic == pytest.approx(math.exp(-2.0 * (0.1 + 0.9 * (1.0 - 0.75**2))), rel=1e-9)
    assert through + ballistic == pytest.approx(0.66096, rel=0.03)


OPAQUE = Medium(sigma_a=1.0, sigma_s_prime=20.0, eta=1.0)


@pytest.mark.parametrize("direction", [DOWN, (1.0, 0.3, 0.2), (0.01, 1.0, 0.0)])
@pytest.mark.parametrize("name", ["ball", "cube"])
def test_all_of_a_convex_bodys_lit_side_is_lit_and_nothing_else(
    name: str, direction: Vector, ball_mesh: TetMesh
) -> None:
    mesh = ball_mesh if name == "ball" else block((5, 4, 3), (3.0, 3.0, 3.0))
    deposit = deposit_on_mesh(CollimatedBeam(direction), mesh, OPAQUE)
    segments = deposit.terms.segments
    facing = -mesh.surface.normals @ (np.array(direction) / np.linalg.norm(direction))
    lit = facing > 0
    # In one mesh of six a facet .07 degrees from edge-on, 1.2e-5 of the light, is behind a neighbour.
    assert deposit.ledger.incident == pytest.approx(float(mesh.boundary_areas[lit] @ facing[lit]), rel=5e-5)
    # A ray starts on every lit facet, but for those nearly edge-on, and on no other.
    _, starts, _ = mesh.closest_boundary(segments.starts)
    assert set(np.flatnonzero(facing > 1e-2)) <= set(starts.tolist()) <= set(np.flatnonzero(lit))


# A ring whose tube is four across; seen from the side it is a band of four by twelve with two half discs.
MAJOR, MINOR = 6.0, 2.0
SEEN = 4.0 * 12.0 + math.pi * 4.0


@pytest.fixture(scope="module")
def ring_mesh() -> TetMesh:
    return tetrahedralize(torus(MAJOR, MINOR), edge_length=1.0)


def test_what_faces_the_light_but_is_hidden_gets_none(ring_mesh: TetMesh) -> None:
    """From +x: the near half is lit, and the far half only by what passes the tube, here next to nothing."""
    deposit = deposit_on_mesh(CollimatedBeam((-1.0, 0.0, 0.0)), ring_mesh, OPAQUE)
    segments = deposit.terms.segments
    facing = ring_mesh.surface.normals[:, 0]
    without_shadows = float(ring_mesh.boundary_areas[facing > 0] @ facing[facing > 0])
    # Measured -.8 %: facets, and one ray each where they are half in the shadow.
    assert deposit.ledger.incident == pytest.approx(SEEN, rel=0.015)
    assert without_shadows > 1.5 * SEEN
    entering = segments.starts[segments.fluxes > 1e-6 * segments.fluxes.max()]
    # The inner side of the far half is hidden by the near one but for a hair at the very top, where facets are.
    hidden = (np.hypot(*entering.T[:2]) < MAJOR - 0.1) & (entering[:, 0] < -0.5) & (np.abs(entering[:, 2]) < 1.8)
    assert not hidden.any()


def passes(extinction: float) -> tuple[float, float]:
    """Power that enters the far half of the ring through the hole, and that leaves at last, for unit irradiance."""
    z = (np.arange(800) + 0.5) / 800 * 4.0 - 2.0
    half = np.sqrt(4.0 - z**2)[:, None]
    y = (np.arange(1600) + 0.5)[None] / 1600 * 8.0
    outer = np.sqrt(np.maximum((MAJOR + half) ** 2 - y**2, 0.0))
    inner = np.sqrt(np.maximum((MAJOR - half) ** 2 - y**2, 0.0))
    seen = y < MAJOR + half
    once = np.where(seen, np.exp(-extinction * (outer - inner)), 0.0)
    cell = 2.0 * (4.0 / 800) * (8.0 / 1600)
    return float(once[inner > 0].sum() * cell), float((once**2).sum() * cell)


def test_behind_a_gap_arrives_what_has_passed_before_it(ring_mesh: TetMesh) -> None:
    """At matched indices light goes straight on: through the tube, across the hole and through the tube again."""
    clear = Medium(sigma_a=0.05, sigma_s_prime=0.35, eta=1.0)
    deposit = deposit_on_mesh(CollimatedBeam((-1.0, 0.0, 0.0)), ring_mesh, clear)
    segments = deposit.terms.segments
    again = (np.hypot(*segments.starts.T[:2]) < MAJOR) & (segments.starts[:, 0] < 0)
    entering, leaving = passes(0.4)
    # Measured 2 % of both, by the facets; 1 % with edges of .6.
    assert float(segments.fluxes[again].sum()) == pytest.approx(entering, rel=0.04)
    assert deposit.ledger.ballistic == pytest.approx(leaving, rel=0.04)
    out = deposit.ledger.absorbed + deposit.ledger.ballistic + deposit.ledger.specular
    scattered = segments.fluxes @ -np.expm1(-0.4 * segments.lengths) * 0.35 / 0.4
    assert out + scattered == pytest.approx(deposit.ledger.incident, rel=1e-9)


def test_rays_that_graze_facets_go_on(ring_mesh: TetMesh) -> None:
    """One direction in fifteen has a ray along a facet; none of them may meet it again and again, and stay there."""
    clear = Medium(sigma_a=0.05, sigma_s_prime=0.35, eta=1.0)
    for direction in on_sphere(1.0, np.linspace(0.6, 1.4, 60)):
        deposit = deposit_on_mesh(CollimatedBeam(tuple(direction)), ring_mesh, clear)
        assert deposit.terms.powers.sum() == 0


def test_lights_that_cannot_be() -> None:
    with pytest.raises(InputError, match="direction is zero"):
        CollimatedBeam((0.0, 0.0, 0.0))
    with pytest.raises(InputError, match="irradiance is 0; give a number of W/unit² greater than 0"):
        CollimatedBeam(DOWN, 0.0)
    with pytest.raises(InputError, match="irradiance is nan"):
        CollimatedBeam(DOWN, math.nan)
    away = CollimatedBeam(DOWN, 1.0, Disc((30.0, 0.0, 0.0), 2.0))
    with pytest.raises(InputError, match=r"collimated light along \(0, 0, -1\) misses the body, which spans"):
        solve(box((10.0, 10.0, 10.0)), OPAQUE, [away])
    below = CollimatedBeam(DOWN, 1.0, Disc((0.0, 0.0, -20.0), 2.0), from_center=True)
    with pytest.raises(InputError, match="misses the body"):
        solve(box((10.0, 10.0, 10.0)), OPAQUE, [below])
