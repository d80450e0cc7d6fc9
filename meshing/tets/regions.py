"""Regions: closed surfaces inside the body, or inside each other, each of which will have a medium of its own.

The innermost region that holds a place is its region. Surfaces that hold a common place lie one within the other,
so the innermost is that of the least volume, and no order needs to be given.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from tetlux.meshing.arrays import BoolArray, FloatArray, IntArray
from tetlux.meshing.errors import InputError
from tetlux.meshing.host.blocks import grouped
from tetlux.meshing.search.proximity import cross_segments, overlapping_boxes
from tetlux.meshing.surface.surface import Surface
from tetlux.meshing.tets.mesh import FACES, TetMesh, tetrahedron_volumes

# Surfaces nearer than this share of the body's diagonal touch: files round at about a tenth of it.
TOUCH = 1e-6
# Places of a surface that are asked on which side of another they lie; without a crossing one would do.
LOOKS = 64
# Tetrahedra of a compartment that are asked whether they lie in a region; and the share of its volume, or of the
# region's, that may answer otherwise than the rest.
ASKED = 500
DISSENT = 0.1
# The mesher's time goes with the inverse of the smallest region's size: at 0.012 of the body's 8 s, at 0.0025 minutes.
SMALLEST = 0.005
# How far beyond the envelope a node on a surface may be.
ROUNDING = 1.01


@dataclass(frozen=True)
class Nesting:
    """How the inner surfaces of a body lie.

    Attributes
    ----------
    parents : tuple of int
        Of each inner surface: the region that it lies in, 0 for the body itself.
    touching : tuple of bool
        Of the body and of each inner surface: whether it touches another one.
    """

    parents: tuple[int, ...]
    touching: tuple[bool, ...]

    def within(self, region: int) -> list[int]:
        """A region and all that lie in it, directly or not."""
        return [i for i in range(len(self.parents) + 1) if region in self._path(i)]

    def _path(self, region: int) -> list[int]:
        return [region] if region == 0 else [region, *self._path(self.parents[region - 1])]


def check_regions(surface: Surface, regions: Sequence[Surface]) -> None:
    """Refuse inner surfaces that bound no region of the body.

    An inner surface may touch the body's surface or another inner one, such as the layers of a slab do.

    Parameters
    ----------
    surface : Surface
        The body's.
    regions : sequence of Surface
        Closed surfaces inside it, or inside each other, in any order.

    Raises
    ------
    InputError
        If one is in another unit than the body, lies outside of it, crosses its surface or another inner one, or is
        the same as one of them; or if it is so small that the mesher would be at it for minutes.
    """
    nesting(surface, regions)
    for number, region in enumerate(regions, 1):
        if region.diagonal < SMALLEST * surface.diagonal:
            raise InputError(
                f"region {number} is {region.diagonal:.3g} {region.unit} across, less than {SMALLEST:.1%} of the body, "
                "and too small to be meshed within it; leave it out, or make it larger."
            )


@lru_cache(maxsize=16)  # every solution on every mesh asks
def own_volumes(surface: Surface, regions: tuple[Surface, ...]) -> FloatArray:
    """Volume of the body without its regions, and of each region without those in it, (r + 1,), unit³."""
    volumes = np.array([surface.volume, *(region.volume for region in regions)])
    own = volumes.copy()
    np.subtract.at(own, list(nesting(surface, regions).parents), volumes[1:])
    return own


def nesting(surface: Surface, regions: Sequence[Surface]) -> Nesting:
    """How the inner surfaces lie, or an InputError as `check_regions` raises it."""
    near = TOUCH * surface.diagonal
    touching = np.zeros(len(regions) + 1, dtype=bool)
    around: list[list[int]] = [[0] for _ in regions]
    volumes = [np.inf, *(inner.volume for inner in regions)]
    names = [f"the body ({surface.name})", *(f"region {i} ({inner.name})" for i, inner in enumerate(regions, 1))]
    for i, inner in enumerate(regions, 1):
        touching[[0, i]] |= _touches_inside(inner, surface, names[i], names[0], near)
    for j, second in enumerate(regions, 1):
        for i, first in enumerate(regions[: j - 1], 1):
            if not _boxes_meet(first, second, near):
                continue
            one, other = _pair(first, second, names[i], names[j], near)
            touching[[i, j]] |= one.touches or other.touches
            if one.answers.all():
                around[i - 1].append(j)
            elif other.answers.all():
                around[j - 1].append(i)
    parents = tuple(min(those, key=lambda k: volumes[k]) for those in around)
    return Nesting(parents, tuple(touching.tolist()))


def _touches_inside(inner: Surface, body: Surface, name: str, body_name: str, near: float) -> bool:
    """Whether a surface inside the body touches that one's; an error if it is not inside."""
    if inner.unit != body.unit:
        raise InputError(f"{name} is in {inner.unit} and the body in {body.unit}; give both in one unit.")
    place = _crossing(inner, body, near)
    sides = _inside(inner, body, near)
    if place is None and len(sides.answers) == 0:
        raise InputError(f"{name} is the whole body; give its medium to the body and leave it out.")
    if place is None and not sides.answers.any():
        around = _written(inner.points.mean(axis=0), near)
        if _inside(body, inner, near).answers.any():
            raise InputError(f"{name} holds {body_name} and not the other way round; exchange or shrink it.")
        raise InputError(f"{name} lies outside {body_name}, around {around}; move it inside, or leave it out.")
    if place is None and not sides.answers.all():
        place = sides.places[~sides.answers][0]
    if place is not None:
        raise InputError(
            f"{name} crosses the surface of {body_name} around {_written(place, near)}; "
            "move or shrink it until it lies inside."
        )
    return sides.touches or bool(_on(body.points, inner, near).any())


