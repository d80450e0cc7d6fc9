"""Several channels, scenes and lights at once are what each is alone on the same mesh."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from tests.conftest import TISSUE, block
from tetlux.fem import (
    CollimatedBeam,
    DiffuseLight,
    Disc,
    Emission,
    EnvironmentLight,
    Image,
    Light,
    Medium,
    PencilBeam,
    PointSource,
    Region,
    Solution,
    System,
    solve,
)
from tetlux.fem.ballistic.rays import Rays
from tetlux.fem.media.coefficients import AnyMedium
from tetlux.fem.media.varying import VaryingMedium
from tetlux.fem.solve_scenes import solve_each
from tetlux.fem.sources.deposit import Deposit
from tetlux.meshing import InputError, Surface, TetMesh, box, sphere
from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.tets import cache as mesh_cache

RED = Medium(sigma_a=0.01, sigma_s=4.0, g=0.75, eta=1.4)
BLUE = Medium(sigma_a=0.3, sigma_s=6.0, g=0.7, eta=1.4)
OTHER_INDEX = Medium(sigma_a=0.05, sigma_s_prime=1.2, eta=1.0)
THIN = Medium(sigma_a=0.005, sigma_s=0.2, g=0.5, eta=1.4)
SHADED = VaryingMedium(base=RED, sigma_a=lambda p: 0.01 - 0.02 * p[:, 2])
CUBE = block((6, 6, 6), (6.0, 6.0, 6.0))
LIGHTS: list[Light] = [
    CollimatedBeam((0.2, 0.1, -1.0), 0.3),
    CollimatedBeam((0.0, 0.0, -1.0), 2.0, Disc((0.0, 0.5, 1.0), 1.0)),
    PointSource((0.5, 0.2, -2.0), power=3.0),
    PencilBeam((0.1, 0.2, 3.0), (0.1, 0.0, -1.0), deposit="line"),
    PencilBeam((-1.0, 0.2, 3.0), (0.0, 0.1, -1.0), deposit="line", radius=0.4),
    PencilBeam((1.0, 0.2, 3.0), (0.0, 0.1, -1.0)),
    DiffuseLight(0.2),
    EnvironmentLight(np.linspace(0.0, 1.0, 50).reshape(5, 10)),
    Emission(0.01),
]
SHARES = ("incident", "specular", "absorbed", "exited", "ballistic")


def same(one: Solution, other: Solution, rel: float = 1e-10) -> None:
    """Fluence, exitance at nodes and at points, and the ledger, by their largest values."""
    for found, expected in (
        (one.fluence, other.fluence),
        (one.exitance, other.exitance),
        (one.exitance_at(CUBE.points[::7]), other.exitance_at(CUBE.points[::7])),
    ):
        assert found == pytest.approx(expected, rel=rel, abs=rel * float(np.abs(expected).max()))
    for name in SHARES:
        expected_power = getattr(other.power, name)
        assert getattr(one.power, name) == pytest.approx(expected_power, rel=rel, abs=rel * other.power.incident)


@pytest.mark.parametrize("media", [(RED, BLUE), (RED, OTHER_INDEX, RED), (SHADED, BLUE), (BLUE, THIN, RED, SHADED)])
def test_channels_are_solved_as_each_alone(media: Sequence[AnyMedium]) -> None:
    together = solve(CUBE, media, LIGHTS)
    assert len(together) == len(media)
    for medium, channel in zip(media, together, strict=True):
        # On a mesh that knows no paths yet.
        alone = solve(TetMesh(CUBE.points, CUBE.tetrahedra), medium, LIGHTS)
        same(channel, alone)
        assert channel.error_estimate == pytest.approx(alone.error_estimate, rel=1e-6)
        assert channel.warnings == alone.warnings
        assert channel.medium == alone.medium
        assert abs(channel.power.balance_error) < 1e-9


def test_what_falls_on_a_mesh_is_worked_out_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """For all channels of one index, and for a spot that only differs in its irradiance."""
    worked: list[str] = []
    draw, look = CollimatedBeam._incident_rays, EnvironmentLight._illuminate

    def counting_draw(light: CollimatedBeam, mesh: TetMesh) -> tuple[Rays, FloatArray]:
        worked.append("beam")
        return draw(light, mesh)

    def counting_look(light: EnvironmentLight, mesh: TetMesh, eta: float) -> Deposit:
        worked.append("sky")
        return look(light, mesh, eta)

    monkeypatch.setattr(CollimatedBeam, "_incident_rays", counting_draw)
    monkeypatch.setattr(EnvironmentLight, "_illuminate", counting_look)
    sky, disc = EnvironmentLight(np.ones((4, 8))), Disc((0.0, 0.5, 1.0), 1.0)
    down, spot = CollimatedBeam((0.0, 0.0, -1.0)), CollimatedBeam((0.0, 0.0, -1.0), spot=disc)
    cases: list[tuple[list[Medium], list[Light], list[str]]] = [
        ([RED, BLUE, THIN], [down, sky], ["beam", "sky"]),
        ([RED, OTHER_INDEX], [sky], ["sky", "sky"]),
        ([RED], [down, spot, replace(spot, irradiance=3.0)], ["beam", "beam"]),
        ([RED], [spot, replace(spot, from_center=True), replace(spot, direction=(0.0, 0.1, -1.0))], ["beam"] * 3),
        # A direction that cannot be looked up is no fault.
        ([RED, BLUE], [CollimatedBeam((0.0, 0.0, -1.0), spot=Disc([0.0, 0.5, 1.0], 1.0))], ["beam"] * 2),  # type: ignore[arg-type]
    ]
    for media, lights, expected in cases:
        worked.clear()
        solve(TetMesh(CUBE.points, CUBE.tetrahedra), media, lights)
        assert sorted(worked) == expected


@pytest.mark.parametrize("light", LIGHTS[:2])
def test_twice_the_irradiance_is_twice_the_light(light: CollimatedBeam) -> None:
    """Though both fall on the same places of one mesh."""
    one, two = (System(CUBE, RED).solve([replace(light, irradiance=irradiance)]) for irradiance in (0.7, 1.4))
    assert two.exitance == pytest.approx(2.0 * one.exitance, rel=1e-9)
    for name in SHARES:
        assert getattr(two.power, name) == pytest.approx(2.0 * getattr(one.power, name), rel=1e-9)


def test_a_spot_of_ones_own_may_change() -> None:
    """Of those that cannot, what they light is remembered; an image keeps its place."""

    class Own:
        """Anything that does what a spot does."""

        def __init__(self, radius: float) -> None:
            self.disc = Disc((0.0, 0.5, 1.0), radius)

        def __getattr__(self, name: str) -> object:
            return getattr(self.disc, name)

    own, system = Own(0.5), System(CUBE, RED)
    light = CollimatedBeam((0.0, 0.0, -1.0), spot=own)  # type: ignore[arg-type]
    small = system.solve([light]).power.incident
    own.disc = Disc((0.0, 0.5, 1.0), 1.0)
    assert system.solve([light]).power.incident == pytest.approx(4.0 * small, rel=0.02)
    center = np.array([0.0, 0.5, 1.0])
    image = Image(center, 2.0, np.ones((2, 2)))  # type: ignore[arg-type]
    center += 100.0
    assert image.center == (0.0, 0.5, 1.0)


def test_a_mesh_remembers_the_latest(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mesh_cache, "MOST_RESULTS", 2)
    mesh = TetMesh(CUBE.points, CUBE.tetrahedra)
    worked: list[str] = []

    def work(key: str) -> str:
        def working() -> str:
            worked.append(key)
            return key

        return mesh.cache.get(key, working)

    assert [work(key) for key in "aababcbac"] == list("aababcbac")
    # The third drives out the first, which then drives out the second.
    assert worked == ["a", "b", "c", "a"]


def test_regions_have_a_medium_in_each_channel() -> None:
    middles = CUBE.points[CUBE.tetrahedra].mean(axis=1)
    mesh = TetMesh(CUBE.points, CUBE.tetrahedra, regions=(middles[:, 2] < -3.0).astype(np.int64))
    surface, lights = box((6.0, 6.0, 3.0), center=(0.0, 0.0, -4.5)), LIGHTS[:4]
    red, blue = solve(mesh, [RED, BLUE], lights, regions=[Region(surface, [BLUE, RED])])
    same(red, solve(mesh, RED, lights, regions=[Region(surface, BLUE)]))
    same(blue, solve(mesh, BLUE, lights, regions=[Region(surface, RED)]))
    # One medium for all channels is that of each.
    _, blue = solve(mesh, [RED, BLUE], lights, regions=[Region(surface, RED)])
    same(blue, solve(mesh, BLUE, lights, regions=[Region(surface, RED)]))


def test_each_scene_has_its_lights_and_its_medium() -> None:
    scenes = [LIGHTS[:2], LIGHTS[2:4], LIGHTS[:2]]
    media = [RED, BLUE, BLUE]
    together = solve_each(CUBE, media, scenes)
    for lights, medium, solution in zip(scenes, media, together, strict=True):
        same(solution, solve(TetMesh(CUBE.points, CUBE.tetrahedra), medium, lights))


def test_every_light_has_a_ledger_of_its_own() -> None:
    """What each of the lights adds is what it gives alone, and all of them make up the whole."""
    system = System(CUBE, RED, expected=2 * len(LIGHTS))
    together = system.solve(LIGHTS)
    assert len(together.of_lights) == len(LIGHTS)
    for light, part in zip(LIGHTS, together.of_lights, strict=True):
        same(part, system.solve([light]), rel=1e-8)
        assert abs(part.power.balance_error) < 1e-9
    assert sum(part.exitance for part in together.of_lights) == pytest.approx(together.exitance, rel=1e-10)
    for name in SHARES:
        parts = sum(getattr(part.power, name) for part in together.of_lights)
        assert getattr(together.power, name) == pytest.approx(parts, rel=1e-10)
    # One alone is the whole, and has no parts.
    assert system.solve(LIGHTS[:1]).of_lights == ()


@pytest.mark.slow
def test_one_mesh_is_fine_enough_for_all_channels(ball: Surface) -> None:
    lights = [CollimatedBeam((0.0, 0.0, -1.0))]
    together = solve(ball, [TISSUE, Medium(sigma_a=0.3, sigma_s_prime=0.7, eta=1.4)], lights, tolerance=0.08)
    assert together[0].mesh is together[1].mesh
    assert max(channel.error_estimate for channel in together) <= 0.08
    for channel, medium in zip(together, (TISSUE, Medium(sigma_a=0.3, sigma_s_prime=0.7, eta=1.4)), strict=True):
        same(channel, solve(ball, medium, lights, mesh=channel.mesh))


def test_counts_that_do_not_go_together() -> None:
    with pytest.raises(InputError, match="region 1 has 3 media for 2 channels; give one, or one for each"):
        solve(CUBE, [RED, BLUE], LIGHTS, regions=[Region(sphere(1.0, center=(0.0, 0.0, -3.0)), [RED, BLUE, RED])])
    with pytest.raises(InputError, match="the body has 2 media for 3 channels"):
        solve_each(CUBE, [RED, BLUE], [LIGHTS] * 3)
    region = Region(sphere(1.0, center=(0.0, 0.0, -3.0)), [RED, BLUE])
    with pytest.raises(InputError, match="a region has 2 media where one is wanted"):
        System(CUBE, RED, regions=(region,)).solve(LIGHTS[:1])
    with pytest.raises(InputError, match="there is no"):
        solve(CUBE, [], LIGHTS)
    with pytest.raises(InputError, match="there is no light"):
        solve(CUBE, [RED, BLUE], [])
