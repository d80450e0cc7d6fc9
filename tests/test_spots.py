"""Spots of collimated light: their power and their pattern, whatever the mesh that they fall on."""

import math

import numpy as np
import pytest

from tests.conftest import block
from tests.lights_made import deposit_on_mesh
from tetlux.fem import CollimatedBeam, Disc, Gaussian, Image, Medium, Rectangle
from tetlux.fem.lights.spots import Spot
from tetlux.meshing import InputError, TetMesh, box
from tetlux.meshing.arrays import FloatArray, Vector

MATCHED = Medium(sigma_a=0.01, sigma_s_prime=1.0, eta=1.0)
DOWN = (0.0, 0.0, -1.0)
# Upper faces of 10 x 10 at z = 0: of two triangles, of some whose edges lie askew to every spot, and of small ones.
MESHES = {"two facets": block((1, 1, 1), (10.0, 10.0, 5.0)), "seven": block((7, 7, 2), (10.0, 10.0, 5.0))}
MESHES["thirty"] = block((30, 30, 1), (10.0, 10.0, 5.0))
RNG = np.random.default_rng(0)
NOISE = RNG.random((64, 48))


def power(spot: Spot, mesh: TetMesh, *, direction: Vector = DOWN, from_center: bool = False) -> float:
    beam = CollimatedBeam(direction, 1.0, spot, from_center=from_center)
    return float(deposit_on_mesh(beam, mesh, MATCHED).ledger.incident)


SPOTS: dict[str, Spot] = {
    "disc": Disc((0.3, -0.7, 3.0), 2.0),
    "disc within a facet": Disc((0.2, -0.4, 3.0), 0.005),
    "gaussian": Gaussian((0.3, -0.7, 3.0), 1.2),
    "gaussian within a facet": Gaussian((0.2, -0.4, 3.0), 0.003),
    "rectangle along the edges": Rectangle((0.0, 0.0, 3.0), 4.0, 2.6),
    "rectangle turned": Rectangle((0.3, -0.7, 3.0), 4.0, 2.6, up=(0.3, 0.9, 0.0)),
    "narrow rectangle": Rectangle((0.3, -0.7, 3.0), 8.0, 0.05, up=(0.3, 0.9, 0.0)),
    "image of one pixel": Image((0.3, -0.7, 3.0), 3.0, np.ones((1, 1)), up=(0.3, 0.9, 0.0)),
    "bright quarter": Image((0.3, -0.7, 3.0), 3.0, np.array([[1.0, 0.0], [0.0, 0.0]])),
    "noise": Image((0.3, -0.7, 3.0), 3.0, NOISE, up=(0.3, 0.9, 0.0)),
    "bytes": Image((0.3, -0.7, 3.0), 3.0, (NOISE * 255).astype(np.uint8)),
    "1000 x 3 pixels": Image((0.3, -0.7, 3.0), 0.02, RNG.random((1000, 3)), up=(0.3, 0.9, 0.0)),
    "3 x 1000 pixels": Image((0.3, -0.7, 3.0), 6.0, RNG.random((3, 1000)), up=(0.3, 0.9, 0.0)),
}


@pytest.mark.parametrize("mesh", MESHES)
@pytest.mark.parametrize("name", SPOTS)
def test_the_power_of_a_spot_on_a_flat_face_is_irradiance_times_area(name: str, mesh: str) -> None:
    """Measured: up to 0.3 %, of fine images, and 0.1 % of the others; looked up once in each part, up to 100 %."""
    spot = SPOTS[name]
    assert power(spot, MESHES[mesh]) == pytest.approx(spot.area, rel=5e-3)


def test_areas_are_what_they_are() -> None:
    assert SPOTS["disc"].area == pytest.approx(4.0 * math.pi)
    # Of the whole Gaussian, exp(-8) is cut off.
    assert SPOTS["gaussian"].area == pytest.approx(0.5 * math.pi * 1.44, rel=1e-3)
    assert SPOTS["rectangle turned"].area == pytest.approx(10.4)
    assert SPOTS["bright quarter"].area == pytest.approx(2.25)
    assert SPOTS["bytes"].area == pytest.approx((NOISE * 255).astype(np.uint8).mean() * 12.0, rel=1e-9)


@pytest.mark.parametrize("name", ["disc", "rectangle turned", "noise"])
def test_a_slanting_spot_falls_on_more_of_the_face_with_the_same_power(name: str) -> None:
    spot = SPOTS[name]
    assert power(spot, MESHES["seven"], direction=(0.2, 0.3, -1.0)) == pytest.approx(spot.area, rel=5e-3)


