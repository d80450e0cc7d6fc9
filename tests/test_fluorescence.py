"""Dyes: emitted light against closed forms and derivatives, the ledgers of both equations, and what is refused."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.special import eval_legendre, spherical_in

from tests.conftest import block
from tetlux.fem import (
    DiffuseLight,
    Emission,
    Fluorophore,
    Light,
    Medium,
    PencilBeam,
    PointDetector,
    PointSource,
    Power,
    Region,
    Solution,
    VaryingMedium,
    fluorescence,
    read,
    solve,
)
from tetlux.fem.dyes.glow import Glow
from tetlux.fem.dyes.near_sources import integrate_near_sources
from tetlux.fem.models.modulation import shift_of_frequency
from tetlux.fem.quadratic.space import QuadraticSpace
from tetlux.meshing import InputError, TetMesh, sphere, tetrahedralize

RED, INFRARED = (Medium(sigma_a=a, sigma_s_prime=s, eta=1.4) for a, s in ((0.015, 1.2), (0.01, 0.9)))
DYE = Fluorophore(absorption=0.005, quantum_yield=0.5, lifetime=0.56e-9)
BALL, SOURCE = sphere(10.0), [PointSource((0.0, 0.0, 5.0))]
ANGLES = np.radians([0.0, 30.0, 60.0, 90.0, 180.0])
PLACES = 10.0 * np.column_stack([np.sin(ANGLES), 0.0 * ANGLES, np.cos(ANGLES)])
DETECTORS = [PointDetector((x, y, z)) for x, y, z in PLACES.tolist()]


def emitted_exitance(lit: Medium, emitted: Medium, dye: Fluorophore, frequency: float = 0.0) -> np.ndarray:
    """Exitance that a dye in a whole ball of radius 10 emits by a unit source at the radius 5, at `ANGLES`.

    A multiple alpha of the excitation solves the equation of the emission inside, and what makes up for its source and
    its boundary is a field of the emission's own: see the series of `tetlux.fem.exact.sphere`.
    """
    a, r0, order = 10.0, 5.0, np.arange(60)

    def parts(medium: Medium) -> tuple[Any, Any, Any]:
        k = np.sqrt((medium.sigma_a + shift_of_frequency(frequency, medium, "mm")) / medium.diffusion)
        zb = medium.extrapolation_length
        at_wall = 1.0 + zb * k * spherical_in(order, k * a, derivative=True) / spherical_in(order, k * a)
        source = spherical_in(order, k * r0) / spherical_in(order, k * a) / at_wall
        return k, at_wall, source * (2 * order + 1) / (4.0 * np.pi * a**2)

    lit = replace(lit, sigma_a=lit.sigma_a + dye.absorption)
    (kx, _, x), (km, at_wall, m) = parts(lit), parts(emitted)
    weight = dye.absorption * dye.emitted_share(2.0 * np.pi * frequency)
    alpha = weight / (emitted.diffusion * (km**2 - kx**2))
    mismatch = 1.0 - emitted.extrapolation_length / lit.extrapolation_length
    # Both have one index, so that fluences compare as exitances do.
    modes = alpha * (x * (1.0 - mismatch / at_wall) - emitted.diffusion / lit.diffusion * m)
    return np.asarray(eval_legendre(order, np.cos(ANGLES)[:, None]) @ modes)


def check_ledgers(lit: Solution, glowing: Solution) -> None:
    """Nothing is lost in either equation, nor between them."""
    for solution in (lit, glowing, *glowing.of_lights):
        assert abs(solution.power.balance_error) < 1e-9
    for each in (glowing, *glowing.of_lights):
        assert sum(dye.emitted for dye in each.dyes) == pytest.approx(each.power.incident, rel=1e-9)
        for dye in each.dyes:
            assert abs(dye.absorbed - dye.lost - dye.emitted - dye.stored) < 1e-9 * abs(dye.absorbed)
            assert abs(dye.absorbed) < abs(lit.power.absorbed) * (1.0 + 1e-9)


@pytest.fixture(scope="module")
def coarse() -> TetMesh:
    return tetrahedralize(BALL, edge_length=2.5)


def test_the_closed_form_is_that_of_the_figures() -> None:
    known = [1.46006e-4, 1.035803e-4, 5.421089e-5, 2.988244e-5, 1.336479e-5]
    assert emitted_exitance(RED, INFRARED, DYE) == pytest.approx(known, rel=1e-5)


@pytest.mark.parametrize("frequency", [0.0, 200e6])
@pytest.mark.parametrize("subtract", ["fitted", "half-space"])
def test_a_dye_in_a_whole_ball(frequency: float, subtract: Any) -> None:
    """On a mesh of a thousand nodes readings are within .3 %, whatever is subtracted, the exitance within 5 %."""
    lit, glowing = fluorescence(
        BALL, RED, INFRARED, SOURCE, [DYE], detectors=DETECTORS, tolerance=0.1, frequency=frequency, subtract=subtract
    )
    exact = emitted_exitance(RED, INFRARED, DYE, frequency)
    readings = np.array([reading.exitance for reading in glowing.readings])
    assert readings == pytest.approx(exact, rel=5e-3)
    assert glowing.exitance_at(PLACES) == pytest.approx(exact, rel=0.1)
    assert lit.mesh is glowing.mesh
    assert lit.frequency == glowing.frequency == frequency
    check_ledgers(lit, glowing)
    # The dye has a quarter of the absorption everywhere.
    assert glowing.dyes[0].absorbed == pytest.approx(0.25 * lit.power.absorbed, rel=1e-9)
    assert not glowing.warnings


def test_the_estimate_drives_the_mesh() -> None:
    """The excitation alone, whose charges are fitted, is good enough on the first mesh of 700 nodes."""
    lit, glowing = fluorescence(BALL, RED, INFRARED, SOURCE, [DYE], tolerance=0.02)
    assert max(lit.error_estimate, glowing.error_estimate) <= 0.02
    assert len(lit.mesh.points) > 3000
    assert glowing.exitance_at(PLACES) == pytest.approx(emitted_exitance(RED, INFRARED, DYE), rel=0.02)


def test_tolerances_of_readings_are_met() -> None:
    lit, glowing = fluorescence(
        BALL, RED, INFRARED, SOURCE, [DYE], tolerance=None, detectors=DETECTORS, detector_tolerance=0.01
    )
    exact = emitted_exitance(RED, INFRARED, DYE)
    for reading, value in zip(glowing.readings, exact, strict=True):
        assert isinstance(reading.relative_error, float)
        assert reading.relative_error < 0.01
        assert abs(reading.exitance / value - 1.0) < 0.01
    assert all(reading.relative_error is not None and reading.relative_error < 0.01 for reading in lit.readings)


def test_the_error_of_a_reading_is_that_of_both_equations(coarse: TetMesh) -> None:
    """On a mesh that is too coarse for the excitation alone, which decays ten times faster than what is emitted."""
    dark = Medium(sigma_a=0.5, sigma_s_prime=1.2, eta=1.4)
    _, glowing = fluorescence(BALL, dark, INFRARED, SOURCE, [DYE], mesh=coarse, detectors=DETECTORS, subtract="nothing")
    exact = emitted_exitance(dark, INFRARED, DYE)
    for reading, value in zip(glowing.readings, exact, strict=True):
        assert reading.relative_error is not None
        assert abs(reading.exitance / value - 1.0) < 3.0 * reading.relative_error


def test_what_is_emitted_is_the_derivative_by_absorption() -> None:
    """With one medium for both, minus the derivative of the exitance by sigma_a at constant D, on one mesh."""
    inner, medium = sphere(3.0, center=(0.0, 0.0, 4.0)), Medium(sigma_a=0.02, sigma_s_prime=1.0, eta=1.4)
    mesh = tetrahedralize(BALL, [inner], edge_length=2.0)
    faint = Fluorophore(absorption=1e-7, quantum_yield=1.0, region=1)
    beam = [PencilBeam((0.0, 0.0, 20.0), (0.0, 0.0, -1.0), deposit="line")]

    def with_absorption(sigma_a: float) -> Region:
        return Region(inner, Medium(sigma_a=sigma_a, sigma_s_prime=1.02 - sigma_a, eta=1.4))

    _, glowing = fluorescence(
        BALL, medium, medium, beam, [faint], regions=[with_absorption(0.02)], mesh=mesh, subtract="nothing"
    )
    step = 1e-5
    less, more = (
        solve(BALL, medium, beam, regions=[with_absorption(0.02 + s)], mesh=mesh, subtract="nothing")
        for s in (-step, step)
    )
    slope = (more.exitance - less.exitance) / (2.0 * step)
    assert glowing.exitance == pytest.approx(-1e-7 * slope, rel=1e-3, abs=1e-5 * 1e-7 * np.abs(slope).max())
    assert read(DETECTORS[1], glowing).exitance == pytest.approx(
        -1e-7 * (_exitance(more) - _exitance(less)) / (2.0 * step), rel=1e-3
    )


def _exitance(solution: Solution) -> Any:
    return read(DETECTORS[1], solution).exitance


def test_several_lights_and_dyes_in_regions() -> None:
    """Lights add up, each dye has a ledger, and a region may have a medium for each wavelength."""
    inner = sphere(3.0, center=(0.0, 0.0, 4.0))
    regions = [Region(inner, [Medium(sigma_a=0.03, sigma_s_prime=1.0, eta=1.4), INFRARED])]
    dyes = [Fluorophore(0.02, 0.3, region=1), Fluorophore(0.001, 0.8, region=0)]
    lights: list[Light] = [PencilBeam((0, 0, 20.0), (0, 0, -1)), DiffuseLight(irradiance=1e-3)]
    lit, glowing = fluorescence(BALL, RED, INFRARED, lights, dyes, regions=regions, tolerance=0.2)
    check_ledgers(lit, glowing)
    first, second = glowing.of_lights
    assert first.fluence + second.fluence == pytest.approx(glowing.fluence)
    assert [dye.absorbed for dye in glowing.dyes] == pytest.approx(
        [a.absorbed + b.absorbed for a, b in zip(first.dyes, second.dyes, strict=True)]
    )
    # Alone, a dye emits what it does with the other beside it, whose absorption is added to its medium.
    media = [Medium(sigma_a=0.05, sigma_s_prime=1.0, eta=1.4), INFRARED]
    alone = Medium(sigma_a=0.015 + 0.001, sigma_s_prime=1.2, eta=1.4)
    lone = [Fluorophore(1e-6, 0.3, region=1)]
    _, few = fluorescence(BALL, alone, INFRARED, lights, lone, regions=[Region(inner, media)], mesh=glowing.mesh)
    assert few.dyes[0].absorbed / 1e-6 == pytest.approx(glowing.dyes[0].absorbed / 0.02, rel=1e-3)


def test_a_mesh_with_labels() -> None:
    whole = block((8, 8, 8), (16.0, 16.0, 16.0))
    labelled = replace_labels(whole)
    lights = [PointSource(tuple(whole.points.mean(axis=0).tolist()))]
    for emission in (INFRARED, {1: INFRARED, 2: INFRARED}):
        lit, glowing = fluorescence(
            labelled, {1: RED, 2: RED}, emission, lights, [Fluorophore(0.005, 0.5, region=2)], subtract="nothing"
        )
        check_ledgers(lit, glowing)
        share = float(glowing.dyes[0].absorbed / lit.power.absorbed)
        assert 0.05 < share < 0.25


def replace_labels(mesh: TetMesh) -> TetMesh:
    """The mesh with the labels 1 and 2, below and above its middle."""
    middles = mesh.points[mesh.tetrahedra].mean(axis=1)
    above = middles[:, 2] > np.median(middles[:, 2])
    return TetMesh(mesh.points, mesh.tetrahedra, mesh.unit, 1 + above.astype(np.int64))


def test_emitted_light_excites_a_dye_in_a_thick_body(coarse: TetMesh) -> None:
    """Where nearly all light is absorbed where it is emitted, the dye has its share of that."""
    dark = Medium(sigma_a=0.3, sigma_s_prime=20.0, eta=1.4)
    lit, glowing = fluorescence(BALL, dark, INFRARED, [Emission(density=1.0)], [Fluorophore(0.1, 1.0)], mesh=coarse)
    check_ledgers(lit, glowing)
    assert glowing.dyes[0].absorbed == pytest.approx(0.25 * lit.power.absorbed, rel=1e-9)


def test_light_excites_dyes_before_it_is_scattered(coarse: TetMesh) -> None:
    """What beams lose to absorption on their way belongs to the ledger of a dye as to that of its medium."""
    medium, dye = Medium(sigma_a=0.2, sigma_s_prime=1.0, eta=1.4), Fluorophore(0.1, 0.5)
    for deposit in ("point", "line"):
        beam = [PencilBeam((0.0, 0.0, 20.0), (0.0, 0.0, -1.0), deposit=deposit)]
        lit, glowing = fluorescence(BALL, medium, INFRARED, beam, [dye], mesh=coarse)
        check_ledgers(lit, glowing)
        assert glowing.dyes[0].absorbed == pytest.approx(lit.power.absorbed / 3.0, rel=1e-9)
        assert glowing.quadratic is not None
        (glow,) = glowing.quadratic.volume_sources
        assert isinstance(glow, Glow)
        (direct,) = glow.field.direct
        third = np.full(len(lit.mesh.tetrahedra), 0.1)
        space = glowing.quadratic.operator.space
        before = float(direct.deposit.ledger.absorbed) / 3.0
        assert direct.at_nodes(third).sum() == pytest.approx(before, rel=1e-9)
        assert direct.in_space(space, third)[: len(lit.mesh.points)].sum() == pytest.approx(before, rel=1e-3)


def test_a_medium_that_varies(coarse: TetMesh) -> None:
    varying = VaryingMedium(base=RED, sigma_a=lambda points: 0.015 + 0.0 * points[:, 0])
    lit, glowing = fluorescence(BALL, varying, INFRARED, SOURCE, [DYE], mesh=coarse)
    _, constant = fluorescence(BALL, RED, INFRARED, SOURCE, [DYE], mesh=coarse)
    check_ledgers(lit, glowing)
    assert isinstance(glowing.power, Power)
    assert glowing.power.incident == pytest.approx(constant.power.incident, rel=0.02)


def test_the_fluence_around_a_source_is_integrated(coarse: TetMesh) -> None:
    """The glow of quadratic elements holds what Gauss's theorem says is absorbed, within 2e-4."""
    lit, glowing = fluorescence(BALL, RED, INFRARED, SOURCE, [DYE], mesh=coarse)
    assert glowing.quadratic is not None
    (glow,) = glowing.quadratic.volume_sources
    assert isinstance(glow, Glow)
    nodes = len(lit.mesh.points)
    assert glow.at_dofs[:nodes].sum() == pytest.approx(glow.at_nodes.sum(), rel=1e-3)
    # Without the tetrahedra around the source a part is missing.
    assert len(lit.patches) == 1
    patch = lit.patches[0]
    space = QuadraticSpace(lit.mesh, np.zeros((len(lit.mesh.edges), 3)))
    near = integrate_near_sources(space, patch)
    assert abs(near.values[:, :4].sum()) > 1e-3 * glow.integrate(np.ones(len(lit.mesh.tetrahedra), dtype=bool)).real


