"""From triangles as they come to a `Surface`: merged, stitched, capped, oriented, checked."""
