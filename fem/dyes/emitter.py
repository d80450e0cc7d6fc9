"""`DyeEmitter`: dyes that the solution of one scene excites, and that light another one."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tetlux.fem.dyes.direct import DirectLight
from tetlux.fem.dyes.glow import Excitation, Glow
from tetlux.fem.dyes.placed import Dyes, power_of
from tetlux.fem.error.estimate import weigh_residual
from tetlux.fem.known.split import SplitLights
from tetlux.fem.operators.assembly import Lumping
from tetlux.fem.outcome.power import DyePower
from tetlux.fem.outcome.solution import Solution
from tetlux.fem.sources.deposit import Deposit
from tetlux.fem.sources.ledger import Ledger
from tetlux.fem.sources.terms import SourceTerms
from tetlux.fem.system import MeshSolution, System
from tetlux.meshing.arrays import sum_by_index
from tetlux.meshing.describe import one_line


@dataclass(frozen=True, eq=False)
class DyeEmitter:
    """Dyes that are lit in one scene: a `tetlux.fem.adapt.Emitter`.

    Attributes
    ----------
    dyes : Dyes
    lit_in : int
        The number of that scene.
    frequency : float
        Hz.
    mass : {"lumped", "consistent"}
    deposits : tuple of Deposit
        Of the lights of that scene.
    """

    dyes: Dyes
    lit_in: int
    frequency: float
    mass: Lumping
    deposits: tuple[Deposit, ...]

    def lights_on(self, lit: MeshSolution, system: System) -> SplitLights:
        """What the dyes emit by each light that excites them."""
        mesh, coefficients = lit.solution.mesh, system.coefficients
        weights = self.dyes.weights(mesh, 2.0 * math.pi * self.frequency)
        direct = tuple(
            DirectLight(mesh, coefficients, deposit.evaluate_on(mesh, system.true_surface, coefficients))
            for deposit in self.deposits
        )
        excitation = Excitation(lit.solution, coefficients, self.mass, weights, direct)
        return split_glows(
            [
                Deposit(Ledger(incident=glow.at_nodes.sum().item()), SourceTerms(volume_sources=(glow,)))
                for glow in excitation.glows
            ]
        )

    def add_error(self, found: MeshSolution, lit: MeshSolution, system: System) -> MeshSolution:
        """Add the error of the excitation to the estimate of what is emitted.

        With z a dual solution of the emission, that of the excitation has the load ``∫ w z v``, w the emitted power
        over the fluence.
        """
        mesh, estimate = lit.solution.mesh, found.estimate
        weights = self.dyes.weights(mesh, 2.0 * math.pi * self.frequency) * mesh.volumes
        shares = np.repeat(0.25 * weights[:, None], 4, axis=1)
        at_nodes = sum_by_index(mesh.tetrahedra, shares, len(mesh.points))
        duals = system.plain.solver.solve_to_low_accuracy(at_nodes[:, None] * estimate.duals).x
        inner = [region.surface for region in system.regions]
        of_exitance, of_power = weigh_residual(lit.solution, system.coefficients, duals, inner=inner)
        total = replace(
            estimate,
            exitance_indicators=estimate.exitance_indicators + of_exitance,
            power_indicators=estimate.power_indicators + of_power,
        )
        return replace(found, solution=replace(found.solution, error_estimate=total.error), estimate=total)

    def add_ledger(self, emitted: Solution) -> Solution:
        """The solution of what is emitted with the ledgers of the dyes, of each light too."""
        assert emitted.quadratic is not None
        glows = [source for source in emitted.quadratic.volume_sources if isinstance(source, Glow)]
        of_lights = [
            tuple(
                power_of(dye.fluorophore, glow.integrate(dye.cells(emitted.mesh)), self.frequency)
                for dye in self.dyes.placed
            )
            for glow in glows
        ]
        parts = zip(emitted.of_lights, of_lights, strict=False)
        return replace(
            emitted,
            dyes=tuple(_sum(of_dye) for of_dye in zip(*of_lights, strict=True)),
            of_lights=tuple(replace(part, dyes=dyes) for part, dyes in parts),
        )

    __repr__ = one_line


def split_glows(deposits: Sequence[Deposit]) -> SplitLights:
    """Lights of which nothing is subtracted."""
    return SplitLights(tuple(deposits), (), (), {}, tuple(deposits))


def _sum(parts: Sequence[DyePower]) -> DyePower:
    return DyePower(
        sum(part.absorbed for part in parts),
        sum(part.lost for part in parts),
        sum(part.emitted for part in parts),
        sum(part.stored for part in parts),
    )
