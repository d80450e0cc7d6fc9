"""How fine the mesher's mesh is by default, and what it is too coarse to show."""

# Default deviation of the mesher's boundary from a surface: this share of the diagonal, ...
DEVIATION = 0.01
# ... or of the mean thickness 2 V/A of what lies on either side of it, if that is less.
DEVIATION_OF_THICKNESS = 0.25
# Below this share of the body's volume a separate lump of tetrahedra is debris of the envelope, unless the surface has
# bodies as small.
DEBRIS = 1e-3
# A body whose thickness, 2 V/A, is below this share of its diagonal has no inside.
FLAT = 1e-7
