"""`Fluorophore`: a dye that absorbs light of one wavelength and emits part of it at another."""

from dataclasses import dataclass, replace

from tetlux.fem.inputs import check_positive
from tetlux.fem.media.coefficients import AnyMedium
from tetlux.fem.media.medium import Medium
from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.describe import one_line
from tetlux.meshing.errors import InputError

# Lifetimes of dyes are nanoseconds, of lanthanides milliseconds: a longer one is in another unit, s.
LONGEST_LIFETIME = 0.1


@dataclass(frozen=True)
class Fluorophore:
    """A dye in the whole body, or in one of its parts.

    Parameters
    ----------
    absorption : float
        Absorption coefficient of the dye at the wavelength of excitation, 1/unit, which adds to that of the medium.
    quantum_yield : float
        Share of the absorbed photons that are emitted again, above 0 and at most 1. The ledger counts photons of both
        wavelengths as equal in energy; for powers in W give the yield times the ratio of the wavelengths, excitation
        over emission.
    lifetime : float
        Mean time from absorption to emission, s. It matters for modulated light alone.
    region : int or str, optional
        The part that holds the dye: 0 is the body outside of its regions, i is the i-th region; of a mesh with labels,
        a label by its number or name. The whole body if not given.

    Raises
    ------
    InputError
        If a number is out of range; and, when solved, if there is no such part.

    Examples
    --------
    >>> dye = Fluorophore(absorption=0.005, quantum_yield=0.5, lifetime=0.56e-9, region=1)
    >>> round(abs(dye.emitted_share(6.28e8)), 4)  # modulated at 100 MHz
    0.4717
    """

    absorption: float
    quantum_yield: float
    lifetime: float = 0.0
    region: int | str | None = None

    def __post_init__(self) -> None:
        check_positive(self.absorption, "absorption", "1/unit")
        if not 0.0 < self.quantum_yield <= 1.0:
            raise InputError(
                f"quantum_yield is {self.quantum_yield:g}; give the share of absorbed photons that are emitted, above "
                "0 and at most 1.",
                field="quantum_yield",
            )
        if not 0.0 <= self.lifetime <= LONGEST_LIFETIME:
            raise InputError(
                f"lifetime is {self.lifetime:g}; give seconds, from 0 to {LONGEST_LIFETIME:g} (1e-9 is a nanosecond).",
                field="lifetime",
            )

    def emitted_share(self, omega: float = 0.0) -> complex:
        """Emitted over absorbed power, ``quantum_yield/(1 + i omega lifetime)``, of light modulated at omega, rad/s."""
        if omega == 0.0:
            return self.quantum_yield
        return self.quantum_yield / (1.0 + 1j * omega * self.lifetime)

    def stored_share(self, omega: float) -> complex:
        """Amplitude of what the excited molecules take, over that of the absorbed power."""
        return self.quantum_yield - self.emitted_share(omega)


def add_absorption(medium: AnyMedium, absorption: float) -> AnyMedium:
    """The medium with a dye in it, whose absorption coefficient is given, 1/unit."""
    if isinstance(medium, Medium):
        return replace(medium, sigma_a=medium.sigma_a + absorption)
    base = replace(medium.base, sigma_a=medium.base.sigma_a + absorption)
    field = None if medium.sigma_a is None else _Sum(medium, absorption)
    return replace(medium, base=base, sigma_a=field)


@dataclass(frozen=True, eq=False)
class _Sum:
    """The absorption of a medium that varies, with that of a dye, as a field."""

    medium: AnyMedium
    absorption: float

    def __call__(self, points: FloatArray) -> FloatArray:
        assert not isinstance(self.medium, Medium)
        return self.medium.at(points)[0] + self.absorption

    __repr__ = one_line
