"""Light without a mesh: screened charges outside a body, fitted to its boundary.

A charge ``q e^{-k r}/(4 pi D r)`` solves the diffusion equation everywhere but at its own position. A sum of the
light's sources inside the body and of charges outside it therefore solves the equation inside exactly. The strengths of
the charges outside are found by least squares on the residual of the boundary condition ``D dphi/dn + phi/(2A) = 0`` at
points of the surface. This is the method of fundamental solutions (Fairweather & Karageorghis 1998, Adv. Comput. Math.
9, 69-95). Its matrices are nearly singular; Barnett & Betcke 2008, J. Comput. Phys. 227, 7003-7026, show why this does
not harm the sum.

    kernel      the fluence and flux of charges
    samples     points on a surface at a variable spacing
    placement   positions of charges and of equations
    fit         strengths by least squares
    check       a bound and an estimate of the error
    adapt       more charges where the residual is large
    faint       more where the exitance is below zero
    quadrature  integrals over the surface
    regions     homogeneous regions, each with charges of its own
    field       the sum of sources and charges

`tetlux.fem.charges.check` states the assumptions of the bound. The method needs the true normals of a surface, so that
it works on the smooth surface (`Surface.on_curve`) and not on its triangles.
"""
