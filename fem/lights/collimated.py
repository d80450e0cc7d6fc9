"""Parallel light: over the whole body, or in a spot of any pattern."""

from dataclasses import dataclass, replace

import numpy as np

from tetlux.fem.ballistic.follow import Rays, entered, follow
from tetlux.fem.body.body import Body
from tetlux.fem.inputs import check_positive, unit_vector
from tetlux.fem.lights.arrows import Arrows
from tetlux.fem.lights.spots import UNCHANGING, Spot
from tetlux.fem.lights.spots.plane import scattered, sunflower
from tetlux.fem.media.coefficients import Coefficients
from tetlux.fem.sources.deposit import Deposit
from tetlux.meshing.arrays import FloatArray, IntArray, Vector, sum_by_index
from tetlux.meshing.describe import as_text
from tetlux.meshing.errors import InputError
from tetlux.meshing.surface.subdivide import quarter_triangles
from tetlux.meshing.surface.surface import Surface
from tetlux.meshing.surface.triangles import longest_sides, triangle_areas
from tetlux.meshing.tets.mesh import TetMesh

# Rays by which it is looked for where the light meets the body.
LOOKS = 2000
# And at so many of these, at most, it is looked at how deep it reaches.
DEPTHS = 64
# Light on the whole body is drawn as so many arrows.
ARROWS = 3
# Facets are quartered at most so many times to see a spot. What each part sees of it is looked up at so many points, at
# least and at most, and at so many together where that lies in between.
_CUTS = 16
_POINTS = (16, 256, 500_000)


