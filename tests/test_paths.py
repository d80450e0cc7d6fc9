"""Beams through bodies: faded, reflected inside, let out and met again, each against what is computed by hand."""

import math

import numpy as np
import pytest

from tests.conftest import block
from tests.lights_made import deposit_on_mesh
from tetlux.fem import CollimatedBeam, Light, Medium, PencilBeam, Rectangle, System
from tetlux.fem.ballistic import follow as paths
from tetlux.fem.ballistic.follow import follow
from tetlux.fem.ballistic.rays import Rays
from tetlux.fem.media.coefficients import Coefficients, coefficients_of
from tetlux.fem.media.fresnel import reflectance
from tetlux.fem.operators.loads import load_vector
from tetlux.fem.outcome.power import Power
from tetlux.meshing import TetMesh
from tetlux.meshing.arrays import BoolArray, FloatArray, Vector


def carved(mesh: TetMesh, keep: BoolArray) -> TetMesh:
    """The part of a mesh that some tetrahedra (m,) make up."""
    nodes, tetrahedra = np.unique(mesh.tetrahedra[keep], return_inverse=True)
    return TetMesh(mesh.points[nodes], tetrahedra.reshape(-1, 4))


def trough() -> TetMesh:
    """Two walls 4 thick, 4 apart, on a common floor: x from -6 to 6, z from -4 to 0, the floor's top at -3."""
    whole = block((12, 4, 4), (12.0, 4.0, 4.0))
    middles = whole.points[whole.tetrahedra].mean(axis=1)
    return carved(whole, (np.abs(middles[:, 0]) > 2.0) | (middles[:, 2] < -3.0))


TROUGH, CUBE = trough(), block((4, 4, 4), (4.0, 4.0, 4.0))


def medium(eta: float, *, sigma_a: float = 0.05, sigma_s: float = 0.3, g: float = 0.5) -> Medium:
    return Medium(sigma_a=sigma_a, sigma_s=sigma_s, g=g, eta=eta)


def extinction(of: Medium) -> float:
    return of.sigma_a + of.delta_eddington[0]


def lit(mesh: TetMesh, of: Medium, light: Light) -> Power:
    """The ledger of a light of power 1, which is to close."""
    power = System(mesh, of).solve([light]).power
    assert abs(power.balance_error) < 1e-9
    return power


def thin_beam(origin: Vector, direction: Vector, kind: str) -> Light:
    """Power 1 in a beam that is thin, or without width."""
    if kind == "pencil":
        return PencilBeam(origin, direction, deposit="line")
    if kind == "round pencil":
        return PencilBeam(origin, direction, deposit="line", radius=0.05)
    spot = Rectangle(origin, 0.1, 0.1, up=(0.1, 0.9, 0.3))
    return CollimatedBeam(direction, 100.0, spot)


def plate_by_hand(of: Medium, length: float, cosine_outside: float = 1.0) -> tuple[float, float, float]:
    """Of a beam through a plate: reflected outside, let through, and let out backwards, all reflections counted.

    Both faces reflect F: through are (1-F)² e + (1-F)² F² e³ + ..., and back (1-F)² F e² (1 + F² e² + ...).
    """
    lost = float(reflectance(cosine_outside, 1.0 / of.eta))
    fade = math.exp(-extinction(of) * length)
    series = (1.0 - lost) ** 2 * fade / (1.0 - (lost * fade) ** 2)
    return lost, series, series * lost * fade


@pytest.mark.parametrize("kind", ["pencil", "round pencil", "spot"])
@pytest.mark.parametrize("degrees", [0.0, 30.0, 60.0])
@pytest.mark.parametrize("eta", [1.0, 1.4])
def test_what_passes_a_plate(eta: float, degrees: float, kind: str) -> None:
    """Thickness 1: exp(-sigma_t* l)(1-F)² at once, and 3 % of that more after one and two reflections inside."""
    plate = block((8, 8, 2), (16.0, 16.0, 1.0))
    of, angle = medium(eta), math.radians(degrees)
    direction = (math.sin(angle), 0.0, -math.cos(angle))
    origin = (0.3 - 5.0 * direction[0], 0.2, -5.0 * direction[2])
    inside = math.sqrt(1.0 - (math.sin(angle) / eta) ** 2)
    lost, through, back = plate_by_hand(of, 1.0 / inside, math.cos(angle))
    power = lit(plate, of, thin_beam(origin, direction, kind))
    # The power of a spot itself is right to .2 %.
    assert power.incident == pytest.approx(1.0, rel=5e-3)
    assert power.specular / power.incident == pytest.approx(lost, rel=1e-4, abs=1e-12)
    # Up to 1e-6 is not followed any further.
    assert power.ballistic / power.incident == pytest.approx(through + back, rel=1e-6)
    first = math.exp(-extinction(of) / inside) * (1.0 - lost) ** 2
    assert first <= through + back <= (1.0 + 1.2 * lost) * first


