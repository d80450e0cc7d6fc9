"""`QuadraticSolution`: the fluence of lights in quadratic elements, and what is read of it."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from tetlux.fem.known.fitted_patch import FittedPatch
from tetlux.fem.known.patch import Patch, patch_of
from tetlux.fem.media.coefficients import at_cells
from tetlux.fem.media.fresnel import moments
from tetlux.fem.quadratic.loads import QuadraticPatch, line_load, quadratic_load, quadratic_patch
from tetlux.fem.quadratic.operator import QuadraticOperator
from tetlux.fem.quadratic.roughness import roughness
from tetlux.fem.quadratic.sight import Seen, Sight
from tetlux.fem.sources.deposit import Deposit
from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.describe import one_line

# Charges are subtracted where they are at most this many times brighter than the fluence.
BRIGHTER = 4.0
# A beam of so many rays or more is broad.
BROAD = 16
# Layers are thin if k h is more than this: under diffuse light quadratic elements are .1 % off at 1.4, and 200 % at 9.
THIN = 2.0


@dataclass(frozen=True, eq=False)
class QuadraticLights:
    """The lights of a scene on a mesh; solved for when something is read.

    Attributes
    ----------
    operator : QuadraticOperator
    deposits : tuple of Deposit
        What each light leaves on the mesh.
    linear : tuple of tuple of Patch
        The patches of each light in linear elements.
    guesses : tuple of (n,) ndarray
        The fluence of each light in linear elements, by which patches are chosen anew.
    """

    operator: QuadraticOperator
    deposits: tuple[Deposit, ...]
    linear: tuple[tuple[Patch, ...], ...]
    guesses: tuple[FloatArray, ...]

    @cached_property
    def patches(self) -> tuple[tuple[QuadraticPatch, ...], ...]:
        """The patches of each light in quadratic elements."""
        return tuple(
            tuple(_patch(self.operator, patch, guess) for patch in own)
            for own, guess in zip(self.linear, self.guesses, strict=True)
        )

    @cached_property
    def loads(self) -> FloatArray:
        """The load of each light, (size, k), W."""
        space, coefficients = self.operator.space, self.operator.coefficients
        loads = [quadratic_load(space, coefficients, deposit.terms) for deposit in self.deposits]
        return np.column_stack(
            [load + sum(each.load for each in own) for load, own in zip(loads, self.patches, strict=True)]
        )

    @cached_property
    def broad_beams(self) -> FloatArray:
        """What the rays of broad beams put on bubbles, of each light, (size, k), W."""
        space, coefficients = self.operator.space, self.operator.coefficients
        found = np.zeros((space.size, len(self.deposits)))
        for light, deposit in enumerate(self.deposits):
            if len(deposit.terms.segments) >= BROAD:
                found[:, light], *_ = line_load(space, coefficients, deposit.terms.segments)
        found[: len(space.mesh.points)] = 0.0
        return found

    @cached_property
    def fluence(self) -> FloatArray:
        """The fluence of each light, with interpolants where it is subtracted, (size, k), W/unit²."""
        # Fitted charges are far brighter near the light than what is missing, which is all that is solved for.
        fitted = np.column_stack(
            [
                np.sum([np.zeros(self.operator.space.size), *(each.guess for each in own if each.is_fitted)], axis=0)
                for own in self.patches
            ]
        )
        return fitted + self.operator.solve(self.loads - self.operator.matrix @ fitted)

    __repr__ = one_line


def _patch(operator: QuadraticOperator, patch: Patch, fluence: FloatArray) -> QuadraticPatch:
    """A patch in quadratic elements, by the fluence (n,) of its light in linear elements.

    The residual of fitted charges is integrated anew over the bent facets: at the points that linear elements have it,
    a reading a thousandth as bright as the brightest was 4 % off.
    """
    return quadratic_patch(operator, patch if isinstance(patch, FittedPatch) else _widened(patch, fluence))


def _widened(patch: Patch, fluence: FloatArray) -> Patch:
    """The patch of tetrahedra where charges are not much brighter than the fluence (n,) in linear elements.

    Its borders, across which the fluence jumps, are then farther from the light than those of linear elements.
    """
    wide = patch_of(patch.mesh, patch.charges, patch.at_nodes <= BRIGHTER * np.abs(fluence), patch.at_nodes)
    return wide if wide.cells.sum() > patch.cells.sum() else patch


@dataclass(frozen=True, eq=False)
class QuadraticSolution:
    """Some of the lights of a scene, together.

    Attributes
    ----------
    of : QuadraticLights
    lights : tuple of int
    """

    of: QuadraticLights
    lights: tuple[int, ...]

    @property
    def operator(self) -> QuadraticOperator:
        """The operator."""
        return self.of.operator

    @cached_property
    def fluence(self) -> FloatArray:
        """Fluence (size,), W/unit²."""
        return np.asarray(self.of.fluence[:, self.lights].sum(axis=1))

    def has_thin_layers(self, sight: Sight) -> bool:
        """Whether light that is spread over the surface or the volume fades within a tetrahedron there.

        Quadratic elements then overshoot, while linear ones are fitted to such layers: see
        `tetlux.fem.operators.fitting`.
        """
        if not any(self.of.deposits[light].terms.is_distributed and not self.of.linear[light] for light in self.lights):
            return False
        cells, coefficients = self.operator.see(sight).cells, self.operator.coefficients
        diffusion, sigma_a = (at_cells(each, cells) for each in (coefficients.diffusion, coefficients.sigma_a))
        # The edge of a regular tetrahedron of this volume.
        edges = (6.0 * np.sqrt(2.0) * self.operator.mesh.volumes[cells]) ** (1.0 / 3.0)
        return bool((np.sqrt(sigma_a / diffusion) * edges > THIN).any())

    @property
    def patches(self) -> list[QuadraticPatch]:
        """Their patches."""
        return [patch for light in self.lights for patch in self.of.patches[light]]

    @cached_property
    def unresolved(self) -> FloatArray:
        """`roughness` of the fluence less what is known of it in closed form, (m, 4, 3)."""
        space = self.operator.space
        rough = roughness(space, self.fluence)
        for patch in self.patches:
            inside = np.flatnonzero(patch.patch.cells)
            rough[inside] -= roughness(space, patch.guess)[inside]
        return rough

    @property
    def broad_beams(self) -> FloatArray:
        """What the rays of broad beams put on bubbles, (size,), W."""
        return np.asarray(self.of.broad_beams[:, self.lights].sum(axis=1))

    @cached_property
    def rest(self) -> FloatArray:
        """What is left of the load, (size,), W."""
        load = self.of.loads[:, self.lights].sum(axis=1)
        return np.asarray(load - self.operator.matrix @ self.fluence)

    def read(self, sight: Sight) -> float:
        """The mean exitance, W/unit², or fluence inside."""
        seen = self.operator.see(sight)
        dual = self.operator.duals([sight])[0]
        values = seen.scale * self.at(seen)
        if not sight.inside:
            values += self._unscattered(seen)
        return float(sight.weights @ values + self.rest @ dual)

    def at(self, seen: Seen) -> FloatArray:
        """Fluence at points, (q,), W/unit²."""
        fluence, points = seen.values(self.fluence), seen.sight.points
        for patch in self.patches:
            inside = np.flatnonzero(patch.patch.cells[seen.cells])
            if len(inside):
                fluence[inside] += patch.patch.charges.fluence(points[inside]) - seen.values(patch.guess)[inside]
        return fluence

    def _unscattered(self, seen: Seen) -> FloatArray:
        """Exitance beside ``phi/(2A)`` under diffuse light, (q,), as `Solution.exitance` has it."""
        mesh = self.operator.mesh
        given = sum(self.of.deposits[light].terms.transmitted_irradiance for light in self.lights)
        if not np.any(given):
            return np.zeros(len(seen.cells))
        transmitted = np.zeros(len(mesh.points))
        transmitted[mesh.boundary_nodes] = given
        share = 1.0 - 2.0 / (1.0 + 3.0 * moments(self.operator.coefficients.outer.eta)[1])
        return np.asarray(share * (transmitted[seen.places[:, :3]] * seen.hats[:, :3]).sum(axis=1))

    __repr__ = one_line
