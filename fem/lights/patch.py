"""Diffuse light on a round patch of the surface: a lamp that touches the skin."""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from tetlux.fem.body.body import Body
from tetlux.fem.inputs import as_vector, check_positive
from tetlux.fem.lights.arrows import Arrows
from tetlux.fem.lights.diffuse import diffuse_transmittance
from tetlux.fem.lights.spots.plane import scattered, sunflower
from tetlux.fem.media.coefficients import Coefficients
from tetlux.fem.sources.deposit import Deposit
from tetlux.meshing.arrays import FloatArray, Vector, sum_by_index
from tetlux.meshing.describe import as_text
from tetlux.meshing.errors import InputError
from tetlux.meshing.surface.subdivide import quarter_triangles
from tetlux.meshing.surface.surface import Surface
from tetlux.meshing.surface.triangles import longest_sides
from tetlux.meshing.tets.mesh import TetMesh

# Places of the patch near which the mesh is fine.
PLACES = 200
# Parts of facets that the rim crosses are cut until they are this share of the radius, in at most so many steps, and
# each is sampled at so many points: the lit area of a flat face is right to 0.1 %.
EDGE, CUTS, SAMPLES = 1.0 / 8.0, 16, 64


@dataclass(frozen=True)
class DiffusePatch:
    """The same radiance from every direction on a round patch of the surface; the rest of the surface is dark.

    The patch is what of the surface lies within the radius of its center, measured straight, and is connected to it.
    What passes the surface is treated as for `DiffuseLight`. At the rim the irradiance is spread over the facets that
    the rim crosses. The lamp reflects nothing of what leaves the body.

    Parameters
    ----------
    center : (3,) floats
        Taken to the nearest point of the surface, unit.
    radius : float
        unit.
    irradiance : float
        On the outside of the patch, W/unit².

    Raises
    ------
    InputError
        If a value is not finite, or the radius or the irradiance not positive; and, when solved, if the center is
        farther than the radius from the surface, or the medium's boundary is "classic".

    Examples
    --------
    >>> lamp = DiffusePatch(center=(0.0, 0.0, 10.0), radius=2.0, irradiance=0.5)
    """

    center: Vector
    radius: float
    irradiance: float

    def __post_init__(self) -> None:
        as_vector(self.center, "center")
        check_positive(self.radius, "radius", "unit")
        check_positive(self.irradiance, "irradiance", "W/unit²")

    def deposit_in(self, body: Body) -> Deposit:
        """Which facets are lit is known on a mesh; here it is said near which places that mesh has to be fine."""
        transmittance = diffuse_transmittance(body.outer, "a diffuse patch")
        surface = body.surface
        places = self._places(surface)
        depth = float(body.mean_free_paths(body.just_inside(places)).min())
        # As far apart as rays of a beam on the whole body; of a small patch what is finer than its depth is blurred.
        wide, narrow = max(depth, surface.diagonal / np.sqrt(2000.0)), 0.5 * max(self.radius, depth)
        lit = LitPatch(self.center, self.radius, self.irradiance, transmittance * self.irradiance)
        return Deposit(resolution=min(wide, narrow), lit=places, entries=places, on_mesh=lit)

    def arrows(self, surface: Surface) -> Arrows:
        """A point at its center."""
        return Arrows(self._middle(surface)[0][None])

    def _middle(self, surface: Surface) -> tuple[FloatArray, FloatArray]:
        """The point of the surface nearest to the center, and the normal there."""
        center = as_vector(self.center, "center")
        (middle,), (normal,) = surface.project(center[None])
        away = float(np.linalg.norm(middle - center))
        if away > self.radius:
            raise InputError(
                f"the center of the patch {as_text(self.center)} is {away:.3g} {surface.unit} from the surface, more "
                f"than its radius; the nearest point of the surface is {as_text(middle)}.",
                field="center",
            )
        return middle, normal

    def _places(self, surface: Surface) -> FloatArray:
        """Places of the patch, its middle first, (p, 3)."""
        middle, normal = self._middle(surface)
        reach = min(self.radius, surface.diagonal)
        places, _ = surface.project(middle + sunflower(PLACES, reach, normal))
        places = np.vstack([middle, places, surface.points])
        return np.asarray(places[np.linalg.norm(places - middle, axis=1) <= self.radius])


