"""Light from all around, different from every direction: an environment map."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.spatial import cKDTree

from tetlux.fem.body.body import Body
from tetlux.fem.inputs import unit_vector
from tetlux.fem.lights.spots.image import check_pixels
from tetlux.fem.media.coefficients import Coefficients
from tetlux.fem.media.fresnel import reflectance
from tetlux.fem.sources.deposit import Deposit
from tetlux.meshing.arrays import FloatArray, Vector, sum_by_index
from tetlux.meshing.describe import as_text, one_line
from tetlux.meshing.errors import InputError
from tetlux.meshing.surface.surface import Surface
from tetlux.meshing.tets.mesh import TetMesh

# The map is summed to as many directions, each the mean of what it stands for: even light is right to 0.1 %.
DIRECTIONS = 512
# An image of fewer rows and columns is divided, since a pixel of it stands for more than one direction.
FEWEST = (64, 128)


@dataclass(frozen=True, eq=False)
class EnvironmentLight:
    """Distant light given per direction by a latitude-longitude image, with the shadows that the body casts on itself.

    What passes the surface is taken as diffuse there (`DiffuseLight`), which for the sun's part of a sky is off by 12 %
    at a reduced albedo of 0.9: give that as a `CollimatedBeam`.

    Parameters
    ----------
    radiance : (rows, columns) ndarray
        Of even steps in latitude, the upper row first, and in longitude, W/(unit² sr).
    up : (3,) floats
        Where the upper edge of the image is.
    front : (3,) floats
        Where its middle is, as far as that is across `up`. Who looks there from the body sees the image as it is.

    Raises
    ------
    InputError
        If the radiance is no image, or black, or the two directions are one; and, when solved, if the medium's boundary
        is "classic".
    """

    radiance: FloatArray
    up: Vector = (0.0, 0.0, 1.0)
    front: Vector = (0.0, 1.0, 0.0)

    def __post_init__(self) -> None:
        check_pixels(self.radiance)
        if np.linalg.norm(np.cross(unit_vector(self.up, "up"), unit_vector(self.front, "front"))) < 1e-6:
            raise InputError(
                f"up and front of the environment are both along {as_text(self.up)}; give another front.",
                field="up",
            )

    @cached_property
    def directions(self) -> tuple[FloatArray, FloatArray]:
        """Unit vectors towards the light (d, 3), and the irradiance across each that comes from there (d,), W/unit²."""
        radiance = self.radiance
        for axis, fewest in enumerate(FEWEST):
            radiance = np.repeat(radiance, -(-fewest // radiance.shape[axis]), axis=axis)
        rows, columns = radiance.shape
        edges = np.linspace(0.0, np.pi, rows + 1)
        polar = np.arccos(np.clip(0.5 * (np.cos(edges[:-1]) + np.cos(edges[1:])), -1.0, 1.0))
        around = ((np.arange(columns) + 0.5) / columns - 0.5) * 2.0 * np.pi
        solid = -np.diff(np.cos(edges)) * 2.0 * np.pi / columns
        up = unit_vector(self.up, "up")
        front = unit_vector(self.front, "front")
        front = front - (front @ up) * up
        front /= np.linalg.norm(front)
        right = np.cross(front, up)
        level = np.outer(np.cos(around), front) + np.outer(np.sin(around), right)
        towards = np.sin(polar)[:, None, None] * level + np.cos(polar)[:, None, None] * up
        power = (radiance * solid[:, None]).ravel()
        bright = power > 0
        towards, power = towards.reshape(-1, 3)[bright], power[bright]
        # Each pixel goes to the nearest of points that are spread evenly over the sphere.
        index = np.arange(DIRECTIONS)
        height, turn = 1.0 - (2.0 * index + 1.0) / DIRECTIONS, index * np.pi * (3.0 - np.sqrt(5.0))
        level = np.column_stack([np.cos(turn), np.sin(turn)])
        even = np.column_stack([np.sqrt(1.0 - height**2)[:, None] * level, height])
        home = np.asarray(cKDTree(even).query(towards)[1])
        total = sum_by_index(home, power, DIRECTIONS)
        mean = np.column_stack([sum_by_index(home, power * axis, DIRECTIONS) for axis in towards.T])
        found = total > 0
        return mean[found] / np.linalg.norm(mean[found], axis=1, keepdims=True), total[found]

    def deposit_in(self, body: Body) -> Deposit:
        """What passes the surface is known on a mesh."""
        if body.outer.boundary != "exact":
            raise InputError(
                'environment light needs the boundary "exact": "classic" has no Fresnel moments to go with it.'
            )
        return Deposit(on_mesh=self)

    def on(self, mesh: TetMesh, surface: Surface, coefficients: Coefficients) -> Deposit:
        """See `tetlux.fem.sources.deposit.OnMesh`."""
        del surface
        eta = coefficients.outer.eta
        return mesh.cache.get((self, eta), lambda: self._seen_from(mesh, eta))

    def _seen_from(self, mesh: TetMesh, eta: float) -> Deposit:
        """What falls on a mesh, and what passes into refractive index eta."""
        normals, middles = mesh.surface.normals, mesh.points[mesh.boundary_faces].mean(axis=1)
        outside, passed = np.zeros((2, len(middles)))
        for towards, power in zip(*self.directions, strict=True):
            cosine = normals @ towards
            facing = np.flatnonzero(cosine > 0)
            _, hit = mesh.rays.first(middles[facing], np.broadcast_to(towards, (len(facing), 3)))
            seen = facing[hit < 0]
            falling = power * cosine[seen]
            outside[seen] += falling
            passed[seen] += (1.0 - reflectance(cosine[seen], 1.0 / eta)) * falling
        irradiance, transmitted = (
            mesh.to_boundary_nodes(each * mesh.boundary_areas) / mesh.boundary_node_areas for each in (outside, passed)
        )
        return Deposit(irradiance=irradiance, transmitted_irradiance=transmitted)

    __repr__ = one_line
