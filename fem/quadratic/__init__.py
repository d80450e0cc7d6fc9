"""Quadratic elements on the same mesh, for readings far from the light.

Light decays over many tetrahedra on its way to a detector. Linear elements change its decay rate k by a share of
(k h)²/24, with h the size of tetrahedra. In a ball of radius 80 mm where light decays over 4 mm, linear elements need
edges of .6 mm between the light and a fibre 50 mm away for a reading to 1 %; quadratic ones need edges of 3 mm.

The basis is hierarchical: the hat functions of the nodes, and a bubble ``4 lambda_i lambda_j`` on each edge. Edges of
the boundary and of interfaces are bent onto the true surface, and with them the tetrahedra that they belong to.

    elements            shape functions of one tetrahedron and of one triangle
    space               the finite-element space of a mesh, with bent edges
    assembly            the matrix, and integrals of shape functions
    loads               the right-hand side of lights
    measurement         weighted points at which the solution is read
    operator            the matrix with its solver, and the dual solutions of measurements
    scene               the lights of a scene, solved for
    solution            the fluence of lights, and measurements of it
    recovered_gradient  the difference between averaged and own gradients (Zienkiewicz & Zhu 1987)
    reading_error       a reading, and the contribution of each tetrahedron to its error
    error               the error of a reading, by its dual solution
    field_error         errors at almost every point of the surface and inside, by duals of random signs
"""
