"""Diffuse light on a round patch of the surface: a lamp that touches the skin."""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from tetlux.fem.body.body import Body
from tetlux.fem.inputs import as_vector, check_positive
from tetlux.fem.lights.arrows import Arrows
from tetlux.fem.lights.diffuse import diffuse_transmittance
from tetlux.fem.lights.illumination import illumination_resolution
from tetlux.fem.lights.spots.plane import sunflower
from tetlux.fem.lights.spots.triangles import area_vectors, triangle_samples
from tetlux.fem.media.coefficients import Coefficients
from tetlux.fem.sources.deposit import Deposit
from tetlux.fem.sources.footprint import Footprint
from tetlux.fem.sources.hints import MeshHints
from tetlux.fem.sources.terms import SourceTerms
from tetlux.meshing.arrays import FloatArray, Vector, sum_by_index
from tetlux.meshing.describe import as_text
from tetlux.meshing.errors import InputError
from tetlux.meshing.surface.subdivide import quarter_triangles
from tetlux.meshing.surface.surface import Surface
from tetlux.meshing.surface.triangles import longest_sides
from tetlux.meshing.tets.mesh import TetMesh

# Samples of the patch near which the mesh is fine.
PLACES = 200
# Facets across the rim are split in four until they are smaller than RIM_SHARE of the radius, at most MOST_SPLITS
# times. Each piece is sampled at SAMPLES points: the illuminated area of a flat face is right to 0.1 %.
RIM_SHARE, MOST_SPLITS, SAMPLES = 1.0 / 8.0, 16, 64


@dataclass(frozen=True)
class DiffusePatch:
    """The same radiance from every direction on a round patch of the surface; the rest of the surface is dark.

    The patch is the part of the surface within the radius of its center, in a straight line, that is connected to the
    center. Light that passes the surface is treated as for `DiffuseLight`. At the rim the irradiance is averaged over
    each facet that the rim crosses. The lamp reflects none of the light that leaves the body.

    Parameters
    ----------
    center : (3,) floats
        Moved to the nearest point of the surface, unit.
    radius : float
        Radius of the patch, unit.
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
        """Choose where the mesh has to be fine; which of its facets are illuminated is found on the mesh.

        See `tetlux.fem.Light` for parameters and result.
        """
        transmitted = diffuse_transmittance(body.outer, "a diffuse patch") * self.irradiance
        places = self._places(body.surface)
        depth = float(body.mean_free_paths(body.just_inside(places)).min())
        resolution = illumination_resolution(body.surface, depth, self.radius)
        on_mesh = PatchOnMesh(self.center, self.radius, self.irradiance, transmitted)
        return Deposit(hints=MeshHints(resolution, places), footprint=Footprint(places), on_mesh=on_mesh)

    def arrows(self, surface: Surface) -> Arrows:
        """Draw a point at its center; see `HasArrows`."""
        return Arrows(self._middle(surface)[0][None])

    def _middle(self, surface: Surface) -> tuple[FloatArray, FloatArray]:
        """The point of the surface nearest to the center, and the normal there."""
        center = as_vector(self.center, "center")
        (middle,), (normal,) = surface.project(center[None])
        distance = float(np.linalg.norm(middle - center))
        if distance > self.radius:
            raise InputError(
                f"the center of the patch {as_text(self.center)} is {distance:.3g} {surface.unit} from the surface, "
                f"more than its radius; the nearest point of the surface is {as_text(middle)}.",
                field="center",
            )
        return middle, normal

    def _places(self, surface: Surface) -> FloatArray:
        """Places on the patch (p, 3), its middle first."""
        middle, normal = self._middle(surface)
        reach = min(self.radius, surface.diagonal)
        places, _ = surface.project(middle + sunflower(PLACES, reach, normal))
        places = np.vstack([middle, places, surface.points])
        return np.asarray(places[np.linalg.norm(places - middle, axis=1) <= self.radius])


@dataclass(frozen=True)
class PatchOnMesh:
    """A round patch on the boundary of a mesh: its irradiance on the outside and the part that passes, W/unit²."""

    center: Vector
    radius: float
    irradiance: float
    transmitted_irradiance: float

    def deposit_on(self, mesh: TetMesh, surface: Surface, coefficients: Coefficients) -> Deposit:
        """See `tetlux.fem.sources.deposit.MeshDependent`."""
        del surface, coefficients
        key = (type(self), tuple(self.center), self.radius)
        areas = mesh.cache.get(key, lambda: self._illuminated_areas(mesh))
        shares = mesh.to_boundary_nodes(areas) / mesh.boundary_node_areas
        irradiance, transmitted = self.irradiance * shares, self.transmitted_irradiance * shares
        return Deposit(terms=SourceTerms(irradiance=irradiance, transmitted_irradiance=transmitted))

    def _illuminated_areas(self, mesh: TetMesh) -> FloatArray:
        """Illuminated area of each boundary facet, (f,), unit²."""
        (middle,), (facet,), _ = mesh.closest_boundary(as_vector(self.center, "center")[None])
        areas = _areas_within(mesh.points[mesh.boundary_faces] - middle, self.radius)
        # Another part of the surface within the radius, such as the far side of a thin plate, does not touch the lamp.
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
    for split in range(MOST_SPLITS):
        distances, sizes = np.linalg.norm(corners, axis=2), longest_sides(corners)
        inside = distances.max(axis=1) <= radius
        areas += sum_by_index(owner[inside], _areas(corners[inside]), len(areas))
        crossed = ~inside & (distances.min(axis=1) <= radius + sizes)
        corners, owner, sizes = corners[crossed], owner[crossed], sizes[crossed]
        fine = sizes <= RIM_SHARE * radius if split < MOST_SPLITS - 1 else np.ones(len(sizes), dtype=bool)
        areas += sum_by_index(owner[fine], _areas(corners[fine]) * _shares_within(corners[fine], radius), len(areas))
        corners, owner = quarter_triangles(corners[~fine]), np.repeat(owner[~fine], 4)
        if len(corners) == 0:
            break
    return areas


def _areas(corners: FloatArray) -> FloatArray:
    """Areas of triangles (f, 3, 3), (f,)."""
    return np.asarray(np.linalg.norm(area_vectors(corners), axis=1))


def _shares_within(corners: FloatArray, radius: float) -> FloatArray:
    """Sampled shares of triangles (f, 3, 3) within a radius of the origin, (f,)."""
    points = triangle_samples(SAMPLES) @ corners
    return np.asarray((np.linalg.norm(points, axis=2) <= radius).mean(axis=1))
