"""Which triangle does a ray meet first? For millions of rays."""

from functools import cached_property
from importlib.util import find_spec

import numpy as np

from tetlux.meshing.arrays import FloatArray, IntArray
from tetlux.meshing.search.embree import Embree
from tetlux.meshing.search.vtk_rays import RayLocator

# Embree has no wheel for Linux on ARM.
ENGINE: type[Embree] | type[RayLocator] = RayLocator if find_spec("embreex") is None else Embree
# Embree computes in single precision: rays start this share of the triangles' extent along their way.
OFFSET = 1e-5


class RayCaster:
    """The triangles of a surface, ready to be met by rays.

    Parameters
    ----------
    points : (n, 3) ndarray
    faces : (f, 3) ndarray
    """

    def __init__(self, points: FloatArray, faces: IntArray) -> None:
        self._corners = points[faces]
        low, high = points.min(axis=0), points.max(axis=0)
        self._origin, self._size = 0.5 * (low + high), float(np.linalg.norm(high - low))

    @cached_property
    def _engine(self) -> Embree | RayLocator:
        return ENGINE((self._corners - self._origin) / self._size)

    def first(self, origins: FloatArray, directions: FloatArray) -> tuple[FloatArray, IntArray]:
        """The first triangle that each ray meets.

        Parameters
        ----------
        origins, directions : (q, 3) ndarray
            Directions are unit vectors. What lies within 1e-5 of the surface's extent before the origin is not met.

        Returns
        -------
        distances : (q,) ndarray
            inf where nothing is met.
        faces : (q,) ndarray
            -1 where nothing is met.
        """
        if len(origins) == 0:
            return np.zeros(0), np.zeros(0, dtype=np.int64)
        # No precision holds places far from the triangles: rays start from near them.
        gone = np.maximum(np.einsum("ij,ij->i", self._origin - origins, directions) - self._size, 0.0)
        origins = origins + gone[:, None] * directions
        offset = OFFSET * self._size
        starts = (origins + offset * directions - self._origin) / self._size
        faces, rough = self._engine(starts, directions)
        # The engine says which triangle; how far that is, is computed anew in full precision.
        corners = self._corners[faces]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        with np.errstate(divide="ignore", invalid="ignore"):
            exact = np.einsum("ij,ij->i", corners[:, 0] - origins, normals)
            exact /= np.einsum("ij,ij->i", directions, normals)
        rough = rough * self._size + offset
        with np.errstate(invalid="ignore"):
            distances = np.where(np.abs(exact - rough) < 10.0 * offset, exact, rough)
        return np.where(faces >= 0, gone + distances, np.inf), faces
