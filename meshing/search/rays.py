"""The first triangle that each of millions of rays hits."""

from functools import cached_property
from importlib.util import find_spec
from typing import Any

import numpy as np

from tetlux.meshing.arrays import FloatArray, IntArray
from tetlux.meshing.search.embree import Embree
from tetlux.meshing.search.vtk_rays import RayLocator

# Embree has no wheel for Linux on ARM.
ENGINE: type[Embree] | type[RayLocator] = RayLocator if find_spec("embreex") is None else Embree
# Rays start this share of the triangles' extent beyond their origin, since Embree computes in single precision.
OFFSET = 1e-5


class RayCaster:
    """The triangles of a surface, prepared for ray casting.

    Parameters
    ----------
    points : (n, 3) ndarray
    faces : (f, 3) ndarray
    """

    def __init__(self, points: FloatArray, faces: IntArray) -> None:
        self._corners = points[faces]
        low, high = points.min(axis=0), points.max(axis=0)
        self._origin, self._size = 0.5 * (low + high), float(np.linalg.norm(high - low))

    def __getstate__(self) -> dict[str, Any]:
        """Engines cannot be pickled; one is made anew at the first ray."""
        return {name: value for name, value in vars(self).items() if name != "_engine"}

    @cached_property
    def _engine(self) -> Embree | RayLocator:
        return ENGINE((self._corners - self._origin) / self._size)

    def first(self, origins: FloatArray, directions: FloatArray) -> tuple[FloatArray, IntArray]:
        """The first triangle that each ray hits.

        Parameters
        ----------
        origins, directions : (q, 3) ndarray
            Directions are unit vectors. Hits within 1e-5 of the surface's extent from the origin are ignored.

        Returns
        -------
        distances : (q,) ndarray
            Unit; inf for rays without a hit.
        faces : (q,) ndarray
            -1 for rays without a hit.
        """
        if len(origins) == 0:
            return np.zeros(0), np.zeros(0, dtype=np.int64)
        # Move distant origins near the triangles, where coordinates keep their precision.
        skipped = np.maximum(np.einsum("ij,ij->i", self._origin - origins, directions) - self._size, 0.0)
        origins = origins + skipped[:, None] * directions
        offset = OFFSET * self._size
        starts = (origins + offset * directions - self._origin) / self._size
        faces, approximate = self._engine(starts, directions)
        # The engine finds the triangle; its distance is recomputed in double precision.
        corners = self._corners[faces]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        with np.errstate(divide="ignore", invalid="ignore"):
            exact = np.einsum("ij,ij->i", corners[:, 0] - origins, normals)
            exact /= np.einsum("ij,ij->i", directions, normals)
        approximate = approximate * self._size + offset
        with np.errstate(invalid="ignore"):
            distances = np.where(np.abs(exact - approximate) < 10.0 * offset, exact, approximate)
        return np.where(faces >= 0, skipped + distances, np.inf), faces
