"""Default resolution of the mesher, and the sizes below which it cannot resolve parts."""

# Default deviation of the mesher's boundary from a surface: the smaller of this share of the diagonal ...
DEVIATION = 0.01
# ... and this share of the mean thickness 2 V/A of the regions on both sides.
DEVIATION_OF_THICKNESS = 0.25
# A connected component of the mesh below this share of the volume is debris of the mesher's envelope, unless the
# surface has bodies as small.
DEBRIS = 1e-3
# A body whose mean thickness 2 V/A is below this share of its diagonal is flat and encloses no volume.
FLAT = 1e-7
