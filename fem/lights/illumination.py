"""How fine a mesh has to be where light falls on an extended part of the surface."""

import numpy as np

from tetlux.meshing.surface.surface import Surface

# Rays that find where light on the whole body enters it.
ENTRY_RAYS = 2000


def illumination_resolution(surface: Surface, depth: float, size: float = np.inf) -> float:
    """Length that a mesh has to resolve below an illuminated part of a surface.

    It is the penetration depth, but no finer than the spacing of `ENTRY_RAYS` places on the surface, between which the
    mesh is not refined; and no coarser than half the size of the part. In a part smaller than the penetration depth,
    scattering blurs what is finer than that depth.

    Parameters
    ----------
    surface : Surface
    depth : float
        Penetration depth of the light, unit.
    size : float
        Radius of the illuminated part, unit; inf for the whole surface.

    Returns
    -------
    float
        unit.
    """
    spacing = surface.diagonal / np.sqrt(ENTRY_RAYS)
    return float(min(max(depth, spacing), 0.5 * max(size, depth)))