def _pair(first: Surface, second: Surface, name: str, other_name: str, near: float) -> tuple["_Sides", "_Sides"]:
    """On which side of each other two inner surfaces lie; an error if they cross or are the same."""
    place = _crossing(first, second, near)
    one, other = _inside(first, second, near), _inside(second, first, near)
    if place is None and 0 in (len(one.answers), len(other.answers)):
        raise InputError(f"{name} and {other_name} are the same surface; leave one of them out.")
    for sides in (one, other):
        if place is None and sides.answers.any() and not sides.answers.all():
            place = sides.places[sides.answers][0]
    if place is not None:
        raise InputError(
            f"{name} and {other_name} cross each other around {_written(place, near)}; "
            "move them apart, or put one wholly inside the other."
        )
    return one, other


def _written(place: FloatArray, near: float) -> str:
    return f"({', '.join(f'{x:.4g}' for x in np.round(place / near) * near + 0.0)})"


def _box(surface: Surface) -> tuple[FloatArray, FloatArray]:
    return surface.points.min(axis=0), surface.points.max(axis=0)


def _boxes_meet(first: Surface, second: Surface, near: float) -> bool:
    (low, high), (lowest, highest) = _box(first), _box(second)
    return bool(((low <= highest + near) & (lowest <= high + near)).all())


def _crossing(first: Surface, second: Surface, near: float) -> FloatArray | None:
    """A place where an edge of either surface runs through a triangle of the other, clear of its rim."""
    low = np.maximum(_box(first)[0], _box(second)[0]) - near
    high = np.minimum(_box(first)[1], _box(second)[1]) + near
    if (low > high).any():
        return None
    parts = []
    for surface in (first, second):
        corners = surface.points[surface.faces]
        parts.append(corners[((corners.min(axis=1) <= high) & (corners.max(axis=1) >= low)).all(axis=1)])
    count, corners = len(parts[0]), np.concatenate(parts)
    if count in (0, len(corners)):
        return None
    for i, j in overlapping_boxes(corners.min(axis=1), corners.max(axis=1)):
        mixed = (i < count) != (j < count)
        for face, other in ((i[mixed], j[mixed]), (j[mixed], i[mixed])):
            place = _pierced(corners[face], corners[other], near)
            if place is not None:
                return place
    return None


