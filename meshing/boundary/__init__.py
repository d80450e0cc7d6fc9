"""The boundary of a mesh: layers of flat tetrahedra along it, and the curved surface that its facets stand for."""