@dataclass(frozen=True)
class LitPatch:
    """A round patch on the boundary of a mesh, with its irradiance outside and what passes of it, W/unit²."""

    center: Vector
    radius: float
    irradiance: float
    transmitted_irradiance: float

    def on(self, mesh: TetMesh, surface: Surface, coefficients: Coefficients) -> Deposit:
        """See `tetlux.fem.sources.deposit.OnMesh`."""
        del surface, coefficients
        areas = mesh.cache.get((type(self), tuple(self.center), self.radius), lambda: self._lit_areas(mesh))
        shares = mesh.to_boundary_nodes(areas) / mesh.boundary_node_areas
        return Deposit(irradiance=self.irradiance * shares, transmitted_irradiance=self.transmitted_irradiance * shares)

    def _lit_areas(self, mesh: TetMesh) -> FloatArray:
        """Area of each boundary facet that is lit, (f,)."""
        (middle,), (facet,), _ = mesh.closest_boundary(as_vector(self.center, "center")[None])
        areas = _areas_within(mesh.points[mesh.boundary_faces] - middle, self.radius)
        # Another part of the surface that is as near, as the far side of a thin plate, does not touch the lamp.
        lit = np.flatnonzero(areas > 0)
        corners = mesh.boundary_triangles[lit]
        ends = corners[:, [0, 1]].ravel(), corners[:, [1, 2]].ravel()
        count = len(mesh.boundary_nodes)
        _, part = connected_components(coo_array((np.ones(len(ends[0])), ends), shape=(count, count)), directed=False)
        areas[lit[part[corners[:, 0]] != part[mesh.boundary_triangles[facet, 0]]]] = 0.0
        return areas


def _areas_within(corners: FloatArray, radius: float) -> FloatArray:
    """Area of triangles (f, 3, 3) within a radius of the origin, (f,)."""
    areas, owner = np.zeros(len(corners)), np.arange(len(corners))
    for cut in range(CUTS):
        distances, sizes = np.linalg.norm(corners, axis=2), longest_sides(corners)
        whole = distances.max(axis=1) <= radius
        areas += sum_by_index(owner[whole], _sizes(corners[whole]), len(areas))
        crossed = ~whole & (distances.min(axis=1) <= radius + sizes)
        corners, owner, sizes = corners[crossed], owner[crossed], sizes[crossed]
        fine = sizes <= EDGE * radius if cut < CUTS - 1 else np.ones(len(sizes), dtype=bool)
        areas += sum_by_index(owner[fine], _sizes(corners[fine]) * _shares_within(corners[fine], radius), len(areas))
        corners, owner = quarter_triangles(corners[~fine]), np.repeat(owner[~fine], 4)
        if len(corners) == 0:
            break
    return areas


def _sizes(corners: FloatArray) -> FloatArray:
    """Areas of triangles (f, 3, 3), (f,)."""
    sides = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return np.asarray(0.5 * np.linalg.norm(sides, axis=1))


def _shares_within(corners: FloatArray, radius: float) -> FloatArray:
    """Shares of triangles (f, 3, 3) within a radius of the origin, by samples, (f,)."""
    u, v = scattered(SAMPLES).T
    # A square folded along its diagonal is a triangle.
    u, v = np.where(u + v > 1.0, (1.0 - u, 1.0 - v), (u, v))
    points = np.column_stack([1.0 - u - v, u, v]) @ corners
    return np.asarray((np.linalg.norm(points, axis=2) <= radius).mean(axis=1))