def test_a_wide_beam_passes_a_plate_as_a_thin_one_does() -> None:
    """But for what enters or leaves through the plate's sides: at normal incidence nothing does."""
    of = medium(1.4)
    lost, through, back = plate_by_hand(of, 1.0)
    power = lit(block((6, 6, 2), (16.0, 16.0, 1.0)), of, CollimatedBeam((0.0, 0.0, -1.0)))
    assert power.incident == pytest.approx(256.0)
    assert power.specular == pytest.approx(256.0 * lost)
    assert power.ballistic == pytest.approx(256.0 * (through + back), rel=1e-6)


@pytest.mark.parametrize("thickness", [1e-2, 1e-4, 1e-6])
def test_what_stays_in_a_thin_plate(thickness: float) -> None:
    """By its thickness in mean free paths: what is not followed is a millionth of that, not of the beam."""
    of = medium(1.4, sigma_a=0.4 * thickness, sigma_s=0.6 * thickness, g=0.0)
    lost, through, back = plate_by_hand(of, 1.0)
    beam = PencilBeam((0.3, 0.2, 5.0), (0.0, 0.0, -1.0), deposit="line")
    plate = block((6, 6, 2), (16.0, 16.0, 1.0))
    found = deposit_on_mesh(beam, plate, of)
    scattered = load_vector(plate, coefficients_of(of), found.terms).sum()
    stays = 1.0 - lost - through - back
    assert found.ledger.absorbed == pytest.approx(0.4 * stays, rel=1e-5)
    assert scattered == pytest.approx(0.6 * stays, rel=1e-5)


@pytest.mark.parametrize("kind", ["pencil", "round pencil", "spot"])
@pytest.mark.parametrize("eta", [1.0, 1.4])
def test_a_beam_through_two_walls(eta: float, kind: str) -> None:
    """Each wall lets through t and back b of what falls on it, having reflected F; what it reflects outside is lost.

    In the gap the first wall's t goes to and fro, the share b each time: t/(1-b) falls on walls in all. What has become
    a millionth of the beam is not followed, which at index 1.4 makes 2e-6 of what leaves.
    """
    of = medium(eta)
    lost, through, back = plate_by_hand(of, 4.0)
    power = lit(TROUGH, of, thin_beam((-10.0, 0.3, -1.4), (1.0, 0.0, 0.0), kind))
    in_gap = through / (1.0 - back)
    assert power.specular / power.incident == pytest.approx(lost * (1.0 + in_gap), rel=1e-6, abs=1e-12)
    assert power.ballistic / power.incident == pytest.approx(back + in_gap * through, rel=1e-5)
    if eta == 1.0:
        assert power.ballistic / power.incident == pytest.approx(math.exp(-8.0 * extinction(of)), rel=1e-9)


@pytest.mark.parametrize("kind", ["pencil", "spot"])
def test_what_is_left_in_each_wall(kind: str) -> None:
    """At matched indices, without diffusion: power scattered or absorbed in a wall is what it takes off the beam."""
    of = medium(1.0)
    light = thin_beam((-10.0, 0.3, -1.4), (1.0, 0.0, 0.0), kind)
    deposit = deposit_on_mesh(light, TROUGH, of)
    segments = deposit.terms.segments
    beyond = segments.starts[:, 0] > 0
    fade = math.exp(-4.0 * extinction(of))
    entered = [float(segments.fluxes[some].sum()) / deposit.ledger.incident for some in (~beyond, beyond)]
    assert entered == pytest.approx([1.0, fade], rel=1e-9)
    assert segments.lengths == pytest.approx(np.full(len(segments.lengths), 4.0))
    assert segments.starts[beyond][:, 0] == pytest.approx(np.full(beyond.sum(), 2.0))
    assert deposit.ledger.ballistic / deposit.ledger.incident == pytest.approx(fade**2, rel=1e-9)


