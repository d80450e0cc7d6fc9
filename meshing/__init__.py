"""Geometry: surfaces, tetrahedral meshes and their files, independent of light."""

from tetlux.meshing.errors import InputError, RunError, TetluxError
from tetlux.meshing.files.meshes import read_mesh
from tetlux.meshing.files.surfaces import read_surface
from tetlux.meshing.mesher.api import tetrahedralize
from tetlux.meshing.repair.pipeline import surface_from_arrays
from tetlux.meshing.shapes import box, cylinder, slab, sphere, torus
from tetlux.meshing.surface.surface import Surface
from tetlux.meshing.tets.given import mesh_from_arrays
from tetlux.meshing.tets.mesh import TetMesh
from tetlux.meshing.tets.nesting import check_regions
from tetlux.meshing.tets.refine import refine

__all__ = [
    "InputError",
    "RunError",
    "Surface",
    "TetMesh",
    "TetluxError",
    "box",
    "check_regions",
    "cylinder",
    "mesh_from_arrays",
    "read_mesh",
    "read_surface",
    "refine",
    "slab",
    "sphere",
    "surface_from_arrays",
    "tetrahedralize",
    "torus",
]
