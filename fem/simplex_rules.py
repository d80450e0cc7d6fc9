"""Quadrature rules of the unit simplices, and rules for the fields of charges over triangles."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy.spatial import cKDTree

from tetlux.meshing.arrays import FloatArray, IntArray
from tetlux.meshing.describe import one_line
from tetlux.meshing.surface.subdivide import quarter_triangles
from tetlux.meshing.surface.triangles import longest_sides

# A triangle is cut in four at most this often.
MOST_CUTS = 12


@dataclass(frozen=True, eq=False)
class Rule:
    """A quadrature rule of a simplex.

    Attributes
    ----------
    points : (q, d + 1) ndarray
        Barycentric coordinates.
    weights : (q,) ndarray
        They sum to 1.
    """

    points: FloatArray
    weights: FloatArray

    __repr__ = one_line


@cache
def triangle_rule(degree: int) -> Rule:
    """The rule of a triangle that is exact for polynomials of a degree."""
    return _rule("RefTri", degree)


@cache
def tetrahedron_rule(degree: int) -> Rule:
    """The rule of a tetrahedron that is exact for polynomials of a degree up to 4; beyond, scikit-fem's is not."""
    return _rule("RefTet", degree)


def _rule(element: str, degree: int) -> Rule:
    # Imported here, since scikit-fem takes a sixth of the time that tetlux.fem takes to import.
    from skfem import quadrature, refdom  # noqa: PLC0415

    points, weights = quadrature.get_quadrature(getattr(refdom, element), degree)
    return Rule(np.column_stack([1.0 - points.sum(axis=0), points.T]), weights / weights.sum())


@dataclass(frozen=True, eq=False)
class Pieces:
    """Parts of triangles that are integrated by one rule.

    Attributes
    ----------
    owner : (p,) ndarray
        The triangle that each part belongs to.
    corners : (p, 3, 3) ndarray
        Barycentric coordinates of its corners in that triangle.
    share : float
        Its share of the triangle's area.
    rule : Rule
    """

    owner: IntArray
    corners: FloatArray
    share: float
    rule: Rule

    __repr__ = one_line


def cut_near_charges(
    count: int,
    locate: Callable[[IntArray, FloatArray], FloatArray],
    charges: FloatArray,
    degrees: Sequence[tuple[float, int]],
) -> Iterator[Pieces]:
    """Cut triangles until a rule integrates the fields of charges over each part.

    Parameters
    ----------
    count : int
        Number of triangles.
    locate : callable
        Returns the corners of parts, (p, 3, 3), given their owners (p,) and barycentric coordinates there (p, 3, 3).
    charges : (c, 3) ndarray
        Positions, unit.
    degrees : sequence of (float, int)
        Degrees of the rules, each up to a ratio of the longest side to the distance of the nearest charge, in ascending
        order. A part with a ratio above the last one is cut in four, at most `MOST_CUTS` times.

    Yields
    ------
    Pieces
    """
    tree = cKDTree(charges)
    owner, corners = np.arange(count), np.broadcast_to(np.eye(3), (count, 3, 3))
    for cut in range(MOST_CUTS + 1):
        if len(owner) == 0:
            return
        parts = locate(owner, corners)
        size = longest_sides(parts)
        ratio = size / np.maximum(tree.query(parts.mean(axis=1))[0], 1e-12 * size)
        if cut == MOST_CUTS:
            ratio = np.minimum(ratio, 0.5 * degrees[-1][0])
        least = 0.0
        for limit, degree in degrees:
            here = np.flatnonzero((least <= ratio) & (ratio < limit))
            if len(here):
                yield Pieces(owner[here], corners[here], 0.25**cut, triangle_rule(degree))
            least = limit
        left = ratio >= least
        owner, corners = np.repeat(owner[left], 4), quarter_triangles(corners[left])
