"""`Patch`: the tetrahedra on which charges are subtracted, where they are close to the fluence."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.spatial import cKDTree

from tetlux.fem.known.charges import Charges
from tetlux.fem.media.coefficients import WITHIN
from tetlux.fem.media.medium import Medium
from tetlux.fem.media.varying import VaryingMedium
from tetlux.meshing.arrays import BoolArray, FloatArray, IntArray, NumberArray
from tetlux.meshing.describe import one_line
from tetlux.meshing.search.rays import OFFSET
from tetlux.meshing.surface.triangles import longest_sides
from tetlux.meshing.tets.march import march
from tetlux.meshing.tets.mesh import TetMesh
from tetlux.meshing.tets.topology import FACES

# A charge that is nearer to a facet than this share of the facet's longest edge is too near for the integrals over it.
RESOLVED = 3e-4
# Longest edge of an inner face of a patch, over its distance from the charges: across such faces the fluence jumps by
# the error of linear interpolation.
COARSEST_INNER = 1.5
# Charges are accurate where they differ from the fluence by at most this share of themselves.
ACCURATE = 0.5
# Coefficients of a medium that varies are those at the source if they differ by less than this share.
SAME = 1e-9


@dataclass(frozen=True, eq=False)
class Patch:
    """The tetrahedra of a mesh on which charges are subtracted.

    Parameters
    ----------
    mesh : TetMesh
    charges : Charges
    cells : (m,) ndarray of bool
        Whether each tetrahedron belongs to the patch.
    at_nodes : (n,) ndarray
        Fluence of the charges at the nodes, W/unit².
    """

    mesh: TetMesh
    charges: Charges
    cells: BoolArray
    at_nodes: NumberArray

    def with_charges(self, charges: Charges) -> "Patch":
        """The same tetrahedra with other charges."""
        return Patch(self.mesh, charges, self.cells, charges.fluence(self.mesh.points))

    @cached_property
    def faces(self) -> tuple[IntArray, BoolArray]:
        """Its outer faces (f, 3), oriented outward, and whether each is a facet of the body's boundary (f,)."""
        mesh = self.mesh
        if self.cells.all():
            return mesh.boundary_faces, np.ones(len(mesh.boundary_faces), dtype=bool)
        cells, opposite, on_boundary = self.outer
        return mesh.tetrahedra[cells[:, None], FACES[opposite]], on_boundary

    @cached_property
    def outer(self) -> tuple[IntArray, IntArray, BoolArray]:
        """Its outer faces by their tetrahedra (f,) and opposite corners (f,), and whether each is of the boundary."""
        inside = np.flatnonzero(self.cells)
        neighbours = self.mesh.neighbours[inside]
        # At the boundary the index -1 reads the last tetrahedron; the first condition overrides what it says.
        places = np.flatnonzero((neighbours < 0) | ~self.cells[neighbours])
        cells, opposite = np.divmod(places, 4)
        return inside[cells], opposite, neighbours.reshape(-1)[places] < 0

    __repr__ = one_line


def find_accurate_nodes(patch: Patch, fluence: NumberArray) -> BoolArray:
    """Whether the charges are close to the fluence (n,) at each node, (n,)."""
    accurate = np.abs(fluence - patch.at_nodes) <= ACCURATE * np.abs(patch.at_nodes)
    charges = patch.charges
    negative = charges.positions[: charges.sources][charges.strengths[: charges.sources] < 0]
    if len(negative):
        # Around negative sources the fluence of the charges crosses zero, where a relative difference says nothing.
        accurate |= cKDTree(negative).query(patch.mesh.points)[0] <= charges.medium.mean_free_path
    return np.asarray(accurate)


def patch_of(mesh: TetMesh, charges: Charges, accurate: BoolArray, at_nodes: NumberArray | None = None) -> Patch:
    """The patch of the tetrahedra whose nodes are all accurate (n,); empty if integrals over its faces would fail."""
    cells: BoolArray = np.asarray(accurate[mesh.tetrahedra].all(axis=1))
    if charges.region is not None:
        cells &= mesh.regions == charges.region
    if charges.varying is not None:
        cells[cells] = _has_medium(mesh.points[mesh.tetrahedra[cells]], charges.medium, charges.varying)
    patch = Patch(mesh, charges, cells, charges.fluence(mesh.points) if at_nodes is None else at_nodes)
    return patch if is_sound(patch) else replace(patch, cells=np.zeros(len(cells), dtype=bool))


