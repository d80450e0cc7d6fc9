"""`QuadraticSolution`: the fluence of lights in quadratic elements, and measurements of it."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal

import numpy as np

from tetlux.fem.models.boundary import boundary_condition_of
from tetlux.fem.quadratic.measurement import DiscreteMeasurement, Measurement
from tetlux.fem.quadratic.operator import QuadraticOperator
from tetlux.fem.quadratic.patches import QuadraticPatch
from tetlux.fem.quadratic.reading_error import ReadingError
from tetlux.fem.quadratic.recovered_gradient import recovered_gradient_difference
from tetlux.fem.quadratic.scene import QuadraticScene
from tetlux.fem.sources.volume import VolumeSource
from tetlux.meshing.arrays import BoolArray, FloatArray, Number, NumberArray
from tetlux.meshing.describe import one_line

# Layers with a larger k h are thin. Under diffuse light the error of quadratic elements is .1 % at 1.4 and 200 % at 9.
LARGEST_RESOLVED_KH = 2.0

Where = Literal["surface", "inside"]


def prefer_positive(values: NumberArray, linear: NumberArray) -> NumberArray:
    """Values of quadratic elements, or of linear ones where those are below zero; complex ones as they are."""
    return values if np.iscomplexobj(values) else np.where(values > 0, values, linear)


@dataclass(frozen=True, eq=False)
class QuadraticSolution:
    """The sum of some lights of a scene.

    Attributes
    ----------
    scene : QuadraticScene
    lights : tuple of int
    errors : dict
        The readings that were made, and their errors.
    bands : dict
        The errors of bands of the surface and of the volume: see `tetlux.fem.quadratic.field_error`.
    """

    scene: QuadraticScene
    lights: tuple[int, ...]
    errors: dict[Measurement, ReadingError] = field(default_factory=dict)
    bands: dict[Where, list[ReadingError]] = field(default_factory=dict)

    @property
    def operator(self) -> QuadraticOperator:
        """The operator."""
        return self.scene.operator

    @cached_property
    def solved(self) -> NumberArray:
        """What is solved for, (size,), W/unit²: see `QuadraticScene.solved`."""
        return np.asarray(self.scene.solved[:, self.lights].sum(axis=1))

    @cached_property
    def fluence(self) -> NumberArray:
        """Fluence (size,), W/unit²."""
        return np.asarray(self.scene.fluence[:, self.lights].sum(axis=1))

    @cached_property
    def thin_layers(self) -> BoolArray:
        """Whether distributed light decays within each tetrahedron, (m,).

        Quadratic elements then overshoot, while linear ones are fitted to such layers: see
        `tetlux.fem.operators.fitting`.
        """
        mesh, coefficients = self.operator.mesh, self.operator.coefficients
        if not any(
            self.scene.deposits[light].terms.is_distributed and not self.scene.linear_patches[light]
            for light in self.lights
        ):
            return np.zeros(len(mesh.tetrahedra), dtype=bool)
        # The edge of a regular tetrahedron of this volume.
        edges = (6.0 * np.sqrt(2.0) * mesh.volumes) ** (1.0 / 3.0)
        return np.asarray(coefficients.decay * edges > LARGEST_RESOLVED_KH)

    @property
    def volume_sources(self) -> list[VolumeSource]:
        """Their volume sources."""
        return [source for light in self.lights for source in self.scene.deposits[light].terms.volume_sources]

    @property
    def patches(self) -> list[QuadraticPatch]:
        """Their patches."""
        return [patch for light in self.lights for patch in self.scene.patches[light]]

    @cached_property
    def gradient_difference(self) -> NumberArray:
        """`recovered_gradient_difference` of the fluence less the charges of patches, (m, 4, 3)."""
        space = self.operator.space
        difference = recovered_gradient_difference(space, self.solved)
        for patch in self.patches:
            if patch.is_whole:
                continue
            inside = np.flatnonzero(patch.patch.cells)
            difference[inside] -= recovered_gradient_difference(space, patch.interpolant)[inside]
        return difference

    @cached_property
    def broad_beams(self) -> FloatArray:
        """Load of the rays of broad beams on bubbles, (size,), W."""
        return np.asarray(self.scene.broad_beams[:, self.lights].sum(axis=1))

    @cached_property
    def residual(self) -> NumberArray:
        """Load less the matrix times what is solved for, (size,), W."""
        load = self.scene.loads[:, self.lights].sum(axis=1)
        return np.asarray(load - self.operator.matrix @ self.solved)

    def prepare(self, measurements: Sequence[Measurement]) -> Iterator[Sequence[Measurement]]:
        """Parts of measurements, as many as have their dual solutions kept; those of each part are found together."""
        most = self.operator.most_duals
        for start in range(0, len(measurements), most):
            some = measurements[start : start + most]
            self.operator.duals([measurement for measurement in some if measurement not in self.errors])
            yield some

    def values_at(self, discrete: DiscreteMeasurement) -> NumberArray:
        """What is measured at the points of a measurement, (q,): exitance, or fluence inside, W/unit²."""
        values = discrete.scale * self.fluence_at(discrete)
        return values if discrete.measurement.inside else values + self._unscattered(discrete)

    def read(self, discrete: DiscreteMeasurement, dual: NumberArray) -> Number:
        """The value of a measurement with its dual solution (size,), W/unit²."""
        return (discrete.measurement.weights @ self.values_at(discrete) + self.residual @ dual).item()

    def fluence_at(self, discrete: DiscreteMeasurement) -> NumberArray:
        """Fluence at the points of a measurement, (q,), W/unit²."""
        fluence, points = self.remainder_at(discrete), discrete.measurement.points
        for patch in self.patches:
            inside = np.flatnonzero(patch.patch.cells[discrete.cells])
            if len(inside):
                fluence[inside] += patch.patch.charges.fluence(points[inside])
        return fluence

    def remainder_at(self, discrete: DiscreteMeasurement) -> NumberArray:
        """The fluence less that of charges at the points of a measurement, as on the mesh, (q,), W/unit²."""
        remainder = discrete.values(self.solved)
        for patch in self.patches:
            if not patch.is_whole:
                inside = np.flatnonzero(patch.patch.cells[discrete.cells])
                remainder[inside] -= discrete.values(patch.interpolant)[inside]
        return remainder

    def exitance_on(self, points: FloatArray, linear: NumberArray) -> NumberArray:
        """Exitance at points (q, 3) that lie on the surface, (q,), W/unit².

        Where there is hardly any light it may be below zero; there it is that of linear elements (q,), which is not.
        """
        values = self.values_at(self.operator.discretise(Measurement(points, np.zeros(len(points)))))
        return prefer_positive(values, linear)

    def fluence_inside(self, points: FloatArray, linear: NumberArray) -> NumberArray:
        """Fluence at points (q, 3) of the body, (q,), W/unit²; likewise."""
        values = self.values_at(self.operator.discretise(Measurement(points, np.zeros(len(points)), inside=True)))
        return prefer_positive(values, linear)

    @property
    def linear_fluence(self) -> NumberArray:
        """Fluence of linear elements at the nodes, (n,), W/unit²."""
        return np.asarray(np.sum([self.scene.linear_fluences[light] for light in self.lights], axis=0))

    @property
    def exitance_at_nodes(self) -> NumberArray:
        """Exitance at the boundary nodes, (b,), W/unit²."""
        nodes = self.operator.mesh.boundary_nodes
        fluence = self.solved[nodes] + sum(each.patch.at_nodes[nodes] for each in self.patches if each.is_whole)
        return np.asarray(self.operator.robin * fluence + self._unscattered_at_nodes[nodes])

    @cached_property
    def _unscattered_at_nodes(self) -> FloatArray:
        """Exitance in addition to ``phi/(2A)`` under diffuse light at all nodes, (n,), as in `Solution.exitance`."""
        return self._on_boundary(boundary_condition_of(self.operator.coefficients.outer).exitance_offset)

    @cached_property
    def inflow(self) -> FloatArray:
        """Inflow of diffuse light at all nodes, (n,), W/unit²."""
        return self._on_boundary(boundary_condition_of(self.operator.coefficients.outer).inflow)

    def _on_boundary(self, change: Callable[[float | FloatArray], float | FloatArray]) -> FloatArray:
        """A function of the transmitted irradiance at the boundary nodes, and 0 inside, (n,)."""
        found = np.zeros(len(self.operator.mesh.points))
        given = sum(self.scene.deposits[light].terms.transmitted_irradiance for light in self.lights)
        found[self.operator.mesh.boundary_nodes] = change(given)
        return found

    def _unscattered(self, discrete: DiscreteMeasurement) -> FloatArray:
        at_corners = self._unscattered_at_nodes[discrete.dofs[:, :3]]
        return np.asarray((at_corners * discrete.shape_values[:, :3]).sum(axis=1))

    __repr__ = one_line
