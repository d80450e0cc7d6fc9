"""Sensitivities of readings, against differences of readings, moments, and the series of a ball."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from tests.conftest import TISSUE
from tetlux.fem import (
    DiffuseLight,
    FibreDetector,
    Grid,
    Medium,
    PencilBeam,
    PointDetector,
    PointSource,
    Region,
    System,
    VaryingMedium,
    mesh_field,
    moments,
    sensitivity,
    solve,
)
from tetlux.fem.exact import sphere as exact
from tetlux.fem.known.split import Subtract
from tetlux.fem.lights import Light
from tetlux.fem.lights.places import MovedLight, at_place, place_of
from tetlux.fem.outcome.detectors import read_all
from tetlux.fem.sensitivity.nearby import Coefficient, change_medium
from tetlux.fem.sensitivity.parameters import Per, parameter_shares
from tetlux.fem.sensitivity.products import multiply
from tetlux.fem.sensitivity.sensitivity import check_readings
from tetlux.meshing import InputError, RunError, Surface, TetMesh, sphere, tetrahedralize
from tetlux.meshing.arrays import NumberArray

ANGLES = np.radians([30.0, 90.0, 150.0])
PLACES = 10.0 * np.column_stack([np.sin(ANGLES), 0.0 * ANGLES, np.cos(ANGLES)])
DETECTORS = [PointDetector((x, y, z)) for x, y, z in PLACES.tolist()]
FIBRE = FibreDetector((0.0, 10.0, 0.0), radius=0.5, numerical_aperture=0.3)
BEAM = PencilBeam((2.0, 0.0, 20.0), (0.0, 0.1, -1.0))
LIGHTS: list[Light] = [BEAM, PointSource((0.0, 2.0, 1.0))]
SOURCE = PointSource((0.0, 0.0, 10.0 - TISSUE.mean_free_path))


@pytest.fixture(scope="module")
def layered(ball: Surface) -> System:
    """A ball with a ball in it, on a coarse mesh."""
    inside = Region(sphere(5.0, center=(0.0, 1.0, 1.0)), Medium(sigma_a=0.04, sigma_s_prime=1.5, eta=1.4))
    mesh = tetrahedralize(ball, edge_length=2.2, regions=[inside.surface])
    return System(mesh, TISSUE, ball, regions=(inside,))


@pytest.fixture(scope="module")
def even(ball: Surface, ball_mesh: TetMesh) -> System:
    return System(ball_mesh, TISSUE, ball)


def read_at(system: System, lights: Sequence[Light], subtract: str = "fitted") -> NumberArray:
    solution = system.solve(lights, subtract=subtract)  # type: ignore[arg-type]
    parts = solution.of_lights or (solution,)
    return np.array([[reading.exitance for reading in read_all([*DETECTORS, FIBRE], part)] for part in parts])


@pytest.mark.parametrize("shift", [0.0, 0.006j])
@pytest.mark.parametrize("label", [0, 1])
@pytest.mark.parametrize("coefficient", ["sigma_a", "sigma_s_prime"])
def test_derivatives_to_media_are_differences_of_readings(
    layered: System, shift: complex, label: int, coefficient: Coefficient
) -> None:
    """With the depth and power of the beam, D, and the charges that are subtracted. Measured: 1e-9."""
    system, lights = replace(layered, shift=shift), LIGHTS
    found = sensitivity(system, lights, [*DETECTORS, FIBRE], to=[coefficient], per="region").derivatives[coefficient]
    step = {"sigma_a": 2e-5, "sigma_s_prime": 2e-3}[coefficient]
    changes = {}
    for steps in (-2, -1, 1, 2):
        changes[steps] = read_at(change_medium(system, label, coefficient, steps * step), lights)
    differences = (8.0 * (changes[1] - changes[-1]) - (changes[2] - changes[-2])) / (12.0 * step)
    assert found[:, :, label] == pytest.approx(differences, rel=1e-6)


def test_fitted_charges_are_differentiated_too(even: System) -> None:
    found = sensitivity(even, [SOURCE], [*DETECTORS, FIBRE], per="region")
    for coefficient, step in (("sigma_a", 2e-5), ("sigma_s_prime", 2e-3)):
        changes = [read_at(change_medium(even, 0, coefficient, side * step), [SOURCE]) for side in (-1.0, 1.0)]  # type: ignore[arg-type]
        assert found.derivatives[coefficient][..., 0] == pytest.approx((changes[1] - changes[0]) / (2 * step), rel=2e-5)


def test_steady_light_is_differentiated_on_the_mesh_of_modulated_light(ball: Surface) -> None:
    """Charges that are kept with it have complex strengths."""
    mesh = solve(ball, TISSUE, [SOURCE], detectors=DETECTORS, detector_tolerance=0.05, frequency=1e8).mesh
    system = System(mesh, TISSUE, ball)
    found = sensitivity(system, [SOURCE], [*DETECTORS, FIBRE], per="region", positions=[0])
    changes = [read_at(change_medium(system, 0, "sigma_a", side * 2e-5), [SOURCE]) for side in (-1.0, 1.0)]
    assert found.derivatives["sigma_a"][..., 0] == pytest.approx((changes[1] - changes[0]) / 4e-5, rel=2e-5)


def test_where_charges_are_placed_anew_there_are_no_derivatives(ball: Surface) -> None:
    """A light that is 1.5 times as deep as before has other charges; one step less deep it has the same."""
    mesh, extinction = tetrahedralize(ball, cache=False), TISSUE.sigma_a + TISSUE.reduced_scattering

    def at(depth: float) -> System:
        return System(mesh, replace(TISSUE, sigma_s_prime=extinction * depth - TISSUE.sigma_a), ball)

    for depth in (1.0, 1.4999):
        assert (sensitivity(at(depth), [BEAM], DETECTORS, per="region").derivatives["sigma_a"] < 0.0).all()
    with pytest.raises(RunError, match="charges of a light come or go"):
        sensitivity(at(1.5 - 5e-8), [BEAM], DETECTORS, per="region")


@pytest.mark.parametrize("shift", [0.0, 0.006j])
@pytest.mark.parametrize("subtract", ["fitted", "nothing"])
def test_derivatives_to_places_are_differences_of_readings(even: System, subtract: Subtract, shift: complex) -> None:
    """Of a point in any direction, and of a beam away from edges of the surface. Measured: 1e-9."""
    system, step = replace(even, shift=shift), 5e-3
    lights: list[Light] = [MovedLight(light, repr(light)) for light in (BEAM, PointSource((0.0, 2.0, 1.0)))]
    found = sensitivity(system, lights, [*DETECTORS, FIBRE], positions=[0, 1], subtract=subtract)
    assert found.derivatives["position"].shape == (2, 4, 3)
    for light, axis in [(1, 0), (1, 1), (1, 2), (0, 2)]:
        place, way, changes = place_of(lights[light]), step * np.eye(3)[axis], {}
        assert place is not None
        for steps in (-2, -1, 1, 2):
            moved = list(lights)
            moved[light] = at_place(lights[light], place + steps * way)
            changes[steps] = read_at(system, moved, subtract)[light]
        differences = (8.0 * (changes[1] - changes[-1]) - (changes[2] - changes[-2])) / (12.0 * step)
        of_place = found.derivatives["position"][light, :, axis]
        assert of_place == pytest.approx(differences, abs=1e-7 * float(np.abs(found.readings[light]).max()))


def test_nothing_changes_along_a_beam(even: System) -> None:
    found = sensitivity(even, [BEAM], DETECTORS, positions=[0], log=True)
    changes = found.derivatives["position"][0] @ np.array(BEAM.direction)
    assert changes == pytest.approx(np.zeros(3), abs=1e-12)
    assert np.abs(found.derivatives["position"]).max() > 0.1


def test_without_a_true_surface_the_half_space_is_subtracted(even: System) -> None:
    bare = replace(even, surface=None)
    found = sensitivity(bare, [SOURCE], DETECTORS, to=["sigma_a"], per="region").derivatives["sigma_a"]
    changes = [read_at(change_medium(bare, 0, "sigma_a", side * 2e-5), [SOURCE])[:, :3] for side in (-1.0, 1.0)]
    assert found[..., 0] == pytest.approx((changes[1] - changes[0]) / 4e-5, rel=2e-5)


def test_derivatives_are_those_of_the_series(even: System) -> None:
    """Measured: .1 %."""
    found = sensitivity(even, [SOURCE], DETECTORS, per="region", log=True)
    step = 1e-5

    def series(sigma_a: float) -> NumberArray:
        medium = replace(TISSUE, sigma_a=sigma_a)
        radius = 10.0 - TISSUE.mean_free_path
        return np.log(exact.point_exitance(medium, radius=10.0, source_radius=radius, gamma=ANGLES))

    slopes = (series(TISSUE.sigma_a + step) - series(TISSUE.sigma_a - step)) / (2.0 * step)
    assert found.derivatives["sigma_a"][0, :, 0] == pytest.approx(slopes, rel=0.005)


@pytest.mark.parametrize("shift", [0.0, 0.006j])
def test_derivatives_to_parts_sum_to_those_to_media(layered: System, shift: complex) -> None:
    """Over nodes, tetrahedra and points of a grid, of all media together and of tetrahedra of each."""
    system = replace(layered, shift=shift)
    whole = sensitivity(system, [BEAM], DETECTORS, per="region")
    grid = Grid(shape=(5, 6, 7), origin=(-9.0, -9.0, -9.0), spacing=3.0)
    parts: list[Per] = ["node", "tetrahedron", grid]
    for per in parts:
        found = sensitivity(system, [BEAM], DETECTORS, per=per)
        for coefficient, values in found.derivatives.items():
            expected = whole.derivatives[coefficient]
            assert values.sum(axis=2) == pytest.approx(expected.sum(axis=2), rel=1e-9)
            if per == "tetrahedron":
                inner = values[:, :, system.mesh.regions == 1].sum(axis=2)
                assert inner == pytest.approx(expected[:, :, 1], rel=1e-9)
    assert found.readings == pytest.approx(read_at(system, [BEAM])[:, :3], rel=1e-9)


@pytest.mark.parametrize("coefficient", ["sigma_a", "sigma_s_prime"])
def test_taylor_remainder_is_of_second_order(even: System, coefficient: Coefficient) -> None:
    """Along a random change of the coefficients of nodes: a fourth at half the step."""
    mesh = even.mesh
    source = PointSource((0.0, 3.0, 0.0))
    found = sensitivity(even, [source], DETECTORS, to=[coefficient], subtract="nothing")
    size = TISSUE.sigma_a if coefficient == "sigma_a" else TISSUE.reduced_scattering
    way = size * np.random.default_rng(1).uniform(-1.0, 1.0, len(mesh.points))
    remainders = []
    for step in (0.2, 0.1, 0.05):
        field = mesh_field(mesh, size + step * way)
        changed = replace(even, medium=VaryingMedium(base=TISSUE, **{coefficient: field}))
        after = read_at(changed, [source], "nothing")[:, :3]
        remainders.append(np.abs(after - found.readings - step * (found.derivatives[coefficient] @ way)))
    first, second, third = remainders
    assert first / second == pytest.approx(np.full((1, 3), 4.0), rel=0.1)
    assert second / third == pytest.approx(np.full((1, 3), 4.0), rel=0.05)


def test_sources_and_detectors_may_change_places(even: System) -> None:
    """Products are the same with either as the light, and a reading is that of the adjoint solution."""
    operator = even.quadratic
    random = np.random.default_rng(2)
    loads = random.uniform(0.0, 1.0, (operator.space.size, 2))
    light, dual = (operator.solve(load[:, None]) for load in loads.T)
    assert (loads[:, 1] @ light).item() == pytest.approx((loads[:, 0] @ dual).item(), rel=1e-9)
    cells = len(even.mesh.tetrahedra)
    shares = parameter_shares(even.mesh, np.zeros(cells, dtype=np.int64), "node")
    ours, theirs = (
        multiply(operator.space, *pair, np.ones(cells), shares, shares, np.float64)
        for pair in ((light, dual), (dual, light))
    )
    assert ours.mass == pytest.approx(theirs.mass, rel=1e-9)
    assert ours.stiffness == pytest.approx(theirs.stiffness, rel=1e-9, abs=1e-12 * np.abs(ours.stiffness).max())


def test_partial_path_lengths_are_times_of_flight(layered: System) -> None:
    """In mm, over the speed of light; what is subtracted is not that of the mesh. Measured: 6e-3 next to the beam."""
    found = sensitivity(layered, [BEAM], DETECTORS, per="region")
    times = moments(layered, [BEAM], DETECTORS, order=1).mean
    assert found.path_lengths.sum(axis=2) == pytest.approx(299.792458e9 / 1.4 * times, rel=0.015)
    # Light that is read on the far side has crossed the inner ball.
    assert found.path_lengths[0, 2, 1] > 3.0 * found.path_lengths[0, 0, 1]
    assert found.labels == (0, 1)


def test_logarithms_and_single_precision(even: System) -> None:
    plain = sensitivity(even, [SOURCE], DETECTORS)
    log = sensitivity(even, [SOURCE], DETECTORS, log=True, dtype=np.float32)
    assert log.derivatives["sigma_a"].dtype == np.float32
    expected = plain.derivatives["sigma_a"] / plain.readings[:, :, None]
    assert log.derivatives["sigma_a"] == pytest.approx(expected, rel=1e-3, abs=1e-5 * np.abs(expected).max())


def test_what_has_no_sensitivities_is_refused(even: System) -> None:
    with pytest.raises(InputError, match=r'per is "cell"; it is "node", "tetrahedron", "region" or a Grid'):
        sensitivity(even, [SOURCE], DETECTORS, per="cell")  # type: ignore[arg-type]
    with pytest.raises(InputError, match=r'to is "g"|to is \[\'g\'\]; give a list of "sigma_a" and "sigma_s_prime"'):
        sensitivity(even, [SOURCE], DETECTORS, to=["g"])  # type: ignore[list-item]
    with pytest.raises(InputError, match="sensitivities are of what detectors read, and there is none"):
        sensitivity(even, [SOURCE], [])
    with pytest.raises(InputError, match="the grid has shape"):
        Grid(shape=(0, 1, 1), origin=(0.0, 0.0, 0.0), spacing=1.0)
    with pytest.raises(InputError, match=r"detector 2 is in the dark: it reads -2e-20 of light 1, and less than"):
        check_readings(np.array([[1.0, -2e-20]]), np.array([1e-18]))
    absorbing = replace(even, medium=replace(TISSUE, sigma_a=5.0, sigma_s_prime=5.0))
    with pytest.raises(InputError, match="diffuse light fades within a tetrahedron at a detector"):
        sensitivity(absorbing, [DiffuseLight(1.0)], DETECTORS)
