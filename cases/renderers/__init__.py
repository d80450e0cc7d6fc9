"""The files of a run that 3D programs and renderers read."""
