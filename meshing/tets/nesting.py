"""The nesting of the closed surfaces of regions in the body and in each other, and the refusal of crossings."""

from collections.abc import Sequence
from dataclasses import dataclass
from weakref import WeakKeyDictionary, ref

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from tetlux.meshing.arrays import BoolArray, FloatArray, spread_indices
from tetlux.meshing.describe import as_text
from tetlux.meshing.errors import InputError
from tetlux.meshing.search.proximity import cross_segments, overlapping_boxes
from tetlux.meshing.surface.surface import Surface

# Surfaces closer than this share of the body's diagonal touch; rounding in files is about a tenth of it.
TOUCH_DISTANCE = 1e-6
# Sample points per surface that decide whether it lies inside another; one would suffice if none touched.
SIDE_SAMPLES = 64
# Regions below this share of the body's diagonal are refused. The mesher's time grows with the inverse of the size of
# the smallest region: 8 s at 0.012, minutes at 0.0025.
SMALLEST = 0.005


# The inner surfaces that were last found nested in a body: a plan, its models and the mesher ask for the same.
_Found = tuple[tuple[ref[Surface], ...], "Nesting"]
_found: WeakKeyDictionary[Surface, _Found] = WeakKeyDictionary()


@dataclass(frozen=True)
class Nesting:
    """The nesting of the inner surfaces of a body.

    Attributes
    ----------
    parents : tuple of int
        For each inner surface, the region that directly contains it; 0 is the body itself.
    touching : tuple of bool
        For the body and each inner surface, whether it touches another surface.
    """

    parents: tuple[int, ...]
    touching: tuple[bool, ...]

    def within(self, region: int) -> list[int]:
        """A region and all regions inside it, at any depth."""
        return [i for i in range(len(self.parents) + 1) if region in self._path(i)]

    def _path(self, region: int) -> list[int]:
        return [region] if region == 0 else [region, *self._path(self.parents[region - 1])]


def check_regions(surface: Surface, regions: Sequence[Surface]) -> None:
    """Refuse inner surfaces that bound no region of the body.

    An inner surface may touch the body's surface or another inner one, as the layers of a slab do.

    Parameters
    ----------
    surface : Surface
        The body's.
    regions : sequence of Surface
        Closed surfaces inside it, or inside each other, in any order.

    Raises
    ------
    InputError
        If an inner surface is not in the body's unit, lies outside the body, crosses or equals its surface or another
        inner one, or is so small that the mesher would take minutes.
    """
    nesting(surface, regions)
    for number, region in enumerate(regions, 1):
        if region.diagonal < SMALLEST * surface.diagonal:
            raise InputError(
                f"region {number} is {region.diagonal:.3g} {region.unit} across, less than {SMALLEST:.1%} of the body, "
                "and too small to be meshed within it; leave it out, or make it larger."
            )


def nesting(surface: Surface, regions: Sequence[Surface]) -> Nesting:
    """Find the nesting of inner surfaces.

    Raises
    ------
    InputError
        As `check_regions` does, except for small surfaces.
    """
    known = _found.get(surface)
    if known is not None and [each() for each in known[0]] == list(regions):
        return known[1]
    found = _nest(surface, regions)
    _found[surface] = tuple(map(ref, regions)), found
    return found


def _nest(surface: Surface, regions: Sequence[Surface]) -> Nesting:
    near = TOUCH_DISTANCE * surface.diagonal
    touching = np.zeros(len(regions) + 1, dtype=bool)
    around: list[list[int]] = [[0] for _ in regions]
    volumes = [np.inf, *(inner.volume for inner in regions)]
    names = [f"the body ({surface.name})", *(f"region {i} ({inner.name})" for i, inner in enumerate(regions, 1))]
    for i, inner in enumerate(regions, 1):
        touching[[0, i]] |= _check_inside_body(inner, surface, names[i], names[0], near)
    for j, second in enumerate(regions, 1):
        for i, first in enumerate(regions[: j - 1], 1):
            if not _boxes_meet(first, second, near):
                continue
            one, other = _compare_pair(first, second, names[i], names[j], near)
            touching[[i, j]] |= one.touches or other.touches
            if one.inside.all():
                around[i - 1].append(j)
            elif other.inside.all():
                around[j - 1].append(i)
    parents = tuple(min(those, key=lambda k: volumes[k]) for those in around)
    return Nesting(parents, tuple(touching.tolist()))


