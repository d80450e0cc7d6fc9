"""Light from all around that differs from direction to direction: an environment map."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.spatial import cKDTree

from tetlux.fem.body.body import Body
from tetlux.fem.inputs import unit_vector
from tetlux.fem.lights.diffuse import check_exact_boundary
from tetlux.fem.lights.spots.image import check_pixels
from tetlux.fem.lights.spots.plane import GOLDEN_ANGLE
from tetlux.fem.media.coefficients import Coefficients
from tetlux.fem.media.fresnel import reflectance
from tetlux.fem.sources.deposit import Deposit
from tetlux.fem.sources.terms import SourceTerms
from tetlux.meshing.arrays import FloatArray, Vector, sum_by_index
from tetlux.meshing.describe import as_text, one_line
from tetlux.meshing.errors import InputError
from tetlux.meshing.surface.surface import Surface
from tetlux.meshing.tets.mesh import TetMesh

# Directions to which the map is reduced, each the mean of the pixels nearest to it: the irradiance of a uniform map is
# right to 0.1 %.
DIRECTIONS = 512
# Smallest numbers of rows and columns; the pixels of a coarser image are divided, so that none covers many directions.
LEAST_SHAPE = (64, 128)


@dataclass(frozen=True, eq=False)
class EnvironmentLight:
    """Distant light given per direction by a latitude-longitude image, with the shadows that the body casts on itself.

    Light that passes the surface is treated as diffuse there (`DiffuseLight`). For the sun's part of a sky that is off
    by 12 % at a reduced albedo of 0.9: give the sun as a `CollimatedBeam`.

    Parameters
    ----------
    radiance : (rows, columns) ndarray
        In equal steps of latitude, the upper row first, and of longitude, W/(unit² sr).
    up : (3,) floats
        Direction of the upper edge of the image, of any length.
    front : (3,) floats
        Direction of the middle of the image; its component along `up` does not count. Seen from the body, the image is
        not mirrored.

    Raises
    ------
    InputError
        If the radiance is no image, or black, or the two directions are parallel; and, when solved, if the medium's
        boundary is "classic".

    Examples
    --------
    Light from the upper half of space only:

    >>> import numpy as np
    >>> sky = EnvironmentLight(np.repeat([[1.0], [0.0]], 4, axis=1))
    >>> towards, irradiance = sky.directions
    >>> round(float(irradiance @ towards[:, 2]), 1)  # on a horizontal plane: pi W/unit²
    3.1
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
        """Unit vectors towards the light (d, 3), and the irradiance across each of them (d,), W/unit²."""
        towards, irradiance = self._pixels()
        nearest = np.asarray(cKDTree(_fibonacci_sphere(DIRECTIONS)).query(towards)[1])
        total = sum_by_index(nearest, irradiance, DIRECTIONS)
        mean = np.column_stack([sum_by_index(nearest, irradiance * axis, DIRECTIONS) for axis in towards.T])
        bright = total > 0
        return mean[bright] / np.linalg.norm(mean[bright], axis=1, keepdims=True), total[bright]

    def _pixels(self) -> tuple[FloatArray, FloatArray]:
        """The same for each bright pixel."""
        radiance = self.radiance
        for axis, least in enumerate(LEAST_SHAPE):
            radiance = np.repeat(radiance, -(-least // radiance.shape[axis]), axis=axis)
        rows, columns = radiance.shape
        edges = np.linspace(0.0, np.pi, rows + 1)
        polar = np.arccos(np.clip(0.5 * (np.cos(edges[:-1]) + np.cos(edges[1:])), -1.0, 1.0))
        azimuth = ((np.arange(columns) + 0.5) / columns - 0.5) * 2.0 * np.pi
        solid_angle = -np.diff(np.cos(edges)) * 2.0 * np.pi / columns
        up = unit_vector(self.up, "up")
        front = unit_vector(self.front, "front")
        front = front - (front @ up) * up
        front /= np.linalg.norm(front)
        right = np.cross(front, up)
        level = np.outer(np.cos(azimuth), front) + np.outer(np.sin(azimuth), right)
        towards = np.sin(polar)[:, None, None] * level + np.cos(polar)[:, None, None] * up
        irradiance = (radiance * solid_angle[:, None]).ravel()
        bright = irradiance > 0
        return towards.reshape(-1, 3)[bright], irradiance[bright]

    def deposit_in(self, body: Body) -> Deposit:
        """Leave everything to a mesh: which of its facets are in shadow is found there.

        See `tetlux.fem.Light` for parameters and result.
        """
        check_exact_boundary(body.outer, "environment light")
        return Deposit(on_mesh=self)

    def deposit_on(self, mesh: TetMesh, surface: Surface, coefficients: Coefficients) -> Deposit:
        """See `tetlux.fem.sources.deposit.MeshDependent`."""
        del surface
        eta = coefficients.outer.eta
        return mesh.cache.get((self, eta), lambda: self._illuminate(mesh, eta))

    def _illuminate(self, mesh: TetMesh, eta: float) -> Deposit:
        """Irradiance of a mesh of refractive index eta, outside and transmitted."""
        normals, middles = mesh.surface.normals, mesh.points[mesh.boundary_faces].mean(axis=1)
        outside, transmitted = np.zeros((2, len(middles)))
        for towards, across in zip(*self.directions, strict=True):
            cosine = normals @ towards
            facing = np.flatnonzero(cosine > 0)
            _, hit = mesh.rays.first(middles[facing], np.broadcast_to(towards, (len(facing), 3)))
            lit = facing[hit < 0]
            irradiance = across * cosine[lit]
            outside[lit] += irradiance
            transmitted[lit] += (1.0 - reflectance(cosine[lit], 1.0 / eta)) * irradiance
        at_nodes = (
            mesh.to_boundary_nodes(each * mesh.boundary_areas) / mesh.boundary_node_areas
            for each in (outside, transmitted)
        )
        irradiance, transmitted = at_nodes
        return Deposit(terms=SourceTerms(irradiance=irradiance, transmitted_irradiance=transmitted))

    __repr__ = one_line


def _fibonacci_sphere(count: int) -> FloatArray:
    """Unit vectors (count, 3) spread evenly over all directions, by the golden angle."""
    index = np.arange(count)
    height, turn = 1.0 - (2.0 * index + 1.0) / count, index * np.pi * GOLDEN_ANGLE
    level = np.column_stack([np.cos(turn), np.sin(turn)])
    return np.column_stack([np.sqrt(1.0 - height**2)[:, None] * level, height])
