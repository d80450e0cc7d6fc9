"""The regions of the mesher's tetrahedra."""

from collections.abc import Sequence

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from tetlux.meshing.arrays import BoolArray, FloatArray, IntArray, spread_indices
from tetlux.meshing.surface.surface import Surface
from tetlux.meshing.tets.geometry import tetrahedron_volumes
from tetlux.meshing.tets.nesting import are_on_surface
from tetlux.meshing.tets.regions import sort_by_volume
from tetlux.meshing.tets.topology import find_shared_faces

# Tetrahedra per compartment that are tested for lying in a region.
COMPARTMENT_SAMPLES = 500
# All tetrahedra of a compartment are tested if its samples disagree on more than this share of its volume, or of the
# region's volume.
DISSENT = 0.1
# A node on a surface is at most this many envelopes from it.
ENVELOPE_SLACK = 1.01


def tag_tetrahedra(
    points: FloatArray, tetrahedra: IntArray, surface: Surface, regions: Sequence[Surface], envelope: float
) -> IntArray:
    """The region of each tetrahedron, (m,); -1 outside the body.

    Triangles with all corners in the envelope of a surface divide the mesh into compartments, each of which lies in
    one region. So a few sample tetrahedra per compartment decide, and one whose centroid is in the envelope but on the
    wrong side follows the rest. A tetrahedron with all corners in the envelope is a compartment of its own.

    Parameters
    ----------
    points : (n, 3) ndarray
    tetrahedra : (m, 4) ndarray
    surface : Surface
    regions : sequence of Surface
        The surfaces that the mesher was given.
    envelope : float
        Largest distance of nodes on a surface from it, unit.
    """
    shared = find_shared_faces(tetrahedra, len(points))
    centroids, volumes = points[tetrahedra].mean(axis=1), tetrahedron_volumes(points, tetrahedra)

    def is_inside(by: Surface) -> BoolArray:
        return _is_inside(points, centroids, volumes, shared, by, ENVELOPE_SLACK * envelope)

    inside = is_inside(surface)
    result = np.where(inside, 0, -1)
    for i in sort_by_volume(regions):
        result[inside & is_inside(regions[i - 1])] = i
    return result


def _is_inside(
    points: FloatArray,
    centroids: FloatArray,
    volumes: FloatArray,
    shared: tuple[IntArray, IntArray],
    surface: Surface,
    near: float,
) -> BoolArray:
    """Whether each tetrahedron lies inside a surface, (m,)."""
    cells, corners = shared
    cells = cells[~are_on_surface(points, surface, near)[corners].all(axis=1)]
    count = len(centroids)
    links = coo_array((np.ones(len(cells), dtype=bool), cells.T), shape=(count, count))
    compartment = connected_components(links, directed=False)[1]
    order = np.argsort(compartment, kind="stable")
    parts = np.split(order, np.flatnonzero(np.diff(compartment[order])) + 1)
    samples = np.concatenate([part[spread_indices(len(part), COMPARTMENT_SAMPLES)] for part in parts])
    inside, sampled = surface.contains(centroids[samples]), compartment[samples]
    share = np.bincount(sampled, inside) / np.bincount(sampled)
    result = np.asarray((share > 0.5)[compartment])
    # A gap in the mesh's copy of the surface merges two compartments: test each of their tetrahedra.
    size = np.bincount(compartment, volumes)
    mixed = np.minimum(share, 1.0 - share) * size > DISSENT * np.minimum(size, surface.volume)
    cells = np.flatnonzero(mixed[compartment])
    result[cells] = surface.contains(centroids[cells])
    return result
