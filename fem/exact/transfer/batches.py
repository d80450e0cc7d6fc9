"""Independent batches of random walks, whose spread gives standard errors."""

import math
import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from types import ModuleType
from typing import Literal, NamedTuple, TypedDict

import numpy as np

from tetlux.fem.media.medium import Medium
from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.errors import InputError

# The relative uncertainty of a standard error is 1/sqrt(2 BATCHES), 6 %.
BATCHES = 128

LightKind = Literal["pencil", "beam", "point"]


class SampleMean(NamedTuple):
    """A mean over samples and its standard error."""

    value: float
    standard_error: float


class LedgerFields(TypedDict):
    """The fields of a ledger, see `tetlux.fem.exact.monte_carlo.Ledger`."""

    photons: int
    specular: SampleMean
    absorbed: SampleMean
    exited: SampleMean
    ballistic: SampleMean


@dataclass(frozen=True, eq=False)
class Shares:
    """Tallies of each batch, as shares of the incident power: (batches,), and (batches, bins + 1) for both faces."""

    photons: int
    specular: FloatArray
    absorbed: FloatArray
    ballistic: FloatArray
    front: FloatArray
    back: FloatArray

    def ledger(self) -> LedgerFields:
        """The shares of the power balance, with standard errors."""
        return {
            "photons": self.photons,
            "specular": estimate(self.specular),
            "absorbed": estimate(self.absorbed),
            "exited": estimate(self.front.sum(axis=1) + self.back.sum(axis=1)),
            "ballistic": estimate(self.ballistic),
        }


@dataclass(frozen=True, eq=False)
class Batches:
    """The arguments of a run in independent batches, for `photons.trace`."""

    medium: Medium
    ball: bool
    size: float
    light: LightKind
    depth: float
    edges: FloatArray
    photons: int
    seed: int

    def run(self) -> Shares:
        """Run all batches in threads on all cores."""
        if self.photons < 1 or self.seed < 0:
            raise InputError(f"photons is {self.photons} and seed {self.seed}; give at least 1, and at least 0.")
        kernel = _kernel()
        batch = -(-self.photons // BATCHES)
        seeds = np.random.SeedSequence(self.seed).spawn(BATCHES)
        with ThreadPoolExecutor(os.cpu_count()) as pool:
            rows = np.array(list(pool.map(lambda seed: self._run_batch(kernel, batch, seed), seeds)))
        bins = self.edges.size
        return Shares(
            photons=batch * BATCHES,
            specular=rows[:, kernel.SPECULAR],
            absorbed=rows[:, kernel.ABSORBED],
            ballistic=rows[:, kernel.BALLISTIC],
            front=rows[:, kernel.FIRST_BIN : kernel.FIRST_BIN + bins],
            back=rows[:, kernel.FIRST_BIN + bins :],
        )

    def _run_batch(self, kernel: ModuleType, photons: int, seed: np.random.SeedSequence) -> FloatArray:
        scattering, g = _scattering(self.medium)
        extinction = self.medium.sigma_a + scattering
        tally: FloatArray = kernel.trace(
            np.random.Generator(np.random.PCG64(seed)),
            photons,
            self.ball,
            self.size,
            {"pencil": kernel.PENCIL, "beam": kernel.BEAM, "point": kernel.POINT}[self.light],
            self.depth,
            float(extinction),
            float(scattering / extinction),
            float(g),
            float(self.medium.eta),
            self.edges,
        )
        return tally / photons


def _kernel() -> ModuleType:
    """Import the compiled random walk, which needs numba."""
    try:
        import numba  # noqa: F401, PLC0415
    except ImportError as error:
        raise InputError('Monte Carlo needs numba; install it with: pip install "tetlux[montecarlo]"') from error
    from tetlux.fem.exact.transfer import photons  # noqa: PLC0415

    return photons


def _scattering(medium: Medium) -> tuple[float, float]:
    """sigma_s and g of a medium; sigma_s' and 0 if only sigma_s' is given."""
    if medium.phase is not None:
        raise InputError("Monte Carlo has only the Henyey-Greenstein phase function; give the medium g, not phase.")
    if medium.sigma_s is None or medium.g is None:
        return medium.reduced_scattering, 0.0
    return medium.sigma_s, medium.g


def mean_and_error(batches: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Mean over the batches and its standard error."""
    return batches.mean(axis=0), batches.std(axis=0, ddof=1) / math.sqrt(len(batches))


def estimate(batches: FloatArray) -> SampleMean:
    """Mean over the batches with its standard error."""
    mean, error = mean_and_error(batches)
    return SampleMean(float(mean), float(error))
