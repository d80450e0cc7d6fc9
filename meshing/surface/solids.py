"""The built-in shapes by dimensions and placement, independent of their triangles.

A `Surface` that was made by `sphere`, `slab`, `box`, `cylinder` or `torus` carries one of these as its `shape`, so that
closed forms and exact normals need not be guessed from its triangles. All lengths are in the surface's unit.
"""

from dataclasses import dataclass

import numpy as np

from tetlux.meshing.arrays import FloatArray, Vector

# Largest distance of a vertex from the shape that it lies on, as a share of the largest coordinate.
ON_SHAPE = 1e-9


@dataclass(frozen=True)
class Sphere:
    """A sphere."""

    radius: float
    center: Vector = (0.0, 0.0, 0.0)

    def distance(self, points: FloatArray) -> FloatArray:
        """Distance (n,) of points (n, 3) from the surface of the sphere."""
        return np.asarray(np.abs(np.linalg.norm(points - self.center, axis=1) - self.radius))


@dataclass(frozen=True)
class Box:
    """A box with edges of lengths `size` along the axes."""

    size: Vector
    center: Vector = (0.0, 0.0, 0.0)

    def distance(self, points: FloatArray) -> FloatArray:
        """Distance (n,) of points (n, 3) from the faces of the box."""
        return _distance_from_box(points - self.center, 0.5 * np.array(self.size))


@dataclass(frozen=True)
class Slab:
    """A square plate of `width` x `width` between z = -depth and z = 0, centred on the z axis."""

    width: float
    depth: float

    def distance(self, points: FloatArray) -> FloatArray:
        """Distance (n,) of points (n, 3) from the faces of the plate."""
        half = 0.5 * np.array([self.width, self.width, self.depth])
        return _distance_from_box(points - np.array([0.0, 0.0, -half[2]]), half)


@dataclass(frozen=True)
class Cylinder:
    """A cylinder along z with flat ends, centred at `center`."""

    radius: float
    height: float
    center: Vector = (0.0, 0.0, 0.0)

    def distance(self, points: FloatArray) -> FloatArray:
        """Distance (n,) of points (n, 3) from the side and the ends."""
        x, y, z = (points - self.center).T
        return _distance_from_box(np.column_stack([np.hypot(x, y), z]), np.array([self.radius, 0.5 * self.height]))


@dataclass(frozen=True)
class Torus:
    """A torus around a line along z: a tube of radius `minor` around a circle of radius `major`."""

    major: float
    minor: float
    center: Vector = (0.0, 0.0, 0.0)

    def distance(self, points: FloatArray) -> FloatArray:
        """Distance (n,) of points (n, 3) from the surface of the tube."""
        x, y, z = (points - self.center).T
        return np.asarray(np.abs(np.hypot(np.hypot(x, y) - self.major, z) - self.minor))


Shape = Sphere | Box | Slab | Cylinder | Torus


def lies_on(points: FloatArray, shape: Shape) -> bool:
    """Whether all points (n, 3) lie on the surface of a shape, within rounding."""
    scale = float(np.abs(points).max(initial=0.0))
    return bool((shape.distance(points) <= ON_SHAPE * scale).all())


def _distance_from_box(points: FloatArray, half: FloatArray) -> FloatArray:
    """Distance (n,) of points (n, d) from the boundary of a box around the origin, given half its edges (d,)."""
    beyond = np.abs(points) - half
    outside = np.linalg.norm(np.maximum(beyond, 0.0), axis=1)
    return np.asarray(outside + np.abs(np.minimum(beyond.max(axis=1), 0.0)))