@dataclass(frozen=True)
class CollimatedBeam:
    """Parallel light, with the shadows that the body casts on itself.

    Where it meets the body it is refracted, less Fresnel's loss, and scattered along its path by delta-Eddington,
    ``Q0 = sigma_s* E``, ``Q1 = g* sigma_s* E s`` with ``E = E0 exp(-sigma_t* l)`` (Joseph, Wiscombe & Weinman 1976).
    At the far side it is reflected inside or leaves, and may meet the body again. What is reflected outside is lost.

    Parameters
    ----------
    direction : (3,) floats
        In which the light travels, any length.
    irradiance : float
        Across the beam, W/unit²; of a spot, where it is brightest.
    spot : Spot, optional
        Its cross-section; without one it lights the whole body.
    from_center : bool
        Whether the light starts at the spot's center, and not far away.

    Raises
    ------
    InputError
        If the direction is zero or the irradiance not positive; and, when solved, if the light misses the body.
    """

    direction: Vector
    irradiance: float = 1.0
    spot: Spot | None = None
    from_center: bool = False

    def __post_init__(self) -> None:
        unit_vector(self.direction, "direction")
        check_positive(self.irradiance, "irradiance", "W/unit²")

    def deposit_in(self, body: Body) -> Deposit:
        """Its rays are drawn on the facets of a mesh; here it is found where they meet the body."""
        surface = body.surface
        lit = self.entries(surface)
        if len(lit) == 0:
            raise InputError(
                f"the collimated light along {as_text(self.direction)} misses the body, which spans "
                f"{surface.extent}; change its direction or the spot's center."
            )
        depth = self._least_depth(body, lit)
        # As far apart as rays on the body are, at least.
        apart = surface.diagonal / np.sqrt(LOOKS)
        # What is smaller than its depth in a spot is blurred; the spot itself may be a thin beam.
        narrow = np.inf if self.spot is None else max(0.5 * self.spot.reach, 0.5 * depth)
        return Deposit(
            resolution=min(max(depth, apart), narrow),
            lit=lit,
            entries=lit,
            breadth=np.inf if self.spot is None else None,
            on_mesh=self,
        )

    def arrows(self, surface: Surface) -> Arrows:
        """Several on the whole body, one on a spot."""
        direction = unit_vector(self.direction, "direction")
        return Arrows(self.entries(surface), direction, ARROWS if self.spot is None else 1)

    def _least_depth(self, body: Body, entries: FloatArray) -> float:
        """Least depth, at some of the entries, at which the beam has faded to 1/e, unit."""
        some = body.just_inside(entries[:: -(-len(entries) // DEPTHS)])
        along = np.broadcast_to(unit_vector(self.direction, "direction"), some.shape)
        _, ends = body.ways_out(some, along)
        return float(body.paths(some, along, ends).place(np.ones(len(some)), peaked=True).min())

    def entries(self, surface: Surface) -> FloatArray:
        """Some of the places where the light meets the body first, (q, 3)."""
        direction = unit_vector(self.direction, "direction")
        middle = 0.5 * (surface.points.min(axis=0) + surface.points.max(axis=0))
        reach = 0.5 * surface.diagonal
        center = middle if self.spot is None else np.asarray(self.spot.center, dtype=float)
        offsets = sunflower(LOOKS, reach, direction) if self.spot is None else self.spot.looks(LOOKS, direction)
        if self.spot is not None:
            offsets = offsets[self.spot.brightness(offsets, direction) > 0]
        starts = center + offsets
        if self.spot is None or not self.from_center:
            # From before the body, wherever the spot's center is along the beam.
            starts += np.outer((middle - starts) @ direction - surface.diagonal, direction)
        directions = np.broadcast_to(direction, starts.shape)
        distances, met = surface.rays.first(starts, directions)
        return np.asarray(starts + np.where(met >= 0, distances, 0.0)[:, None] * direction)[met >= 0]

    def on(self, mesh: TetMesh, surface: Surface, coefficients: Coefficients) -> Deposit:
        """See `tetlux.fem.sources.deposit.OnMesh`."""
        del surface
        if self.spot is None or isinstance(self.spot, UNCHANGING):
            key = (type(self), tuple(self.direction), self.spot, self.from_center)
            rays, normals = mesh.cache.get(key, lambda: self._falling(mesh))
        else:
            rays, normals = self._falling(mesh)
        rays = replace(rays, powers=self.irradiance * rays.powers)
        inside, specular = entered(rays, normals, coefficients.outer.eta)
        deposit = follow(mesh, coefficients, inside)
        return replace(deposit, incident=float(rays.powers.sum()), specular=specular + deposit.specular)

    def _falling(self, mesh: TetMesh) -> tuple[Rays, FloatArray]:
        """The rays that reach facets of a mesh, their powers at an irradiance of 1, and the normals there (r, 3)."""
        direction = unit_vector(self.direction, "direction")
        normals, _ = triangle_areas(mesh.points, mesh.boundary_faces)
        facing = np.flatnonzero(normals @ direction < 0)
        corners, owner = self._pieces(mesh.points[mesh.boundary_faces[facing]], direction)
        owner = facing[owner]
        # One ray a facet: with three the exitance is 5 % of its error better, and takes twice as long.
        points = corners.mean(axis=1)
        sides = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        caught = -0.5 * sides @ direction
        powers, way = caught, np.full(len(points), np.inf)
        if self.spot is not None:
            center = np.asarray(self.spot.center, dtype=float)
            points, bright = _seen(self.spot, corners - center, direction)
            points, powers = center + points, bright * powers
            if self.from_center:
                way = (points - center) @ direction
        lit = np.flatnonzero((powers > 0) & (way > 0))
        distances, _ = mesh.rays.first(points[lit], np.broadcast_to(-direction, (len(lit), 3)))
        lit = lit[distances >= way[lit]]
        # All that a facet gets of a spot is one ray, from the middle of it.
        facets, places = np.unique(owner[lit], return_inverse=True)
        total = sum_by_index(places, powers[lit], len(facets))
        starts = np.column_stack(
            [sum_by_index(places, powers[lit] * axis, len(facets)) / total for axis in points[lit].T]
        )
        along = np.broadcast_to(direction, starts.shape)
        return Rays(starts, along, total, mesh.boundary_cells[facets]), normals[facets]

    def _pieces(self, corners: FloatArray, direction: FloatArray) -> tuple[FloatArray, IntArray]:
        """Parts of facets (f, 3, 3) that are small enough to see the spot, (p, 3, 3), and whose they are, (p,)."""
        owner = np.arange(len(corners))
        spot = self.spot
        if spot is None:
            return corners, owner
        done, owners = [], []
        for cut in range(_CUTS):
            size = longest_sides(corners)
            offsets = corners.mean(axis=1) - np.asarray(spot.center, dtype=float)
            near = spot.away(offsets, direction) <= size
            corners, owner, size = corners[near], owner[near], size[near]
            cutting = size > spot.detail
            fine = np.flatnonzero(~cutting & (size > spot.edge))
            offsets = corners[fine].reshape(-1, 3) - np.asarray(spot.center, dtype=float)
            cutting[fine] = np.ptp(spot.brightness(offsets, direction).reshape(-1, 3), axis=1) > 0
            cutting &= cut < _CUTS - 1
            done.append(corners[~cutting])
            owners.append(owner[~cutting])
            corners, owner = quarter_triangles(corners[cutting]), np.repeat(owner[cutting], 4)
            if len(corners) == 0:
                break
        return np.concatenate(done), np.concatenate(owners)


def _seen(spot: Spot, corners: FloatArray, direction: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The middle of what triangles (p, 3, 3) see of a spot, (p, 3), and its mean brightness there, (p,)."""
    least, most, together = _POINTS
    count = int(np.clip(together // max(len(corners), 1), least, most))
    u, v = scattered(count).T
    # A square folded along its diagonal is a triangle.
    u, v = np.where(u + v > 1.0, (1.0 - u, 1.0 - v), (u, v))
    points = np.column_stack([1.0 - u - v, u, v]) @ corners
    bright = spot.brightness(points.reshape(-1, 3), direction).reshape(-1, count)
    mean = bright.mean(axis=1)
    middles = np.einsum("pk,pki->pi", bright, points) / np.where(mean > 0, count * mean, 1.0)[:, None]
    return middles, mean
