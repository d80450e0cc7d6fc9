"""Makes hare.stl: a sitting hare of 40 mm, fat in the body and thin in the ears. Run by hand.

The body is a smooth union of ellipsoids and capsules, given by approximate signed distances on a grid
(https://iquilezles.org/articles/distfunctions), contoured at distance zero and decimated to 9,600 triangles.
"""

from collections.abc import Callable
from functools import reduce
from pathlib import Path
from typing import cast

import numpy as np
import pyvista

from tetlux.meshing.arrays import FloatArray, Vector

SignedDistance = Callable[[FloatArray], FloatArray]

# Spacing of the grid, mm: eight points through an ear.
SPACING = 0.3
FACES = 9600
HEIGHT = 40.0


def turn(axis: int, degrees: float) -> FloatArray:
    """Rotation about a coordinate axis, right-handed, (3, 3)."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    i, j = [(1, 2), (2, 0), (0, 1)][axis]
    matrix = np.eye(3)
    matrix[[i, i, j, j], [i, j, i, j]] = c, -s, s, c
    return matrix


def ellipsoid(center: Vector, radii: Vector, rotation: FloatArray | None = None) -> SignedDistance:
    """An ellipsoid whose axes are the columns of `rotation`."""
    axes = np.eye(3) if rotation is None else rotation

    def distance(points: FloatArray) -> FloatArray:
        local = (points - center) @ axes / radii
        scaled, slope = np.linalg.norm(local, axis=1), np.linalg.norm(local / radii, axis=1)
        return np.asarray(scaled * (scaled - 1.0) / np.maximum(slope, 1e-9))

    return distance


def capsule(start: Vector, end: Vector, radius: float) -> SignedDistance:
    """A capsule: the points within `radius` of a segment."""
    a, along = np.asarray(start), np.subtract(end, start)

    def distance(points: FloatArray) -> FloatArray:
        share = np.clip((points - a) @ along / (along @ along), 0.0, 1.0)
        return np.asarray(np.linalg.norm(points - a - share[:, None] * along, axis=1) - radius)

    return distance


def smooth_min(a: FloatArray, b: FloatArray, blend: float) -> FloatArray:
    """The smaller of two distances, with a fillet about `blend` wide where they are nearly equal."""
    near = np.clip(1.0 - np.abs(a - b) / blend, 0.0, 1.0)
    return np.minimum(a, b) - 0.25 * blend * near**2


def smooth_union(blend: float, *shapes: SignedDistance) -> SignedDistance:
    """The union of shapes, with fillets."""
    return lambda points: reduce(lambda a, b: smooth_min(a, b, blend), (s(points) for s in shapes))


def subtract(blend: float, shape: SignedDistance, tool: SignedDistance) -> SignedDistance:
    """A shape without the part inside a tool."""
    return lambda points: -smooth_min(-shape(points), tool(points), blend)


def mirror(shape: Callable[[float], SignedDistance]) -> tuple[SignedDistance, SignedDistance]:
    """The left and the right shape of a pair; `shape` is called with +1 and -1."""
    return shape(1.0), shape(-1.0)


def ear(side: float) -> SignedDistance:
    """An ear: a long leaf, hollow towards the front, leaning back and outwards."""
    rotation = turn(0, -13.0 * side) @ turn(1, -14.0) @ turn(2, 28.0 * side)
    foot = np.array([4.6, 2.1 * side, 24.5])

    def at(x: float, z: float) -> Vector:
        px, py, pz = foot + rotation @ [x, 0.0, z]
        return float(px), float(py), float(pz)

    leaf = ellipsoid(at(0.0, 8.2), (1.75, 3.0, 9.2), rotation)
    return subtract(0.8, leaf, ellipsoid(at(2.35, 8.6), (1.6, 2.2, 7.0), rotation))


def torso() -> SignedDistance:
    """Back, chest, haunches and forelegs."""
    trunk = smooth_union(
        3.0,
        ellipsoid((-2.8, 0.0, 9.2), (9.3, 7.4, 9.2), turn(1, -25.0)),
        ellipsoid((2.6, 0.0, 14.0), (5.3, 5.2, 8.0), turn(1, 12.0)),
        # The belly reaches the ground, so that no tunnel is left between the legs.
        ellipsoid((1.0, 0.0, 2.6), (5.6, 6.2, 3.2)),
    )
    return smooth_union(
        1.3,
        trunk,
        *mirror(lambda s: ellipsoid((-1.9, 6.0 * s, 6.6), (6.4, 3.1, 6.2), turn(1, 25.0) @ turn(2, 6.0 * s))),
        *mirror(lambda s: capsule((5.7, 2.9 * s, 12.0), (7.8, 2.7 * s, 2.0), 1.8)),
    )


def head() -> SignedDistance:
    """Skull, muzzle, cheeks, nose and eyes."""
    skull = smooth_union(
        2.4,
        ellipsoid((5.4, 0.0, 23.3), (5.4, 4.5, 4.6), turn(1, 12.0)),
        ellipsoid((9.4, 0.0, 21.8), (3.3, 2.9, 2.7), turn(1, 18.0)),
        *mirror(lambda s: ellipsoid((7.0, 2.7 * s, 21.4), (2.7, 2.1, 2.3))),
    )
    eyes = mirror(lambda s: ellipsoid((7.9, 3.7 * s, 24.3), (1.3, 0.95, 1.35)))
    return smooth_union(0.4, skull, ellipsoid((12.2, 0.0, 22.3), (0.85, 1.15, 0.75)), *eyes)


def hare() -> SignedDistance:
    """The whole animal, facing +x, standing on z = 0."""
    body = smooth_union(
        1.5,
        torso(),
        ellipsoid((-11.3, 0.0, 4.6), (3.1, 2.9, 3.1)),
        *mirror(lambda s: ellipsoid((3.6, 6.6 * s, 1.3), (5.6, 2.1, 1.9), turn(2, -6.0 * s))),
        *mirror(lambda s: ellipsoid((8.6, 2.9 * s, 1.1), (2.7, 1.7, 1.6))),
    )
    whole = smooth_union(1.8, body, head(), *mirror(ear))
    return subtract(0.6, whole, lambda points: np.asarray(points[:, 2]))


def contour(shape: SignedDistance) -> pyvista.PolyData:
    """Contour a shape at distance zero, with `FACES` triangles and a height of `HEIGHT`."""
    low, high = np.array([-18.0, -14.0, -1.5]), np.array([18.0, 14.0, 46.0])
    grid = pyvista.ImageData(
        dimensions=tuple(np.ceil((high - low) / SPACING).astype(int) + 1),
        spacing=(SPACING,) * 3,
        origin=tuple(low),
    )
    grid.point_data["distance"] = shape(np.asarray(grid.points, dtype=np.float64))
    surface = grid.contour([0.0], scalars="distance").connectivity("largest")
    # A low-pass filter removes the slivers of marching cubes without shrinking the ears.
    surface = surface.smooth_taubin(n_iter=20, pass_band=0.15)
    surface = surface.decimate(1.0 - FACES / surface.n_cells, volume_preservation=True).clean()
    surface = surface.compute_normals(auto_orient_normals=True, point_normals=False)
    surface.points = (surface.points - [0.0, 0.0, surface.bounds[4]]) * (
        HEIGHT / (surface.bounds[5] - surface.bounds[4])
    )
    return cast("pyvista.PolyData", surface)


if __name__ == "__main__":
    target = Path(__file__).with_name("hare.stl")
    made = contour(hare())
    made.save(target, binary=True)
    print(f"{target}: {made.n_cells} triangles, {made.volume:.0f} mm³, bounds {np.round(made.bounds, 1)}")
