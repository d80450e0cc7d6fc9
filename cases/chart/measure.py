"""What a chart measures with: places on a surface, relative errors, the front of the best, fitted exponents."""

import math
from collections.abc import Sequence

import numpy as np
from scipy.spatial import cKDTree

from tetlux.meshing.arrays import BoolArray, FloatArray
from tetlux.meshing.subdivide import quartered
from tetlux.meshing.surface import Surface, longest_sides

# Exitance falls like 1/r³ from where light enters: the pieces that are sampled are no longer than this times their
# distance from the light, and no longer than this share of the body's diagonal.
PIECE, LONGEST_PIECE = 0.2, 0.05
# A rule of degree 2 inside a triangle (Strang & Fix 1973): the middle alone is where flat facets stray farthest.
_RULE = np.full((3, 3), 1.0 / 6.0) + 0.5 * np.eye(3)
# Fewer points than this make no line.
FEWEST_FOR_A_FIT = 3


def surface_samples(
    surface: Surface, lit: FloatArray, resolutions: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Points of a surface, dense where light is near, with the area that each stands for.

    Parameters
    ----------
    surface : Surface
    lit, resolutions : (s, 3), (s,) ndarray
        Where light is deposited, and the length to resolve there: see `tetlux.fem.grading.lit_points`.

    Returns
    -------
    points, normals : (n, 3) ndarray
        On the triangles of the surface, and their outward unit normals.
    weights : (n,) ndarray
        They add up to the area of the surface, unit².
    """
    tree = cKDTree(lit) if len(lit) else None
    corners, normals = surface.points[surface.faces], surface.normals
    done: list[tuple[FloatArray, FloatArray]] = []
    while len(corners):
        limit = np.full(len(corners), LONGEST_PIECE * surface.diagonal)
        if tree is not None:
            distance, nearest = tree.query(corners.mean(axis=1))
            limit = np.minimum(limit, PIECE * np.maximum(distance, 0.5 * resolutions[nearest]))
        small = longest_sides(corners) <= limit
        done.append((corners[small], normals[small]))
        corners, normals = quartered(corners[~small]), np.repeat(normals[~small], 4, axis=0)
    pieces, of_pieces = (np.concatenate(parts) for parts in zip(*done, strict=True))
    across = np.cross(pieces[:, 1] - pieces[:, 0], pieces[:, 2] - pieces[:, 0])
    areas = 0.5 * np.linalg.norm(across, axis=1)
    return (_RULE @ pieces).reshape(-1, 3), np.repeat(of_pieces, 3, axis=0), np.repeat(areas / 3.0, 3)


def relative_error(values: FloatArray, truth: FloatArray, weights: FloatArray) -> float:
    """Relative L2 error over a surface: ``sqrt(∫ (values - truth)² dA / ∫ truth² dA)``."""
    return math.sqrt(float(weights @ (values - truth) ** 2) / float(weights @ truth**2))


def pareto_front(seconds: Sequence[float], errors: Sequence[float]) -> BoolArray:
    """Which runs (n,) are not beaten: no other is as quick and as accurate, and better in one of the two."""
    front = np.zeros(len(seconds), dtype=bool)
    best = math.inf
    for index in np.lexsort((errors, seconds)):
        if errors[index] < best:
            best, front[index] = errors[index], True
    return front


def fitted_exponent(x: Sequence[float], y: Sequence[float]) -> float | None:
    """The p of ``y = c x^p`` by least squares of the logarithms; None for fewer than three points or one x."""
    if len(x) < FEWEST_FOR_A_FIT or min(*x, *y) <= 0 or max(x) == min(x):
        return None
    return float(np.polyfit(np.log(x), np.log(y), 1)[0])