@pytest.mark.parametrize(
    ("absorption", "quantum_yield", "lifetime", "words"),
    [
        (0.005, 1.2, 0.0, "quantum_yield is 1.2; give the share of absorbed photons that are emitted, above 0"),
        (0.005, 0.0, 0.0, "quantum_yield is 0; give"),
        (0.005, float("nan"), 0.0, "quantum_yield is nan"),
        (0.0, 0.5, 0.0, "absorption is 0; give a number of 1/unit greater than 0"),
        (-1.0, 0.5, 0.0, "absorption is -1"),
        (0.005, 0.5, -1e-9, "lifetime is -1e-09; give seconds, from 0 to 0.1"),
        (0.005, 0.5, 0.56, "lifetime is 0.56; give seconds"),
    ],
)
def test_a_fluorophore_that_cannot_be(absorption: float, quantum_yield: float, lifetime: float, words: str) -> None:
    with pytest.raises(InputError) as error:
        Fluorophore(absorption, quantum_yield, lifetime)
    assert words in str(error.value)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"fluorophores": []}, "there is no fluorophore; give a list of at least one"),
        ({"fluorophores": [RED]}, "is no fluorophore; give Fluorophore(absorption, quantum_yield)"),
        ({"fluorophores": [replace(DYE, region=1)]}, "a fluorophore is in region 1, where the body has nothing"),
        ({"fluorophores": [replace(DYE, region="tumour")]}, "in region 'tumour', where the body has nothing"),
        ({"emission": None}, "the medium of the emission is None; give a Medium, or media by label"),
        ({"excitation": [RED]}, "the medium of the excitation is [Medium"),
        ({"excitation": {1: RED}}, "media by label need a mesh with labelled tetrahedra"),
        ({"lights": []}, "there is no light; give at least one"),
        ({"frequency": -1.0}, "frequency is -1"),
        ({"tolerance": 2.0}, "tolerance"),
    ],
)
def test_what_is_refused(changes: dict[str, Any], words: str) -> None:
    arguments: dict[str, Any] = {
        "body": BALL,
        "excitation": RED,
        "emission": INFRARED,
        "lights": SOURCE,
        "fluorophores": [DYE],
    }
    with pytest.raises(InputError) as error:
        fluorescence(**(arguments | changes))
    assert words in str(error.value)
