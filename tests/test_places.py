"""Where light is left the medium of that place counts, whichever part of a body is written down as "the body"."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from tests.conftest import block
from tests.layers_made import CLEAR, DENSE, DOWN, layer
from tetlux.fem import (
    Body,
    CollimatedBeam,
    Deposit,
    DiffuseLight,
    Disc,
    Emission,
    EnvironmentLight,
    Ledger,
    Light,
    Medium,
    MeshHints,
    PencilBeam,
    PointSource,
    Region,
    Solution,
    SourceTerms,
    VaryingMedium,
    solve,
)
from tetlux.fem.body.partition import MeshPartition, SurfacePartition
from tetlux.fem.exact import layered
from tetlux.fem.media.coefficients import AnyMedium
from tetlux.fem.media.fresnel import reflectance
from tetlux.meshing import InputError, Surface, TetMesh, box, sphere, tetrahedralize
from tetlux.meshing.arrays import FloatArray

# One mesh for all ways of writing it, so that they agree to rounding.
MESH = block((8, 8, 8), (16.0, 16.0, 8.0))
UPPER = (MESH.points[MESH.tetrahedra].mean(axis=1)[:, 2] > -3.0).astype(np.int64)
ABOVE, BELOW = layer(0.0, 3.0), layer(3.0, 8.0)
PLACES = np.array([[2.0, 0.0, 0.0], [0.0, -5.0, 0.0], [8.0, 0.0, -2.0], [0.0, 3.0, -8.0]])

# Where a light goes by the number of a region, that of the upper layer is put in.
LIGHTS: dict[str, Callable[[int], Light]] = {
    "pencil": lambda _: PencilBeam((0.3, 0.2, 20.0), DOWN),
    "slanting pencil": lambda _: PencilBeam((-20.0, 0.2, 20.0), (1.0, 0.0, -1.0)),
    "from the side": lambda _: PencilBeam((20.0, 0.2, -3.1), (-1.0, 0.0, 0.01)),
    "pencil with radius": lambda _: PencilBeam((0.3, 0.2, 20.0), DOWN, radius=1.0),
    "line": lambda _: PencilBeam((0.3, 0.2, 20.0), DOWN, deposit="line"),
    "collimated": lambda _: CollimatedBeam((0.2, 0.1, -1.0)),
    "spot": lambda _: CollimatedBeam(DOWN, spot=Disc((0.0, 0.0, 20.0), 2.5)),
    "diffuse": lambda _: DiffuseLight(1.0),
    "environment": lambda _: EnvironmentLight(np.array([[1.0, 0.5], [0.2, 0.4]])),
    "emission": lambda upper: Emission(1.0, region=upper),
    "point above": lambda _: PointSource((0.3, 0.2, -1.2)),
    "point below": lambda _: PointSource((0.3, 0.2, -4.2)),
}
# Points and thin beams are subtracted where a medium is the same throughout a region, and not where it varies.
SPREAD = ("line", "collimated", "spot", "diffuse", "environment")


def upper_is_region(upper: Medium, lower: Medium, light: Light) -> Solution:
    return solve(replace(MESH, regions=UPPER), lower, [light], regions=[Region(ABOVE, upper)])


def lower_is_region(upper: Medium, lower: Medium, light: Light) -> Solution:
    return solve(replace(MESH, regions=1 - UPPER), upper, [light], regions=[Region(BELOW, lower)])


def step(upper: float, lower: float) -> Callable[[FloatArray], FloatArray]:
    return lambda points: np.where(points[:, 2] > -3.0, upper, lower)


def field(base: Medium, upper: Medium, lower: Medium) -> VaryingMedium:
    return VaryingMedium(
        base=base,
        sigma_a=step(upper.sigma_a, lower.sigma_a),
        sigma_s_prime=step(upper.reduced_scattering, lower.reduced_scattering),
    )


def assert_same(one: Solution, other: Solution) -> None:
    assert one.power.exited == pytest.approx(other.power.exited, rel=1e-6)
    assert one.power.absorbed == pytest.approx(other.power.absorbed, rel=1e-6)
    assert one.exitance_at(PLACES) == pytest.approx(other.exitance_at(PLACES), rel=1e-5)
    assert one.valid_at(PLACES) == pytest.approx(other.valid_at(PLACES), rel=1e-6)


@pytest.mark.parametrize("name", LIGHTS)
def test_either_layer_may_be_the_region(name: str) -> None:
    for upper, lower in ((DENSE, CLEAR), (CLEAR, DENSE)):
        one, other = upper_is_region(upper, lower, LIGHTS[name](1)), lower_is_region(upper, lower, LIGHTS[name](0))
        assert_same(one, other)
        assert one.warnings == other.warnings


@pytest.mark.parametrize("name", [name for name in LIGHTS if name != "emission"])
def test_the_base_of_a_medium_that_varies_does_not_matter(name: str) -> None:
    light = LIGHTS[name](1)
    one, other = (solve(MESH, field(base, DENSE, CLEAR), [light]) for base in (DENSE, CLEAR))
    assert_same(one, other)
    if name in SPREAD:
        assert_same(one, upper_is_region(DENSE, CLEAR, light))


class Wire:
    """A light of a user's own, along the x axis of the plate's middle."""

    def deposit_in(self, body: Body) -> Deposit:
        points = np.column_stack([np.linspace(-4.0, 4.0, 9), np.zeros(9), np.full(9, -2.0)])
        finest = float(body.mean_free_paths(points).min())
        terms = SourceTerms(points=points, powers=np.full(9, 1.0 / 9.0))
        return Deposit(Ledger(incident=1.0), terms, MeshHints(resolution=finest))


def test_a_light_of_ones_own_is_told_the_medium_of_each_place() -> None:
    one, other = upper_is_region(DENSE, CLEAR, Wire()), lower_is_region(DENSE, CLEAR, Wire())
    assert_same(one, other)
    assert one.power.incident == 1.0
    assert abs(one.power.balance_error) < 1e-12
    deposit = Wire().deposit_in(Body(layer(0.0, 8.0), (CLEAR, DENSE), SurfacePartition([ABOVE])))
    assert deposit.hints.resolution == pytest.approx(DENSE.mean_free_path)


Depth = Callable[[FloatArray, FloatArray], FloatArray]


def deposited(media: tuple[AnyMedium, ...], light: Light, *surfaces: Surface) -> tuple[FloatArray, FloatArray]:
    deposit = light.deposit_in(Body(layer(0.0, 8.0), media, SurfacePartition(surfaces)))
    return deposit.terms.points, deposit.terms.powers


@pytest.mark.parametrize("thickness", [1e-3, 0.1, 0.4, 0.6, 3.0])
def test_a_pencil_is_deposited_at_an_optical_depth_of_one(thickness: float) -> None:
    """Whatever layers it takes to get there, of which the thinnest change nothing."""
    light = PencilBeam((0.0, 0.0, 5.0), DOWN)
    layers = layer(0.0, thickness), layer(thickness, 8.0)
    in_upper = min(thickness * DENSE.sigma_t_prime, 1.0)
    depth = min(thickness, DENSE.mean_free_path) + (1.0 - in_upper) * CLEAR.mean_free_path
    # Of what is lost on the whole way, which is more than that to the deposit.
    whole = -np.expm1(-thickness * DENSE.sigma_t_prime)
    rest = np.exp(-thickness * DENSE.sigma_t_prime) * -np.expm1(-(8.0 - thickness) * CLEAR.sigma_t_prime)
    share = (whole * DENSE.albedo + rest * CLEAR.albedo) / (whole + rest)
    entering = 1.0 - float(reflectance(np.ones(1), 1.0 / 1.4)[0])
    for points, powers in (
        deposited((CLEAR, DENSE), light, layers[0]),
        deposited((DENSE, CLEAR), light, layers[1]),
    ):
        assert points[0] == pytest.approx([0.0, 0.0, -depth], abs=1e-9)
        assert powers[0] == pytest.approx(entering * share, rel=1e-9)
    varying = VaryingMedium(
        base=CLEAR,
        sigma_a=lambda p: np.where(p[:, 2] > -thickness, DENSE.sigma_a, CLEAR.sigma_a),
        sigma_s_prime=lambda p: np.where(p[:, 2] > -thickness, DENSE.reduced_scattering, CLEAR.reduced_scattering),
    )
    points, powers = deposited((varying,), light)
    assert points[0, 2] == pytest.approx(-depth, abs=2e-3 * CLEAR.mean_free_path)
    assert powers[0] == pytest.approx(entering * share, rel=1e-3)


@pytest.mark.parametrize("sideways", [0.0, 0.3])
def test_a_pencil_along_a_border_is_in_the_same_layer_however_it_is_written(sideways: float) -> None:
    light = PencilBeam((20.0, 0.2, -3.0), (-1.0, sideways, 0.0))
    one, _ = deposited((CLEAR, DENSE), light, layer(0.0, 3.0))
    other, _ = deposited((DENSE, CLEAR), light, layer(3.0, 8.0))
    assert one == pytest.approx(other, abs=1e-9)
    assert 8.0 - one[0, 0] == pytest.approx(DENSE.mean_free_path, rel=0.05)


def test_half_the_optical_depth_of_a_thin_body() -> None:
    """0.2 of a dense and 0.4 of a clear medium are an optical depth of 0.41 + 0.1608."""
    body = box((16.0, 16.0, 0.6), center=(0.0, 0.0, -0.3))
    partition = SurfacePartition([layer(0.0, 0.2)])
    deposit = PencilBeam((0.0, 0.0, 5.0), DOWN).deposit_in(Body(body, (CLEAR, DENSE), partition))
    assert deposit.terms.points[0, 2] == pytest.approx(-0.5 * (0.2 * 2.05 + 0.4 * 0.402) / 2.05, abs=1e-9)
    assert "less than two mean free paths" in deposit.warnings[0]


def test_optical_depth_in_coefficients_that_vary() -> None:
    """Against closed forms: sigma_s' linear and exponential along the path, on many slanting paths at once."""
    surface = box((40.0, 40.0, 20.0), center=(0.0, 0.0, -10.0))
    base = Medium(sigma_a=0.0, sigma_s_prime=1.0, eta=1.4)
    cosines = np.linspace(0.3, 1.0, 8)
    directions = np.column_stack([np.sqrt(1.0 - cosines**2), 0.0 * cosines, -cosines])
    starts, lengths = np.zeros((8, 3)), np.full(8, 10.0)
    linear: Depth = lambda x, c: 0.2 * x + 0.15 * c * x**2  # noqa: E731
    exponential: Depth = lambda x, c: 6.0 / c * -np.expm1(-0.5 * c * x)  # noqa: E731
    for sigma, depth in (
        (lambda p: 0.2 - 0.3 * p[:, 2], linear),
        (lambda p: 3.0 * np.exp(0.5 * p[:, 2]), exponential),
    ):
        body = Body(surface, (VaryingMedium(base=base, sigma_s_prime=sigma),))
        paths = body.paths(starts, directions, lengths)
        assert paths.total_depths == pytest.approx(depth(lengths, cosines), rel=1e-3)
        for wanted in (0.1, 1.0, 2.0):
            assert depth(paths.distances_at(np.full(8, wanted)), cosines) == pytest.approx(np.full(8, wanted), rel=1e-3)
        assert paths.error <= 2e-3
        assert paths.albedo == pytest.approx(np.ones(8))


