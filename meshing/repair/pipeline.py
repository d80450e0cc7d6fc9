"""Check a triangle mesh, repair what can be repaired safely, and report both."""

from typing import get_args

import numpy as np
import numpy.typing as npt

from tetlux.meshing.arrays import FloatArray, IntArray
from tetlux.meshing.errors import InputError
from tetlux.meshing.notes import Note
from tetlux.meshing.repair.crossings import count_self_intersections
from tetlux.meshing.repair.holes import Holes, check_closed, close_holes
from tetlux.meshing.repair.merge import MERGE_TOLERANCE, merge_vertices, single_faces, without_pairs
from tetlux.meshing.repair.orient import face_outward, wind_consistently
from tetlux.meshing.repair.pinches import mend_parts
from tetlux.meshing.repair.seams import stitch
from tetlux.meshing.repair.sides import drop_second_sides
from tetlux.meshing.repair.specks import drop_specks
from tetlux.meshing.repair.topology import Edges, bodies, compact
from tetlux.meshing.resolution import FLAT
from tetlux.meshing.surface.surface import UNITS, Surface
from tetlux.meshing.surface.triangles import signed_volume, triangle_areas

# Bounds on coordinates, in any unit.
LONGEST = 1e30
# A surface that crosses itself at more than this number and this share of triangles is refused: the mesher would take
# minutes.
TANGLE = (100, 0.75)
# Coordinates rounded to more than this share of the diagonal cause a warning.
COARSE = 1e-4


def surface_from_arrays(
    points: npt.ArrayLike,
    faces: npt.ArrayLike,
    *,
    unit: str = "mm",
    name: str = "surface",
    holes: Holes = "small",
) -> Surface:
    """Check a triangle mesh, repair what can be repaired safely, and report the repairs.

    Parameters
    ----------
    points : (n, 3) array_like
    faces : (m, 3) array_like
    unit : str
        One of nm, um, mm, cm, m, in.
    name : str
        Used in messages.
    holes : "small", "close" or "refuse"
        Which holes are capped: small ones (up to 5 % of the diagonal wide, slits, those of three edges), all, or
        none.

    Returns
    -------
    Surface
        Closed and outward oriented; `repairs` and `warnings` list what was found.

    Raises
    ------
    InputError
        If the mesh bounds no body: empty, not finite, flat, or open.

    Examples
    --------
    >>> from tetlux.meshing import box
    >>> cube = box((1.0, 1.0, 1.0))
    >>> surface_from_arrays(cube.points, cube.faces[2:], holes="close").volume
    1.0
    """
    if unit not in UNITS:
        raise InputError(f'unit "{unit}" is not known; give one of {", ".join(UNITS)}.')
    if holes not in get_args(Holes):
        raise InputError(f'holes is "{holes}"; give one of {", ".join(get_args(Holes))}.')
    points, faces = _check_arrays(points, faces, name)
    repairs: list[str] = []
    warnings: list[str] = []
    rounding = _rounding(points)
    points, faces = _connect(points, faces, name, rounding, repairs)
    points, faces = close_holes(points, faces, name, unit, holes, repairs, warnings)
    # A loose triangle was closed by its own reversed copy.
    points, faces = compact(points, without_pairs(faces))
    _check_solid(points, faces, name, rounding, least=4)
    check_closed(faces, name)
    faces = wind_consistently(faces, name, repairs)
    points, faces = drop_specks(points, faces, unit, repairs)
    faces, nested = face_outward(points, faces, name, repairs, warnings)
    points, faces = compact(points, mend_parts(points, faces, bodies(len(points), faces), repairs))
    crowded = int((Edges(faces).triangles > 2).sum())
    if crowded:
        warnings.append(
            Note(
                "edges-shared",
                f"{crowded} {'edge is' if crowded == 1 else 'edges are'} shared by more than two triangles: parts of "
                "the body touch there, and no light passes where they share an edge only.",
                value=crowded,
            )
        )
    diagonal = float(np.linalg.norm(np.ptp(points, axis=0)))
    if 2.0 * signed_volume(points, faces) <= FLAT * diagonal * float(triangle_areas(points, faces)[1].sum()):
        raise InputError(f"{name}: the surface is flat and encloses no volume; give a closed surface.")
    crossing = _check_crossings(points, faces, name, warnings)
    if rounding > COARSE:
        warnings.append(
            Note(
                "far-from-origin",
                f"the surface lies so far from the origin that its coordinates are rounded to {rounding:.1%} of its "
                "size; move it to the origin where it was made, and write it again.",
                value=rounding,
            )
        )
    # Walls between touching bodies count twice.
    overlaps = nested or crossing or crowded > 0
    return Surface(points, faces, unit, name, tuple(repairs), tuple(warnings), overlaps)


