"""Which triangle does a ray meet first? Millions of rays, by Embree."""

from functools import cached_property
from typing import Any

import numpy as np

from tetlux.meshing.arrays import FloatArray, IntArray

# Embree computes in single precision: rays start this share of the triangles' extent along their way.
OFFSET = 1e-5
# And are nowhere as far as this many extents away, where single precision has no numbers any more.
FARTHEST = 1e12


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
    def _scene(self) -> Any:
        from embreex.mesh_construction import TriangleMesh  # noqa: PLC0415
        from embreex.rtcore_scene import EmbreeScene  # noqa: PLC0415

        scene = EmbreeScene(robust=True)
        TriangleMesh(scene, self._single(self._corners.reshape(-1, 3)).reshape(-1, 3, 3))
        return scene

    def _single(self, points: FloatArray) -> np.ndarray[Any, np.dtype[np.float32]]:
        """Places about the origin, in units of the extent, which single precision can hold."""
        return np.asarray(np.clip((points - self._origin) / self._size, -FARTHEST, FARTHEST), dtype=np.float32)

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
        # Single precision holds no places far from the triangles: rays start from near them.
        gone = np.maximum(np.einsum("ij,ij->i", self._origin - origins, directions) - self._size, 0.0)
        origins = origins + gone[:, None] * directions
        offset = OFFSET * self._size
        starts = self._single(origins + offset * directions)
        met = self._scene.run(starts, np.ascontiguousarray(directions, dtype=np.float32), output=True)
        faces = np.asarray(met["primID"], dtype=np.int64)
        # Embree says which triangle; how far that is, is computed anew in full precision.
        corners = self._corners[faces]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        with np.errstate(divide="ignore", invalid="ignore"):
            exact = np.einsum("ij,ij->i", corners[:, 0] - origins, normals)
            exact /= np.einsum("ij,ij->i", directions, normals)
        rough = np.asarray(met["tfar"], dtype=np.float64) * self._size + offset
        distances = np.where(np.abs(exact - rough) < 10.0 * offset, exact, rough)
        return np.where(faces >= 0, gone + distances, np.inf), faces
