"""Light before it is scattered: rays are refracted, followed through a mesh, and leave segments."""
