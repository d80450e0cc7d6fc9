"""Quadrature points of a surface where exitance is compared, and the relative error over them."""

import math
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from tetlux.meshing.arrays import BoolArray, FloatArray
from tetlux.meshing.surface.solids import Sphere
from tetlux.meshing.surface.subdivide import quarter_triangles
from tetlux.meshing.surface.surface import Surface
from tetlux.meshing.surface.triangles import longest_sides

# Exitance falls off like 1/r³ from the entry of light, so sampled pieces are no longer than PIECE times their distance
# from the light, and no longer than LONGEST_PIECE times the body's diagonal.
PIECE, LONGEST_PIECE = 0.2, 0.05
# A rule of degree 2 inside a triangle (Strang & Fix 1973), which avoids the centre, where flat facets lie deepest below
# a curved surface.
_RULE = np.full((3, 3), 1.0 / 6.0) + 0.5 * np.eye(3)


class Samples(NamedTuple):
    """Quadrature points of a surface.

    Attributes
    ----------
    points, normals : (n, 3) ndarray
        Points, unit, and outward unit normals there.
    weights : (n,) ndarray
        Quadrature weights, unit².
    """

    points: FloatArray
    normals: FloatArray
    weights: FloatArray

    def where(self, mask: BoolArray) -> "Samples":
        """The samples that a mask (n,) selects."""
        return Samples(self.points[mask], self.normals[mask], self.weights[mask])


def surface_samples(surface: Surface, lit: FloatArray, resolutions: FloatArray) -> Samples:
    """Choose quadrature points of a surface, densely where light is near.

    Parameters
    ----------
    surface : Surface
    lit, resolutions : (s, 3), (s,) ndarray
        Points where light is deposited, and the lengths to resolve there: see `tetlux.fem.grading.places_to_resolve`.

    Returns
    -------
    Samples
        On the triangles of the surface; the weights add up to its area.
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
        corners, normals = quarter_triangles(corners[~small]), np.repeat(normals[~small], 4, axis=0)
    pieces, of_pieces = (np.concatenate(parts) for parts in zip(*done, strict=True))
    across = np.cross(pieces[:, 1] - pieces[:, 0], pieces[:, 2] - pieces[:, 0])
    areas = 0.5 * np.linalg.norm(across, axis=1)
    return Samples((_RULE @ pieces).reshape(-1, 3), np.repeat(of_pieces, 3, axis=0), np.repeat(areas / 3.0, 3))


def project_to_sphere(samples: Samples, sphere: Sphere) -> Samples:
    """Move samples from the triangles of a sphere to the sphere itself, with weights for the same solid angles."""
    distances = np.linalg.norm(samples.points - sphere.center, axis=1)
    outward = (samples.points - sphere.center) / distances[:, None]
    stretch = np.einsum("ij,ij->i", outward, samples.normals) * (sphere.radius / distances) ** 2
    return Samples(sphere.center + sphere.radius * outward, outward, samples.weights * stretch)


def relative_error(values: FloatArray, truth: FloatArray, weights: FloatArray) -> float:
    """Relative L2 error over a surface: ``sqrt(∫ (values - truth)² dA / ∫ truth² dA)``."""
    return math.sqrt(float(weights @ (values - truth) ** 2) / float(weights @ truth**2))
