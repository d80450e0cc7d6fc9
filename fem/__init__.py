"""Light diffusing in tetrahedra."""
