"""Light without a mesh: screened charges outside a body, fitted to its boundary.

A charge ``q e^{-k r}/(4 pi D r)`` obeys the diffusion equation everywhere but where it is. So the light's own sources
inside the body and any charges outside it obey the equation inside exactly, and only the boundary condition
``D dphi/dn + phi/(2A) = 0`` is left: strengths are found by least squares on what violates it at points of the surface.
This is the method of fundamental solutions (Fairweather & Karageorghis 1998, Adv. Comput. Math. 9, 69-95); that its
tables are nearly singular and why that does no harm, see Barnett & Betcke 2008, J. Comput. Phys. 227, 7003-7026.

    kernel      the charge, and sums of many
    samples     points spread over a surface at a spacing that varies
    places      where charges and equations go
    fit         strengths by least squares
    check       a bound of the error, and an estimate
    adapt       more charges, where the residual is large
    quadrature  integrals over the surface
    several     several even regions, each with charges of its own
    field       sources and charges together

`tetlux.fem.charges.check` says what the bound promises and what not. Surfaces are the smooth ones (`Surface.on_curve`):
their true normals are what the method lives on.
"""
