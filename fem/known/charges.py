"""`Charges`: a sum of screened point charges, its fluence and its gradient."""

from dataclasses import dataclass

import numpy as np

from tetlux.fem.media.medium import Medium
from tetlux.fem.media.varying import VaryingMedium
from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.describe import one_line
from tetlux.meshing.host.blocks import run_in_blocks

# Pairs of a point and a charge in one block of work, few enough to stay in the processor's cache.
PAIRS = 100_000


@dataclass(frozen=True, eq=False)
class Charges:
    """Screened point charges: ``sum_i q_i e^{-k r_i}/(4 pi D r_i)``.

    Parameters
    ----------
    positions : (c, 3) ndarray
        The sources first, inside the body; then the images, outside.
    strengths : (c,) ndarray
        W.
    sources : int
        Number of sources.
    closest : float
        Least distance at which a charge is evaluated, unit.
    medium : Medium
    region : int, optional
        The region that the sources lie in, if the body has several media.
    field : VaryingMedium, optional
        The medium of that region if it varies; `medium` is what it is at the sources.
    name : str
        Of their light, by which their patch is kept with a mesh: see `tetlux.fem.known.kept_patches`.
    """

    positions: FloatArray
    strengths: FloatArray
    sources: int
    closest: float
    medium: Medium
    region: int | None = None
    field: VaryingMedium | None = None
    name: str = ""

    @property
    def has_negative_source(self) -> bool:
        """Whether a source is negative, as those of a first moment are: fluence beside it may be below zero."""
        return bool((self.strengths[: self.sources] < 0).any())

    def fluence(self, points: FloatArray) -> FloatArray:
        """Fluence at points (n, 3), (n,), W/unit²."""
        return self._at(points, None)

    def fluence_and_gradient(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Fluence (n,), W/unit², and its gradient (n, 3), W/unit³."""
        gradient = np.empty((len(points), 3))
        return self._at(points, gradient), gradient

    def _at(self, points: FloatArray, gradient: FloatArray | None) -> FloatArray:
        """The fluence; its gradient is written to `gradient` if that is given."""
        k = self.medium.sigma_tr
        origin = self.positions[0]
        charges = self.positions - origin
        strengths = self.strengths / (4.0 * np.pi * self.medium.diffusion)
        fluence = np.empty(len(points))

        def evaluate(block: slice) -> None:
            x = points[block] - origin
            # |x - p|² from |x|² + |p|² - 2 x.p would lose digits close to a charge.
            distance = np.square(x[:, :1] - charges[:, 0])
            distance += np.square(x[:, 1:2] - charges[:, 1])
            distance += np.square(x[:, 2:] - charges[:, 2])
            np.sqrt(distance, out=distance)
            np.maximum(distance, self.closest, out=distance)
            each = np.exp(-k * distance)
            each /= distance
            fluence[block] = each @ strengths
            if gradient is not None:
                each *= strengths
                each *= (k + 1.0 / distance) / distance
                gradient[block] = each @ charges - each.sum(axis=1)[:, None] * x

        run_in_blocks(evaluate, len(points), max(1, PAIRS // len(charges)))
        return fluence

    __repr__ = one_line
