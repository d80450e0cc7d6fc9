"""On a kept mesh readings of layered bodies are smooth in the coefficients: patches of charges are kept too."""

import numpy as np
import pytest

from tetlux.fem import Medium, PencilBeam, PointDetector, Region, Solution, solve
from tetlux.fem.known.kept_patches import OTHER_MEDIUM, kept_patch
from tetlux.meshing import TetMesh, sphere
from tetlux.meshing.arrays import FloatArray

RADIUS = 12.0
BEAM = [PencilBeam((0.0, 0.0, 30.0), (0.0, 0.0, -1.0))]
DETECTORS = [PointDetector((RADIUS * float(np.sin(g)), 0.0, RADIUS * float(np.cos(g)))) for g in (0.3, 0.8, 1.6)]


def solve_layers(factor: float, mesh: TetMesh | None = None, *, shell: float = 1.0) -> Solution:
    """Solve a ball of two layers, with a factor on the absorption of the inner one."""
    inner = Medium(sigma_a=0.05 * factor, sigma_s_prime=0.8, eta=1.4)
    outer = Medium(sigma_a=0.012 * shell, sigma_s_prime=1.1, eta=1.4)
    regions = [Region(sphere(8.0), inner)]
    return solve(sphere(RADIUS), outer, BEAM, regions=regions, detectors=DETECTORS, tolerance=0.05, mesh=mesh)


@pytest.fixture(scope="module")
def first() -> Solution:
    return solve_layers(1.0)


def test_readings_are_smooth_in_the_absorption_of_a_layer(first: Solution) -> None:
    """Residuals of a polynomial of degree 5; they are 1e-4 if patches are chosen anew, and 1e-9 otherwise."""
    factors = np.linspace(0.88, 1.12, 11)
    readings: FloatArray = np.log(
        [[reading.exitance for reading in solve_layers(factor, first.mesh).readings] for factor in factors.tolist()]
    )
    for reading in readings.T:
        fit = np.polynomial.Polynomial.fit(factors, reading, 5)
        assert np.abs(reading - fit(factors)).max() < 1e-7


def test_the_mesh_gives_the_readings_it_was_refined_for(first: Solution) -> None:
    again = solve_layers(1.0, first.mesh)
    for before, after in zip(first.readings, again.readings, strict=True):
        assert after.exitance == pytest.approx(before.exitance, rel=1e-9)


def test_another_medium_has_a_patch_of_its_own(first: Solution) -> None:
    (patch,) = first.patches
    assert kept_patch(first.mesh, patch.charges, patch.at_nodes, "linear") is not None
    # The decay length changes with the root of the absorption.
    (other,) = solve_layers(1.0, first.mesh, shell=1.1 * OTHER_MEDIUM**2).patches
    assert other.charges.name == patch.charges.name
    kept = kept_patch(first.mesh, other.charges, other.at_nodes, "linear")
    assert kept is not None
    assert (kept.cells == other.cells).all()
    assert kept_patch(first.mesh, patch.charges, patch.at_nodes, "linear") is None


def test_a_light_elsewhere_does_not_have_the_patch(first: Solution) -> None:
    beam = PencilBeam((0.0, 0.0, -30.0), (0.0, 0.0, 1.0))
    inner = Medium(sigma_a=0.05, sigma_s_prime=0.8, eta=1.4)
    outer = Medium(sigma_a=0.012, sigma_s_prime=1.1, eta=1.4)
    (other,) = solve(sphere(RADIUS), outer, [beam], regions=[Region(sphere(8.0), inner)], mesh=first.mesh).patches
    (patch,) = first.patches
    assert other.charges.name != patch.charges.name
    top = first.mesh.points[first.mesh.tetrahedra[other.cells]].mean(axis=1)[:, 2].max()
    assert other.cells.any()
    assert top < first.mesh.points[first.mesh.tetrahedra[patch.cells]].mean(axis=1)[:, 2].max()
