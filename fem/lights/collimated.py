"""Parallel light: on the whole body, or a spot of any pattern."""

from dataclasses import dataclass, replace

import numpy as np

from tetlux.fem.ballistic.follow import refract_and_follow
from tetlux.fem.ballistic.rays import Rays
from tetlux.fem.body.body import Body
from tetlux.fem.inputs import check_positive, unit_vector
from tetlux.fem.lights.arrows import Arrows
from tetlux.fem.lights.illumination import ENTRY_RAYS, illumination_resolution
from tetlux.fem.lights.spots import IMMUTABLE_SPOTS, Spot
from tetlux.fem.lights.spots.plane import sunflower
from tetlux.fem.lights.spots.triangles import area_vectors, sample_spot, split_for_spot
from tetlux.fem.media.coefficients import Coefficients
from tetlux.fem.sources.deposit import Deposit
from tetlux.fem.sources.footprint import Footprint
from tetlux.fem.sources.hints import MeshHints
from tetlux.meshing.arrays import FloatArray, IntArray, Vector, sum_by_index
from tetlux.meshing.describe import as_text
from tetlux.meshing.errors import InputError
from tetlux.meshing.surface.surface import Surface
from tetlux.meshing.surface.triangles import triangle_areas, vertex_normals
from tetlux.meshing.tets.mesh import TetMesh

# Entries, at most, at which the penetration depth is computed.
DEPTH_SAMPLES = 64
# Arrows of light on the whole body in pictures.
ARROWS = 3

# Barycentric coordinates of three points of a triangle, whose mean is exact for quadratic functions.
THREE_POINTS = (np.ones((3, 3)) + 3.0 * np.eye(3)) / 6.0
# A facet whose normal differs from one at a corner by an angle of less than this cosine is flat, and light at a smaller
# cosine than the second one is refracted by flat facets.
LEAST_BEND_COSINE, LEAST_COSINE = 0.8, 0.02
# Where light meets a surface at a smaller cosine, it varies along the surface as fast as with depth.
GRAZING = 0.18