def test_a_mesh_knows_its_regions_as_their_surfaces_do() -> None:
    body, core = sphere(10.0, subdivisions=3), sphere(5.0, subdivisions=3)
    mesh = tetrahedralize(body, [core])
    rng = np.random.default_rng(3)
    starts = rng.normal(size=(40, 3))
    starts *= 9.0 / np.linalg.norm(starts, axis=1, keepdims=True)
    directions = 9.0 * rng.normal(size=(40, 3)) - starts
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    # Facets of the mesh lie up to 0.2 beside the core's surface, and what grazes it may meet the core or not.
    smaller, larger = (SurfacePartition([sphere(radius, subdivisions=3)]) for radius in (4.7, 5.1))
    least, found, most = (
        Body(body, (CLEAR, DENSE), partition).paths(starts, directions, np.full(40, 9.0)).total_depths
        for partition in (smaller, MeshPartition(mesh), larger)
    )
    assert (least <= found + 1e-9).all()
    assert (found <= most + 1e-9).all()
    assert np.ptp(found) > 5.0


@pytest.mark.parametrize("upper_first", [True, False])
def test_two_layers_are_those_of_the_closed_form(upper_first: bool) -> None:
    upper = Medium(sigma_a=0.05, sigma_s_prime=2.0, eta=1.4)
    lower = Medium(sigma_a=0.2, sigma_s_prime=0.8, eta=1.4)
    body, outside, inner = layer(0.0, 8.0), upper, Region(BELOW, lower)
    if upper_first:
        outside, inner = lower, Region(ABOVE, upper)
    solution = solve(body, outside, [PencilBeam((0.0, 0.0, 5.0), DOWN)], regions=[inner])
    share = (1.0 - (0.4 / 2.4) ** 2) * upper.albedo
    depth, layers = upper.mean_free_path, ([upper, lower], [3.0, 5.0])
    total = sum(layered.point_total(*layers, depth=depth, face=face) for face in ("front", "back"))
    # 0.2 % leaves through the sides.
    assert solution.power.exited == pytest.approx(share * total, rel=0.01)
    expected = share * layered.point_exitance(*layers, depth=depth, rho=[1.0, 2.0])
    assert solution.exitance_at(np.array([[1.0, 0.0, 0.0], [0.0, 2.0, 0.0]])) == pytest.approx(expected, rel=0.05)


