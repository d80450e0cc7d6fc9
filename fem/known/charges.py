"""`Charges`: charges of one light that are subtracted on a mesh."""

from dataclasses import dataclass

from tetlux.fem.charges.field import ChargeField
from tetlux.fem.media.medium import Medium
from tetlux.fem.media.varying import VaryingMedium
from tetlux.meshing.arrays import Number
from tetlux.meshing.describe import one_line


@dataclass(frozen=True, eq=False, kw_only=True)
class Charges(ChargeField):
    """A field of charges of one light, with what a mesh has to know to subtract it.

    Parameters
    ----------
    sources : int
        Number of sources, inside the body: the first of the charges. The others are outside it.
    medium : Medium
        Whose equation they solve.
    region : int, optional
        The region that the sources lie in, if the body has several media.
    varying : VaryingMedium, optional
        The medium of that region if it varies; `medium` is what it is at the sources.
    name : str
        Of their light, by which their patch is kept with a mesh: see `tetlux.fem.known.kept_patches`.
    """

    sources: int
    medium: Medium
    region: int | None = None
    varying: VaryingMedium | None = None
    name: str = ""

    @property
    def shift(self) -> complex:
        """What their equation adds to sigma_a, 1/unit: 0 for steady light."""
        return self.equation.shift

    def divide_power(self, taken: Number) -> tuple[Number, Number]:
        """Divide power that a volume takes, W, into what is absorbed and what is stored."""
        if self.shift == 0:
            return taken, 0.0
        stored = taken * self.shift / (self.medium.sigma_a + self.shift)
        return taken - stored, stored

    @property
    def has_negative_source(self) -> bool:
        """Whether a source is negative, as those of a first moment are: fluence beside it may be below zero."""
        return bool((self.strengths[: self.sources].real < 0).any())

    __repr__ = one_line
