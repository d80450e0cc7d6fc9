"""Check that tetrahedra fill a body without gaps and overlaps: each face is shared by two or on the boundary."""

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from tetlux.meshing.arrays import BoolArray, IntArray
from tetlux.meshing.errors import InputError
from tetlux.meshing.host.blocks import group_keys
from tetlux.meshing.notes import Note
from tetlux.meshing.tets.mesh import TetMesh
from tetlux.meshing.tets.topology import FACES, face_keys

# A facet is covered if a tetrahedron contains the point at this distance outside its centroid: the first share of the
# facet's size, but at least the second share of the mesh's diagonal, since files round coordinates.
PROBE_DISTANCE, LEAST_PROBE_DISTANCE = 1e-4, 2e-6
# A tetrahedron overlaps the mesh if that point is deeper in it than this many times the distance.
OVERLAP_DEPTH = 20.0
# Largest share of the boundary's area that may lie against or inside other tetrahedra, with a warning.
MOST_COVERED = 1e-3


def count_doubly_covered_faces(corners: IntArray, nodes: int) -> int:
    """Count the faces with several tetrahedra on one side: these tetrahedra overlap.

    Parameters
    ----------
    corners : (m, 4) ndarray
        Corners of positively oriented tetrahedra.
    nodes : int
        Number of nodes of the mesh.
    """
    faces = corners[:, FACES].reshape(-1, 3)
    _, face = group_keys(face_keys(corners, nodes))
    # Tetrahedra on one side of a face list its corners in the same orientation: an even or an odd permutation.
    first, second = faces[:, 0], faces[:, 1]
    even = ((first < second) & ((second < faces[:, 2]) | (faces[:, 2] < first))) | (
        (first > second) & (second < faces[:, 2]) & (faces[:, 2] < first)
    )
    count = int(face.max()) + 1
    covered = np.bincount(face[even], minlength=count), np.bincount(face[~even], minlength=count)
    return int((np.maximum(*covered) > 1).sum())


def check_overlap(corners: IntArray, nodes: int) -> None:
    """Refuse tetrahedra that share a face and lie on the same side of it.

    Raises
    ------
    InputError
    """
    covered = count_doubly_covered_faces(corners, nodes)
    if covered:
        raise InputError(
            f"tetrahedra overlap: {covered:,} of their faces have several tetrahedra on one side, as when some are "
            "given twice; give each part of the volume once."
        )


def check_conformity(mesh: TetMesh) -> tuple[str, ...]:
    """Refuse a mesh with overlaps, or with parts that touch without common nodes.

    Returns
    -------
    tuple of str
        Notes on facets that lie against others, if they are few.

    Raises
    ------
    InputError
    """
    check_overlap(mesh.tetrahedra, len(mesh.points))
    return check_facets(mesh)


def conformity_of(mesh: TetMesh) -> tuple[str, ...]:
    """`check_conformity`, computed once per mesh."""
    return mesh.cache.get(check_conformity, lambda: check_conformity(mesh))


def check_facets(mesh: TetMesh, merged: bool = False) -> tuple[str, ...]:
    """The part of `check_conformity` for the boundary; `merged` if coincident nodes were merged."""
    against, inside = _covered_facets(mesh)
    area = float(mesh.boundary_areas[against | inside].sum())
    if area == 0.0:
        parts = _count_parts(mesh)
        if parts == 1:
            return ()
        sentence = f"the mesh is {parts} parts without a common node; no light passes between them."
        return (Note("several-bodies", sentence, value=parts),)
    figure = f"{area:.3g} {mesh.unit}²"
    if area <= MOST_COVERED * mesh.area:
        sentence = f"{figure} of the mesh's boundary face each other inside it; no light passes there."
        return (Note("facets-covered", sentence, value=area),)
    if mesh.boundary_areas[inside].sum() > 0.5 * area:
        raise InputError(
            f"tetrahedra overlap: {figure} of the boundary lie inside other tetrahedra; give each part of the volume "
            "once."
        )
    raise InputError(
        f"parts touch without having their nodes in common: {figure} of the boundary face each other inside, and no "
        "light would pass there; mesh the parts together, so that they share the nodes between them (in gmsh with "
        "BooleanFragments or Coherence)"
        + ("." if merged else ", or give doubled nodes to mesh_from_arrays, which joins them.")
    )


def _count_parts(mesh: TetMesh) -> int:
    """The number of connected components by common nodes."""
    size = len(mesh.points)
    used = np.unique(mesh.tetrahedra).size
    links = coo_array((np.ones(len(mesh.edges), dtype=bool), mesh.edges.T), shape=(size, size))
    # Each unused node counts as a component.
    return int(connected_components(links, directed=False)[0]) - (size - used)


def _covered_facets(mesh: TetMesh) -> tuple[BoolArray, BoolArray]:
    """Boundary facets that lie against another tetrahedron, and those inside one, (f,) each."""
    corners = mesh.points[mesh.boundary_faces]
    middles = corners.mean(axis=1)
    normals, areas = mesh.surface.normals, mesh.boundary_areas
    steps = np.maximum(PROBE_DISTANCE * np.sqrt(areas), LEAST_PROBE_DISTANCE * mesh.diagonal)
    cells, weights = mesh.locate(middles + steps[:, None] * normals)
    covered = (cells >= 0) & (cells != mesh.boundary_cells)
    rows = np.flatnonzero(covered)
    # The distance from a face of that tetrahedron is a barycentric coordinate times the height on the face.
    heights = 1.0 / np.linalg.norm(mesh.hat_gradients[cells[rows]], axis=2)
    deep = (weights[rows] * heights).min(axis=1) > OVERLAP_DEPTH * steps[rows]
    inside = np.zeros(len(cells), dtype=bool)
    inside[rows[deep]] = True
    return covered & ~inside, inside