def _has_medium(corners: FloatArray, medium: Medium, varying: VaryingMedium) -> BoolArray:
    """Whether a medium that varies is one medium throughout each of some tetrahedra (m, 4, 3), (m,).

    The charges solve the equation of that medium only. The points are those by which the tetrahedra get their
    coefficients.
    """
    sigma_a, reduced = varying.at((WITHIN @ corners).reshape(-1, 3))
    same = np.abs(sigma_a - medium.sigma_a) <= SAME * medium.sigma_a
    same &= np.abs(reduced - medium.reduced_scattering) <= SAME * medium.reduced_scattering
    return np.asarray(same.reshape(-1, 4).all(axis=1))


def is_sound(patch: Patch) -> bool:
    """Whether the integrals over the faces of a patch can be trusted, so that Gauss's theorem holds.

    The sources must lie inside the patch, the images outside it, and neither too close to its faces. The ledger does
    not show when they fail, since it is made of the same integrals.
    """
    mesh, charges, cells = patch.mesh, patch.charges, patch.cells
    places = charges.positions[: charges.sources]
    foot, face, _ = mesh.closest_boundary(places)
    if not _holds(patch, places, foot, face):
        return False
    if (np.linalg.norm(foot - places, axis=1) < RESOLVED * _sizes(mesh, face)).any():
        return False
    images = charges.positions[charges.sources :]
    foot, face, _ = mesh.closest_boundary(images)
    close = np.linalg.norm(foot - images, axis=1) < RESOLVED * _sizes(mesh, face)
    if (close & cells[mesh.boundary_cells[face]]).any() or _any_inside(patch, images):
        return False
    if cells.all():
        return True
    faces, on_boundary = patch.faces
    inner = mesh.points[faces[~on_boundary]]
    distances, _ = cKDTree(charges.positions).query(inner.mean(axis=1))
    return bool((longest_sides(inner) <= COARSEST_INNER * distances).all())


def holds_sources(patch: Patch) -> bool:
    """Whether all sources lie inside a patch."""
    places = patch.charges.positions[: patch.charges.sources]
    foot, face, _ = patch.mesh.closest_boundary(places)
    return _holds(patch, places, foot, face)


def _holds(patch: Patch, places: FloatArray, foot: FloatArray, face: IntArray) -> bool:
    """Whether all points (q, 3) lie inside a patch, by the nearest of the boundary and the triangle there (q,)."""
    cells = _point_cells(patch.mesh, places, foot, face)
    return bool((cells >= 0).all() and patch.cells[cells].all())


def _sizes(mesh: TetMesh, faces: IntArray) -> FloatArray:
    """Longest sides of boundary triangles, (q,)."""
    return mesh.boundary_sides[faces]


def _point_cells(mesh: TetMesh, places: FloatArray, foot: FloatArray, face: IntArray) -> IntArray:
    """The tetrahedra that points (q, 3) lie in, (q,); -1 for points outside.

    Found by marching from the nearest points `foot` (q, 3) of the boundary, in its triangles `face` (q,).
    """
    way, found = places - foot, np.full(len(places), -1)
    lengths = np.linalg.norm(way, axis=1)
    directions = way / np.where(lengths > 0, lengths, 1.0)[:, None]
    for part in march(
        mesh, foot, directions, lengths, np.where(lengths > 0, mesh.boundary_cells[face], -1), keep=False
    ):
        last = np.flatnonzero(part.leave == lengths[part.paths])
        found[part.paths[last]] = part.cells[last]
    return found


def _any_inside(patch: Patch, places: FloatArray) -> bool:
    """Whether any of the points (q, 3) lies in a patch.

    A ray away from the charges rules out most points: those from which it does not leave the body through a facet.
    """
    mesh = patch.mesh
    away = places - patch.charges.positions[0]
    away /= np.linalg.norm(away, axis=1, keepdims=True)
    inside = np.zeros(len(places), dtype=bool)
    # A ray misses a facet that it starts on: one ray starts at the point, another a little before it.
    for begin in (0.0, -2.0 * OFFSET * mesh.diagonal):
        _, met = mesh.rays.first(places + begin * away, away)
        inside |= (met >= 0) & (np.einsum("ij,ij->i", mesh.surface.normals[met], away) > 0)
    if not inside.any():
        return False
    found, _ = mesh.locate(places[inside])
    return bool(patch.cells[found[found >= 0]].any())


def inherit_accurate_nodes(accurate: BoolArray, points: FloatArray, finer: TetMesh) -> BoolArray:
    """Accurate nodes of a refined mesh: its old nodes, `points` (n, 3), keep theirs, a new one has its neighbour's."""
    new = finer.points[len(points) :]
    if accurate.all() or len(new) == 0:
        return np.concatenate([accurate, np.ones(len(new), dtype=bool)])
    return np.concatenate([accurate, accurate[cKDTree(points).query(new)[1]]])
