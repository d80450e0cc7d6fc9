"""What readings change by because loads and subtracted charges depend on the coefficients.

With the dual solution z of a reading fixed, the reading depends on them through ``z.b + G(detector) - d.I G``. Places
and powers of charges are differentiated by central differences, strengths that are fitted by those of the equations
that they are fitted to (`tetlux.fem.charges.change`), fields in closed form (`tetlux.fem.charges.derivative`). No
system is solved for that.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tetlux.fem.body.body import Body
from tetlux.fem.body.partition import MeshPartition
from tetlux.fem.charges.change import differentiate_strengths
from tetlux.fem.charges.derivative import ChargeDerivatives
from tetlux.fem.known.charges import Charges
from tetlux.fem.known.kept_fits import fits_of
from tetlux.fem.known.patch import Patch
from tetlux.fem.known.split import SplitLights, Subtract, split_lights
from tetlux.fem.media.coefficients import at_cells
from tetlux.fem.quadratic.loads import line_load, point_load, quadratic_load
from tetlux.fem.quadratic.measurement import DiscreteMeasurement
from tetlux.fem.quadratic.patch_faces import Field
from tetlux.fem.quadratic.patches import QuadraticPatch, field_load, interpolant_of
from tetlux.fem.quadratic.scene import QuadraticScene
from tetlux.fem.quadratic.solution import QuadraticSolution
from tetlux.fem.sensitivity.nearby import (
    SHORTENINGS,
    SHORTER,
    STEP,
    WEIGHTS,
    Change,
    Coefficient,
    Nearby,
    change_medium,
    change_of,
    has_charges_of,
    has_rest,
    power_change,
)
from tetlux.fem.sensitivity.products import multiply_on
from tetlux.fem.sources.deposit import Deposit
from tetlux.fem.sources.light import Light
from tetlux.fem.system import System
from tetlux.meshing.arrays import NumberArray
from tetlux.meshing.describe import one_line
from tetlux.meshing.errors import RunError
from tetlux.meshing.host.blocks import map_in_threads


@dataclass(frozen=True, eq=False)
class Readout:
    """What readings of some lights need besides the fluence at the nodes.

    Attributes
    ----------
    system : System
    lights : sequence of Light
    subtract : {"fitted", "half-space", "free-space", "nothing"}
    scene : QuadraticScene
        Of the lights on the system's mesh.
    measurements : sequence of DiscreteMeasurement
        Of d detectors.
    duals : (size, d) ndarray
        Their dual solutions.
    """

    system: System
    lights: Sequence[Light]
    subtract: Subtract
    scene: QuadraticScene
    measurements: Sequence[DiscreteMeasurement]
    duals: NumberArray

    def readings(self) -> NumberArray:
        """What each detector reads of each light, (l, d), W/unit²."""
        parts = [QuadraticSolution(self.scene, (light,)) for light in range(len(self.lights))]
        readings = zip(self.measurements, self.duals.T, strict=True)
        return np.array([[part.read(discrete, dual) for part in parts] for discrete, dual in readings]).T

    def deposits(self) -> list[Deposit]:
        """What each light leaves in the body."""
        system, body = self.system, self._body(self.system)
        return [
            light.deposit_in(body).evaluate_on(system.mesh, system.true_surface, system.coefficients)
            for light in self.lights
        ]

    def derivatives(self, label: int, coefficients: Sequence[Coefficient]) -> NumberArray:
        """Derivatives of readings to k coefficients of a medium by loads and charges alone, (k, l, d), W/unit."""
        shape = len(coefficients), len(self.lights), len(self.measurements)
        found = np.zeros(shape, self.scene.fluence.dtype)
        least = [self._least(label, coefficient) for coefficient in coefficients]
        # Where nothing is absorbed a charge has no derivative, while readings do: that of the mesh is left.
        some = [number for number in range(len(coefficients)) if least[number] != 0]
        nearby = [self._nearby(label, coefficients[number], least[number]) for number in some]
        of_matrix = self._multiply(label) if some else {}

        def work(light: int) -> None:
            for number, each in zip(some, nearby, strict=True):
                found[number, light] = self.of_load(each, light)
            for patch, known in enumerate(self.scene.patches[light]):
                is_own = _is_in(known.patch, label)
                changes = [
                    change_of(each, light, patch, coefficients[number] if is_own else None)
                    for number, each in zip(some, nearby, strict=True)
                ]
                found[some, light] += self.of_charges(known, changes)
                if known in of_matrix:
                    mass, stiffness = of_matrix[known]
                    for number in some:
                        found[number, light] += (mass if coefficients[number] == "sigma_a" else 0.0) - stiffness

        map_in_threads(work, range(len(self.lights)))
        return found

    def _nearby(self, label: int, coefficient: Coefficient, least: float) -> list[Nearby]:
        """The lights with a coefficient a step away on both sides, as near as no charge comes or goes.

        Raises
        ------
        RunError
            If some do however near, as where a light is so much deeper than the one that its charges are kept for.
        """
        step, known = STEP * least, [[each.patch.charges for each in own] for own in self.scene.patches]
        for _ in range(SHORTENINGS):
            changed = [change_medium(self.system, label, coefficient, steps * step) for steps in WEIGHTS]
            splits = map_in_threads(lambda system: self.split(self.lights, system), changed)
            found = [
                Nearby(weight / step, system, split)
                for weight, system, split in zip(WEIGHTS.values(), changed, splits, strict=True)
            ]
            if all(has_charges_of(one.split, known) for one in found):
                return found
            step *= SHORTER
        raise RunError("charges of a light come or go at these coefficients; change one of them by a thousandth.")

    def _least(self, label: int, coefficient: Coefficient) -> float:
        """The least coefficient of a medium, 1/unit."""
        coefficients, mesh = self.system.coefficients, self.system.mesh
        if coefficients.uniform:
            cells = np.zeros(1, dtype=np.int64)
        else:
            several = len(self.system.media) > 1
            cells = np.flatnonzero(mesh.regions == label) if several else np.arange(len(mesh.tetrahedra))
        absorption, extinction = (at_cells(each, cells) for each in (coefficients.sigma_a, coefficients.sigma_t_prime))
        return float((absorption if coefficient == "sigma_a" else extinction - absorption).min())

    def split(self, lights: Sequence[Light], system: System) -> SplitLights:
        """Lights in a system, with the charges that are kept with its mesh, which are not fitted to it."""
        kept = fits_of(system.mesh)
        return split_lights(lights, self._body(system), self.subtract, kept=kept, shift=system.shift, refit=False)

    def _body(self, system: System) -> Body:
        return Body(system.true_surface, system.media, MeshPartition(system.mesh))

    def of_load(self, nearby: Sequence[Nearby], light: int) -> NumberArray:
        """Derivative of ``z.b`` of what is not subtracted of a light of theirs, (d,)."""
        rest = [each.split.remaining[light] for each in nearby]
        if not any(has_rest(one) for one in rest):
            return np.zeros(len(self.measurements))
        space, load = self.scene.operator.space, np.zeros(self.scene.operator.space.size)
        for each, remaining in zip(nearby, rest, strict=True):
            system = each.system
            deposit = remaining.evaluate_on(system.mesh, system.true_surface, system.coefficients)
            lines = line_load(space, system.coefficients, deposit.terms.segments)
            load = load + each.weight * quadratic_load(space, system.coefficients, deposit.terms, lines)
        return np.asarray(load @ self.duals)

    def of_charges(self, known: QuadraticPatch, changes: Sequence[Change]) -> NumberArray:
        """Derivatives of ``z.b + G(detector) - d.I G`` by k changes of the charges of a patch, (k, d)."""
        found = np.zeros((len(changes), len(self.measurements)), self.scene.fluence.dtype)
        others = []
        for number, change in enumerate(changes):
            if not known.patch.cells.any():
                found[number] = self._of_points(change)
            elif (power := power_change(known.patch.charges, change)) is not None:
                found[number] = power * self._of_patch(known)
            else:
                others.append(number)
        if others:
            found[others] = self._of_derivatives(known, [changes[number] for number in others])
        return found

    def _of_points(self, change: Change) -> NumberArray:
        """Derivative of the load of points that are not subtracted, times each dual, (d,)."""
        space = self.scene.operator.space
        loads = [
            weight * point_load(space, each.positions[: each.sources], each.strengths[: each.sources].real)
            for weight, each in change.weighted
        ]
        return np.asarray(np.sum(loads, axis=0) @ self.duals)

    def _of_patch(self, known: QuadraticPatch) -> NumberArray:
        """``z.b + G(detector) - d.I G`` of the charges of a patch, (d,)."""
        missing = _read_missing(known.patch, known.patch.charges, known.interpolant[:, None], self.measurements)
        return np.asarray(known.load @ self.duals + missing[:, 0])

    def _of_derivatives(self, known: QuadraticPatch, changes: Sequence[Change]) -> NumberArray:
        """The same of derivatives of the charges by k changes, (k, d)."""
        patch, operator, mesh = known.patch, self.scene.operator, self.system.mesh
        derived = _differentiate(patch.charges, changes)
        marked = np.zeros(len(mesh.points), dtype=bool)
        marked[mesh.tetrahedra[patch.cells]] = True
        at_nodes = np.zeros((len(mesh.points), len(changes)), patch.charges.equation.dtype)
        at_nodes[marked] = derived.fluence(mesh.points[marked])
        interpolant = interpolant_of(operator.space, patch, derived, at_nodes)
        of_potential = patch.charges.equation.diffusion * interpolant
        of_potential += known.interpolant[:, None] * derived.diffusion
        load = field_load(operator, patch, derived, interpolant, of_potential, self.scene.inner_faces)
        return np.asarray(load.T @ self.duals + _read_missing(patch, derived, interpolant, self.measurements).T)

    def _multiply(self, label: int) -> dict[QuadraticPatch, tuple[NumberArray, NumberArray]]:
        """Products of the interpolants of charges in a medium with the duals on their patches, two (d,) for each."""
        patches = [each for own in self.scene.patches for each in own if _is_in(each.patch, label)]
        patches = [each for each in patches if each.patch.cells.any()]
        if not patches:
            return {}
        operator = self.scene.operator
        functions = np.column_stack([each.interpolant for each in patches])
        within = np.column_stack([each.patch.cells for each in patches])
        factors = np.broadcast_to(3.0 * np.square(operator.coefficients.diffusion), len(within))
        products = multiply_on(operator.space, functions, within, self.duals, factors)
        return dict(zip(patches, zip(*products, strict=True), strict=True))

    __repr__ = one_line


def _is_in(patch: Patch, label: int) -> bool:
    """Whether the charges of a patch are those of a medium."""
    return patch.charges.region is None or patch.charges.region == label


def _read_missing(
    patch: Patch, field: Field, interpolant: NumberArray, measurements: Sequence[DiscreteMeasurement]
) -> NumberArray:
    """What each of d detectors reads of k fields on a patch less their interpolants (size, k), (d, k)."""
    found = np.zeros((len(measurements), interpolant.shape[1]), interpolant.dtype)
    for number, discrete in enumerate(measurements):
        inside = np.flatnonzero(patch.cells[discrete.cells])
        if len(inside):
            points, weights = discrete.measurement.points[inside], discrete.measurement.weights[inside]
            known = np.column_stack([discrete.values(each)[inside] for each in interpolant.T])
            found[number] = discrete.scale * (weights @ (field.fluence(points).reshape(known.shape) - known))
    return found


def _differentiate(known: Charges, changes: Sequence[Change]) -> ChargeDerivatives:
    """The derivatives of charges by some changes."""
    positions, closest = (np.array([one.sum(name) for one in changes]) for name in ("positions", "closest"))
    strengths = np.array([one.sum("strengths") for one in changes])
    if (placement := changes[0].placement) is not None:
        of_charges = differentiate_strengths(placement, known, [one.weighted for one in changes])
        strengths = np.hstack([strengths[:, : known.sources], of_charges])
    k, diffusion = known.equation.wave_number, known.equation.diffusion
    of_diffusion = np.array([0.0 if one.coefficient is None else -3.0 * diffusion**2 for one in changes])
    # k² = sigma_a/D, and D = 1/(3 sigma_t').
    of_wave_number = -0.5 * k * of_diffusion / diffusion
    of_wave_number += np.array([0.5 / (k * diffusion) if one.coefficient == "sigma_a" else 0.0 for one in changes])
    return ChargeDerivatives(known, positions, strengths, of_wave_number, of_diffusion, closest)
