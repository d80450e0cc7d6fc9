"""Orient the triangles of each body consistently and outward."""

import numpy as np

from tetlux.meshing.arrays import BoolArray, FloatArray, IntArray
from tetlux.meshing.errors import InputError
from tetlux.meshing.notes import Note
from tetlux.meshing.repair.topology import Edges, bodies, components
from tetlux.meshing.search.proximity import winding_number
from tetlux.meshing.surface.triangles import signed_volume

# A surface with more separate bodies is refused as fragmented.
MOST_BODIES = 1000


def wind_consistently(faces: IntArray, name: str, repairs: list[str]) -> IntArray:
    """Orient triangles so that the two at each edge traverse it in opposite directions.

    Raises
    ------
    InputError
        If the surface is not orientable, like a Klein bottle.
    """
    edges = Edges(faces)
    if edges.consistent:
        return faces
    turned = flips_of(edges, len(faces))
    if turned is None:
        raise InputError(f"{name}: the surface has no inside and outside (like a Klein bottle); repair it.")
    repairs.append("made the winding of the triangles consistent.")
    return np.where(turned[:, None], faces[:, ::-1], faces)


def face_outward(
    points: FloatArray, faces: IntArray, name: str, repairs: list[str], warnings: list[str]
) -> tuple[IntArray, bool]:
    """Orient every body outward.

    Returns
    -------
    faces : (m, 3) ndarray
    nested : bool
        Whether a body lies inside another.

    Raises
    ------
    InputError
        If there is a cavity, or there are too many bodies.
    """
    body = bodies(len(points), faces)
    count = int(body.max()) + 1
    if count > MOST_BODIES:
        raise InputError(
            f"{name}: the surface falls into {count:,} bodies that share no vertex, more than {MOST_BODIES:,}; merge "
            "its vertices by distance in a mesh editor, or keep the largest bodies."
        )
    order = np.argsort(body, kind="stable")
    parts = np.split(faces[order], np.flatnonzero(np.diff(body[order])) + 1)
    inward = np.array([_volume_of(points[part]) < 0 for part in parts])
    inner = _inner_bodies(points, parts, inward, name)
    if inner:
        which = f"body {inner[0]} of {count} lies" if len(inner) == 1 else f"{len(inner)} bodies of {count} lie"
        sentence = f"{which} inside another and {'changes' if len(inner) == 1 else 'change'} nothing."
        warnings.append(Note("nested-bodies", sentence, value=len(inner)))
    several = int(inward.sum())
    if several:
        surfaces = "an inside-out surface" if several == 1 else f"{several} inside-out surfaces"
        repairs.append(f"turned {surfaces} outward.")
    outer = count - len(inner)
    if outer > 1:
        sentence = f"the surface consists of {outer} bodies; light does not pass between those that are apart."
        warnings.append(Note("several-bodies", sentence, value=outer))
    return np.where(inward[body][:, None], faces[:, ::-1], faces), bool(inner)


def _inner_bodies(points: FloatArray, parts: list[IntArray], inward: BoolArray, name: str) -> list[int]:
    """Numbers, from 1, of the bodies inside others; cavities are refused."""
    low = np.array([points[part].min(axis=(0, 1)) for part in parts])
    high = np.array([points[part].max(axis=(0, 1)) for part in parts])
    inner = []
    for i, part in enumerate(parts):
        boxes = ((low <= low[i]) & (high >= high[i])).all(axis=1)
        boxes[i] = False
        start = points[part[0, :1]]
        around = [j for j in np.flatnonzero(boxes) if abs(winding_number(points, parts[j], start)[0]) > 0.5]
        if (inward[around] != inward[i]).any():
            raise InputError(
                f"{name}: there is a cavity inside the body, and cavities are not supported; remove the inner surface."
            )
        if around:
            inner.append(i + 1)
    return inner


def flips_of(edges: Edges, count: int) -> BoolArray | None:
    """Triangles to flip, (m,), for a consistent orientation; None if there is none.

    A graph has two nodes per triangle, one for each orientation, and links consistent orientations of neighbours. If
    both nodes of a triangle are connected, the surface is not orientable.
    """
    between_two = np.flatnonzero(edges.triangles[edges.edge] == 2)
    pairs = between_two[np.argsort(edges.edge[between_two], kind="stable")].reshape(-1, 2)
    against = count * (edges.balance[edges.edge[pairs[:, 0]]] != 0)
    one, other = (pairs % count).T
    rows, columns = np.concatenate([one, one + count]), np.concatenate([other + against, other + count - against])
    part = components(2 * count, np.column_stack([rows, columns]))
    as_is, turned = part[:count], part[count:]
    return None if (as_is == turned).any() else np.asarray(as_is > turned)


def _volume_of(corners: FloatArray) -> float:
    """Signed volume enclosed by triangles (f, 3, 3)."""
    return signed_volume(corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3))
