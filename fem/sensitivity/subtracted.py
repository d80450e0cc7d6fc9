"""What readings change by because loads and subtracted charges depend on the coefficients.

With the dual solution z of a reading fixed, the reading depends on them through ``z.b + G(detector) - d.I G``. This is
smooth, and is differentiated by central differences: no system is solved for that.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from tetlux.fem.body.body import Body
from tetlux.fem.body.partition import MeshPartition
from tetlux.fem.known.charges import Charges
from tetlux.fem.known.kept_fits import fits_of
from tetlux.fem.known.patch import Patch
from tetlux.fem.known.split import SplitLights, Subtract, split_lights
from tetlux.fem.media.coefficients import AnyMedium, at_cells, by_label
from tetlux.fem.media.medium import Medium
from tetlux.fem.media.varying import VaryingMedium
from tetlux.fem.quadratic.assembly import element_matrices
from tetlux.fem.quadratic.loads import (
    InnerFaces,
    QuadraticPatch,
    inner_faces,
    line_load,
    patch_by_elements,
    quadratic_load,
)
from tetlux.fem.quadratic.measurement import DiscreteMeasurement
from tetlux.fem.quadratic.scene import QuadraticScene
from tetlux.fem.quadratic.solution import QuadraticSolution
from tetlux.fem.sources.deposit import Deposit
from tetlux.fem.sources.light import Light
from tetlux.fem.system import System
from tetlux.meshing.arrays import Number, NumberArray
from tetlux.meshing.describe import one_line
from tetlux.meshing.host.blocks import map_in_threads

Coefficient = Literal["sigma_a", "sigma_s_prime"]
# Step of central differences of four points, as a share of the coefficient. Readings change like exp(-k r): at k r = 20
# differences are off by 1e-7. Shorter steps are worse: integrals near a charge are cut in other ways as it moves, and
# jump by some 1e-8.
STEP = 2e-3
# Weights of the values one and two steps to each side (Fornberg 1988).
WEIGHTS = {1.0: 2.0 / 3.0, -1.0: -2.0 / 3.0, 2.0: -1.0 / 12.0, -2.0: 1.0 / 12.0}


def change_medium(system: System, label: int, coefficient: Coefficient, step: float) -> System:
    """A system with a coefficient of one medium larger by a step, 1/unit."""
    changed = dict(by_label(system.media))
    changed[label] = _add(changed[label], coefficient, step)
    if isinstance(system.medium, Mapping):
        return replace(system, medium=changed)
    regions = tuple(replace(region, medium=changed[number]) for number, region in enumerate(system.regions, 1))
    return replace(system, medium=changed[0], regions=regions)


def _add(medium: AnyMedium, coefficient: Coefficient, step: float) -> AnyMedium:
    if isinstance(medium, VaryingMedium):
        varying, base = getattr(medium, coefficient), _add(medium.base, coefficient, step)
        assert isinstance(base, Medium)
        return replace(medium, base=base, **({} if varying is None else {coefficient: lambda at: varying(at) + step}))
    if coefficient == "sigma_s_prime" and medium.sigma_s is not None:
        return replace(medium, sigma_s=medium.sigma_s + step / (1.0 - medium.mean_cosine))
    if coefficient == "sigma_s_prime":
        return replace(medium, sigma_s_prime=medium.reduced_scattering + step)
    return replace(medium, sigma_a=medium.sigma_a + step)


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
    _values: dict[int, NumberArray] = field(default_factory=dict)
    _inner: dict[QuadraticPatch, InnerFaces] = field(default_factory=dict)

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

    def derivative(self, label: int, coefficient: Coefficient) -> NumberArray:
        """Derivative of readings to the coefficient of a medium by loads and charges alone, (l, d), W/unit."""
        found = np.zeros((len(self.lights), len(self.measurements)), self.scene.fluence.dtype)
        step = STEP * self._least(label, coefficient)
        if step == 0:
            # Where nothing is absorbed a charge has no derivative, while readings do: that of the mesh is left.
            return found
        before = self._split(self.system)
        for steps, weight in WEIGHTS.items():
            changed = change_medium(self.system, label, coefficient, steps * step)
            split = self._split(changed)
            differing = [light for light in range(len(self.lights)) if _differ(before, split, light)]
            values = map_in_threads(lambda light: self._changed_value(changed, before, split, light), differing)  # noqa: B023
            for light, value in zip(differing, values, strict=True):
                found[light] += weight * value
        return found / step

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

    def _split(self, system: System) -> SplitLights:
        kept = fits_of(system.mesh)
        return split_lights(self.lights, self._body(system), self.subtract, kept=kept, shift=system.shift)

    def _body(self, system: System) -> Body:
        return Body(system.true_surface, system.media, MeshPartition(system.mesh))

    def _changed_value(self, system: System, before: SplitLights, after: SplitLights, light: int) -> NumberArray:
        """`_value` after a change; where it changed the power alone, of points that are subtracted, it is linear."""
        power = _common_power(before, after, light)
        if power is None:
            return self._value(system, after, light)
        if light not in self._values:
            self._values[light] = self._value(self.system, before, light)
        return np.asarray(power * self._values[light])

    def _value(self, system: System, split: SplitLights, light: int) -> NumberArray:
        """``z.b + G(detector) - d.I G`` of each detector, (d,)."""
        space, coefficients = self.scene.operator.space, system.coefficients
        deposit = split.remaining[light].evaluate_on(system.mesh, system.true_surface, coefficients)
        lines = line_load(space, coefficients, deposit.terms.segments)
        load: NumberArray = quadratic_load(space, coefficients, deposit.terms, lines)
        value = np.zeros(len(self.measurements), self.scene.fluence.dtype)
        for charges, known in zip(_charges_of(split, light), self.scene.patches[light], strict=True):
            patch = self._patch(system, charges, known)
            load = load + patch.load
            value += [_read_missing(patch, each) for each in self.measurements]
        return np.asarray(value + load @ self.duals)

    def _patch(self, system: System, charges: Charges, known: QuadraticPatch) -> QuadraticPatch:
        """Charges on the tetrahedra that others had."""
        cells, space = known.patch.cells, self.scene.operator.space
        inside = np.flatnonzero(cells)
        at_nodes = np.zeros(len(system.mesh.points), charges.equation.dtype)
        nodes = np.unique(system.mesh.tetrahedra[inside])
        at_nodes[nodes] = charges.fluence(system.mesh.points[nodes])
        coefficients = system.coefficients
        diffusion, sigma = (at_cells(value, inside) for value in (coefficients.diffusion, coefficients.sigma))
        elements = element_matrices(space, diffusion, sigma, inside)
        if known not in self._inner:
            self._inner[known] = inner_faces(space, known.patch)
        return patch_by_elements(space, Patch(system.mesh, charges, cells, at_nodes), elements, self._inner[known])

    __repr__ = one_line


def _read_missing(patch: QuadraticPatch, discrete: DiscreteMeasurement) -> Number:
    """What a detector reads of charges less their interpolant."""
    inside = np.flatnonzero(patch.patch.cells[discrete.cells])
    if len(inside) == 0:
        return 0.0
    points, weights = discrete.measurement.points[inside], discrete.measurement.weights[inside]
    missing = patch.patch.charges.fluence(points) - discrete.values(patch.interpolant)[inside]
    return discrete.scale * (weights @ missing).item()


def _charges_of(split: SplitLights, light: int) -> list[Charges]:
    """The charges of a light, in the order of its patches."""
    found = [charges for charges, owner in zip(split.charges, split.owners, strict=True) if owner == light]
    return [*found, *([split.fitted[light].charges] if light in split.fitted else [])]


def _common_power(before: SplitLights, after: SplitLights, light: int) -> float | None:
    """The factor of the power of a light's charges, if nothing else of the light differs; None if anything does."""
    deposit = before.remaining[light]
    if (
        len(deposit.terms.segments)
        or len(deposit.terms.points)
        or deposit.on_mesh is not None
        or light in before.fitted
    ):
        return None
    ours, theirs = _facts(before, light), _facts(after, light)
    power = float(np.real(theirs[3][0] / ours[3][0])) if len(ours) > 3 else 1.0
    scaled = [power * facts if number >= 2 and number % 3 == 0 else facts for number, facts in enumerate(ours)]
    return power if all(np.allclose(a, b, rtol=1e-14, atol=0.0) for a, b in zip(scaled, theirs, strict=True)) else None


def _differ(before: SplitLights, after: SplitLights, light: int) -> bool:
    """Whether anything of a light that goes into loads differs between two splits."""
    deposit = before.remaining[light]
    if len(deposit.terms.segments) or deposit.on_mesh is not None:
        return True
    first, second = (_facts(split, light) for split in (before, after))
    return any(not np.array_equal(one, other) for one, other in zip(first, second, strict=True))


def _facts(split: SplitLights, light: int) -> list[NumberArray]:
    """What charges and points of a light are."""
    terms = split.remaining[light].terms
    facts: list[NumberArray] = [terms.points, terms.powers]
    for charges in _charges_of(split, light):
        equation = np.array([charges.equation.wave_number, charges.equation.diffusion])
        facts += [charges.positions, charges.strengths, equation]
    return facts
