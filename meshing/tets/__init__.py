"""`TetMesh`, rays through it, its regions, its refinement, and checks of meshes that are given."""
