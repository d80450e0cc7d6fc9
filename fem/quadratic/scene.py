"""`QuadraticScene`: the lights of a scene on a mesh, solved for by quadratic elements."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from tetlux.fem.known.charges import Charges
from tetlux.fem.known.fitted_patch import FittedPatch
from tetlux.fem.known.kept_patches import keep_or_choose
from tetlux.fem.known.patch import Patch, patch_of
from tetlux.fem.quadratic.loads import LineLoad, line_load, quadratic_load
from tetlux.fem.quadratic.operator import STOP_RESIDUAL, QuadraticOperator
from tetlux.fem.quadratic.patch_faces import InnerFaces, inner_faces
from tetlux.fem.quadratic.patches import QuadraticPatch, quadratic_patch
from tetlux.fem.sources.deposit import Deposit
from tetlux.meshing.arrays import FloatArray, NumberArray
from tetlux.meshing.describe import one_line
from tetlux.meshing.host.blocks import map_in_threads

# Charges are subtracted where their fluence is at most this many times the fluence itself.
LARGEST_BRIGHTNESS_RATIO = 4.0
# A beam of at least this many rays is broad.
LEAST_RAYS_OF_BROAD_BEAM = 16


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
    steady : QuadraticScene, optional
        That of the same lights without the shift: see `shifted`.
    charges : tuple of tuple of Charges
        With the shift, in the order of the steady scene's patches.
    known : tuple of (size, k) ndarray
        What was solved for with similar shifts, to begin with.
    stop_residual : float
        Relative residual at which the iteration stops.
    """

    operator: QuadraticOperator
    deposits: tuple[Deposit, ...]
    linear_patches: tuple[tuple[Patch, ...], ...]
    linear_fluences: tuple[NumberArray, ...]
    steady: "QuadraticScene | None" = None
    charges: tuple[tuple[Charges, ...], ...] = ()
    known: tuple[NumberArray, ...] = ()
    stop_residual: float = STOP_RESIDUAL

    def shifted(
        self,
        shift: complex,
        charges: tuple[tuple[Charges, ...], ...],
        known: tuple[NumberArray, ...],
        stop_residual: float,
    ) -> "QuadraticScene":
        """The scene with a shift, on the patches of this steady one, of which each light's charges are given."""
        operator = self.operator.shifted(shift)
        return replace(self, operator=operator, steady=self, charges=charges, known=known, stop_residual=stop_residual)

    @cached_property
    def patches(self) -> tuple[tuple[QuadraticPatch, ...], ...]:
        """The patches of each light in quadratic elements."""
        every = [patch for own in self._chosen for patch in own]
        # What threads share is made before.
        operator, inner, _ = self.operator, self.inner_faces, self.operator.matrix
        made = iter(map_in_threads(lambda patch: quadratic_patch(operator, patch, inner), every))
        return tuple(tuple(next(made) for _ in own) for own in self._chosen)

    @cached_property
    def inner_faces(self) -> InnerFaces:
        """The faces at which patches end inside the body."""
        if self.steady is not None:
            return self.steady.inner_faces
        return inner_faces(self.operator.space, [patch for own in self._chosen for patch in own])

    @cached_property
    def _chosen(self) -> tuple[tuple[Patch, ...], ...]:
        """The patches of each light."""
        if self.steady is not None:
            return tuple(
                tuple(patch.with_charges(each) for patch, each in zip(own, charges, strict=True))
                for own, charges in zip(self.steady._chosen, self.charges, strict=True)
            )
        return tuple(
            tuple(_choose(patch, fluence) for patch in own)
            for own, fluence in zip(self.linear_patches, self.linear_fluences, strict=True)
        )

    @cached_property
    def loads(self) -> NumberArray:
        """The load of each light, (size, k), W."""
        of_patches = [sum(each.load for each in own) for own in self.patches]
        return np.column_stack([load + more for load, more in zip(self.deposit_loads, of_patches, strict=True)])

    @cached_property
    def deposit_loads(self) -> list[NumberArray]:
        """The load of what each light leaves on the mesh, (size,), W."""
        if self.steady is not None:
            return self.steady.deposit_loads
        space, coefficients = self.operator.space, self.operator.coefficients
        return [
            quadratic_load(space, coefficients, deposit.terms, lines)
            for deposit, lines in zip(self.deposits, self.lines, strict=True)
        ]

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
    def solved(self) -> NumberArray:
        """What is solved for of each light, (size, k), W/unit².

        That is the fluence with the interpolants of its patches, and of patches that are the whole body the fluence
        less that of their charges.
        """
        if not any(each.is_fitted and not each.is_whole for own in self.patches for each in own):
            return self.operator.solve_near(self.loads, self.known, self.stop_residual)
        # The remainder is far smaller near the light than the fitted charges.
        fitted = self._interpolants(lambda each: each.is_fitted and not each.is_whole)
        loads = self.loads - self.operator.matrix @ fitted
        return fitted + self.operator.solve_near(loads, self.known, self.stop_residual)

    @cached_property
    def fluence(self) -> NumberArray:
        """The fluence of each light, with the interpolants of its patches, (size, k), W/unit²."""
        if not any(each.is_whole for own in self.patches for each in own):
            return self.solved
        return self.solved + self._interpolants(lambda each: each.is_whole)

    def _interpolants(self, which: Callable[[QuadraticPatch], bool]) -> NumberArray:
        """The sum of the interpolants of some patches of each light, (size, k)."""
        nothing = np.zeros(self.operator.space.size)
        return np.column_stack(
            [np.sum([nothing, *(each.interpolant for each in own if which(each))], axis=0) for own in self.patches]
        )

    __repr__ = one_line


def _choose(patch: Patch, fluence: NumberArray) -> Patch:
    """A patch for quadratic elements, by the fluence (n,) of its light in linear elements.

    The residual of fitted charges is integrated over the bent facets. With the quadrature points of linear elements, a
    reading of a thousandth of the largest had an error of 4 %.
    """
    if isinstance(patch, FittedPatch):
        return patch
    return keep_or_choose(patch.mesh, patch.charges, patch.at_nodes, "quadratic", lambda: _widen(patch, fluence))


def _widen(patch: Patch, fluence: NumberArray) -> Patch:
    """The patch of tetrahedra where charges are not much brighter than the fluence (n,) in linear elements.

    Its faces, across which the fluence jumps, are then farther from the light than those of the linear patch.
    """
    wide = patch_of(
        patch.mesh, patch.charges, np.abs(patch.at_nodes) <= LARGEST_BRIGHTNESS_RATIO * np.abs(fluence), patch.at_nodes
    )
    return wide if wide.cells.sum() > patch.cells.sum() else patch
