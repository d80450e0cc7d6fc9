"""Bodies that are hard to mesh: needles, thin plates, touching bodies, cavities, necks and spikes."""

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from tetlux.meshing import shapes
from tetlux.meshing.arrays import FloatArray, IntArray, Vector
from tetlux.meshing.repair.pipeline import surface_from_arrays
from tetlux.meshing.surface.surface import Surface

SEGMENTS = 32


def revolve(heights: npt.ArrayLike, radii: npt.ArrayLike, name: str) -> Surface:
    """Make a surface of revolution about z.

    Parameters
    ----------
    heights : (k + 2,) array_like
        Ascending; the first and the last are the heights of the tips.
    radii : (k,) array_like
        Radii at the heights between.
    name : str

    Returns
    -------
    Surface
    """
    z, r = np.asarray(heights, dtype=float), np.asarray(radii, dtype=float)
    angle = 2.0 * np.pi * np.arange(SEGMENTS) / SEGMENTS
    rings = np.array([[(a * np.cos(t), a * np.sin(t), h) for t in angle] for a, h in zip(r, z[1:-1], strict=True)])
    points = np.vstack([rings.reshape(-1, 3), [(0.0, 0.0, z[0]), (0.0, 0.0, z[-1])]])
    return surface_from_arrays(points, _faces_of_revolution(len(r)), name=name)


def _faces_of_revolution(rings: int) -> IntArray:
    """Triangles between rings of points, and to the lower and upper tip, whose points follow those of the rings."""
    here = np.arange(SEGMENTS)
    after = (here + 1) % SEGMENTS
    faces = []
    for ring in range(rings - 1):
        low, high = ring * SEGMENTS, (ring + 1) * SEGMENTS
        faces += [np.column_stack([here + low, after + low, after + high])]
        faces += [np.column_stack([here + low, after + high, here + high])]
    bottom, top, last = rings * SEGMENTS, rings * SEGMENTS + 1, (rings - 1) * SEGMENTS
    faces += [np.column_stack([after, here, np.full(SEGMENTS, bottom)])]
    faces += [np.column_stack([here + last, after + last, np.full(SEGMENTS, top)])]
    return np.vstack(faces)


def merge(first: Surface, second: Surface, name: str) -> Surface:
    """Combine the triangles of two surfaces in one."""
    points = np.vstack([first.points, second.points])
    return surface_from_arrays(points, np.vstack([first.faces, second.faces + len(first.points)]), name=name)


def hollow(outside: float, inside: float, name: str) -> Surface:
    """A ball with a concentric spherical cavity."""
    hole = shapes.sphere(inside, subdivisions=3)
    return merge(shapes.sphere(outside, subdivisions=3), Surface(hole.points, hole.faces[:, ::-1]), name)


def stretch(surface: Surface, factors: FloatArray, name: str) -> Surface:
    """Scale a surface along the axes by factors (3,)."""
    return surface_from_arrays(surface.points * factors, surface.faces, name=name)


def _neck() -> Surface:
    z = np.linspace(-8.0, 8.0, 33)
    balls = np.sqrt(np.maximum(0.0, 16.0 - (np.abs(z[1:-1]) - 4.0) ** 2))
    return revolve(z, np.maximum(balls, 0.3), "neck")


def _spike() -> Surface:
    z = np.concatenate([[0.0], np.linspace(0.0, 18.0, 13), [20.0]])
    return revolve(z, 4.0 * (1.0 - z[1:-1] / 20.0), "spike")


def _needle() -> Surface:
    return stretch(shapes.sphere(1.0, subdivisions=2), np.array([0.5, 0.5, 10.0]), "needle")


def _touching_balls() -> Surface:
    first, second = (shapes.sphere(4.0, center=(0.0, 0.0, z), subdivisions=3) for z in (4.0, -4.0))
    return merge(first, second, "touching balls")


def _touching_boxes() -> Surface:
    """Two boxes that share an edge."""
    first, second = (shapes.box((6.0, 6.0, 6.0), center=(x, 0.0, x)) for x in (3.0, -3.0))
    return merge(first, second, "touching boxes")


# Each body with a point inside it; lengths in mean free paths.
BODIES: dict[str, tuple[Callable[[], Surface], Vector]] = {
    "needle": (_needle, (0.1, 0.0, 5.0)),
    "thin plate": (lambda: shapes.box((20.0, 20.0, 0.4)), (1.0, 2.0, 0.1)),
    "spike": (_spike, (0.1, 0.0, 15.0)),
    "thin neck": (_neck, (0.1, 0.0, 5.0)),
    "thin ring": (lambda: shapes.torus(8.0, 0.5, segments=48), (8.1, 0.0, 0.0)),
    "touching balls": (_touching_balls, (0.1, 0.2, 1.0)),
    "touching boxes": (_touching_boxes, (0.3, 0.2, 0.5)),
    "cavity": (lambda: hollow(8.0, 5.0, "cavity"), (0.1, 0.2, 7.0)),
    "thin shell": (lambda: hollow(8.0, 7.4, "thin shell"), (0.1, 0.2, 7.7)),
}