@dataclass(frozen=True)
class CollimatedBeam:
    """Parallel light, with the shadows that the body casts on itself.

    At the surface a part is reflected by Fresnel's law, and the rest, of irradiance E0, is refracted. After a path l it
    has the irradiance ``E = E0 exp(-sigma_t* l)`` and scatters by delta-Eddington: ``Q0 = sigma_s* E`` and ``Q1 = g*
    sigma_s* E s``, where s is its direction, sigma_s* and g* are those of `Medium.delta_eddington`, and ``sigma_t* =
    sigma_a + sigma_s*`` (Joseph, Wiscombe & Weinman 1976). At the far side it is reflected inside or leaves, and may
    enter the body again. Light that is reflected outside is lost.

    Parameters
    ----------
    direction : (3,) floats
        In which the light travels, of any length.
    irradiance : float
        On a plane across the beam, W/unit²; of a spot, where it is brightest.
    spot : Spot, optional
        Its cross-section; without one it illuminates the whole body.
    from_center : bool
        Whether the light starts at the center of the spot, and not far away.

    Raises
    ------
    InputError
        If the direction is zero or the irradiance not positive; and, when solved, if the light misses the body.

    Examples
    --------
    >>> from tetlux.fem import Disc
    >>> laser = CollimatedBeam(direction=(0.0, 0.0, -1.0), irradiance=0.5, spot=Disc((0.0, 0.0, 20.0), radius=2.0))
    """

    direction: Vector
    irradiance: float = 1.0
    spot: Spot | None = None
    from_center: bool = False

    def __post_init__(self) -> None:
        unit_vector(self.direction, "direction")
        check_positive(self.irradiance, "irradiance", "W/unit²")

    def deposit_in(self, body: Body) -> Deposit:
        """Find where the light enters; its rays start on the facets of a mesh, see `deposit_on`.

        See `tetlux.fem.Light` for parameters and result.
        """
        surface = body.surface
        entries = self.entries(surface)
        if len(entries) == 0:
            raise InputError(
                f"the collimated light along {as_text(self.direction)} misses the body, which spans "
                f"{surface.extent}; change its direction or the spot's center."
            )
        depth = self._least_depth(body, entries)
        return Deposit(
            hints=self._hints(surface, entries, depth),
            footprint=Footprint(entries, radius=np.inf if self.spot is None else None),
            on_mesh=self,
        )

    def _hints(self, surface: Surface, entries: FloatArray, depth: float) -> MeshHints:
        if self.spot is not None:
            return MeshHints(illumination_resolution(surface, depth, self.spot.reach), entries)
        cosines = -surface.project(entries)[1] @ unit_vector(self.direction, "direction")
        resolution = illumination_resolution(surface, depth)
        return MeshHints(resolution, entries, depth=depth, rims=entries[cosines < GRAZING])

    def arrows(self, surface: Surface) -> Arrows:
        """Draw several on the whole body, one on a spot; see `HasArrows`."""
        direction = unit_vector(self.direction, "direction")
        return Arrows(self.entries(surface), direction, ARROWS if self.spot is None else 1)

    def _least_depth(self, body: Body, entries: FloatArray) -> float:
        """Least depth, over some of the entries, at which the beam has decayed to 1/e, unit."""
        some = body.just_inside(entries[:: -(-len(entries) // DEPTH_SAMPLES)])
        directions = np.broadcast_to(unit_vector(self.direction, "direction"), some.shape)
        _, ends = body.extents_along(some, directions)
        return float(body.paths(some, directions, ends).distances_at(np.ones(len(some)), delta_eddington=True).min())

    def entries(self, surface: Surface) -> FloatArray:
        """Sample the places where the light first meets a surface.

        Parameters
        ----------
        surface : Surface

        Returns
        -------
        (e, 3) ndarray
            At most about 2000; none if the light misses the surface.
        """
        direction = unit_vector(self.direction, "direction")
        middle = 0.5 * (surface.points.min(axis=0) + surface.points.max(axis=0))
        if self.spot is None:
            starts = middle + sunflower(ENTRY_RAYS, 0.5 * surface.diagonal, direction)
        else:
            offsets = self.spot.samples(ENTRY_RAYS, direction)
            offsets = offsets[self.spot.brightness(offsets, direction) > 0]
            starts = np.asarray(self.spot.center, dtype=float) + offsets
        if self.spot is None or not self.from_center:
            # Start in front of the body, wherever the spot's center is along the beam.
            starts = starts + np.outer((middle - starts) @ direction - surface.diagonal, direction)
        directions = np.broadcast_to(direction, starts.shape)
        distances, faces = surface.rays.first(starts, directions)
        met = faces >= 0
        return np.asarray(starts + np.where(met, distances, 0.0)[:, None] * direction)[met]

    def deposit_on(self, mesh: TetMesh, surface: Surface, coefficients: Coefficients) -> Deposit:
        """See `tetlux.fem.sources.deposit.MeshDependent`."""
        del surface
        if self.spot is None or isinstance(self.spot, IMMUTABLE_SPOTS):
            key = (type(self), tuple(self.direction), self.spot, self.from_center)
            rays, normals = mesh.cache.get(key, lambda: self._incident_rays(mesh))
        else:
            rays, normals = self._incident_rays(mesh)
        arriving = replace(rays, powers=self.irradiance * rays.powers)
        return refract_and_follow(mesh, coefficients, arriving, normals)

    def _incident_rays(self, mesh: TetMesh) -> tuple[Rays, FloatArray]:
        """One ray for each illuminated facet of a mesh, with its power at an irradiance of 1, and the normals (r, 3).

        There are three rays a facet where layers of tetrahedra have their light exactly. Elsewhere the error of the
        exitance would be 5 % smaller and the computation would take twice as long.
        """
        direction = unit_vector(self.direction, "direction")
        normals, _ = triangle_areas(mesh.points, mesh.boundary_faces)
        facets = np.flatnonzero(normals @ direction < 0)
        corners = mesh.points[mesh.boundary_faces[facets]]
        if self.spot is not None:
            corners, owners = split_for_spot(self.spot, corners, direction)
            facets = facets[owners]
        points, powers, reach = self._sample_pieces(corners, direction)
        lit = np.flatnonzero((powers > 0) & (reach > 0))
        # A piece is in shadow if the way back to the light meets another facet.
        distances, _ = mesh.rays.first(points[lit], np.broadcast_to(-direction, (len(lit), 3)))
        lit = lit[distances >= reach[lit]]
        facets, places = np.unique(facets[lit], return_inverse=True)
        total = sum_by_index(places, powers[lit], len(facets))
        if self.spot is None and mesh.columns is not None:
            return _rays_on_curved(mesh, facets, total, direction)
        # The power of all pieces of a facet starts at their centroid.
        starts = np.column_stack(
            [sum_by_index(places, powers[lit] * axis, len(facets)) / total for axis in points[lit].T]
        )
        directions = np.broadcast_to(direction, starts.shape)
        return Rays(starts, directions, total, mesh.boundary_cells[facets]), normals[facets]

    def _sample_pieces(self, corners: FloatArray, direction: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Place, power at an irradiance of 1, and distance that light has travelled, for pieces of facets (p, 3, 3)."""
        projected_areas = -area_vectors(corners) @ direction
        if self.spot is None:
            return corners.mean(axis=1), projected_areas, np.full(len(corners), np.inf)
        points, brightness = sample_spot(self.spot, corners, direction)
        reach = np.full(len(corners), np.inf)
        if self.from_center:
            reach = (points - np.asarray(self.spot.center, dtype=float)) @ direction
        return points, brightness * projected_areas, reach


def _rays_on_curved(
    mesh: TetMesh, facets: IntArray, powers: FloatArray, direction: FloatArray
) -> tuple[Rays, FloatArray]:
    """Three rays for each of some facets (f,) with their powers (f,), and the normals (3f, 3).

    The facets stand for a curved surface, on which the incidence, and so the irradiance, differs between the three. Of
    oblique light, which moves along the surface as it goes down, one ray gives some nodes too much and others too
    little, by several per cent.
    """
    at_corners = vertex_normals(mesh.boundary_points, mesh.boundary_triangles)[mesh.boundary_triangles[facets]]
    flat = mesh.surface.normals[facets][:, None]
    is_smooth = np.einsum("fci,fki->fc", at_corners, flat).min(axis=1) > LEAST_BEND_COSINE
    normals = np.where(is_smooth[:, None, None], THREE_POINTS @ at_corners, flat)
    normals /= np.linalg.norm(normals, axis=2, keepdims=True)
    cosines = np.maximum(-normals @ direction, 0.0)
    # Where all are in the dark, the facet is at the border of the light.
    weights = np.where(cosines.max(axis=1, keepdims=True) == 0, 1.0, cosines)
    shares = weights / weights.sum(axis=1, keepdims=True)
    normals = np.where(cosines[..., None] > LEAST_COSINE, normals, flat).reshape(-1, 3)
    starts = (THREE_POINTS @ mesh.points[mesh.boundary_faces[facets]]).reshape(-1, 3)
    directions = np.broadcast_to(direction, starts.shape)
    cells = np.repeat(mesh.boundary_cells[facets], 3)
    return Rays(starts, directions, (powers[:, None] * shares).reshape(-1), cells), normals
