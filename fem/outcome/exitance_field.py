"""Exitance as a field over a surface, however it was found: what detectors, radiance and charts need of a solution."""

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np

from tetlux.fem.media.medium import Medium
from tetlux.fem.models.boundary import boundary_condition_of
from tetlux.fem.validity.meshless import SurfaceValidity
from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.surface.surface import Surface
from tetlux.meshing.tets.mesh import TetMesh


class ExitanceField(Protocol):
    """Anything that knows the exitance of a surface; `tetlux.fem.Solution` is one."""

    @property
    def surface(self) -> Surface:
        """The surface that light leaves through."""
        ...

    @property
    def medium(self) -> Medium:
        """The medium below it, whose refractive index light leaves."""
        ...

    def exitance_on(self, queries: FloatArray) -> FloatArray:
        """Exitance (q,) at points (q, 3) that lie on the surface, W/unit²."""
        ...


class ResolvedField(ExitanceField, Protocol):
    """An exitance that also knows how fine it is."""

    @property
    def resolution(self) -> tuple[FloatArray, FloatArray]:
        """Points of the surface (n, 3), and how much space the exitance needs to change there, (n,), unit."""
        ...

    @property
    def error_estimate(self) -> float:
        """Estimated relative L2 error of the exitance; nan if it is unknown."""
        ...


@runtime_checkable
class FieldWithErrors(Protocol):
    """An exitance that knows its own errors at single points without a mesh."""

    @property
    def validity(self) -> SurfaceValidity | None:
        """Expected errors of diffusion; None where they are not known."""
        ...

    def errors_on(self, queries: FloatArray) -> FloatArray:
        """Estimated relative errors (q,) of the exitance at points (q, 3) that lie on the surface."""
        ...


@dataclass(frozen=True, eq=False)
class Dark:
    """No light at all: what is read there shows whether a detector can be placed."""

    surface: Surface
    medium: Medium

    def exitance_on(self, queries: FloatArray) -> FloatArray:
        """Zeros (q,)."""
        return np.zeros(len(queries))


@dataclass(frozen=True, eq=False)
class LinearFluence:
    """Fluence by its values at the nodes of a mesh, linear between them, as another solver returns it.

    Attributes
    ----------
    mesh : TetMesh
    surface : Surface
        What the mesh stands for.
    medium : Medium
    fluence : (n,) ndarray
        At the nodes, W/unit².
    """

    mesh: TetMesh
    surface: Surface
    medium: Medium
    fluence: FloatArray

    def exitance_on(self, queries: FloatArray) -> FloatArray:
        """Exitance ``M = phi/(2A)`` (q,) on the facets nearest to points (q, 3), W/unit²."""
        _, face, weights = self.mesh.closest_boundary(queries)
        fluence = (weights * self.fluence[self.mesh.boundary_faces[face]]).sum(axis=1)
        return np.asarray(boundary_condition_of(self.medium).exitance(fluence, 0.0))
