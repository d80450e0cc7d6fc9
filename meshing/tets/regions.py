"""Regions: closed surfaces inside the body or inside each other, each with a medium of its own.

The region of a point is the innermost surface that contains it. Surfaces that contain a common point are nested, so
the innermost one has the least volume, and users need not give an order.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np

from tetlux.meshing.arrays import BoolArray, FloatArray, IntArray
from tetlux.meshing.errors import InputError
from tetlux.meshing.surface.surface import Surface
from tetlux.meshing.tets.mesh import TetMesh
from tetlux.meshing.tets.nesting import TOUCH_DISTANCE, are_on_surface, nesting


@lru_cache(maxsize=16)  # each solution on each mesh needs them
def own_volumes(surface: Surface, regions: tuple[Surface, ...]) -> FloatArray:
    """Volume of the body without its regions, and of each region without those in it, (r + 1,), unit³."""
    volumes = np.array([surface.volume, *(region.volume for region in regions)])
    own = volumes.copy()
    np.subtract.at(own, list(nesting(surface, regions).parents), volumes[1:])
    return own


def sort_by_volume(regions: Sequence[Surface]) -> list[int]:
    """Region numbers by falling volume: the last region in this order that contains a point is the point's region."""
    return sorted(range(1, len(regions) + 1), key=lambda i: -regions[i - 1].volume)


def owners(pairs: IntArray, regions: Sequence[Surface]) -> IntArray:
    """The region whose surface has each triangle between two regions (f, 2): the smaller of the two, (f,)."""
    rank = np.argsort([0, *sort_by_volume(regions)])
    return np.asarray(np.where(rank[pairs[:, 0]] > rank[pairs[:, 1]], pairs[:, 0], pairs[:, 1]))


def corner_groups(mesh: TetMesh) -> IntArray:
    """Number of each corner of tetrahedra, the same for all corners at one node in one region, (m, 4)."""
    if not mesh.regions.any():
        return mesh.tetrahedra
    first = int(mesh.regions.min())
    keys = mesh.tetrahedra * (int(mesh.regions.max()) - first + 1) + (mesh.regions[:, None] - first)
    return np.asarray(np.unique(keys, return_inverse=True)[1].reshape(keys.shape))


def region_at(points: FloatArray, regions: Sequence[Surface]) -> IntArray:
    """The region of each point (q, 3) of a body, (q,)."""
    result = np.zeros(len(points), dtype=np.int64)
    for region in sort_by_volume(regions):
        result[regions[region - 1].contains(points)] = region
    return result


def surface_nodes(mesh: TetMesh, surface: Surface, regions: Sequence[Surface]) -> list[tuple[Surface, BoolArray]]:
    """The surfaces of a mesh, from the smallest to the body's, each with a mask (n,) of its nodes.

    A triangle between two regions belongs to the smaller region's surface.

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
    order = [0, *sort_by_volume(regions)]
    owner = owners(pairs, regions)
    surfaces = []
    for i in order[:0:-1]:
        mask = np.zeros(len(mesh.points), dtype=bool)
        mask[faces[owner == i]] = True
        surfaces.append((regions[i - 1], mask))
    if (np.sum([boundary, *(mask for _, mask in surfaces)], axis=0) > 1).any():
        # Where surfaces touch, the triangles belong to the body's surface or else to the smaller one.
        surfaces = [
            (_part_off(inner, (surface, *(smaller for smaller, _ in surfaces[:k]))), mask)
            for k, (inner, mask) in enumerate(surfaces)
        ]
    return [*surfaces, (surface, boundary)]


@lru_cache(maxsize=16)  # each refinement needs it again
def _part_off(surface: Surface, others: tuple[Surface, ...]) -> Surface:
    """The triangles of a surface that do not lie on other surfaces."""
    shared = np.zeros(len(surface.faces), dtype=bool)
    for other in others:
        near = TOUCH_DISTANCE * max(surface.diagonal, other.diagonal)
        whole = np.flatnonzero(are_on_surface(surface.points, other, near)[surface.faces].all(axis=1))
        shared[whole[are_on_surface(surface.points[surface.faces[whole]].mean(axis=1), other, near)]] = True
    if not shared.any() or shared.all():
        return surface
    return replace(surface, faces=surface.faces[~shared], shape=None)
