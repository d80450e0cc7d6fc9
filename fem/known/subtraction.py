"""What is known of a point source in closed form, so that finite elements need not resolve it.

Near a source the fluence is that of a half-space with the Robin boundary (`tetlux.fem.exact.half_space`): the
source, its mirror image, and a line of sinks above that (Bryan 1890). With the line cut into points, all of it is
a sum of screened charges ``q e^{-k r}/(4 pi D r)``: one inside the body, the others outside. Whatever their
strengths, inside the body such a sum G solves the diffusion equation exactly, so nothing is lost by cutting the
line into few points, or by leaving out those that would come to lie in another part of a body: G then is only a
poorer guess of the fluence.

Finite elements solve for the rest. G is used on a patch of tetrahedra only, those where it is a good guess, and
the fluence is ``phi_h = u_h + (G - I_h G)`` there, with ``I_h G`` the linear interpolant: u_h has the fluence's own
values at the nodes, and is plain P1 where there is no patch. In the weak form the patch adds ``-a(G - I_h G, v)``,
and ``a(G, v)`` is, by Gauss, the source's own load and integrals over the patch's faces alone.

Beams without width are sums of such sources too, some of them negative: `tetlux.fem.known.beam_as_charges`.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.spatial import cKDTree
from skfem.quadrature import get_quadrature
from skfem.refdom import RefTri

from tetlux.fem.media.coefficients import coefficients_of
from tetlux.fem.media.medium import Medium
from tetlux.fem.operators.assembly import Mass
from tetlux.fem.operators.loads import load_vector
from tetlux.fem.sources.deposit import Deposit
from tetlux.meshing.arrays import BoolArray, FloatArray, IntArray, summed
from tetlux.meshing.describe import one_line
from tetlux.meshing.host.blocks import in_blocks
from tetlux.meshing.search.rays import OFFSET
from tetlux.meshing.surface.subdivide import quartered
from tetlux.meshing.surface.surface import Surface, longest_sides, triangle_areas
from tetlux.meshing.tets.march import march
from tetlux.meshing.tets.mesh import TetMesh
from tetlux.meshing.tets.topology import FACES

# The line of sinks is cut into panels, each twice as long as what is below it, with this many Gauss points each,
# as far as a share of exp(-REACH) of it.
PANEL_POINTS = 2
REACH = 14.0
# A charge keeps this share of its height above the entry clear of any other part of the body.
CLEARANCE = 0.5
# Close to its source fluence grows like 1/r: a node closer than this share of the source's depth, or of a mean free
# path, shows the fluence at that distance.
CLOSEST = 0.02
# A source this near to a facet, by the facet's longest edge, is too near for the integrals over it to see.
RESOLVED = 3e-4
# Inner faces of a patch are no longer than this times their distance from the charges: across them the fluence steps
# by what linear interpolation misses.
COARSEST_INNER = 1.5
# A guess that is off by more than this share of itself is not used.
GOOD_GUESS = 0.5
# More charges than this cost more than the tetrahedra that they save.
MOST_CHARGES = 3000
# Rules for the faces of a patch by their longest edge over the distance to the nearest charge; where that is larger
# than the last limit, a face is cut in four.
_RULES = tuple((limit, *get_quadrature(RefTri, degree)) for limit, degree in ((0.15, 2), (0.5, 4), (2.0, 8)))
_CUTS = 12
# Pairs of a point and a charge that are worked on at once, so that they stay in the processor's cache.
PAIRS = 100_000


@dataclass(frozen=True, eq=False)
class Charges:
    """Screened point charges: ``sum_i q_i e^{-k r_i}/(4 pi D r_i)``.

    Parameters
    ----------
    positions : (c, 3) ndarray
        The sources first, inside the body; the others lie outside.
    strengths : (c,) ndarray
        W.
    sources : int
        How many of them are sources.
    closest : float
        Distance that no charge is seen from nearer than, unit.
    medium : Medium
    region : int, optional
        The region that the sources are in, if the body has several media.
    """

    positions: FloatArray
    strengths: FloatArray
    sources: int
    closest: float
    medium: Medium
    region: int | None = None

    @property
    def dips(self) -> bool:
        """Whether some of the sources are negative, as those of a first moment are."""
        return bool((self.strengths[: self.sources] < 0).any())

    def fluence(self, points: FloatArray) -> FloatArray:
        """Fluence at points (n, 3), (n,), W/unit²."""
        return self._at(points, None)

    def fluence_and_gradient(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Fluence (n,), W/unit², and its gradient (n, 3), W/unit³."""
        gradient = np.empty((len(points), 3))
        return self._at(points, gradient), gradient

    def _at(self, points: FloatArray, gradient: FloatArray | None) -> FloatArray:
        """The fluence, with its gradient written to an array if there is one."""
        k = self.medium.sigma_tr
        origin = self.positions[0]
        charges = self.positions - origin
        strengths = self.strengths / (4.0 * np.pi * self.medium.diffusion)
        fluence = np.empty(len(points))

        def work(block: slice) -> None:
            x = points[block] - origin
            # |x - p|² from |x|² + |p|² - 2 x.p would lose digits close to a charge.
            distance = np.square(x[:, :1] - charges[:, 0])
            distance += np.square(x[:, 1:2] - charges[:, 1])
            distance += np.square(x[:, 2:] - charges[:, 2])
            np.sqrt(distance, out=distance)
            np.maximum(distance, self.closest, out=distance)
            each = np.exp(-k * distance)
            each /= distance
            fluence[block] = each @ strengths
            if gradient is not None:
                each *= strengths
                each *= (k + 1.0 / distance) / distance
                gradient[block] = each @ charges - each.sum(axis=1)[:, None] * x

        in_blocks(work, len(points), max(1, PAIRS // len(charges)))
        return fluence

    __repr__ = one_line


def charges_of(
    points: FloatArray,
    powers: FloatArray,
    surface: Surface,
    medium: Medium,
    *,
    images: bool | BoolArray,
    most: int = MOST_CHARGES,
    region: int | None = None,
) -> Charges | None:
    """Point sources and their images, each in the plane that touches the surface nearest to it.

    Parameters
    ----------
    points : (s, 3) ndarray
        Inside the body.
    powers : (s,) ndarray
        W.
    surface : Surface
    medium : Medium
    images : bool or (s,) ndarray of bool
        Of which sources there are images; without them it is the sources in free space.
    most : int
        How many charges can be afforded.
    region : int, optional
        See `Charges`.

    Returns
    -------
    Charges or None
        None if they would be more.
    """
    positions, strengths, count = [points], [powers], len(points)
    feet, normals = surface.project(points)
    depths = np.linalg.norm(feet - points, axis=1)
    mirrored = np.broadcast_to(images, len(points)) & (depths > 0)
    for i in np.flatnonzero(mirrored).tolist():
        if count > most:
            return None
        foot, normal, depth, power = feet[i], normals[i], float(depths[i]), float(powers[i])
        heights, weights = _image_line(depth, medium.extrapolation_length)
        line = foot + heights[:, None] * normal
        clear = np.linalg.norm(surface.closest(line)[0] - line, axis=1) >= CLEARANCE * heights
        clear &= ~surface.contains(line)
        # Beyond the first charge that comes too close to the body again there may be more of it.
        clear = np.logical_and.accumulate(clear)
        positions.append(line[clear])
        strengths.append(power * weights[clear])
        count += int(clear.sum())
    if count > most:
        return None
    closest = CLOSEST * min(medium.mean_free_path, float(depths.min()))
    return Charges(np.vstack(positions), np.concatenate(strengths), len(points), closest, medium, region)


def _image_line(depth: float, zb: float) -> tuple[FloatArray, FloatArray]:
    """Heights above the plane and strengths of the images of a unit source: the mirror first, then the sinks."""
    edges = [0.0, depth]
    while edges[-1] < REACH * zb:
        edges.append(min(2.0 * edges[-1] + depth, REACH * zb))
    low, high = np.array(edges[:-1])[:, None], np.array(edges[1:])[:, None]
    nodes, weights = np.polynomial.legendre.leggauss(PANEL_POINTS)
    along = (0.5 * (low + high) + 0.5 * (high - low) * nodes).ravel()
    sinks = -2.0 / zb * np.exp(-along / zb) * (0.5 * (high - low) * weights).ravel()
    return depth + np.concatenate([[0.0], along]), np.concatenate([[1.0], sinks])


@dataclass(frozen=True, eq=False)
class Patch:
    """Where on a mesh charges are subtracted.

    Parameters
    ----------
    mesh : TetMesh
    charges : Charges
    cells : (m,) ndarray of bool
        The tetrahedra of the patch.
    at_nodes : (n,) ndarray
        The charges' fluence at the nodes.
    """

    mesh: TetMesh
    charges: Charges
    cells: BoolArray
    at_nodes: FloatArray

    @cached_property
    def faces(self) -> tuple[IntArray, BoolArray]:
        """Its outer faces (f, 3), oriented outward, and which of them are of the body's boundary (f,)."""
        mesh, inside = self.mesh, np.flatnonzero(self.cells)
        if len(inside) == len(self.cells):
            return mesh.boundary_faces, np.ones(len(mesh.boundary_faces), dtype=bool)
        beyond = mesh.neighbours[inside]
        # Of those at the boundary, which have no number, the last one's is looked at, and does not matter.
        places = np.flatnonzero((beyond < 0) | ~self.cells[beyond])
        cells, faces = np.divmod(places, 4)
        return mesh.tetrahedra[inside[cells, None], FACES[faces]], beyond.reshape(-1)[places] < 0

    __repr__ = one_line


@dataclass(frozen=True, eq=False)
class PatchTerms:
    """What a patch adds to the system and to the ledger.

    Attributes
    ----------
    load : (n,) ndarray
        ``P v(x0) - a(G - I_h G, v)`` over the patch, W.
    exited, absorbed : float
        Of ``G - I_h G``, W.
    """

    load: FloatArray
    exited: float
    absorbed: float

    __repr__ = one_line


def good_nodes(patch: Patch, fluence: FloatArray) -> BoolArray:
    """Where the charges are a good guess of a fluence (n,) at the nodes, (n,)."""
    good = np.abs(fluence - patch.at_nodes) <= GOOD_GUESS * np.abs(patch.at_nodes)
    charges = patch.charges
    negative = charges.positions[: charges.sources][charges.strengths[: charges.sources] < 0]
    if len(negative):
        # Round them the charges' fluence passes through zero, and a share of that says nothing.
        good |= cKDTree(negative).query(patch.mesh.points)[0] <= charges.medium.mean_free_path
    return np.asarray(good)


def patch_of(mesh: TetMesh, charges: Charges, good: BoolArray, at_nodes: FloatArray | None = None) -> Patch:
    """The patch of the tetrahedra whose nodes are all good; an empty one if that would not be sound."""
    cells: BoolArray = np.asarray(good[mesh.tetrahedra].all(axis=1))
    if charges.region is not None:
        cells &= mesh.regions == charges.region
    patch = Patch(mesh, charges, cells, charges.fluence(mesh.points) if at_nodes is None else at_nodes)
    return patch if _is_sound(patch) else replace(patch, cells=np.zeros(len(cells), dtype=bool))


def _is_sound(patch: Patch) -> bool:
    """Whether the integrals over a patch's faces are those that Gauss's theorem speaks of.

    The ledger cannot tell, since it is made of the same integrals.
    """
    mesh, charges, cells = patch.mesh, patch.charges, patch.cells
    places = charges.positions[: charges.sources]
    foot, face, _ = mesh.closest_boundary(places)
    homes = _homes(mesh, places, foot, face)
    if (homes < 0).any() or not cells[homes].all():
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
    apart, _ = cKDTree(charges.positions).query(inner.mean(axis=1))
    return bool((longest_sides(inner) <= COARSEST_INNER * apart).all())


def _sizes(mesh: TetMesh, faces: IntArray) -> FloatArray:
    """Longest sides of boundary triangles, (q,)."""
    return longest_sides(mesh.points[mesh.boundary_faces[faces]])


def _homes(mesh: TetMesh, places: FloatArray, foot: FloatArray, face: IntArray) -> IntArray:
    """The tetrahedra that points (q, 3) lie in, by the way there from the boundary (q, 3); -1 where it ends outside."""
    way, homes = places - foot, np.full(len(places), -1)
    lengths = np.linalg.norm(way, axis=1)
    directions = way / np.where(lengths > 0, lengths, 1.0)[:, None]
    for part in march(
        mesh, foot, directions, lengths, np.where(lengths > 0, mesh.boundary_cells[face], -1), keep=False
    ):
        last = np.flatnonzero(part.leave == lengths[part.paths])
        homes[part.paths[last]] = part.cells[last]
    return homes


def _any_inside(patch: Patch, places: FloatArray) -> bool:
    """Whether any of some points (q, 3) lies in a patch: for most, what they see away from the charges tells."""
    mesh = patch.mesh
    away = places - patch.charges.positions[0]
    away /= np.linalg.norm(away, axis=1, keepdims=True)
    inside = np.zeros(len(places), dtype=bool)
    # Rays do not see what they are next to: one begins before the point, and one behind it.
    for begin in (0.0, -2.0 * OFFSET * mesh.diagonal):
        _, met = mesh.rays.first(places + begin * away, away)
        inside |= (met >= 0) & (np.einsum("ij,ij->i", mesh.surface.normals[met], away) > 0)
    if not inside.any():
        return False
    homes, _ = mesh.locate(places[inside])
    return bool(patch.cells[homes[homes >= 0]].any())


def inherited(good: BoolArray, points: FloatArray, finer: TetMesh) -> BoolArray:
    """Good nodes of a mesh, by the nearest node, on a refinement of it."""
    added = finer.points[len(points) :]
    if good.all() or len(added) == 0:
        return np.concatenate([good, np.ones(len(added), dtype=bool)])
    return np.concatenate([good, good[cKDTree(points).query(added)[1]]])


def patch_terms(patch: Patch, mass: Mass) -> PatchTerms:
    """Assemble what a patch adds.

    Parameters
    ----------
    patch : Patch
    mass : {"lumped", "consistent"}
        As in the system matrix.

    Returns
    -------
    PatchTerms
    """
    mesh, charges, medium = patch.mesh, patch.charges, patch.charges.medium
    sources = Deposit(points=charges.positions[: charges.sources], powers=charges.strengths[: charges.sources])
    if not patch.cells.any():
        return PatchTerms(load_vector(mesh, coefficients_of(medium), sources), exited=0.0, absorbed=0.0)
    count = len(mesh.points)
    faces, on_boundary = patch.faces
    out_of_faces, through = _integrals(mesh.points[faces], charges)
    robin = 1.0 / (2.0 * medium.boundary_factor)
    leaving = robin * out_of_faces * on_boundary[:, None]
    load = -summed(faces, through + leaving, count)
    # The interpolant's own part: stiffness, absorption and boundary of the patch, times G at the nodes.
    inside = slice(None) if patch.cells.all() else np.flatnonzero(patch.cells)
    cells = mesh.tetrahedra[inside]
    values = patch.at_nodes[cells]
    hats = mesh.hat_gradients[inside]
    volumes = mesh.volumes[inside]
    slope = np.einsum("mij,mi->mj", hats, values)
    stiff = (medium.diffusion * volumes)[:, None] * np.einsum("mij,mj->mi", hats, slope)
    absorbed = medium.sigma_a * volumes[:, None] * _mass(values, mass)
    _, areas = triangle_areas(mesh.points, faces)
    exited = robin * (areas * on_boundary)[:, None] * _mass(patch.at_nodes[faces], mass)
    load += summed(cells, stiff + absorbed, count) + summed(faces, exited, count)
    return PatchTerms(
        load,
        exited=float(leaving.sum() - exited.sum()),
        # Gauss: what the charges absorb in the patch is the sources' power less what flows out through its faces.
        absorbed=float(sources.powers.sum() + through.sum() - absorbed.sum()),
    )


def _mass(values: FloatArray, mass: Mass) -> FloatArray:
    """Mass matrices of simplices of size 1 times values at their corners, (m, d + 1)."""
    corners = values.shape[1]
    if mass == "lumped":
        return np.asarray(values / corners)
    return np.asarray((values + values.sum(axis=1, keepdims=True)) / (corners * (corners + 1)))


def _integrals(corners: FloatArray, charges: Charges) -> tuple[FloatArray, FloatArray]:
    """Integrals over triangles (f, 3, 3) of G and of ``D dG/dn`` against their three hat functions, (f, 3) each."""
    value, flux = np.zeros((len(corners), 3)), np.zeros((len(corners), 3))
    tree = cKDTree(charges.positions)
    # Triangles still to do: which face they are part of, and the barycentric coordinates of their corners in it.
    owner, place = np.arange(len(corners)), np.broadcast_to(np.eye(3), (len(corners), 3, 3))
    for cut in range(_CUTS + 1):
        part = place @ corners[owner]
        size = longest_sides(part)
        near = size / np.maximum(tree.query(part.mean(axis=1))[0], 1e-12 * size) if len(part) else size
        done = np.zeros(len(part), dtype=bool)
        for limit, nodes, weights in _RULES:
            last = limit == _RULES[-1][0] and cut == _CUTS
            now = ~done & ((near < limit) | last)
            done |= now
            _add_rule(value, flux, owner[now], place[now], part[now], nodes, weights, charges)
        if done.all():
            break
        owner, place = np.repeat(owner[~done], 4), quartered(place[~done])
    return value, flux


def _add_rule(
    value: FloatArray,
    flux: FloatArray,
    owner: IntArray,
    place: FloatArray,
    part: FloatArray,
    nodes: FloatArray,
    weights: FloatArray,
    charges: Charges,
) -> None:
    if len(owner) == 0:
        return
    hats = np.column_stack([1.0 - nodes[0] - nodes[1], nodes[0], nodes[1]])
    fluence, gradient = charges.fluence_and_gradient((hats @ part).reshape(-1, 3))
    normal = np.cross(part[:, 1] - part[:, 0], part[:, 2] - part[:, 0])  # twice the area long
    area = np.linalg.norm(normal, axis=1)
    through = charges.medium.diffusion * np.einsum("fqi,fi->fq", gradient.reshape(len(part), -1, 3), normal)
    tests = hats @ place
    np.add.at(value, owner, np.einsum("fq,fqi->fi", fluence.reshape(len(part), -1) * area[:, None] * weights, tests))
    np.add.at(flux, owner, np.einsum("fq,fqi->fi", through * weights, tests))
