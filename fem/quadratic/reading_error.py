"""`ReadingError`: a reading, and the contribution of each tetrahedron to its error."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tetlux.meshing.arrays import FloatArray, Number
from tetlux.meshing.describe import one_line

# Relative error that is always added, for what rounding, iterations and fits leave of readings that are nearly exact.
# Of 1,000 random readings (`tests.benchmarks.readings`) for 0 / 2e-6 / 5e-6 / 1e-5 / 2e-5: share within twice the bar
# .935, .944, .957, .968, .979; bar over error in the median 1.4, 1.5, 1.6, 1.75, 2.0; largest error over bar 125, 20,
# 8, 4, 3.
LEAST_RELATIVE_ERROR = 1e-5


@dataclass(frozen=True, eq=False)
class ReadingError:
    """A reading and its estimated error.

    Attributes
    ----------
    value : float or complex
        W/unit².
    squares : (m,) ndarray
        Squared moduli of the contributions of tetrahedra to its error.
    sum : float or complex
        Weighted sum of the signed contributions, W/unit².
    rays : float
        Contribution of rays in place of broad beams, W/unit².
    gaps : float or complex
        Sum of the signed contributions of the gaps between facets and true surfaces, W/unit².
    """

    value: Number
    squares: FloatArray
    sum: Number
    rays: float
    gaps: Number = 0.0

    @staticmethod
    def add(parts: "Sequence[ReadingError]") -> "ReadingError":
        """The reading of the sum of several lights."""
        return ReadingError(
            sum(part.value for part in parts),
            np.sum([part.squares for part in parts], axis=0),
            sum(part.sum for part in parts),
            sum(part.rays for part in parts),
            sum(part.gaps for part in parts),
        )

    @property
    def error(self) -> float:
        """Estimated error, W/unit²."""
        others = self.sum, self.gaps, self.rays, LEAST_RELATIVE_ERROR * self.value
        return float(np.sqrt(self.squares.sum() + sum(abs(each) ** 2 for each in others)))

    @property
    def relative(self) -> float:
        """Estimated relative error; infinite if the reading is 0."""
        return self.error / abs(self.value) if self.value else np.inf

    __repr__ = one_line