@pytest.mark.parametrize("kind", ["pencil", "spot"])
def test_a_wedge_refracts(kind: str) -> None:
    """Down through the flat top and out through the slanting face below: sin(out) = eta sin(wedge's angle)."""
    whole = block((8, 8, 8), (8.0, 8.0, 8.0))
    slope = math.tan(math.radians(20.0))
    # Nodes moved up to a slanting lower face, z = -3 - slope (x + 4).
    points = whole.points.copy()
    points[:, 2] *= (3.0 + slope * (points[:, 0] + 4.0)) / 8.0
    wedge, of = TetMesh(points, whole.tetrahedra), medium(1.4)
    light = thin_beam((0.5, 0.3, 5.0), (0.0, 0.0, -1.0), kind)
    deposit = deposit_on_mesh(light, wedge, of)
    segments = deposit.terms.segments
    length = 3.0 + slope * 4.5
    first = np.argmax(segments.fluxes)
    assert segments.directions[first] == pytest.approx([0.0, 0.0, -1.0], abs=1e-12)
    assert segments.lengths[first] == pytest.approx(length, abs=0.04)
    # What comes out, caught by a screen: another body below, of the same medium.
    screen = block((2, 2, 1), (60.0, 60.0, 1.0))
    both = TetMesh(
        np.vstack([points, screen.points - [0.0, 0.0, 20.0]]),
        np.vstack([whole.tetrahedra, screen.tetrahedra + len(points)]),
    )
    deposit = deposit_on_mesh(light, both, of)
    segments = deposit.terms.segments
    caught = np.flatnonzero(np.abs(segments.starts[:, 2] + 20.0) < 1e-9)
    bend = math.asin(1.4 * math.sin(math.radians(20.0))) - math.radians(20.0)
    # Away from the normal, which is towards the thick end, +x.
    expected = 0.5 + (20.0 - length) * math.tan(bend)
    direct = caught[np.abs(segments.starts[caught, 0] - expected) < 0.15]
    face = float(reflectance(math.cos(math.radians(20.0)), 1.4))
    onto = float(reflectance(math.cos(bend), 1.0 / 1.4))
    top = float(reflectance(1.0, 1.0 / 1.4))
    share = (1.0 - top) * math.exp(-extinction(of) * length) * (1.0 - face) * (1.0 - onto)
    assert float(segments.fluxes[direct].sum()) / deposit.ledger.incident == pytest.approx(share, rel=0.01)


def test_light_beyond_the_critical_angle_stays_inside_and_leaves_by_the_end() -> None:
    """A light guide: rays at one to three degrees to its faces are reflected whole, and lose a share F at each end."""
    guide = block((20, 4, 2), (40.0, 4.0, 1.0))
    of = medium(1.4, sigma_a=0.02, sigma_s=0.03, g=0.0)
    for cosine in (5e-2, 1e-2, 1e-3, 1e-4):
        along = math.sqrt(1.0 - cosine**2)
        rng = np.random.default_rng(1)
        starts = np.column_stack([np.full(300, -20.0), rng.uniform(-1.9, 1.9, 300), rng.uniform(-0.99, -0.01, 300)])
        directions = np.tile([along, 0.0, cosine], (300, 1))
        deposit = follow(guide, coefficients_of(of), Rays(starts, directions, np.full(300, 1.0 / 300)))
        segments = deposit.terms.segments
        lost, fade = float(reflectance(along, 1.4)), math.exp(-0.05 * 40.0 / along)
        # To and fro between the ends.
        assert deposit.ledger.ballistic == pytest.approx(fade * (1.0 - lost) / (1.0 - lost * fade), rel=1e-4)
        scattered = float(segments.fluxes @ -np.expm1(-0.05 * segments.lengths)) * 0.6 + float(
            deposit.terms.powers.sum()
        )
        assert deposit.ledger.absorbed + deposit.ledger.ballistic + scattered == pytest.approx(1.0, rel=1e-12)


@pytest.mark.parametrize("uniform", [True, False])
def test_a_beam_that_fades_stays_on_its_way(uniform: bool) -> None:
    """Through 30 mean free paths and through 21 of them, where less than 1e-10 of it is left, and through 2."""
    for thick in (7.5, 5.3, 0.5):
        of = Medium(sigma_a=0.4 * thick, sigma_s=0.6 * thick, g=0.0, eta=1.4)
        same = coefficients_of(of)
        cells = np.ones(len(CUBE.tetrahedra))
        each = Coefficients(
            of.sigma_a * cells, of.sigma_t_prime * cells, 0.6 * thick * cells, 0.0 * cells, 0.0 * cells, of
        )
        coefficients = same if uniform else each
        starts = np.array([[0.3, 0.2, 0.0], [-0.7, 0.1, 0.0]])
        deposit = follow(CUBE, coefficients, Rays(starts, np.array([[0.0, 0.0, -1.0]] * 2), np.array([1.0, 2.0])))
        load = load_vector(CUBE, coefficients, deposit.terms)
        assert deposit.ledger.absorbed + load.sum() + deposit.ledger.ballistic == pytest.approx(3.0, rel=1e-14)
        assert load.sum() == pytest.approx(0.6 * (3.0 - deposit.ledger.ballistic), rel=1e-12)
        # Up to 23 mean free paths light is followed to the far side.
        through = 3.0 * math.exp(-4.0 * thick) * (1.0 - float(reflectance(1.0, 1.4)))
        assert deposit.ledger.ballistic == pytest.approx(through if thick < 5.7 else 0.0, rel=1e-2)
        assert (deposit.terms.powers <= paths.NEGLIGIBLE_REFLECTION * 1.5).all()


