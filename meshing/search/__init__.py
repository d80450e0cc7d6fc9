"""Find things in space: rays, nearest points, cells."""
