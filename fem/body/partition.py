"""`Partition`: which region of a body is where, at points and along straight paths."""

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

# Crossings of a path with the surface of one region, at most.
MOST_CROSSINGS = 200
# Crossings are computed for a path moved aside by this share of the surface's diagonal, always in this direction: a
# path along the border of two regions then lies in the same one whichever of the two has the surface.
OFFSET_ASIDE = 1e-5
_ASIDE = np.array([0.41, 0.53, 0.74])


@dataclass(frozen=True, eq=False)
class Pieces:
    """Straight paths divided where they pass from region to region, sorted by path and along each path.

    Parameters
    ----------
    rays : (p,) ndarray
        The path of each piece; every path has at least one.
    enter, leave : (p,) ndarray
        Ends of each piece, as distances along its path, unit.
    regions : (p,) ndarray
        The region that each piece lies in.
    """

    rays: IntArray
    enter: FloatArray
    leave: FloatArray
    regions: IntArray

    @property
    def lengths(self) -> FloatArray:
        """Length of each piece, (p,), unit."""
        return self.leave - self.enter

    def select(self, numbers: IntArray) -> "Pieces":
        """Copies of the pieces with given numbers."""
        return Pieces(self.rays[numbers], self.enter[numbers], self.leave[numbers], self.regions[numbers])


class Partition(Protocol):
    """Where the regions of a body are."""

    def region_at(self, points: FloatArray) -> IntArray:
        """Regions that points (q, 3) inside the body lie in, (q,)."""
        ...

    def samples(self, region: int) -> FloatArray | None:
        """Points (p, 3) of a region at which to sample the range of its coefficients; None for the body's surface."""
        ...

    def pieces(self, starts: FloatArray, directions: FloatArray, begins: FloatArray, lengths: FloatArray) -> Pieces:
        """Divide paths at the borders of regions.

        Parameters
        ----------
        starts, directions : (r, 3) ndarray
            Directions are unit vectors.
        begins : (r,) ndarray
            Distance at which each path enters the body's triangles, which may lie below a start on the curved surface,
            unit. Before that the path is in the region in which it enters.
        lengths : (r,) ndarray
            unit.

        Returns
        -------
        Pieces
        """
        ...


@dataclass(frozen=True)
class SurfacePartition:
    """Regions 1, 2, ... by their closed surfaces; region 0 is the rest of the body."""

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
        rays, enter, leave = _pieces_between(np.hstack(edges), begins, lengths)
        middles = 0.5 * (np.maximum(enter, begins[rays]) + np.maximum(leave, begins[rays]))
        regions = np.zeros(len(rays), dtype=np.int64)
        for region in sort_by_volume(self.surfaces):
            distances, signs = crossings[region - 1]
            # A point is inside if the path leaves the region once more than it enters it from there on.
            inside = (signs[rays] * (distances[rays] > middles[:, None])).sum(axis=1) > 0
            regions[inside] = region
        return Pieces(rays, enter, leave, regions)


@dataclass(frozen=True)
class MeshPartition:
    """Regions by the tetrahedra of a mesh; a place outside the mesh has the region of the nearest tetrahedron."""

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
            edges.append(_pad_rows(paths[changes], enter[changes], len(starts)))
        rays, enter, leave = _pieces_between(np.hstack(edges), begins, lengths)
        middles = 0.5 * (np.maximum(enter, begins[rays]) + np.maximum(leave, begins[rays]))
        return Pieces(rays, enter, leave, self.region_at(starts[rays] + middles[:, None] * directions[rays]))


def _crossings(surface: Surface, starts: FloatArray, directions: FloatArray) -> tuple[FloatArray, IntArray]:
    """Distances at which each path crosses a surface, (r, c), inf for none, and 1 if outwards, -1 if inwards there."""
    distances, signs = [], []
    aside = OFFSET_ASIDE * surface.diagonal * (_ASIDE - (directions @ _ASIDE)[:, None] * directions)
    moved = starts + aside
    active, travelled = np.arange(len(starts)), np.zeros(len(starts))
    step = OFFSET * surface.diagonal
    for _ in range(MOST_CROSSINGS):
        origins = moved[active] + travelled[active, None] * directions[active]
        steps, faces = surface.rays.first(origins, directions[active])
        hit = faces >= 0
        active, faces = active[hit], faces[hit]
        if len(active) == 0:
            break
        travelled[active] += np.maximum(steps[hit], step)
        distance, sign = np.full(len(starts), np.inf), np.zeros(len(starts), dtype=np.int64)
        slope = np.einsum("ij,ij->i", directions[active], surface.normals[faces])
        sign[active] = np.sign(slope)
        # From the crossing of the moved path, in the plane of the triangle, to that of the path itself.
        back = np.einsum("ij,ij->i", aside[active], surface.normals[faces]) / np.where(slope == 0, np.inf, slope)
        distance[active] = travelled[active] + np.clip(back, -step, step)
        distances.append(distance)
        signs.append(sign)
    if not distances:
        return np.zeros((len(starts), 0)), np.zeros((len(starts), 0), dtype=np.int64)
    return np.column_stack(distances), np.column_stack(signs)


def _pieces_between(
    edges: FloatArray, begins: FloatArray, lengths: FloatArray
) -> tuple[IntArray, FloatArray, FloatArray]:
    """Paths (p,) and ends (p,) of the pieces between edges (r, e); the first two edges of a path are its own ends."""
    within = (edges > begins[:, None]) & (edges < lengths[:, None])
    edges = np.sort(np.where(within, edges, lengths[:, None]), axis=1)
    edges = np.column_stack([np.zeros(len(edges)), edges])
    enter, leave = edges[:, :-1], edges[:, 1:]
    some = leave > enter
    some[:, 0] = True
    rays, _ = np.nonzero(some)
    return rays, enter[some], leave[some]


def _pad_rows(rays: IntArray, values: FloatArray, count: int) -> FloatArray:
    """Values of each ray in a row of its own, (count, most), padded with inf; `rays` ascends."""
    first = np.searchsorted(rays, rays)
    place = np.arange(len(rays)) - first
    table = np.full((count, int(place.max(initial=-1)) + 1), np.inf)
    table[rays, place] = values
    return table
