"""`ReadingError`: a reading, and the contribution of each tetrahedron to its error."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tetlux.meshing.arrays import FloatArray, Number
from tetlux.meshing.describe import one_line

# Relative error that is always added, for errors that gradients do not show, such as those of the surface itself. For
# 5e-4 / 2e-4 of 660 random readings .979 / .971 are within twice the bar, which is 7.3 / 3.7 times the true error in
# the median; of 250 that were not used to choose it .956 / .944.
LEAST_RELATIVE_ERROR = 5e-4


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
    """

    value: Number
    squares: FloatArray
    sum: Number
    rays: float

    @staticmethod
    def add(parts: "Sequence[ReadingError]") -> "ReadingError":
        """The reading of the sum of several lights."""
        return ReadingError(
            sum(part.value for part in parts),
            np.sum([part.squares for part in parts], axis=0),
            sum(part.sum for part in parts),
            sum(part.rays for part in parts),
        )

    @property
    def error(self) -> float:
        """Estimated error, W/unit²."""
        return float(
            np.sqrt(
                self.squares.sum() + abs(self.sum) ** 2 + self.rays**2 + (LEAST_RELATIVE_ERROR * abs(self.value)) ** 2
            )
        )

    @property
    def relative(self) -> float:
        """Estimated relative error; infinite if the reading is 0."""
        return self.error / abs(self.value) if self.value else np.inf

    __repr__ = one_line
