"""Derivatives of readings to the coefficients of a body, by adjoint solutions.

A reading of quadratic elements is ``y = d.(u - I G) + G(detector)`` with ``A u = b``, where charges G are subtracted on
a patch and I G is their interpolant. With the dual solution z of the reading, ``A z = d``, its derivative is ::

    dy = z.db - z.dA u + d(G(detector) - d.I G)

The middle term is a sum of products of tetrahedra (`products`). The others are what light sources and charges depend on
(`subtracted`): the depth and power of points, and the closed form that is subtracted. It is the derivative of the
reading as it is computed on the mesh, with the patches that are kept with it.

For coefficients of single nodes, tetrahedra or voxels the charges stay as they are. Then z is multiplied by the fluence
with the charges in closed form, ``u - I G + G`` (`near_sources`). What a region's derivative has besides belongs to the
way of the light into the body: it is given to the tetrahedra on this way (`entry_paths`), so that sums over a region
are exact.

    parameters    what coefficients are varied of: nodes, tetrahedra, regions, voxels
    products      products of solutions and duals in tetrahedra
    near_sources  what these miss of charges between nodes
    subtracted    derivatives of what is subtracted, and of loads
    positions     the same to the places of lights
    entry_paths   the tetrahedra between the surface and the points of a light
    sensitivity   the function that puts all of this together
"""
