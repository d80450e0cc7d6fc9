"""`Reader`: reads the files that a case names, each once for all runs of its sweep."""

from dataclasses import dataclass, field, replace
from pathlib import Path

from tetlux.cases.file.fields import read_array_field, read_image_field, read_mesh_field
from tetlux.cases.file.images import read_pixels
from tetlux.cases.file.schema.case import MeshSpec, SurfaceSpec
from tetlux.cases.file.schema.media import FieldSpec
from tetlux.cases.file.schema.parts import Encoding
from tetlux.fem.media.varying import Field
from tetlux.meshing import shapes
from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.errors import InputError
from tetlux.meshing.files.meshes import read_mesh
from tetlux.meshing.files.surfaces import read_surface
from tetlux.meshing.surface.surface import Surface
from tetlux.meshing.tets.mesh import TetMesh


@dataclass
class Reader:
    """Reads surfaces, meshes, fields and images, and keeps what it has read.

    Attributes
    ----------
    folder : Path
        The folder of the case file, to which file names are relative.
    """

    folder: Path
    _surfaces: dict[str, Surface] = field(default_factory=dict)
    _meshes: dict[str, TetMesh] = field(default_factory=dict)
    _fields: dict[str, Field] = field(default_factory=dict)
    _pixels: dict[tuple[str, Encoding], FloatArray] = field(default_factory=dict)

    def surface(self, spec: SurfaceSpec, unit: str) -> Surface:
        """Read a surface file, or make a built-in shape."""
        label = spec.model_dump_json() + unit
        if label not in self._surfaces:
            self._surfaces[label] = replace(_surface(spec, unit, self.folder), crease_angle=spec.crease_angle)
        return self._surfaces[label]

    def mesh(self, spec: MeshSpec, unit: str) -> TetMesh:
        """Read a volume mesh."""
        label = f"{spec.file} {spec.scale!r} {spec.array} {unit}"
        if label not in self._meshes:
            path = self.folder / spec.file
            self._meshes[label] = read_mesh(path, unit=unit, scale=spec.scale, labels=spec.array)
        return self._meshes[label]

    def field(self, spec: FieldSpec) -> Field:
        """Read a coefficient that varies in space."""
        label = spec.model_dump_json()
        if label not in self._fields:
            self._fields[label] = _field(spec, self.folder)
        return self._fields[label]

    def pixels(self, file: str, encoding: Encoding) -> FloatArray:
        """Read an image as linear light, (rows, columns, 3)."""
        label = file, encoding
        if label not in self._pixels:
            try:
                self._pixels[label] = read_pixels(self.folder / file, encoding)
            except InputError as error:
                raise error.about("file") from error
        return self._pixels[label]


def _surface(spec: SurfaceSpec, unit: str, folder: Path) -> Surface:
    if spec.file is not None:
        return read_surface(folder / spec.file, unit=unit, scale=spec.scale, holes=spec.holes)
    if spec.sphere:
        return shapes.sphere(spec.sphere.radius, center=spec.sphere.center, unit=unit)
    if spec.slab:
        return shapes.slab(spec.slab.width, spec.slab.depth, unit=unit)
    if spec.box:
        return shapes.box(spec.box.size, center=spec.box.center, unit=unit)
    if spec.cylinder:
        c = spec.cylinder
        return shapes.cylinder(c.radius, c.height, center=c.center, unit=unit)
    assert spec.torus is not None
    return shapes.torus(spec.torus.major, spec.torus.minor, center=spec.torus.center, unit=unit)


def _field(spec: FieldSpec, folder: Path) -> Field:
    if spec.volume:
        return read_mesh_field(folder / spec.volume.file, spec.volume.name, scale=spec.volume.scale)
    if spec.images:
        s = spec.images
        return read_image_field(folder / s.files, origin=s.origin, spacing=s.spacing, values=s.values)
    assert spec.array is not None
    return read_array_field(folder / spec.array.file, origin=spec.array.origin, spacing=spec.array.spacing)