def test_a_medium_is_no_region() -> None:
    with pytest.raises(
        InputError, match=r"a Medium is given where a region is wanted; write Region\(surface, medium\)"
    ):
        solve(MESH, CLEAR, [DiffuseLight(1.0)], regions=[DENSE])  # type: ignore[list-item]


def test_places_are_written_as_plain_numbers() -> None:
    missing = PencilBeam(tuple(np.array([50.0, 0.0, 20.0])), DOWN)
    with pytest.raises(InputError, match=r"the beam from \(50, 0, 20\) along \(0, 0, -1\) misses the body"):
        solve(MESH, CLEAR, [missing])
    with pytest.raises(InputError, match=r"position is \[nan, 0\.0, 1\.0\]; give three"):
        PointSource(tuple(np.array([np.nan, 0.0, 1.0])))
    with pytest.raises(InputError, match=r"position is 'here'; give three"):
        PointSource("here")  # type: ignore[arg-type]


def test_a_body_is_of_the_wrong_unit_only_if_all_its_media_say_so() -> None:
    thick = Medium(sigma_a=1.0, sigma_s_prime=5e3, eta=1.4)
    for outside, inside in ((thick, CLEAR), (CLEAR, thick)):
        solve(replace(MESH, regions=UPPER), outside, [DiffuseLight(1.0)], regions=[Region(ABOVE, inside)])
    with pytest.raises(InputError, match="absurdly large for diffusion"):
        solve(replace(MESH, regions=UPPER), thick, [DiffuseLight(1.0)], regions=[Region(ABOVE, thick)])


