"""What is known of the fluence of point sources, subtracted before finite elements solve for the rest.

**Fitted charges.** In one even medium with a known surface, screened charges ``q e^{-k r}/(4 pi D r)`` outside the body
are fitted to the boundary condition on the true surface (`tetlux.fem.charges`). They leave some hundredths of the light
or less, for which finite elements solve throughout the body: see `tetlux.fem.known.fitted`.

**The half-space** is for all other point sources. Near a source the fluence is that of a half-space with a Robin
boundary (`tetlux.fem.exact.half_space`): the source, its mirror image, and a line of sinks above the image (Bryan
1890). With the line cut into points, this too is a sum G of screened charges: one inside the body, the others outside.
It solves the diffusion equation inside the body whatever the strengths of the charges outside. Cutting the line into
few points, or leaving out charges that would lie in another part of the body, therefore adds no error: G is then only a
poorer guess of the fluence.

Finite elements solve for the rest. G is used on a patch of tetrahedra only, where it is close to the fluence. There the
fluence is ``phi_h = u_h + (G - I_h G)``, with ``I_h G`` the linear interpolant of G: u_h is the fluence at the nodes,
and is plain P1 where there is no patch. In the weak form the patch adds ``-a(G - I_h G, v)``. By Gauss's theorem
``a(G, v)`` is the load of the source and integrals over the faces of the patch.

A beam without width is a sum of such sources too, some of them negative.

    charges          a field of screened charges that is subtracted
    fitted           charges fitted to one light on the true surface, and their residual there
    fitted_patch     these on a mesh: the load of what is missing, and what the mesh does not see of it
    kept_fits        fits kept with a mesh
    images           the charges of a point source: itself and its images
    patch            the tetrahedra on which charges are subtracted
    patch_terms      what a patch adds to the load and to the ledger
    beam_as_charges  beams without width
    subtraction      charges on a mesh and what they add to its equations
    split            what of the lights is subtracted, and what is left to the mesh
"""
