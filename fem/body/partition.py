"""Which region of a body is where: at points, and along straight paths."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from tetlux.meshing.arrays import FloatArray, IntArray
from tetlux.meshing.search.rays import OFFSET
from tetlux.meshing.surface.surface import Surface
from tetlux.meshing.tets.march import march
from tetlux.meshing.tets.mesh import TetMesh
from tetlux.meshing.tets.regions import region_at, sort_by_volume

# A path crosses the surface of one region no more often than this.
MOST_CROSSINGS = 200
# A path that runs along the border of two regions lies in one of them, and in the same one whichever of the two has
# the surface: crossings are looked for this share of the surface's diagonal beside it, always on the same side.
ASIDE = 1e-5
_SIDE = np.array([0.41, 0.53, 0.74])


@dataclass(frozen=True, eq=False)
class Pieces:
    """Straight paths cut where they pass from region to region: in the order of the paths, and along each of them.

    Parameters
    ----------
    rays : (p,) ndarray
        The path of each piece; each path has one at least.
    enter, leave : (p,) ndarray
        Where it begins and ends, along the path, unit.
    regions : (p,) ndarray
        The region that it lies in.
    """

    rays: IntArray
    enter: FloatArray
    leave: FloatArray
    regions: IntArray


class Partition(Protocol):
    """Anything that knows where the regions of a body are."""

    def region_at(self, points: FloatArray) -> IntArray:
        """The region that each of the points (q, 3) of the body lies in, (q,)."""
        ...

    def samples(self, region: int) -> FloatArray | None:
        """Points (p, 3) at which the coefficients of a region show their range; None stands for the body's surface."""
        ...

    def pieces(self, starts: FloatArray, directions: FloatArray, begins: FloatArray, lengths: FloatArray) -> Pieces:
        """Cut paths at the borders of regions.

        Parameters
        ----------
        starts, directions : (r, 3) ndarray
            Directions are unit vectors.
        begins : (r,) ndarray
            How far along them the body's triangles begin, which on a curved surface may be below the start, unit.
            Before that the path is in the region where it enters the triangles.
        lengths : (r,) ndarray
            How long they are, unit.
        """
        ...


@dataclass(frozen=True)
class SurfacePartition:
    """Regions by their closed surfaces, in their order; none for a body that has no regions."""

    surfaces: Sequence[Surface] = ()

    def region_at(self, points: FloatArray) -> IntArray:
        """See `Partition`."""
        return region_at(points, self.surfaces)

    def samples(self, region: int) -> FloatArray | None:
        """See `Partition`."""
        return self.surfaces[region - 1].points if region > 0 else None

    def pieces(self, starts: FloatArray, directions: FloatArray, begins: FloatArray, lengths: FloatArray) -> Pieces:
        """See `Partition`."""
        crossings = [_crossings(surface, starts, directions) for surface in self.surfaces]
        edges = [np.zeros((len(starts), 1)), lengths[:, None], *(distances for distances, _ in crossings)]
        rays, enter, leave = _between(np.hstack(edges), begins, lengths)
        middles = 0.5 * (np.maximum(enter, begins[rays]) + np.maximum(leave, begins[rays]))
        regions = np.zeros(len(rays), dtype=np.int64)
        for region in sort_by_volume(self.surfaces):
            distances, signs = crossings[region - 1]
            # Inside is what the path has yet to leave.
            inside = (signs[rays] * (distances[rays] > middles[:, None])).sum(axis=1) > 0
            regions[inside] = region
        return Pieces(rays, enter, leave, regions)


@dataclass(frozen=True)
class MeshPartition:
    """Regions by the tetrahedra of a mesh; outside of them the nearest one's."""

    mesh: TetMesh

    def region_at(self, points: FloatArray) -> IntArray:
        """See `Partition`."""
        return self.mesh.region_at(points)

    def samples(self, region: int) -> FloatArray | None:
        """See `Partition`."""
        return np.asarray(self.mesh.points[np.unique(self.mesh.tetrahedra[self.mesh.regions == region])])

    def pieces(self, starts: FloatArray, directions: FloatArray, begins: FloatArray, lengths: FloatArray) -> Pieces:
        """See `Partition`."""
        edges = [np.column_stack([np.zeros(len(starts)), lengths])]
        for part in march(self.mesh, starts, directions, lengths, keep=False):
            order = np.lexsort((part.enter, part.paths))
            paths, cells, enter = part.paths[order], part.cells[order], part.enter[order]
            regions = np.where(cells >= 0, self.mesh.regions[cells], -1)
            changes = np.flatnonzero((np.diff(regions) != 0) & (np.diff(paths) == 0)) + 1
            edges.append(_padded(paths[changes], enter[changes], len(starts)))
        rays, enter, leave = _between(np.hstack(edges), begins, lengths)
        middles = 0.5 * (np.maximum(enter, begins[rays]) + np.maximum(leave, begins[rays]))
        return Pieces(rays, enter, leave, self.region_at(starts[rays] + middles[:, None] * directions[rays]))


def _crossings(surface: Surface, starts: FloatArray, directions: FloatArray) -> tuple[FloatArray, IntArray]:
    """Where each path crosses a surface, (r, c), inf for none, and whether outwards (1) or inwards (-1) there."""
    distances, signs = [], []
    aside = ASIDE * surface.diagonal * (_SIDE - (directions @ _SIDE)[:, None] * directions)
    beside = starts + aside
    left, travelled = np.arange(len(starts)), np.zeros(len(starts))
    step = OFFSET * surface.diagonal
    for _ in range(MOST_CROSSINGS):
        way, faces = surface.rays.first(beside[left] + travelled[left, None] * directions[left], directions[left])
        hit = faces >= 0
        left, faces = left[hit], faces[hit]
        if len(left) == 0:
            break
        travelled[left] += np.maximum(way[hit], step)
        distance, sign = np.full(len(starts), np.inf), np.zeros(len(starts), dtype=np.int64)
        slope = np.einsum("ij,ij->i", directions[left], surface.normals[faces])
        sign[left] = np.sign(slope)
        # Back from beside the path to the path itself, in the plane of the triangle.
        back = np.einsum("ij,ij->i", aside[left], surface.normals[faces]) / np.where(slope == 0, np.inf, slope)
        distance[left] = travelled[left] + np.clip(back, -step, step)
        distances.append(distance)
        signs.append(sign)
    if not distances:
        return np.zeros((len(starts), 0)), np.zeros((len(starts), 0), dtype=np.int64)
    return np.column_stack(distances), np.column_stack(signs)


def _between(edges: FloatArray, begins: FloatArray, lengths: FloatArray) -> tuple[IntArray, FloatArray, FloatArray]:
    """Paths and ends of the pieces between edges (r, e), of which the first two are the path's own ends."""
    within = (edges > begins[:, None]) & (edges < lengths[:, None])
    edges = np.sort(np.where(within, edges, lengths[:, None]), axis=1)
    edges = np.column_stack([np.zeros(len(edges)), edges])
    enter, leave = edges[:, :-1], edges[:, 1:]
    some = leave > enter
    some[:, 0] = True
    rays, _ = np.nonzero(some)
    return rays, enter[some], leave[some]


def _padded(rays: IntArray, values: FloatArray, count: int) -> FloatArray:
    """Values of each ray in a row of its own, (count, most), inf where there are fewer; rays ascend."""
    first = np.searchsorted(rays, rays)
    place = np.arange(len(rays)) - first
    table = np.full((count, int(place.max(initial=-1)) + 1), np.inf)
    table[rays, place] = values
    return table
