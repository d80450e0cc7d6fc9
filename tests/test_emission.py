"""Light that the volume emits, throughout or in a region."""

import math

import numpy as np
import pytest

from tests.conftest import TISSUE, block
from tetlux.fem import Emission, Medium, PointSource, Region, System, solve
from tetlux.meshing import InputError, Surface, TetMesh, box, sphere

WHOLE = block((6, 6, 6), (6.0, 6.0, 6.0))
INSIDE = (np.abs(WHOLE.points[WHOLE.tetrahedra].mean(axis=1) - [0.0, 0.0, -3.0]) < 1.0).all(axis=1)
MESH = TetMesh(WHOLE.points, WHOLE.tetrahedra, regions=INSIDE.astype(np.int64))
REGION = Region(box((2.0, 2.0, 2.0), center=(0.0, 0.0, -3.0)), TISSUE)


@pytest.mark.parametrize("sigma_a", [0.0, 0.01, 0.1])
def test_a_ball_that_glows_against_its_closed_form(sigma_a: float, ball: Surface) -> None:
    """``phi = q/sigma_a (1 - c sinh(kr)/r)``, and without absorption a paraboloid: all of it comes out."""
    medium = Medium(sigma_a=sigma_a, sigma_s_prime=1.0, eta=1.4)
    solution = solve(ball, medium, [Emission(0.5)], tolerance=0.02)
    k, zb, radius = medium.sigma_tr, medium.extrapolation_length, 10.0
    if sigma_a == 0.0:
        exact = 0.5 * radius / 3.0
    else:
        growth = k / math.tanh(k * radius) - 1.0 / radius
        exact = 0.5 / sigma_a * (1.0 - 1.0 / (1.0 + zb * growth)) / (2.0 * medium.boundary_factor)
    areas = solution.mesh.boundary_node_areas
    # Measured .02 to .4 %; and of the norm, with its ripple, .5 to 1 %.
    assert areas @ solution.exitance / areas.sum() == pytest.approx(exact, rel=0.01)
    assert np.sqrt(areas @ (solution.exitance - exact) ** 2 / areas.sum()) < 0.02 * exact
    assert solution.power.incident == pytest.approx(0.5 * solution.mesh.volume, rel=1e-12)
    assert abs(solution.power.balance_error) < 1e-9


def test_parts_glow_as_much_as_the_whole() -> None:
    """Regions 0 and 1 together are the body."""
    system = System(MESH, TISSUE, expected=3)
    whole = system.solve([Emission(2.0)])
    parts = system.solve([Emission(2.0, region=0), Emission(2.0, region=1)])
    assert parts.exitance == pytest.approx(whole.exitance, rel=1e-9)
    outer, inner = (part.power for part in parts.of_lights)
    assert inner.incident == pytest.approx(2.0 * 8.0, rel=1e-12)
    assert outer.incident == pytest.approx(2.0 * (216.0 - 8.0), rel=1e-12)
    for power in (outer, inner, whole.power):
        assert abs(power.balance_error) < 1e-9
        assert (power.specular, power.ballistic) == (0.0, 0.0)


def test_a_small_region_glows_like_a_point_seen_from_afar() -> None:
    """A cube of 2 in the middle of one of 6: measured .7 % of the power and 3.4 % of the exitance's norm."""
    system = System(MESH, TISSUE, regions=(REGION,), expected=3)
    glow = system.solve([Emission(0.25, region=1)])
    point, aside = (system.solve([PointSource((0.0, 0.0, z), power=2.0)], subtract="nothing") for z in (-3.0, -2.0))
    assert glow.power.incident == pytest.approx(2.0, rel=1e-12)
    assert glow.power.exited == pytest.approx(point.power.exited, rel=0.02)
    apart = [np.linalg.norm(one.exitance - glow.exitance) / np.linalg.norm(glow.exitance) for one in (point, aside)]
    assert apart[0] < 0.06
    # And not like one that is a unit aside.
    assert apart[1] > 0.3


def test_what_absorbs_in_a_glowing_region_is_in_the_ledger() -> None:
    dark = Region(REGION.surface, Medium(sigma_a=1.0, sigma_s_prime=1.0, eta=1.4))
    clear, dimmed = (
        System(MESH, TISSUE, regions=(one,)).solve([Emission(1.0, region=1)]).power for one in (REGION, dark)
    )
    assert dimmed.absorbed > 3.0 * clear.absorbed
    assert abs(dimmed.balance_error) < 1e-9
    assert dimmed.incident == clear.incident


@pytest.mark.parametrize("density", [0.0, -1.0, math.nan, math.inf])
def test_densities_that_cannot_be(density: float) -> None:
    with pytest.raises(InputError, match=r"density is .*; give a number of W/unit³ greater than 0"):
        Emission(density)


@pytest.mark.parametrize("region", [2, -1])
def test_regions_that_are_not_there(region: int) -> None:
    with pytest.raises(InputError, match=f"emission is of region {region}, and there is none; give one of the body's"):
        System(MESH, TISSUE, regions=(REGION,)).solve([Emission(1.0, region=region)])
    with pytest.raises(InputError, match="emission is of region 1, and there is none"):
        solve(sphere(10.0), TISSUE, [Emission(1.0, region=1)])


def test_a_region_emits_what_its_surface_holds() -> None:
    """Also on a coarse mesh, whose part of it is 4 % too small, and less what lies in regions within."""
    core, shell = sphere(2.0), sphere(4.0)
    regions = [Region(shell, TISSUE), Region(core, TISSUE)]
    for number, volume in ((1, shell.volume - core.volume), (2, core.volume)):
        solution = solve(sphere(8.0), TISSUE, [Emission(2.0, region=number)], regions=regions, tolerance=0.5)
        assert solution.mesh.volumes[solution.mesh.regions == 2].sum() < 0.985 * core.volume
        assert solution.power.incident == pytest.approx(2.0 * volume, rel=1e-9)
        assert abs(solution.power.balance_error) < 1e-9