def lit_middles(spot: Spot) -> tuple[FloatArray, FloatArray]:
    """Where rays of a spot meet the face, (r, 2), and their powers."""
    deposit = deposit_on_mesh(CollimatedBeam(DOWN, 1.0, spot), MESHES["seven"], MATCHED)
    segments = deposit.terms.segments
    assert segments.starts[:, 2] == pytest.approx(0.0)
    return segments.starts[:, :2], segments.fluxes


@pytest.mark.parametrize(
    ("direction", "up", "right"),
    [
        # Looking down along the beam with +y up, +x is to the right; from below it is to the left.
        (DOWN, (0.0, 1.0, 0.0), (1.0, 0.0, 0.0)),
        ((0.0, 0.0, 1.0), (0.0, 1.0, 0.0), (-1.0, 0.0, 0.0)),
        (DOWN, (1.0, 0.0, 0.0), (0.0, -1.0, 0.0)),
        (DOWN, (1.0, 1.0, 5.0), (math.sqrt(0.5), -math.sqrt(0.5), 0.0)),
    ],
)
def test_a_bright_quarter_lights_that_quarter_of_the_face(direction: Vector, up: Vector, right: Vector) -> None:
    """Brightness 1 at the upper left, 2 at the upper right, 3 and 4 below: as seen by one who looks along the beam."""
    pixels = np.array([[1.0, 2.0], [3.0, 4.0]])
    spot = Image((0.0, 0.0, -2.0), 4.0, pixels, up=up)
    deposit = deposit_on_mesh(CollimatedBeam(direction, 1.0, spot), MESHES["thirty"], MATCHED)
    segments = deposit.terms.segments
    raised = np.array(up) * [1.0, 1.0, 0.0]
    u, v = (
        segments.starts @ np.array(right),
        segments.starts @ raised / np.linalg.norm(raised),
    )
    found = np.histogram2d(-v, u, bins=(2, 2), range=[(-2, 2), (-2, 2)], weights=segments.fluxes)[0]
    # Parts across the middle lines lie in one quarter or the other, by their own middles.
    assert found == pytest.approx(4.0 * pixels, rel=0.06)
    assert segments.fluxes.sum() == pytest.approx(40.0, rel=5e-3)


def test_rays_lie_where_the_spot_is_bright_and_balance_about_its_middle() -> None:
    for name in ("disc", "rectangle turned", "gaussian", "disc within a facet", "image of one pixel"):
        spot = SPOTS[name]
        places, fluxes = lit_middles(spot)
        offsets = np.column_stack([places, np.zeros(len(places))]) - [*spot.center[:2], 0.0]
        assert np.hypot(*offsets.T[:2]).max() <= spot.reach
        assert fluxes @ offsets / fluxes.sum() == pytest.approx(np.zeros(3), abs=2e-3 * spot.reach)


@pytest.mark.parametrize("name", ["disc", "noise", "bright quarter"])
def test_a_facet_has_one_ray_from_the_middle_of_what_it_sees(name: str) -> None:
    """However many parts of it were looked at: a finer mesh has more rays."""
    mesh, spot = MESHES["seven"], SPOTS[name]
    rays, normals = CollimatedBeam(DOWN, spot=spot)._incident_rays(mesh)
    facets = mesh.closest_boundary(rays.starts)[1]
    assert len(np.unique(facets)) == len(facets) == len(normals)
    assert (mesh.boundary_cells[facets] == rays.cells).all()
    assert rays.starts[:, 2] == pytest.approx(0.0, abs=1e-12)
    # Their moments are those of the spot, by a million points of it.
    random = np.random.default_rng(1)
    offsets = random.uniform(-spot.reach, spot.reach, (1_000_000, 3)) * [1.0, 1.0, 0.0]
    bright = spot.brightness(offsets, np.array(DOWN))
    expected = bright @ offsets / bright.sum() + [*spot.center[:2], 0.0]
    assert rays.powers @ rays.starts / rays.powers.sum() == pytest.approx(expected, abs=5e-3 * spot.reach)