def _connect(
    points: FloatArray, faces: IntArray, name: str, rounding: float, repairs: list[str]
) -> tuple[FloatArray, IntArray]:
    """Merge vertices, stitch seams and remove duplicate triangles."""
    points, faces = merge_vertices(points, faces, repairs)
    points, faces = drop_second_sides(points, faces, repairs)
    points, faces = compact(points, single_faces(points, faces, repairs))
    _check_solid(points, faces, name, rounding, least=1)
    joined, stitched = stitch(points, faces, repairs)
    if stitched is faces:
        return joined, stitched
    # A second side in pieces is recognised once its seams are stitched.
    joined, stitched = drop_second_sides(joined, stitched, repairs)
    return compact(joined, single_faces(joined, stitched, repairs))


def _check_solid(points: FloatArray, faces: IntArray, name: str, rounding: float, least: int) -> None:
    """Refuse a surface with too few triangles or without volume."""
    if len(faces) < least and rounding > MERGE_TOLERANCE:
        raise InputError(
            f"{name}: the surface lies so far from the origin that its vertices are not told apart; move it to the "
            "origin where it was made, and write it again."
        )
    if len(faces) < least:
        raise InputError(f"{name}: the mesh has {len(faces)} usable triangles; a body needs at least four.")
    if np.ptp(points, axis=0).min() == 0:
        raise InputError(f"{name}: the surface is flat and encloses no volume; give a closed surface.")


def _check_crossings(points: FloatArray, faces: IntArray, name: str, warnings: list[str]) -> bool:
    """Whether the surface crosses itself; one with too many crossings is refused."""
    crossing = count_self_intersections(points, faces)
    if crossing is None:
        warnings.append(
            Note(
                "crossing-unchecked",
                "whether the surface crosses itself was not looked at, since too many of its triangles lie side by "
                "side, like the needles of a fan; evenly shaped triangles are quicker and more accurate.",
            )
        )
    elif crossing > max(TANGLE[0], TANGLE[1] * len(faces)):
        raise InputError(
            f"{name}: the surface crosses itself at {crossing:,} of {len(faces):,} triangles, a tangle that bounds no "
            "body; repair it in a mesh editor."
        )
    elif crossing:
        warnings.append(
            Note(
                "crossing",
                f"the surface crosses itself at {crossing} triangles; the union of what it encloses is taken.",
                value=crossing,
            )
        )
    return bool(crossing)


def _check_arrays(points: npt.ArrayLike, faces: npt.ArrayLike, name: str) -> tuple[FloatArray, IntArray]:
    """Check shapes and values; return finite vertices, all of them used, and triangles."""
    try:
        vertices = np.array(points, dtype=np.float64)
        triangles = np.array(faces, dtype=np.int64)
    except (TypeError, ValueError, OverflowError) as error:
        raise InputError(f"{name}: points and faces must be arrays of numbers.") from error
    if vertices.size == 0:
        raise InputError(f"{name}: the mesh is empty; give a closed triangle mesh.")
    if triangles.size == 0:
        raise InputError(f"{name}: there are points but no triangles; give a closed triangle mesh.")
    if vertices.ndim != 2 or vertices.shape[1] != 3 or triangles.ndim != 2 or triangles.shape[1] != 3:
        raise InputError(
            f"{name}: points have shape {vertices.shape} and faces {triangles.shape}; "
            "give (n, 3) coordinates and (m, 3) triangles."
        )
    if triangles.min() < 0 or triangles.max() >= len(vertices):
        raise InputError(f"{name}: a triangle names a vertex that does not exist; the file is damaged.")
    # Unused vertices are no part of the surface and may have any coordinates.
    vertices, triangles = compact(vertices, triangles)
    bad = int((~np.isfinite(vertices)).any(axis=1).sum())
    if bad:
        raise InputError(
            f"{name}: {bad} of {len(vertices)} vertices are not finite (NaN or infinity); repair the file."
        )
    largest = float(np.abs(vertices).max())
    if (vertices == vertices[0]).all():
        raise InputError(
            f"{name}: all vertices are at one place; give a closed triangle mesh, and if it is of a body far from the "
            "origin, move it there before it is written."
        )
    if not 1 / LONGEST <= largest <= LONGEST:
        raise InputError(f"{name}: coordinates reach {largest:g}, absurdly far or near; check the scale and the unit.")
    return vertices, triangles


def _rounding(points: FloatArray) -> float:
    """Rounding of coordinates as a share of the diagonal, from their distance to the origin."""
    single = np.asarray(points, dtype=np.float32)
    largest = np.abs(points).max()
    unit = float(np.spacing(np.float32(largest)) if (single == points).all() else np.spacing(largest))
    diagonal = float(np.linalg.norm(np.ptp(points, axis=0)))
    return unit / diagonal if diagonal > 0 else 0.0
