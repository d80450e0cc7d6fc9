"""Bodies of which only the part that light reaches is meshed."""

import numpy as np
import pytest

from tetlux.cases.shipped import library_folder
from tetlux.fem import (
    CollimatedBeam,
    DiffuseLight,
    Disc,
    Medium,
    PencilBeam,
    PointDetector,
    PointSource,
    Region,
    TruncatedSolution,
    plan,
    solve,
)
from tetlux.fem.exact import half_space, layered
from tetlux.meshing import box, read_surface, sphere, tetrahedralize
from tetlux.meshing.errors import InputError
from tetlux.meshing.repair.box_cut import cut_to_box, refine_around
from tetlux.meshing.repair.topology import Edges

GREY = Medium(sigma_a=0.1, sigma_s_prime=1.0, eta=1.4)
BLOCK = box((160.0, 160.0, 160.0))
SPOT = CollimatedBeam((0.0, 0.0, -1.0), 1.0, spot=Disc((0.0, 0.0, 80.0), 4.0))


@pytest.fixture(scope="module")
def spot() -> TruncatedSolution:
    found = solve(BLOCK, GREY, [SPOT], tolerance=0.05, model="truncated")
    assert isinstance(found, TruncatedSolution)
    return found


def test_a_spot_on_a_block_is_that_of_the_whole_block(spot: TruncatedSolution) -> None:
    whole = solve(BLOCK, GREY, [SPOT], tolerance=0.05)
    rho = np.linspace(0.0, 8.0, 9)
    places = np.column_stack([rho, 0.0 * rho, 80.0 + 0.0 * rho])
    difference = spot.exitance_at(places) - whole.exitance_at(places)
    assert np.linalg.norm(difference) < 0.1 * np.linalg.norm(whole.exitance_at(places))
    assert spot.power.exited == pytest.approx(whole.power.exited, rel=0.01)
    assert spot.power.incident == pytest.approx(np.pi * 16.0, rel=0.01)
    assert spot.power.balance_error == pytest.approx(0.0, abs=1e-9)
    assert spot.error_estimate <= 0.05 * 1.01


def test_beyond_the_part_it_is_dark_and_said_to_be_not_modelled(spot: TruncatedSolution) -> None:
    assert spot.part is not None
    assert 10.0 < spot.part.distance < 48.0
    beyond = np.array([[0.0, 70.0, 80.0], [0.0, 0.0, -80.0]])
    assert spot.is_modelled_at(np.array([[0.0, 5.0, 80.0], *beyond])).tolist() == [True, False, False]
    exitance = spot.exitance_at(beyond)
    assert (exitance >= 0.0).all()
    assert exitance.max() < 1e-7 * spot.exitance.max()
    assert np.isnan(spot.fluence_at(beyond - [0.0, 0.0, 1.0])).all()
    assert spot.cut_error < 1e-3
    assert any("only a part of the body, all within" in warning for warning in spot.warnings)
    assert spot.surface is BLOCK
    assert np.ptp(spot.mesh.points, axis=0).max() < 120.0


def test_a_ball_of_a_million_mean_free_paths_is_a_half_space() -> None:
    tissue = Medium(sigma_a=0.05, sigma_s_prime=1.0, eta=1.4)
    beam = PencilBeam((0.0, 0.0, 2e6), (0.0, 0.0, -1.0))
    found = plan(sphere(1e6), tissue, [beam])
    assert found.chosen == "truncated"
    assert "absurdly large" in found["full"].reason
    solution = solve(sphere(1e6), tissue, [beam], model="auto")
    assert solution.model == "truncated"
    scattered = tissue.albedo * (1.0 - solution.power.specular)
    exited = scattered * half_space.point_total(tissue, depth=tissue.mean_free_path)
    # Of twenty meshes nineteen were off by 0.03 to 0.18 %, one by 0.33 %; half the default tolerance is asked.
    assert solution.power.exited == pytest.approx(exited, rel=0.01)
    with pytest.raises(InputError, match="absurdly large"):
        solve(sphere(1e6), tissue, [beam])