def test_what_of_a_spot_misses_the_body_is_not_incident() -> None:
    """Half of it past the edge of the face, and the light does not come in through the side."""
    for spot in (Disc((5.0, 1.0, 3.0), 2.0), Rectangle((5.0, 1.0, 3.0), 3.0, 2.0), Gaussian((5.0, 1.0, 3.0), 1.0)):
        assert power(spot, MESHES["seven"]) == pytest.approx(0.5 * spot.area, rel=5e-3)


def test_light_from_its_center_passes_by_what_is_behind_it() -> None:
    """Two boxes, one above the other: a lamp between them lights the lower one, and far light the upper one."""
    lower, height = MESHES["seven"], np.array([0.0, 0.0, 10.0])
    cells = np.vstack([lower.tetrahedra, lower.tetrahedra + len(lower.points)])
    both = TetMesh(np.vstack([lower.points, lower.points + height]), cells)
    spot = Disc((0.0, 0.0, 2.0), 1.0)
    # Without scattering to speak of between them, all rays are where the light enters and where it enters again.
    far, near = (
        deposit_on_mesh(CollimatedBeam(DOWN, 1.0, spot, from_center=near), both, MATCHED) for near in (False, True)
    )
    assert far.terms.segments.starts[:, 2].max() == pytest.approx(10.0)
    assert near.terms.segments.starts[:, 2].max() == pytest.approx(0.0)
    assert near.ledger.incident == pytest.approx(far.ledger.incident, rel=1e-9)


def test_a_few_bright_pixels_are_found() -> None:
    """One of 4,096, away from the middle: looking at 2,000 places of the whole image, no light was seen to arrive."""
    pixels = np.zeros((64, 64))
    pixels[9, 50] = 1.0
    spot = Image((0.0, 0.0, 3.0), 6.4, pixels)
    beam = CollimatedBeam(DOWN, 1.0, spot)
    places = beam.entries(box((10.0, 10.0, 5.0)))
    assert np.abs(places - [(50 - 31.5) * 0.1, (31.5 - 9) * 0.1, 2.5]).max() <= 0.05 + 1e-9
    # A pixel is cut into few parts: measured up to 3.5 %.
    assert power(spot, MESHES["seven"]) == pytest.approx(0.01, rel=0.05)


@pytest.mark.parametrize("spot", SPOTS.values(), ids=SPOTS)
def test_places_that_are_looked_at_are_bright_and_all_over_the_spot(spot: Spot) -> None:
    direction = np.array([0.0, 0.6, -0.8])
    offsets = spot.samples(2000, direction)
    bright = spot.brightness(offsets, direction) > 0
    assert bright.mean() > 0.99
    assert spot.distances(offsets, direction) == pytest.approx(np.zeros(len(offsets)), abs=1e-9 * spot.reach)
    beyond = 3.0 * spot.reach * np.cross(direction, [1.0, 0.0, 0.0])[None]
    assert not spot.brightness(beyond, direction).any()
    assert spot.distances(beyond, direction)[0] >= 2.0 * spot.reach - 1e-9


@pytest.mark.parametrize(
    ("pixels", "message"),
    [
        (np.zeros((2, 2)), "black all over; no light"),
        (np.array([[1.0, np.nan]]), "not a number or negative"),
        (np.array([[1.0, np.inf]]), "not a number or negative"),
        (np.array([[1.0, -0.1]]), "not a number or negative"),
        (np.ones((2, 2, 3)), r"has the shape \(2, 2, 3\); give rows and columns"),
        (np.ones((0, 2)), r"has the shape \(0, 2\)"),
    ],
)
def test_images_that_cannot_be(pixels: FloatArray, message: str) -> None:
    with pytest.raises(InputError, match=message):
        Image((0.0, 0.0, 0.0), 1.0, pixels)


def test_spots_that_cannot_be() -> None:
    with pytest.raises(InputError, match="radius of the spot is 0"):
        Disc((0.0, 0.0, 0.0), 0.0)
    with pytest.raises(InputError, match="radius of the spot is nan"):
        Gaussian((0.0, 0.0, 0.0), math.nan)
    with pytest.raises(InputError, match="height of the spot is inf"):
        Rectangle((0.0, 0.0, 0.0), 1.0, math.inf)
    with pytest.raises(InputError, match="center is"):
        Disc((0.0, math.nan, 0.0), 1.0)
    with pytest.raises(InputError, match=r"up of the spot is \(0, 0, 2\), along the beam"):
        power(Rectangle((0.0, 0.0, 3.0), 1.0, 1.0, up=(0.0, 0.0, 2.0)), MESHES["seven"])
