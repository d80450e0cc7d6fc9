"""The charges of point sources: the sources themselves, and their images in the plane that touches the surface."""

import numpy as np

from tetlux.fem.charges.kernel import equation_of
from tetlux.fem.known.charges import Charges
from tetlux.fem.media.medium import Medium
from tetlux.fem.media.varying import VaryingMedium
from tetlux.meshing.arrays import BoolArray, FloatArray
from tetlux.meshing.surface.surface import Surface

# The line of sinks is cut into panels, each twice as long as what is below it, with this many Gauss points each, up to
# the height at which exp(-REACH) of its strength is left.
PANEL_POINTS = 2
REACH = 14.0
# A charge keeps this share of its height above the entry clear of any other part of the body.
CLEARANCE = 0.5
# Near its source the fluence grows like 1/r: at a node closer than this share of the source's depth, or of a mean free
# path, the fluence at that distance is used.
CLOSEST = 0.02
# More charges than this cost more than the tetrahedra that they save.
MOST_IMAGE_CHARGES = 3000


def charges_of(
    points: FloatArray,
    powers: FloatArray,
    surface: Surface,
    medium: Medium,
    *,
    images: bool | BoolArray,
    most: int = MOST_IMAGE_CHARGES,
    region: int | None = None,
    varying: VaryingMedium | None = None,
    shift: complex = 0.0,
) -> Charges | None:
    """Charges of point sources, each with its images in the tangent plane at the nearest point of the surface.

    Parameters
    ----------
    points : (s, 3) ndarray
        Inside the body.
    powers : (s,) ndarray
        W.
    surface : Surface
    medium : Medium
    images : bool or (s,) ndarray of bool
        Whether sources have images, all or each; without images, the fluence is that of free space.
    most : int
        Largest number of charges.
    region : int, optional
        The region that the sources lie in, if the body has several media.
    varying : VaryingMedium, optional
        The medium of that region if it varies; `medium` is what it is at the sources.
    shift : complex
        What is added to sigma_a, 1/unit.

    Returns
    -------
    Charges or None
        None if there would be more than `most`.
    """
    positions, strengths, count = [points], [powers], len(points)
    feet, normals = surface.project(points)
    depths = np.linalg.norm(feet - points, axis=1)
    mirrored = np.broadcast_to(images, len(points)) & (depths > 0)
    for i in np.flatnonzero(mirrored).tolist():
        if count > most:
            return None
        foot, normal, depth, power = feet[i], normals[i], float(depths[i]), float(powers[i])
        heights, weights = _image_line(depth, medium.extrapolation_length)
        line = foot + heights[:, None] * normal
        clear = np.linalg.norm(surface.closest(line)[0] - line, axis=1) >= CLEARANCE * heights
        clear &= ~surface.contains(line)
        # The line ends at the first charge that is too close to another part of the body, or inside it.
        clear = np.logical_and.accumulate(clear)
        positions.append(line[clear])
        strengths.append(power * weights[clear])
        count += int(clear.sum())
    if count > most:
        return None
    closest = CLOSEST * min(medium.mean_free_path, float(depths.min()))
    return Charges(
        equation_of(medium, shift),
        np.vstack(positions),
        np.concatenate(strengths),
        closest,
        sources=len(points),
        medium=medium,
        region=region,
        varying=varying,
    )


def _image_line(depth: float, zb: float) -> tuple[FloatArray, FloatArray]:
    """Heights above the plane and strengths of the images of a unit source: the mirror first, then the sinks."""
    edges = [0.0, depth]
    while edges[-1] < REACH * zb:
        edges.append(min(2.0 * edges[-1] + depth, REACH * zb))
    low, high = np.array(edges[:-1])[:, None], np.array(edges[1:])[:, None]
    nodes, weights = np.polynomial.legendre.leggauss(PANEL_POINTS)
    along = (0.5 * (low + high) + 0.5 * (high - low) * nodes).ravel()
    sinks = -2.0 / zb * np.exp(-along / zb) * (0.5 * (high - low) * weights).ravel()
    return depth + np.concatenate([[0.0], along]), np.concatenate([[1.0], sinks])
