"""Specks: separate bodies so small that the mesher would lose them."""

import numpy as np

from tetlux.meshing.arrays import FloatArray, IntArray, summed
from tetlux.meshing.mesher import DEBRIS, DEVIATION, DEVIATION_OF_THICKNESS
from tetlux.meshing.surface import triangle_areas
from tetlux.meshing.topology import bodies, compact

# A body of a mean thickness 2 V/A below this many of the mesher's deviations is lost.
SPECK = 0.5
# Specks whose places are told.
DESCRIBED = 3


def drop_specks(points: FloatArray, faces: IntArray, unit: str, repairs: list[str]) -> tuple[FloatArray, IntArray]:
    """Remove bodies below the mesher's resolution that are a small part of the whole, and say so.

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
    volume, area = _volumes_and_areas(points, faces, body, count)
    large = volume >= DEBRIS * volume.sum()
    if large.all() or not large.any():
        return points, faces
    diagonal = float(np.linalg.norm(np.ptp(points[faces[large[body]]].reshape(-1, 3), axis=0)))
    thickness = 2.0 * volume[large].sum() / area[large].sum()
    deviation = min(DEVIATION * diagonal, DEVIATION_OF_THICKNESS * thickness)
    speck = ~large & (2.0 * volume < SPECK * deviation * area)
    if not speck.any():
        return points, faces
    repairs.append(_sentence(points, faces, body, np.flatnonzero(speck), unit))
    return compact(points, faces[~speck[body]])


def _volumes_and_areas(
    points: FloatArray, faces: IntArray, body: IntArray, count: int
) -> tuple[FloatArray, FloatArray]:
    """Volume and area of each body, whichever way it is turned."""
    corners = points[faces]
    middle = corners.mean(axis=1)
    centre = np.column_stack([summed(body, x, count) for x in middle.T]) / np.bincount(body, minlength=count)[:, None]
    a, b, c = (corners[:, i] - centre[body] for i in range(3))
    volume = np.abs(summed(body, np.einsum("ij,ij->i", a, np.cross(b, c)) / 6.0, count))
    return volume, summed(body, triangle_areas(points, faces)[1], count)


def _sentence(points: FloatArray, faces: IntArray, body: IntArray, specks: IntArray, unit: str) -> str:
    places, sizes = [], []
    for one in specks:
        corners = points[faces[body == one]].reshape(-1, 3)
        sizes.append(float(np.linalg.norm(np.ptp(corners, axis=0))))
        places.append("(" + ", ".join(f"{x:.4g}" for x in corners.mean(axis=0)) + ")")
    more = f" and {len(places) - DESCRIBED} more places" if len(places) > DESCRIBED else ""
    what = "a speck" if len(places) == 1 else f"{len(places)} specks"
    return (
        f"dropped {what} of up to {max(sizes):.2g} {unit}, smaller than the mesh can show, at "
        f"{', '.join(places[:DESCRIBED])}{more}."
    )