def test_a_layer_is_cut_too() -> None:
    """Light of a point above a dark layer, which reaches across the whole block, as on layers without end."""
    media = [GREY, Medium(sigma_a=0.5, sigma_s_prime=1.0, eta=1.4), GREY]
    layer = Region(box((150.0, 150.0, 4.0), center=(0.0, 0.0, 75.0)), media[1])
    solution = solve(BLOCK, GREY, [PointSource((0.0, 0.0, 78.5))], regions=[layer], tolerance=0.02, model="truncated")
    rho = np.linspace(0.0, 4.0, 9)
    exact = layered.point_exitance(media, [3.0, 4.0, 153.0], depth=1.5, rho=rho)
    found = solution.exitance_at(np.column_stack([rho, 0.0 * rho, 80.0 + 0.0 * rho]))
    assert np.linalg.norm(found - exact) < 0.02 * np.linalg.norm(exact)


def test_a_cut_is_closed_and_keeps_what_is_inside() -> None:
    ball = sphere(10.0)
    low, high = np.array([0.0, -20.0, -20.0]), np.array([20.0, 20.0, 20.0])
    half = cut_to_box(ball, low, high)
    assert half is not None
    assert half.volume == pytest.approx(0.5 * ball.volume, rel=1e-3)
    assert half.area == pytest.approx(0.5 * ball.area + 100.0 * np.pi, rel=1e-2)
    assert half.points[:, 0].min() == pytest.approx(0.0, abs=1e-9)
    assert cut_to_box(ball, low - 100.0, high - 100.0) is None
    assert cut_to_box(ball, low - 100.0, high + 100.0) is ball


def test_a_sphere_is_refined_onto_the_sphere() -> None:
    place = np.array([0.0, 0.0, 10.0])
    fine = refine_around(sphere(10.0), place, 1.0, 0.1)
    near = np.linalg.norm(fine.points - place, axis=1) < 1.0
    assert near.sum() > 400
    np.testing.assert_allclose(np.linalg.norm(fine.points, axis=1), 10.0, rtol=1e-12)


def test_what_cannot_be_cut_is_refused_in_a_sentence() -> None:
    with pytest.raises(InputError, match=r'^no part can be cut out: light enters everywhere; give model="full"\.$'):
        solve(BLOCK, GREY, [DiffuseLight(1.0)], model="truncated")
    with pytest.raises(InputError, match="no part can be cut out: light reaches most of the body"):
        solve(sphere(10.0), GREY, [PointSource((0.0, 0.0, 9.0))], model="truncated")
    with pytest.raises(InputError, match='a mesh is given, and model "truncated" makes its own'):
        solve(BLOCK, GREY, [SPOT], mesh=tetrahedralize(BLOCK, edge_length=60.0), model="truncated")


def test_what_a_cut_is_not_certified_for_is_refused() -> None:
    with pytest.raises(InputError, match='model "truncated" does not take everywhere_tolerance and frequency; leave'):
        solve(BLOCK, GREY, [SPOT], model="truncated", frequency=1e8, everywhere_tolerance=0.1)


def test_a_plan_weighs_the_part_against_the_whole() -> None:
    vein = Region(sphere(1.0, center=(0.0, 0.0, 76.0)), Medium(sigma_a=0.5, sigma_s_prime=1.0, eta=1.4))
    found = plan(BLOCK, GREY, [SPOT], regions=[vein])
    assert found.chosen == "truncated"
    assert found["truncated"].seconds < 0.7 * found["full"].seconds
    assert "beyond which it is dark" in found["truncated"].reason
    assert len(str(found).splitlines()) <= 6
    assert "saves too little" in plan(BLOCK, GREY, [SPOT])["truncated"].reason
    with_detector = plan(BLOCK, GREY, [SPOT], detectors=[PointDetector((0.0, 9.0, 80.0))])
    assert "for the exitance as a whole only" in with_detector["truncated"].reason


def test_cuts_of_a_scan_are_closed_or_refused() -> None:
    """Boxes that meet vertices and edges have cuts with holes, which are not handed on."""
    hare = read_surface(library_folder() / "hare.stl")
    middle, size = 0.5 * (hare.points.min(axis=0) + hare.points.max(axis=0)), 0.25 * hare.diagonal
    sound = 0
    for shift in np.linspace(0.0, 0.2, 15):
        try:
            part = cut_to_box(hare, middle - size, middle + size * (0.3 + shift))
        except InputError as error:
            assert str(error) == "the cut of the surface is not closed"  # noqa: PT017
            continue
        assert part is not None
        assert (Edges(part.faces).balance == 0).all()
        assert 0.0 < part.volume < hare.volume
        sound += 1
    assert sound >= 5