def _check_inside_body(inner: Surface, body: Surface, name: str, body_name: str, near: float) -> bool:
    """Refuse an inner surface that is not inside the body; whether it touches the body's surface."""
    if inner.unit != body.unit:
        raise InputError(f"{name} is in {inner.unit} and the body in {body.unit}; give both in one unit.")
    crossing = _find_crossing(inner, body, near)
    sides = _locate_sides(inner, body, near)
    if crossing is None and len(sides.inside) == 0:
        raise InputError(f"{name} is the whole body; give its medium to the body and leave it out.")
    if crossing is None and not sides.inside.any():
        around = as_text(inner.points.mean(axis=0), near / TOUCH_DISTANCE)
        if _locate_sides(body, inner, near).inside.any():
            raise InputError(f"{name} holds {body_name} and not the other way round; exchange or shrink it.")
        raise InputError(f"{name} lies outside {body_name}, around {around}; move it inside, or leave it out.")
    if crossing is None and not sides.inside.all():
        crossing = sides.points[~sides.inside][0]
    if crossing is not None:
        raise InputError(
            f"{name} crosses the surface of {body_name} around {as_text(crossing, near / TOUCH_DISTANCE)}; "
            "move or shrink it until it lies inside."
        )
    return sides.touches or bool(are_on_surface(body.points, inner, near).any())


def _compare_pair(
    first: Surface, second: Surface, name: str, other_name: str, near: float
) -> tuple["_Sides", "_Sides"]:
    """Compare two inner surfaces: the sides of each relative to the other; an error if they cross or are equal."""
    crossing = _find_crossing(first, second, near)
    one, other = _locate_sides(first, second, near), _locate_sides(second, first, near)
    if crossing is None and 0 in (len(one.inside), len(other.inside)):
        raise InputError(f"{name} and {other_name} are the same surface; leave one of them out.")
    for sides in (one, other):
        if crossing is None and sides.inside.any() and not sides.inside.all():
            crossing = sides.points[sides.inside][0]
    if crossing is not None:
        raise InputError(
            f"{name} and {other_name} cross each other around {as_text(crossing, near / TOUCH_DISTANCE)}; "
            "move them apart, or put one wholly inside the other."
        )
    return one, other


def _box(surface: Surface) -> tuple[FloatArray, FloatArray]:
    return surface.points.min(axis=0), surface.points.max(axis=0)


def _boxes_meet(first: Surface, second: Surface, near: float) -> bool:
    (low, high), (lowest, highest) = _box(first), _box(second)
    return bool(((low <= highest + near) & (lowest <= high + near)).all())


def _find_crossing(first: Surface, second: Surface, near: float) -> FloatArray | None:
    """A point where an edge of either surface passes through the interior of a triangle of the other, or None."""
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
            crossing = _find_pierced(corners[face], corners[other], near)
            if crossing is not None:
                return crossing
    return None


def _find_pierced(triangles: FloatArray, others: FloatArray, near: float) -> FloatArray | None:
    """A point where an edge of a triangle of `others` (p, 3, 3) passes through its partner in `triangles`, if any.

    Touching does not count: both ends must be off the triangle's plane, and the point off its rim, by `near`.
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
    """Sample points of a surface (s, 3), whether each is inside another surface (s,), and whether the two touch."""

    points: FloatArray
    inside: BoolArray
    touches: bool


def _locate_sides(first: Surface, second: Surface, near: float) -> _Sides:
    """Whether the first surface is inside the second, at sample points off the second.

    Surfaces that do not cross change sides only where they touch, so a few sample points per connected part suffice.
    """
    touching = are_on_surface(first.points, second, near)
    ends = np.concatenate([first.faces[:, [0, 1]], first.faces[:, [1, 2]], first.faces[:, [2, 0]]])
    ends = ends[~touching[ends].any(axis=1)]
    size = len(first.points)
    part = connected_components(coo_array((np.ones(len(ends)), ends.T), shape=(size, size)), directed=False)[1]
    free = np.flatnonzero(~touching)
    order = free[np.argsort(part[free], kind="stable")]
    starts = np.flatnonzero(np.diff(part[order], prepend=-1))
    samples_per_part = max(1, SIDE_SAMPLES // max(len(starts), 1))
    chosen = np.concatenate(
        [members[spread_indices(len(members), samples_per_part)] for members in np.split(order, starts[1:])]
    )
    middles = first.points[first.faces[touching[first.faces].any(axis=1)]].mean(axis=1)
    middles = middles[spread_indices(len(middles), SIDE_SAMPLES)]
    points = np.concatenate([first.points[chosen], middles[~are_on_surface(middles, second, near)]])
    return _Sides(points, second.contains(points), bool(touching.any()))


def are_on_surface(points: FloatArray, surface: Surface, near: float) -> BoolArray:
    """Whether each point (q, 3) is within a distance `near`, unit, of the surface, (q,)."""
    low, high = _box(surface)
    on = np.asarray(((points >= low - near) & (points <= high + near)).all(axis=1))
    on[on] = surface.near(points[on], near)
    return on
