"""Quadrature rules of simplices, and triangles that are cut near charges."""

from math import factorial

import numpy as np
import pytest

from tetlux.fem.simplex_rules import Rule, cut_near_charges, tetrahedron_rule, triangle_rule
from tetlux.meshing.arrays import FloatArray, IntArray

DEGREES = ((0.2, 4), (2.0, 8))
TRIANGLES = np.array([[[0.0, 0, 0], [4, 0, 0], [0, 3, 0]], [[50.0, 0, 0], [54, 0, 0], [50, 3, 0]]])


@pytest.mark.parametrize(
    ("rule", "degree"),
    [*((triangle_rule(degree), degree) for degree in (2, 4, 6, 8, 10)), (tetrahedron_rule(4), 4)],
)
def test_rules_are_exact_for_their_degree(rule: Rule, degree: int) -> None:
    corners = rule.points.shape[1]
    assert rule.weights.sum() == pytest.approx(1.0)
    # The mean of lambda^n over a simplex of dimension d is n! d!/(n + d)!.
    exact = factorial(degree) * factorial(corners - 1) / factorial(degree + corners - 1)
    for corner in range(corners):
        assert rule.weights @ rule.points[:, corner] ** degree == pytest.approx(exact)


@pytest.mark.parametrize("height", [1e-3, 0.0])
def test_parts_cover_each_triangle_once(height: float) -> None:
    """Also where a charge lies in one, and cutting ends at the most cuts."""
    charge = np.array([[0.7, 0.6, height]])

    def locate(owner: IntArray, places: FloatArray) -> FloatArray:
        return np.asarray(places @ TRIANGLES[owner])

    covered, cuts = np.zeros(2), np.zeros(2, dtype=np.int64)
    for pieces in cut_near_charges(2, locate, charge, DEGREES):
        covered += np.bincount(pieces.owner, minlength=2) * pieces.share
        np.maximum.at(cuts, pieces.owner, round(np.log2(1.0 / pieces.share) / 2.0))
        assert np.abs(np.linalg.det(pieces.corners)) == pytest.approx(pieces.share)
    assert covered == pytest.approx(1.0)
    # The far triangle is not cut; the near one down to parts twice as long as the charge is high, or to the limit.
    assert cuts.tolist() == [12, 0]


def test_the_field_of_a_charge_near_by_is_integrated() -> None:
    """By the solid angle: the flux of 1/(4 pi r) through a triangle is its share of the sphere."""
    charge = np.array([[0.7, 0.6, 0.05]])
    corners = TRIANGLES[:1]
    flux = 0.0
    for pieces in cut_near_charges(1, lambda owner, places: np.asarray(places @ corners[owner]), charge, DEGREES):
        points = (pieces.rule.points @ pieces.corners) @ corners[pieces.owner]
        distance = np.linalg.norm(points - charge, axis=2)
        flux += float((0.05 / (4.0 * np.pi * distance**3) @ pieces.rule.weights).sum() * pieces.share * 6.0)
    a, b, c = corners[0] - charge
    la, lb, lc = (np.linalg.norm(each) for each in (a, b, c))
    below = la * lb * lc + (a @ b) * lc + (b @ c) * la + (c @ a) * lb
    assert flux == pytest.approx(2.0 * np.arctan2(np.linalg.det([a, b, c]), below) * -1.0 / (4.0 * np.pi), rel=1e-5)