def thin_skin(thickness: float) -> TetMesh:
    """The mesh with its upper nodes pressed into a skin of this thickness, which is region 1."""
    points = MESH.points.copy()
    upper = points[:, 2] > -3.5
    points[upper, 2] *= thickness / 3.0
    return replace(MESH, points=points, regions=UPPER)


def test_a_skin_counts_by_its_optical_depth() -> None:
    """Where it is thick its own validity counts, where it is thin that of what is below it."""
    dark = Medium(sigma_a=1.0, sigma_s_prime=1.0, eta=1.4)

    def albedo(thickness: float) -> float:
        region = Region(layer(0.0, thickness), dark)
        solution = solve(thin_skin(thickness), CLEAR, [DiffuseLight(1.0)], regions=[region])
        assert solution.validity is not None
        # In the middle of the plate; towards its edges it is thinner.
        facet = np.argmax(np.where(solution.mesh.surface.normals[:, 2] > 0.5, solution.validity.thickness, 0.0))
        assert solution.validity.thickness[facet] == pytest.approx(2.0 * thickness + 0.402 * (8.0 - thickness))
        return float(solution.validity.below.albedo[facet])

    assert albedo(0.001) == pytest.approx(CLEAR.albedo, abs=0.002)
    assert albedo(3.0) == pytest.approx(dark.albedo, abs=0.003)
    whole = -np.expm1(-0.6)
    rest = np.exp(-0.6) * -np.expm1(-0.402 * 7.7)
    assert albedo(0.3) == pytest.approx((whole * 0.5 + rest * CLEAR.albedo) / (whole + rest), rel=1e-6)
