"""Surfaces and tetrahedra on disk."""

from tetlux.meshing.files.meshes import read_mesh, write_mesh
from tetlux.meshing.files.surfaces import read_surface

__all__ = ["read_mesh", "read_surface", "write_mesh"]
