"""`QuadraticSolution`: the fluence of lights in quadratic elements, and measurements of it."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal

import numpy as np

from tetlux.fem.known.fitted_patch import FittedPatch
from tetlux.fem.known.kept_patches import keep_or_choose
from tetlux.fem.known.patch import Patch, patch_of
from tetlux.fem.models.boundary import boundary_condition_of
from tetlux.fem.quadratic.loads import LineLoad, QuadraticPatch, line_load, quadratic_load, quadratic_patch
from tetlux.fem.quadratic.measurement import DiscreteMeasurement, Measurement
from tetlux.fem.quadratic.operator import QuadraticOperator
from tetlux.fem.quadratic.reading_error import ReadingError
from tetlux.fem.quadratic.recovered_gradient import recovered_gradient_difference
from tetlux.fem.sources.deposit import Deposit
from tetlux.meshing.arrays import BoolArray, FloatArray, Number, NumberArray
from tetlux.meshing.describe import one_line

# Charges are subtracted where their fluence is at most this many times the fluence itself.
LARGEST_BRIGHTNESS_RATIO = 4.0
# A beam of at least this many rays is broad.
LEAST_RAYS_OF_BROAD_BEAM = 16
# Layers with a larger k h are thin. Under diffuse light the error of quadratic elements is .1 % at 1.4 and 200 % at 9.
LARGEST_RESOLVED_KH = 2.0


Where = Literal["surface", "inside"]


@dataclass(frozen=True, eq=False)
class QuadraticScene:
    """The lights of a scene on a mesh, solved for at the first reading.

    Attributes
    ----------
    operator : QuadraticOperator
    deposits : tuple of Deposit
        Of each light on the mesh.
    linear_patches : tuple of tuple of Patch
        The patches of each light in linear elements.
    linear_fluences : tuple of (n,) ndarray
        The fluence of each light in linear elements, which determines its quadratic patches.
    """

    operator: QuadraticOperator
    deposits: tuple[Deposit, ...]
    linear_patches: tuple[tuple[Patch, ...], ...]
    linear_fluences: tuple[NumberArray, ...]

    @cached_property
    def patches(self) -> tuple[tuple[QuadraticPatch, ...], ...]:
        """The patches of each light in quadratic elements."""
        return tuple(
            tuple(_patch(self.operator, patch, fluence) for patch in own)
            for own, fluence in zip(self.linear_patches, self.linear_fluences, strict=True)
        )

    @cached_property
    def loads(self) -> NumberArray:
        """The load of each light, (size, k), W."""
        space, coefficients = self.operator.space, self.operator.coefficients
        loads = [
            quadratic_load(space, coefficients, deposit.terms, lines)
            for deposit, lines in zip(self.deposits, self.lines, strict=True)
        ]
        return np.column_stack(
            [load + sum(each.load for each in own) for load, own in zip(loads, self.patches, strict=True)]
        )

    @cached_property
    def lines(self) -> list[LineLoad]:
        """The load of the beams of each light."""
        space, coefficients = self.operator.space, self.operator.coefficients
        return [line_load(space, coefficients, deposit.terms.segments) for deposit in self.deposits]

    @cached_property
    def broad_beams(self) -> FloatArray:
        """Load of the rays of broad beams on bubbles, for each light, (size, k), W."""
        found = np.zeros((self.operator.space.size, len(self.deposits)))
        for light, (deposit, lines) in enumerate(zip(self.deposits, self.lines, strict=True)):
            if len(deposit.terms.segments) >= LEAST_RAYS_OF_BROAD_BEAM:
                found[:, light] = lines.load
        found[: len(self.operator.mesh.points)] = 0.0
        return found

    @cached_property
    def fluence(self) -> NumberArray:
        """The fluence of each light, with the interpolants of its patches, (size, k), W/unit²."""
        # The system is solved for the remainder, which is far smaller near the light than the fitted charges.
        fitted = np.column_stack(
            [
                np.sum(
                    [np.zeros(self.operator.space.size), *(each.interpolant for each in own if each.is_fitted)], axis=0
                )
                for own in self.patches
            ]
        )
        return fitted + self.operator.solve(self.loads - self.operator.matrix @ fitted)

    __repr__ = one_line


def prefer_positive(values: NumberArray, linear: NumberArray) -> NumberArray:
    """Values of quadratic elements, or of linear ones where those are below zero; complex ones as they are."""
    return values if np.iscomplexobj(values) else np.where(values > 0, values, linear)


def _patch(operator: QuadraticOperator, patch: Patch, fluence: NumberArray) -> QuadraticPatch:
    """A patch in quadratic elements, by the fluence (n,) of its light in linear elements.

    The residual of fitted charges is integrated over the bent facets. With the quadrature points of linear elements, a
    reading of a thousandth of the largest had an error of 4 %.
    """
    if not isinstance(patch, FittedPatch):
        linear = patch
        patch = keep_or_choose(patch.mesh, patch.charges, patch.at_nodes, "quadratic", lambda: _widen(linear, fluence))
    elements = operator.elements if patch.cells.all() else operator.elements[patch.cells]
    return quadratic_patch(operator.space, patch, elements)


def _widen(patch: Patch, fluence: NumberArray) -> Patch:
    """The patch of tetrahedra where charges are not much brighter than the fluence (n,) in linear elements.

    Its faces, across which the fluence jumps, are then farther from the light than those of the linear patch.
    """
    wide = patch_of(
        patch.mesh, patch.charges, np.abs(patch.at_nodes) <= LARGEST_BRIGHTNESS_RATIO * np.abs(fluence), patch.at_nodes
    )
    return wide if wide.cells.sum() > patch.cells.sum() else patch


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
    def patches(self) -> list[QuadraticPatch]:
        """Their patches."""
        return [patch for light in self.lights for patch in self.scene.patches[light]]

    @cached_property
    def gradient_difference(self) -> NumberArray:
        """`recovered_gradient_difference` of the fluence less the charges of patches, (m, 4, 3)."""
        space = self.operator.space
        difference = recovered_gradient_difference(space, self.fluence)
        for patch in self.patches:
            inside = np.flatnonzero(patch.patch.cells)
            difference[inside] -= recovered_gradient_difference(space, patch.interpolant)[inside]
        return difference

    @cached_property
    def broad_beams(self) -> FloatArray:
        """Load of the rays of broad beams on bubbles, (size,), W."""
        return np.asarray(self.scene.broad_beams[:, self.lights].sum(axis=1))

    @cached_property
    def residual(self) -> NumberArray:
        """Load less the matrix times the fluence, (size,), W."""
        load = self.scene.loads[:, self.lights].sum(axis=1)
        return np.asarray(load - self.operator.matrix @ self.fluence)

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
        fluence, points = discrete.values(self.fluence), discrete.measurement.points
        for patch in self.patches:
            inside = np.flatnonzero(patch.patch.cells[discrete.cells])
            if len(inside):
                fluence[inside] += (
                    patch.patch.charges.fluence(points[inside]) - discrete.values(patch.interpolant)[inside]
                )
        return fluence

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
        return np.asarray(self.operator.robin * self.fluence[nodes] + self._unscattered_at_nodes[nodes])

    @cached_property
    def _unscattered_at_nodes(self) -> FloatArray:
        """Exitance in addition to ``phi/(2A)`` under diffuse light at all nodes, (n,), as in `Solution.exitance`."""
        mesh = self.operator.mesh
        found = np.zeros(len(mesh.points))
        given = sum(self.scene.deposits[light].terms.transmitted_irradiance for light in self.lights)
        found[mesh.boundary_nodes] = boundary_condition_of(self.operator.coefficients.outer).exitance_offset(given)
        return found

    def _unscattered(self, discrete: DiscreteMeasurement) -> FloatArray:
        at_corners = self._unscattered_at_nodes[discrete.dofs[:, :3]]
        return np.asarray((at_corners * discrete.shape_values[:, :3]).sum(axis=1))

    __repr__ = one_line
