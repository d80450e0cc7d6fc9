"""`Reader`: reads the files that cases name, each once for all runs."""

import os
from dataclasses import dataclass, field, replace
from pathlib import Path

from tetlux.cases.file.fields import read_array_field, read_image_field, read_mesh_field
from tetlux.cases.file.images import read_pixels
from tetlux.cases.file.schema.body import MeshSpec, SurfaceSpec
from tetlux.cases.file.schema.media import FieldSpec, SubstanceSpec
from tetlux.cases.file.schema.parts import Encoding
from tetlux.cases.file.spectra import read_spectrum
from tetlux.fem.lights import Light
from tetlux.fem.media.spectra import Spectrum, SpectrumKind
from tetlux.fem.media.varying import Field
from tetlux.meshing import shapes
from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.errors import InputError
from tetlux.meshing.files.meshes import read_mesh
from tetlux.meshing.files.surfaces import read_surface
from tetlux.meshing.surface.surface import Surface
from tetlux.meshing.tets.mesh import TetMesh


@dataclass
class FilesRead:
    """What has been read, by folder, file and options; several case files may share it.

    Attributes
    ----------
    surfaces, meshes, fields, spectra, pixels : dict
    regions : dict
        Surfaces of regions, under the names of these.
    nested : set
        Bodies, by the ids of their surfaces, whose regions are known to lie within each other.
    lights : set
        Lights that are known to meet a body, with the ids of its surfaces and its boundary condition.
    """

    surfaces: dict[object, Surface] = field(default_factory=dict)
    meshes: dict[object, TetMesh] = field(default_factory=dict)
    fields: dict[object, Field] = field(default_factory=dict)
    spectra: dict[object, Spectrum] = field(default_factory=dict)
    pixels: dict[object, FloatArray] = field(default_factory=dict)
    regions: dict[object, Surface] = field(default_factory=dict)
    nested: set[tuple[int, ...]] = field(default_factory=set)
    lights: set[tuple[Light, tuple[int, ...], str]] = field(default_factory=set)


@dataclass
class Reader:
    """Reads surfaces, meshes, fields and images, each once.

    Attributes
    ----------
    folder : Path
        The folder of the case file, to which file names are relative.
    files : FilesRead
    """

    folder: Path
    files: FilesRead = field(default_factory=FilesRead)

    def surface(self, spec: SurfaceSpec, unit: str) -> Surface:
        """Read a surface file, or make a built-in shape."""
        # Built-in shapes are the same for case files in all folders.
        label = (self._label() if spec.file else "", unit, spec.model_dump_json())
        if label not in self.files.surfaces:
            surface = _surface(spec, unit, self.folder)
            self.files.surfaces[label] = replace(surface, crease_angle=spec.crease_angle)
        return self.files.surfaces[label]

    def region(self, spec: SurfaceSpec, unit: str, name: str) -> Surface:
        """Read the surface of a region; it has the name of the region."""
        surface = self.surface(spec, unit)
        # Runs share one object, so that it is hashed, checked and sent to workers once.
        key = id(surface), name
        if key not in self.files.regions:
            self.files.regions[key] = replace(surface, name=name)
        return self.files.regions[key]

    def mesh(self, spec: MeshSpec, unit: str) -> TetMesh:
        """Read a volume mesh."""
        label = (self._label(), spec.file, spec.scale, spec.array, unit)
        if label not in self.files.meshes:
            path = self.folder / spec.file
            self.files.meshes[label] = read_mesh(path, unit=unit, scale=spec.scale, labels=spec.array)
        return self.files.meshes[label]

    def field(self, spec: FieldSpec) -> Field:
        """Read a coefficient that varies in space."""
        label = (self._label(), spec.model_dump_json())
        if label not in self.files.fields:
            self.files.fields[label] = _field(spec, self.folder)
        return self.files.fields[label]

    def spectrum(self, spec: SubstanceSpec) -> tuple[Spectrum, float]:
        """Read the spectrum of a substance, and its amount."""
        is_molar = spec.concentration is not None
        amount = spec.concentration if is_molar else spec.fraction
        assert amount is not None
        label = (self._label(), spec.file, is_molar)
        if label not in self.files.spectra:
            kind: SpectrumKind = "extinction" if is_molar else "absorption"
            self.files.spectra[label] = read_spectrum(self.folder / spec.file, kind)
        return self.files.spectra[label], amount

    def pixels(self, file: str, encoding: Encoding) -> FloatArray:
        """Read an image as linear light, (rows, columns, 3)."""
        label = (self._label(), file, encoding)
        if label not in self.files.pixels:
            try:
                self.files.pixels[label] = read_pixels(self.folder / file, encoding)
            except InputError as error:
                raise error.about("file") from error
        return self.files.pixels[label]

    def _label(self) -> str:
        return os.path.abspath(self.folder)  # noqa: PTH100 - resolve() would ask the file system for each run


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
