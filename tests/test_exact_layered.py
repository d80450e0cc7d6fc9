"""The closed form of plates of layers."""

import numpy as np
import pytest

from tests.conftest import TISSUE
from tetlux.fem import Medium
from tetlux.fem.exact import layered, slab
from tetlux.fem.exact.checks import Face
from tetlux.meshing import InputError

UPPER = Medium(sigma_a=0.05, sigma_s_prime=2.0, eta=1.4)
LOWER = Medium(sigma_a=0.002, sigma_s_prime=0.4, eta=1.4)
RHO = np.array([0.0, 0.5, 3.0, 20.0])


@pytest.mark.parametrize("face", ["front", "back"])
@pytest.mark.parametrize("cut", [0.3, 2.0, 9.0])
def test_equal_layers_are_a_slab(face: Face, cut: float) -> None:
    for medium in (TISSUE, Medium(sigma_a=0.0, sigma_s_prime=1.0, eta=1.0)):
        found = layered.point_exitance([medium, medium], [cut, 10.0 - cut], depth=2.0, rho=RHO, face=face)
        truth = slab.point_exitance(medium, thickness=10.0, depth=2.0, rho=RHO, face=face)
        assert found == pytest.approx(truth, rel=1e-9, abs=1e-12 * truth.max())
        total = layered.point_total([medium, medium], [cut, 10.0 - cut], depth=2.0, face=face)
        assert total == pytest.approx(slab.point_total(medium, thickness=10.0, depth=2.0, face=face), rel=1e-12)


def test_two_layers_as_computed_elsewhere() -> None:
    """Another quadrature, whose code gives 0.0073599 of the documentation of LightPropagation.jl."""
    share = (1.0 - (0.4 / 2.4) ** 2) * UPPER.albedo
    depth = UPPER.mean_free_path
    found = share * layered.point_exitance([UPPER, LOWER], [6.0, 6.0], depth=depth, rho=[2.0, 5.0, 10.0])
    assert found == pytest.approx([7.265e-3, 2.777e-4, 4.87e-6], rel=6e-4)


def test_what_does_not_leave_is_absorbed() -> None:
    """Without absorption all leaves; and the exitance's integral over the face is the total."""
    media = [Medium(sigma_a=0.0, sigma_s_prime=s, eta=1.4) for s in (2.0, 0.3, 1.0)]
    both = [layered.point_total(media, [1.0, 2.0, 3.0], depth=1.5, face=face) for face in ("front", "back")]
    assert sum(both) == pytest.approx(1.0, rel=1e-12)
    rho, weights = np.polynomial.legendre.leggauss(400)
    rho, weights = 40.0 * (rho + 1.0), 40.0 * weights
    exitance = layered.point_exitance([UPPER, LOWER], [2.0, 3.0], depth=2.5, rho=rho)
    total = layered.point_total([UPPER, LOWER], [2.0, 3.0], depth=2.5)
    assert 2.0 * np.pi * (weights * rho) @ exitance == pytest.approx(total, rel=1e-6)


def test_turned_round_front_is_back() -> None:
    front = layered.point_exitance([UPPER, LOWER], [2.0, 3.0], depth=1.5, rho=RHO)
    back = layered.point_exitance([LOWER, UPPER], [3.0, 2.0], depth=3.5, rho=RHO, face="back")
    assert front == pytest.approx(back, rel=1e-12)


def test_plates_that_cannot_be() -> None:
    with pytest.raises(InputError, match="2 media for 1 layers"):
        layered.point_total([UPPER, LOWER], [1.0], depth=0.5)
    with pytest.raises(InputError, match="different refractive indices"):
        layered.point_total([UPPER, Medium(sigma_a=0.1, sigma_s_prime=1.0, eta=1.3)], [1.0, 1.0], depth=0.5)
    with pytest.raises(InputError, match=r'face is "side"'):
        layered.point_total([UPPER], [1.0], depth=0.5, face="side")  # type: ignore[arg-type]
