"""Parallel light: over the whole body, or in a spot of any pattern."""

from dataclasses import dataclass, replace

import numpy as np

from tetlux.fem.coefficients import Coefficients
from tetlux.fem.lights.deposit import Deposit
from tetlux.fem.lights.point import check_positive, unit_vector
from tetlux.fem.lights.spot import Spot, sunflower
from tetlux.fem.medium import Medium
from tetlux.fem.paths import Rays, entered, follow
from tetlux.meshing.arrays import FloatArray, IntArray, Vector
from tetlux.meshing.errors import InputError
from tetlux.meshing.subdivide import quartered
from tetlux.meshing.surface import Surface, longest_sides, triangle_areas
from tetlux.meshing.tetmesh import TetMesh

# Rays by which it is looked for where the light meets the body.
LOOKS = 2000
# Facets that a spot's edge crosses are cut into parts as small as this share of its detail.
EDGE = 1.0 / 16.0
_CUTS = 16


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

    def deposit_in(self, surface: Surface, medium: Medium, *, uniform: bool = True) -> Deposit:
        """Its rays are drawn on the facets of a mesh; here it is found where they meet the body."""
        del uniform
        lit = self.entries(surface)
        if len(lit) == 0:
            raise InputError(
                f"the collimated light along {tuple(self.direction)} misses the body, which spans "
                f"{surface.extent}; change its direction or the spot's center."
            )
        scattering, _ = medium.delta_eddington
        depth = 1.0 / (medium.sigma_a + scattering)
        # As far apart as rays on the body are, at least.
        apart = surface.diagonal / np.sqrt(LOOKS)
        detail = np.inf if self.spot is None else max(self.spot.detail, 0.5 * depth)
        return Deposit(resolution=min(max(depth, apart), detail), lit=lit, on_mesh=self._on_mesh)

    def entries(self, surface: Surface) -> FloatArray:
        """Some of the places where the light meets the body first, (q, 3)."""
        direction = unit_vector(self.direction, "direction")
        middle = 0.5 * (surface.points.min(axis=0) + surface.points.max(axis=0))
        reach = 0.5 * surface.diagonal
        center = middle
        if self.spot is not None:
            reach, center = self.spot.reach, np.asarray(self.spot.center, dtype=float)
        offsets = np.vstack([np.zeros((1, 3)), sunflower(LOOKS, reach, direction)])
        if self.spot is not None:
            offsets = offsets[self.spot.brightness(offsets, direction) > 0]
        starts = center + offsets
        if self.spot is None or not self.from_center:
            # From before the body, wherever the spot's center is along the beam.
            starts += np.outer((middle - starts) @ direction - surface.diagonal, direction)
        directions = np.broadcast_to(direction, starts.shape)
        distances, met = surface.rays.first(starts, directions)
        return np.asarray(starts + np.where(met >= 0, distances, 0.0)[:, None] * direction)[met >= 0]

    def _on_mesh(self, mesh: TetMesh, surface: Surface, coefficients: Coefficients) -> Deposit:
        del surface
        rays, normals = self._falling(mesh)
        inside, specular = entered(rays, normals, coefficients.outer.eta)
        deposit = follow(mesh, coefficients, inside)
        return replace(deposit, incident=float(rays.powers.sum()), specular=specular + deposit.specular)

    def _falling(self, mesh: TetMesh) -> tuple[Rays, FloatArray]:
        """The rays that reach facets of a mesh, and the normals there (r, 3)."""
        direction = unit_vector(self.direction, "direction")
        normals, _ = triangle_areas(mesh.points, mesh.boundary_faces)
        facing = np.flatnonzero(normals @ direction < 0)
        corners, owner = self._pieces(mesh.points[mesh.boundary_faces[facing]], direction)
        owner = facing[owner]
        # One ray a facet: with three the exitance is 5 % of its error better, and takes twice as long.
        points = corners.mean(axis=1)
        sides = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        caught = -0.5 * sides @ direction
        powers, way = self.irradiance * caught, np.full(len(points), np.inf)
        if self.spot is not None:
            offsets = points - np.asarray(self.spot.center, dtype=float)
            powers *= self.spot.brightness(offsets, direction)
            if self.from_center:
                way = offsets @ direction
        lit = np.flatnonzero((powers > 0) & (way > 0))
        distances, _ = mesh.rays.first(points[lit], np.broadcast_to(-direction, (len(lit), 3)))
        lit = lit[distances >= way[lit]]
        along = np.broadcast_to(direction, (len(lit), 3))
        return Rays(points[lit], along, powers[lit]), normals[owner[lit]]

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
            across = np.linalg.norm(offsets - np.outer(offsets @ direction, direction), axis=1)
            near = across <= spot.reach + size
            corners, owner, size, offsets = corners[near], owner[near], size[near], offsets[near]
            cutting = size > spot.detail
            if spot.has_edge:
                values = spot.brightness(corners.reshape(-1, 3) - np.asarray(spot.center, dtype=float), direction)
                crossed = np.ptp(values.reshape(-1, 3), axis=1) > 0
                cutting |= crossed & (size > EDGE * spot.detail)
            cutting &= cut < _CUTS - 1
            done.append(corners[~cutting])
            owners.append(owner[~cutting])
            corners, owner = quartered(corners[cutting]), np.repeat(owner[cutting], 4)
            if len(corners) == 0:
                break
        return np.concatenate(done), np.concatenate(owners)
