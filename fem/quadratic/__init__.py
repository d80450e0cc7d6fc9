"""Quadratic elements on the same mesh: what readings far from the light need.

Light fades over many tetrahedra on its way to a detector, and linear elements err by (k h)²/24 of each fading length,
with h the size of tetrahedra. On a ball of radius 80 mm whose light fades over 4 mm, linear elements would need edges
of .6 mm between the light and a fibre 50 mm away to read it to 1 %; quadratic ones need 3 mm.

They are hierarchical: the hat functions of the nodes, and a bubble ``4 lambda_i lambda_j`` on each edge. Edges of the
boundary and of interfaces are bent onto the true surface, and with them the tetrahedra beside them.

    elements    the functions of one tetrahedron and of one triangle
    space       the functions of a mesh, and how its edges are bent
    assembly    the matrix
    loads       what lights put on the functions
    measurement       what is read: points of the surface, or inside
    operator    the matrix with its solver, and the dual solutions of what is read
    solution    the fluence of lights, and what is read of it
    recovered_gradient_difference   what a function does not resolve
    error       how far off a reading is, by its dual solution
"""
