"""Where parallel rays from outside enter a body."""

import numpy as np

from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.surface.surface import Surface

# Where the sine of the angle between ray and surface is less than this, a ray enters at the flat triangle, and not at
# the curved surface that the triangle approximates.
GRAZING = 0.1


def find_entries(
    surface: Surface, origins: FloatArray, direction: FloatArray, *, curved: bool = True
) -> tuple[FloatArray, FloatArray]:
    """Find where parallel rays from outside first meet a surface.

    Parameters
    ----------
    surface : Surface
    origins : (r, 3) ndarray
        unit.
    direction : (3,) ndarray
        Unit vector.
    curved : bool
        Whether to continue to the curved surface that the triangles approximate.

    Returns
    -------
    points, normals : (e, 3) ndarray
        Of those rays that meet the surface; normals point outwards.
    """
    directions = np.broadcast_to(direction, origins.shape)
    distances, faces = surface.rays.first(origins, directions)
    met = (faces >= 0) & (surface.normals[faces] @ direction < 0)
    # From outside, a ray meets the back of a triangle only along a face or through an edge; such rays are intersected
    # again in double precision.
    unclear = ~met & ((faces >= 0) | (len(origins) == 1))
    for ray in np.flatnonzero(unclear).tolist():
        along, crossed = surface.crossings(origins[ray], direction)
        inward = np.flatnonzero(surface.normals[crossed] @ direction < 0)
        if len(inward):
            distances[ray], faces[ray], met[ray] = along[inward[0]], crossed[inward[0]], True
    points, faces = origins[met] + distances[met, None] * direction, faces[met]
    normals = surface.normals[faces]
    if not curved or len(points) == 0:
        return points, normals
    # Along the ray to the height of the curved surface above the triangle; grazing rays are nearly parallel to both.
    above, curved_normals = surface.on_curve(faces, points)
    slope = normals @ direction
    grazing = (slope > -GRAZING) | (curved_normals @ direction > -GRAZING)
    height = np.einsum("ij,ij->i", above - points, normals)
    step = np.where(grazing, 0.0, height / np.where(grazing, 1.0, slope))
    return points + step[:, None] * direction, np.where(grazing[:, None], normals, curved_normals)
