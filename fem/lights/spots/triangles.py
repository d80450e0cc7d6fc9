"""A spot on triangles: those that it does not resolve are split, and each is sampled."""

import numpy as np

from tetlux.fem.lights.spots.plane import low_discrepancy
from tetlux.fem.lights.spots.spot import Spot
from tetlux.meshing.arrays import FloatArray, IntArray
from tetlux.meshing.surface.subdivide import quarter_triangles
from tetlux.meshing.surface.triangles import longest_sides

# Splits in four of one triangle, at most.
MOST_SPLITS = 16
# Samples of the spot per triangle: minimum, maximum, and the total in between.
SAMPLES = (16, 256, 500_000)


def triangle_samples(count: int) -> FloatArray:
    """Barycentric coordinates (count, 3) of points spread evenly over a triangle."""
    u, v = low_discrepancy(count).T
    # A square folded along its diagonal is a triangle.
    u, v = np.where(u + v > 1.0, (1.0 - u, 1.0 - v), (u, v))
    return np.column_stack([1.0 - u - v, u, v])


def area_vectors(corners: FloatArray) -> FloatArray:
    """Normals of triangles (p, 3, 3) with the length of their areas, (p, 3), unit²."""
    return 0.5 * np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])


def split_for_spot(spot: Spot, corners: FloatArray, direction: FloatArray) -> tuple[FloatArray, IntArray]:
    """Split triangles until each resolves the spot, and drop those away from it.

    Parameters
    ----------
    spot : Spot
    corners : (f, 3, 3) ndarray
        Of the triangles, unit.
    direction : (3,) ndarray
        Unit vector along the beam.

    Returns
    -------
    corners : (p, 3, 3) ndarray
        Of the pieces.
    owners : (p,) ndarray
        The triangle that each is a piece of.
    """
    center, owner = np.asarray(spot.center, dtype=float), np.arange(len(corners))
    pieces, owners = [], []
    for split in range(MOST_SPLITS):
        size = longest_sides(corners)
        near = spot.distances(corners.mean(axis=1) - center, direction) <= size
        corners, owner, size = corners[near], owner[near], size[near]
        coarse = size > spot.detail
        crossing = np.flatnonzero(~coarse & (size > spot.edge_size))
        brightness = spot.brightness(corners[crossing].reshape(-1, 3) - center, direction).reshape(-1, 3)
        coarse[crossing] = np.ptp(brightness, axis=1) > 0
        coarse &= split < MOST_SPLITS - 1
        pieces.append(corners[~coarse])
        owners.append(owner[~coarse])
        corners, owner = quarter_triangles(corners[coarse]), np.repeat(owner[coarse], 4)
        if len(corners) == 0:
            break
    return np.concatenate(pieces), np.concatenate(owners)


def sample_spot(spot: Spot, corners: FloatArray, direction: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Sample a spot on triangles.

    Parameters
    ----------
    spot : Spot
    corners : (p, 3, 3) ndarray
        Of the triangles, unit.
    direction : (3,) ndarray
        Unit vector along the beam.

    Returns
    -------
    centroids : (p, 3) ndarray
        Mean place on each triangle weighted by brightness, unit; the center of the spot where it is dark.
    brightness : (p,) ndarray
        Mean over each triangle.
    """
    least, most, total = SAMPLES
    count = int(np.clip(total // max(len(corners), 1), least, most))
    center = np.asarray(spot.center, dtype=float)
    points = triangle_samples(count) @ (corners - center)
    brightness = spot.brightness(points.reshape(-1, 3), direction).reshape(-1, count)
    mean = brightness.mean(axis=1)
    centroids = np.einsum("pk,pki->pi", brightness, points) / np.where(mean > 0, count * mean, 1.0)[:, None]
    return center + centroids, mean
