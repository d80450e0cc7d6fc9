"""Close the holes of a surface, or refuse it."""

from typing import Literal

import numpy as np

from tetlux.meshing.arrays import FloatArray, IntArray
from tetlux.meshing.describe import as_text
from tetlux.meshing.errors import InputError
from tetlux.meshing.notes import Note
from tetlux.meshing.repair.caps import cap
from tetlux.meshing.repair.rims import join_nested_rims
from tetlux.meshing.repair.topology import Edges, boundary_loops
from tetlux.meshing.surface.triangles import triangle_areas

Holes = Literal["small", "close", "refuse"]
# A hole wider than this share of the diagonal is a missing part; closing it would invent a shape.
LARGEST_HOLE = 0.05
# A wider hole is still closed if its cap is below this share of the squared diagonal: a slit.
SLIT = 1e-4
# A surface is unconnected triangles if more edges than this belong to one triangle only: in all, and per triangle.
MOST_RIMS = (300, 0.25)
# Unless these edges form rims of this many edges on average, as at the ends of a tube of long triangles.
LONG_RIM = 12
# Caps that a message describes one by one.
DESCRIBED = 5


def close_holes(
    points: FloatArray,
    faces: IntArray,
    name: str,
    unit: str,
    holes: Holes,
    repairs: list[str],
    warnings: list[str],
) -> tuple[FloatArray, IntArray]:
    """Cap small holes or all, and report each in `repairs`.

    Parameters
    ----------
    points : (n, 3) ndarray
    faces : (m, 3) ndarray
    name, unit : str
        Used in messages.
    holes : "small", "close" or "refuse"
        Which holes are capped: small ones (narrow ones, slits, those of three edges), all, or none.
    repairs, warnings : list of str
        Sentences are appended.

    Returns
    -------
    points, faces : ndarray

    Raises
    ------
    InputError
        If a hole is left open.
    """
    edges = Edges(faces)
    loops = boundary_loops(edges)
    _check_connected(edges, loops, len(faces), name)
    diagonal = float(np.linalg.norm(np.ptp(points, axis=0)))
    small = [_is_small(points[loop], diagonal) for loop in loops]
    if holes == "refuse" and loops:
        raise InputError(
            f"{_largest(name, points, loops)}; close it in a mesh editor, or leave out surface.holes: refuse."
        )
    wide = [loop for loop, is_small in zip(loops, small, strict=True) if not is_small]
    if holes == "small" and wide:
        raise InputError(
            f'{_largest(name, points, wide)}; cap it with surface.holes: close (in Python holes="close"), or close '
            "it in a mesh editor."
        )
    loops, overlapping = join_nested_rims(points, faces, loops)
    if overlapping:
        places = ", ".join(_middle(points, loop) for loop in overlapping[:DESCRIBED])
        warnings.append(
            Note(
                "holes-nested",
                f"holes lie within holes around {places}, and each has a cap of its own; if they are the two sides of "
                "a wall, make the winding of its triangles consistent in a mesh editor, and a ring closes it.",
                value=len(overlapping),
            )
        )
    small = [_is_small(points[loop], diagonal) for loop in loops]
    wide = [loop for loop, is_small in zip(loops, small, strict=True) if not is_small]
    new_points, new_faces, count = [points], [faces], len(points)
    for loop in loops:
        inner, added = cap(points, loop, count)
        count += len(inner)
        new_points.append(inner)
        new_faces.append(added)
    points = np.vstack(new_points)
    if any(small):
        repairs.append(f"closed {sum(small)} small {'hole' if sum(small) == 1 else 'holes'}.")
    if wide:
        areas = [float(triangle_areas(points, added)[1].sum()) for added in new_faces[1:]]
        wide_areas = [area for area, is_small in zip(areas, small, strict=True) if not is_small]
        repairs.append(_caps_sentence(wide_areas, [_middle(points, loop) for loop in wide], unit))
    return points, np.vstack(new_faces)


def check_closed(faces: IntArray, name: str) -> None:
    """Refuse a surface that is still open.

    Raises
    ------
    InputError
    """
    triangles = Edges(faces).triangles
    odd = int((triangles % 2).sum())
    if odd:
        raise InputError(
            f"{name}: the surface is open: {odd} edges belong to an odd number of triangles; "
            "repair it in a mesh editor."
        )


def _check_connected(edges: Edges, loops: list[IntArray], count: int, name: str) -> None:
    rims = int((edges.triangles == 1).sum())
    if rims > max(MOST_RIMS[0], MOST_RIMS[1] * count) and rims < LONG_RIM * len(loops):
        raise InputError(
            f"{name}: the surface is open: {rims:,} of {len(edges.triangles):,} edges belong to one triangle only, as "
            "if its triangles did not join; merge its vertices by distance in a mesh editor."
        )


def _is_small(rim: FloatArray, diagonal: float) -> bool:
    """Whether a hole is narrow or has three edges, so that its cap is nearly unique."""
    if len(rim) == 3 or np.linalg.norm(np.ptp(rim, axis=0)) <= LARGEST_HOLE * diagonal:
        return True
    spokes = rim - rim.mean(axis=0)
    fan = 0.5 * np.linalg.norm(np.cross(spokes, np.roll(spokes, -1, axis=0)), axis=1).sum()
    return bool(fan <= SLIT * diagonal**2)


def _largest(name: str, points: FloatArray, loops: list[IntArray]) -> str:
    """The first half of a refusal: edges, width and position of the widest hole."""
    widths = [float(np.linalg.norm(np.ptp(points[loop], axis=0))) for loop in loops]
    widest = int(np.argmax(widths))
    loop = loops[widest]
    others = "" if len(loops) == 1 else f", the largest of {len(loops)}"
    return (
        f"{name}: the surface is open: a hole of {len(loop)} edges, {widths[widest]:.4g} wide around "
        f"{_middle(points, loop)}{others}"
    )


def _caps_sentence(areas: list[float], places: list[str], unit: str) -> str:
    """A sentence with the number of caps, and the area and position of each, the largest first."""
    order = np.argsort(areas)[::-1]
    each = [f"{areas[i]:.4g} {unit}² around {places[i]}" for i in order[:DESCRIBED]]
    more = f" and {len(areas) - DESCRIBED} smaller ones" if len(areas) > DESCRIBED else ""
    return f"capped {len(areas)} {'hole' if len(areas) == 1 else 'holes'}: {', '.join(each)}{more}."


def _middle(points: FloatArray, loop: IntArray) -> str:
    """The centre of a rim, as text."""
    return as_text(points[loop].mean(axis=0), float(np.linalg.norm(np.ptp(points, axis=0))))