def _pierced(triangles: FloatArray, others: FloatArray, near: float) -> FloatArray | None:
    """Where an edge of a triangle of `others` (p, 3, 3) runs through its partner in `triangles`, if one does.

    Touching does not count: both ends are to be clear of the triangle's plane, and the place of its rim.
    """
    edges = triangles[:, [2, 0, 1]] - triangles[:, [1, 2, 0]]
    normals = np.cross(edges[:, 0], edges[:, 1])
    twice = np.linalg.norm(normals, axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        side = np.einsum("pij,pj->pi", others - triangles[:, :1], normals) / twice[:, None]
        heights = twice[:, None] / np.linalg.norm(edges, axis=2)
    for a, b in ((0, 1), (1, 2), (2, 0)):
        through = (np.minimum(side[:, a], side[:, b]) < -near) & (np.maximum(side[:, a], side[:, b]) > near)
        start, direction = others[through, a], others[through, b] - others[through, a]
        t, weights = cross_segments(start, direction, triangles[through])
        depth = np.column_stack([1.0 - weights.sum(axis=1), weights]) * heights[through]
        hit = np.flatnonzero(np.isfinite(t) & (depth.min(axis=1, initial=np.inf) > near))
        if len(hit) > 0:
            return np.asarray(start[hit[0]] + t[hit[0]] * direction[hit[0]])
    return None


@dataclass(frozen=True, eq=False)
class _Sides:
    """On which side of another surface places of a surface lie, and whether parts of it lie on that itself."""

    places: FloatArray
    answers: BoolArray
    touches: bool


def _on(points: FloatArray, surface: Surface, near: float) -> BoolArray:
    """Whether each of the points (q, 3) lies on the surface."""
    low, high = _box(surface)
    on = np.asarray(((points >= low - near) & (points <= high + near)).all(axis=1))
    on[on] = surface.near(points[on], near)
    return on


def _inside(first: Surface, second: Surface, near: float) -> _Sides:
    """On which side of the second surface the first one lies, where it does not lie on it.

    Surfaces without a crossing change sides only where they touch, so a few places tell of each part between.
    """
    on = _on(first.points, second, near)
    ends = np.concatenate([first.faces[:, [0, 1]], first.faces[:, [1, 2]], first.faces[:, [2, 0]]])
    ends = ends[~on[ends].any(axis=1)]
    size = len(first.points)
    part = connected_components(coo_array((np.ones(len(ends)), ends.T), shape=(size, size)), directed=False)[1]
    free = np.flatnonzero(~on)
    order = free[np.argsort(part[free], kind="stable")]
    starts = np.flatnonzero(np.diff(part[order], prepend=-1))
    each = max(1, LOOKS // max(len(starts), 1))
    chosen = np.concatenate([those[_evenly(len(those), each)] for those in np.split(order, starts[1:])])
    middles = first.points[first.faces[on[first.faces].any(axis=1)]].mean(axis=1)
    middles = middles[_evenly(len(middles), LOOKS)]
    places = np.concatenate([first.points[chosen], middles[~_on(middles, second, near)]])
    return _Sides(places, second.contains(places), bool(on.any()))


def _evenly(count: int, most: int) -> IntArray:
    """Numbers below `count` at even steps, `most` at most."""
    return np.arange(min(count, most)) * count // max(min(count, most), 1)


def by_volume(regions: Sequence[Surface]) -> list[int]:
    """Numbers of the regions, from the largest to the smallest: of regions that hold a place the last is its own."""
    return sorted(range(1, len(regions) + 1), key=lambda i: -regions[i - 1].volume)


def owners(pairs: IntArray, regions: Sequence[Surface]) -> IntArray:
    """The inner surface, by its number, that triangles between pairs of regions (f, 2) belong to: the smaller one's."""
    rank = np.argsort([0, *by_volume(regions)])
    return np.asarray(np.where(rank[pairs[:, 0]] > rank[pairs[:, 1]], pairs[:, 0], pairs[:, 1]))


def region_at(points: FloatArray, regions: Sequence[Surface]) -> IntArray:
    """The region that each of the points (q, 3) of a body lies in, (q,)."""
    found = np.zeros(len(points), dtype=np.int64)
    for region in by_volume(regions):
        found[regions[region - 1].contains(points)] = region
    return found


def tagged(
    points: FloatArray, tetrahedra: IntArray, surface: Surface, regions: Sequence[Surface], envelope: float
) -> IntArray:
    """The region of each tetrahedron, (m,), -1 for those outside the body.

    Triangles whose corners are all in the envelope of a surface part the mesh into compartments, which are in one
    region as a whole: few tetrahedra need to be asked, and not those whose middle is in the envelope, but on the
    wrong side. Where all corners are in it a tetrahedron is a compartment of its own.

    Parameters
    ----------
    points : (n, 3) ndarray
    tetrahedra : (m, 4) ndarray
    surface : Surface
    regions : sequence of Surface
        These as the mesher got them.
    envelope : float
        How far from them its nodes on them may be, unit.
    """
    neighbours = _neighbours(tetrahedra, len(points))
    middles, volumes = points[tetrahedra].mean(axis=1), tetrahedron_volumes(points, tetrahedra)

    def held(by: Surface) -> BoolArray:
        return _held(points, tetrahedra, middles, volumes, neighbours, by, ROUNDING * envelope)

    inside = held(surface)
    result = np.where(inside, 0, -1)
    for i in by_volume(regions):
        result[inside & held(regions[i - 1])] = i
    return result


def _neighbours(tetrahedra: IntArray, nodes: int) -> tuple[IntArray, IntArray]:
    """Triangles between two tetrahedra: those (p, 2), and the corners (p, 3)."""
    faces = tetrahedra[:, FACES].reshape(-1, 3)
    a, b, c = np.sort(faces, axis=1).astype(np.uint64).T
    _, face = grouped((a * np.uint64(nodes) + b) * np.uint64(nodes) + c)
    order = np.argsort(face, kind="stable")
    pair = np.flatnonzero(np.diff(face[order]) == 0)
    return np.column_stack([order[pair], order[pair + 1]]) // 4, faces[order[pair]]


def _held(
    points: FloatArray,
    tetrahedra: IntArray,
    middles: FloatArray,
    volumes: FloatArray,
    neighbours: tuple[IntArray, IntArray],
    surface: Surface,
    near: float,
) -> BoolArray:
    """Whether each tetrahedron lies inside a surface, (m,)."""
    cells, corners = neighbours
    cells = cells[~_on(points, surface, near)[corners].all(axis=1)]
    count = len(tetrahedra)
    joined = coo_array((np.ones(len(cells), dtype=bool), cells.T), shape=(count, count))
    compartment = connected_components(joined, directed=False)[1]
    order = np.argsort(compartment, kind="stable")
    parts = np.split(order, np.flatnonzero(np.diff(compartment[order])) + 1)
    asked = np.concatenate([part[_evenly(len(part), ASKED)] for part in parts])
    answers, of_answers = surface.contains(middles[asked]), compartment[asked]
    share = np.bincount(of_answers, answers) / np.bincount(of_answers)
    result = np.asarray((share > 0.5)[compartment])
    # Where the surface was not kept, two compartments are one: its tetrahedra have to answer for themselves.
    size = np.bincount(compartment, volumes)
    torn = np.minimum(share, 1.0 - share) * size > DISSENT * np.minimum(size, surface.volume)
    each = np.flatnonzero(torn[compartment])
    result[each] = surface.contains(middles[each])
    return result


def nodes_of(mesh: TetMesh, surface: Surface, regions: Sequence[Surface]) -> list[tuple[Surface, BoolArray]]:
    """The surfaces of a mesh, the smallest first and the body's last, each with its nodes as a mask (n,).

    Triangles between two regions belong to the smaller one's surface.

    Raises
    ------
    InputError
        If the mesh has a region for which no surface is given.
    """
    boundary = np.zeros(len(mesh.points), dtype=bool)
    boundary[mesh.boundary_nodes] = True
    if len(regions) == 0 or len(mesh.interfaces[0]) == 0:
        return [(surface, boundary)]
    faces, pairs, _ = mesh.interfaces
    if int(pairs.max()) > len(regions):
        raise InputError(
            f"the mesh has a region {int(pairs.max())}, and {len(regions)} inner surfaces are given; "
            "give those that it was made of."
        )
    order = [0, *by_volume(regions)]
    owner = owners(pairs, regions)
    found = []
    for i in order[:0:-1]:
        mask = np.zeros(len(mesh.points), dtype=bool)
        mask[faces[owner == i]] = True
        found.append((regions[i - 1], mask))
    if (np.sum([boundary, *(mask for _, mask in found)], axis=0) > 1).any():
        # Where surfaces touch, the larger one's own part ends at the smaller one's, and each inner one's at the body's.
        found = [
            (_apart_from(inner, (surface, *(smaller for smaller, _ in found[:k]))), mask)
            for k, (inner, mask) in enumerate(found)
        ]
    return [*found, (surface, boundary)]


@lru_cache(maxsize=16)  # refinement asks again and again
def _apart_from(surface: Surface, others: tuple[Surface, ...]) -> Surface:
    """The part of a surface whose triangles do not lie on others."""
    shared = np.zeros(len(surface.faces), dtype=bool)
    for other in others:
        near = TOUCH * max(surface.diagonal, other.diagonal)
        whole = np.flatnonzero(_on(surface.points, other, near)[surface.faces].all(axis=1))
        shared[whole[_on(surface.points[surface.faces[whole]].mean(axis=1), other, near)]] = True
    if not shared.any() or shared.all():
        return surface
    return replace(surface, faces=surface.faces[~shared], shape=None)