# Along faces, through edges and corners, at grazing incidence, and where it just touches.
AWKWARD: list[tuple[Vector, Vector]] = [
    ((-2.0, 0.0, 5.0), (0.0, 0.0, -1.0)),
    ((-2.0, -2.0, 5.0), (0.0, 0.0, -1.0)),
    ((0.0, 0.0, 5.0), (0.0, 0.0, -1.0)),
    ((1.0, 1.0, 5.0), (-1.0, -1.0, -5.0)),
    ((-5.0, 0.0, 0.0), (1.0, 0.0, 0.0)),
    ((-5.0, 0.0, -1e-9), (1.0, 0.0, 0.0)),
    ((-3.0, 0.0, 1.0), (1.0, 0.0, -1.0)),
    ((-4.0, -4.0, 2.0), (1.0, 1.0, -1.0)),
    ((-5.0, -5.0, -2.0), (1.0, 1.0, 0.0)),
    ((-5.0, 0.0, 0.003), (1.0, 0.0, -0.001)),
    ((0.0, 0.0, 1e-3), (1.0, 0.0, -1e-3)),
]


@pytest.mark.parametrize("radius", [0.0, 0.3])
@pytest.mark.parametrize("eta", [0.8, 1.0, 1.4])
def test_awkward_beams_lose_nothing(eta: float, radius: float) -> None:
    system = System(CUBE, medium(eta), expected=len(AWKWARD))
    for origin, direction in AWKWARD:
        power = system.solve([PencilBeam(origin, direction, deposit="line", radius=radius)]).power
        assert abs(power.balance_error) < 1e-9
        assert min(power.specular, power.absorbed, power.exited, power.ballistic) >= 0.0
        assert 0.0 < power.incident <= 1.0 + 2e-3


@pytest.mark.parametrize("eta", [0.8, 1.0, 1.4])
@pytest.mark.parametrize("mesh", [CUBE, TROUGH], ids=["cube", "trough"])
def test_wide_beams_from_everywhere_lose_nothing(mesh: TetMesh, eta: float) -> None:
    """Along axes, diagonals of faces and of the cube, nearly along faces, and any other way."""
    directions = [*np.eye(3), *-np.eye(3), (1.0, 1.0, 0.0), (1.0, 1.0, 1.0), (1.0, 1e-4, 1e-6), (-1.0, 0.0, 3e-3)]
    directions += list(np.random.default_rng(3).normal(size=(6, 3)))
    system = System(mesh, medium(eta), expected=len(directions))
    for direction in directions:
        x, y, z = (float(value) for value in direction)
        power = system.solve([CollimatedBeam((x, y, z))]).power
        assert abs(power.balance_error) < 1e-9
        assert min(power.specular, power.absorbed, power.exited, power.ballistic) >= 0.0


def test_a_beam_that_is_reflected_whole_deposits_nothing() -> None:
    """From a denser medium: its path had no power, and made NaNs of what is subtracted for it."""
    beam = PencilBeam((-4.0, -1.0, 2.0), (1.0, 0.3, -0.7), deposit="line")
    power = lit(CUBE, medium(0.7), beam)
    assert (power.specular, power.absorbed, power.exited, power.ballistic) == (1.0, 0.0, 0.0, 0.0)


def test_the_path_on_a_finer_mesh_is_the_same() -> None:
    """What enters, passes and is absorbed before it is scattered does not depend on the mesh of a flat body."""
    of = medium(1.4)
    found: list[FloatArray] = []
    for counts in ((1, 1, 1), (2, 3, 5), (8, 8, 8)):
        mesh = block(counts, (4.0, 4.0, 4.0))
        light = thin_beam((-4.0, 0.3, 1.0), (1.0, 0.1, -0.9), "pencil")
        deposit = deposit_on_mesh(light, mesh, of)
        found.append(np.array([deposit.ledger.specular, deposit.ledger.absorbed, deposit.ledger.ballistic]))
    assert found[1] == pytest.approx(found[0], rel=1e-6)
    assert found[2] == pytest.approx(found[0], rel=1e-6)
