"""How fine a mesh has to be where light falls on an extended part of the surface."""

import numpy as np

from tetlux.fem.sources.hints import MeshHints
from tetlux.meshing.arrays import FloatArray

# Rays that find where light on the whole body enters it.
ENTRY_RAYS = 2000


def illumination_hints(places: FloatArray, depth: float, size: float = np.inf) -> MeshHints:
    """Hints for a mesh below an illuminated part of a surface.

    The light fades over its penetration depth, which layers along the surface resolve. Along the surface, the mesh has
    to resolve half the size of the part. In a part smaller than the penetration depth, scattering blurs what is finer
    than that depth.

    Parameters
    ----------
    places : (e, 3) ndarray
        Samples of the part, unit.
    depth : float
        Penetration depth of the light, unit.
    size : float
        Radius of the illuminated part, unit; inf for the whole surface.

    Returns
    -------
    MeshHints
    """
    return MeshHints(
        resolution=0.5 * max(size, depth), places=places, lit=places, depths=np.full(len(places), float(depth))
    )
