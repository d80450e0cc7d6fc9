"""Remove specks: separate bodies so small that the mesher would lose them."""

import numpy as np

from tetlux.meshing.arrays import BoolArray, FloatArray, IntArray
from tetlux.meshing.describe import as_text
from tetlux.meshing.repair.topology import bodies, compact
from tetlux.meshing.resolution import DEBRIS, DEVIATION, DEVIATION_OF_THICKNESS
from tetlux.meshing.surface.triangles import body_sizes

# A body with a mean thickness 2 V/A below this many deviations of the mesher is dropped. Balls and cubes beside a ball
# of 20 were meshed down to .2: in 2 s above 1, 3 s at .45, 6 to 12 s at .2, where a second attempt is needed.
SPECK = 0.5
# Specks whose positions a message lists.
DESCRIBED = 3


def drop_specks(points: FloatArray, faces: IntArray, unit: str, repairs: list[str]) -> tuple[FloatArray, IntArray]:
    """Remove bodies below the mesher's resolution that are a small part of the volume, and report them in `repairs`.

    Parameters
    ----------
    points : (n, 3) ndarray
    faces : (m, 3) ndarray
        Closed, with consistent winding.
    unit : str
    repairs : list of str
        A sentence is added to it.
    """
    body = bodies(len(points), faces)
    count = int(body.max()) + 1
    if count == 1:
        return points, faces
    volume, area = body_sizes(points, faces, body)
    large = volume >= DEBRIS * volume.sum()
    if large.all() or not large.any():
        return points, faces
    kept = large
    speck = ~large & (2.0 * volume < SPECK * _deviation(points, faces, body, kept, volume, area) * area)
    # Each kept body enlarges the bounding box, and so the mesher's deviation.
    while (~speck != kept).any():
        kept = ~speck
        speck |= ~large & (2.0 * volume < SPECK * _deviation(points, faces, body, kept, volume, area) * area)
    if not speck.any():
        return points, faces
    repairs.append(_sentence(points, faces, body, np.flatnonzero(speck), unit))
    return compact(points, faces[~speck[body]])


def _deviation(
    points: FloatArray, faces: IntArray, body: IntArray, kept: BoolArray, volume: FloatArray, area: FloatArray
) -> float:
    """The mesher's deviation for the bodies that are kept, (b,)."""
    diagonal = float(np.linalg.norm(np.ptp(points[faces[kept[body]]].reshape(-1, 3), axis=0)))
    thickness = float(2.0 * volume[kept].sum() / area[kept].sum())
    return min(DEVIATION * diagonal, DEVIATION_OF_THICKNESS * thickness)


def _sentence(points: FloatArray, faces: IntArray, body: IntArray, specks: IntArray, unit: str) -> str:
    """A sentence with the number and size of specks, and the positions of the first ones."""
    order = np.argsort(body, kind="stable")
    first = np.searchsorted(body[order], np.arange(int(body.max()) + 1))
    corners = points[faces[order]]
    extent = np.maximum.reduceat(corners.max(axis=1), first) - np.minimum.reduceat(corners.min(axis=1), first)
    largest = float(np.linalg.norm(extent[specks], axis=1).max())
    size = float(np.linalg.norm(np.ptp(points, axis=0)))
    middles = [points[faces[body == one]].mean(axis=(0, 1)) for one in specks[:DESCRIBED]]
    places = ", ".join(as_text(middle, size) for middle in middles)
    more = f" and {len(specks) - DESCRIBED} more places" if len(specks) > DESCRIBED else ""
    what = "a speck" if len(specks) == 1 else f"{len(specks):,} specks"
    return f"dropped {what} of up to {largest:.2g} {unit}, smaller than the mesh can show, at {places}{more}."
