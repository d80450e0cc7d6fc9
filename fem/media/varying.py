"""Media whose absorption and scattering vary from place to place."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from tetlux.fem.media.medium import Medium
from tetlux.meshing.arrays import BoolArray, FloatArray
from tetlux.meshing.describe import as_text, one_line
from tetlux.meshing.errors import InputError

# Values (n,) of a coefficient, 1/unit, at points (n, 3); raises InputError where it is not known.
Field = Callable[[FloatArray], FloatArray]


@dataclass(frozen=True, kw_only=True)
class VaryingMedium:
    """A medium with coefficients that depend on the place.

    Parameters
    ----------
    base : Medium
        Gives the refractive index, the boundary, the shape of scattering, and the coefficient that does not vary.
    sigma_a, sigma_s_prime : Field, optional
        Absorption and reduced scattering coefficients, 1/unit. The shape of scattering stays that of `base`.

    Raises
    ------
    InputError
        If a field is no function.
    """

    base: Medium
    sigma_a: Field | None = None
    sigma_s_prime: Field | None = None

    def __post_init__(self) -> None:
        for name in ("sigma_a", "sigma_s_prime"):
            field = getattr(self, name)
            if field is not None and not callable(field):
                raise InputError(
                    f"{name} is {field!r}; give a function of points, and what is constant to the base.", field=name
                )

    def at(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Coefficients at given points.

        Parameters
        ----------
        points : (n, 3) ndarray

        Returns
        -------
        sigma_a, sigma_s_prime : (n,) ndarray
            1/unit.

        Raises
        ------
        InputError
            If a field does not give one number for each point, or somewhere a coefficient is not finite or negative,
            or does not scatter: light does not diffuse through a void.
        """
        sigma_a = _values("sigma_a", self.sigma_a, self.base.sigma_a, points)
        sigma_s_prime = _values("sigma_s_prime", self.sigma_s_prime, self.base.reduced_scattering, points)
        _refuse("sigma_a", sigma_a, ~(sigma_a >= 0), "a coefficient cannot be negative", points)
        scatters = "light does not diffuse where it is not scattered; give a coefficient greater than 0"
        _refuse("sigma_s_prime", sigma_s_prime, ~(sigma_s_prime > 0), scatters, points)
        return sigma_a, sigma_s_prime

    def delta_eddington(self, sigma_s_prime: FloatArray) -> tuple[FloatArray, float]:
        """Scattering coefficients and mean cosine with the forward peak taken out, see `Medium.delta_eddington`.

        Parameters
        ----------
        sigma_s_prime : (n,) ndarray
            As `at` gives them.

        Returns
        -------
        sigma_s_star : (n,) ndarray
            1/unit.
        g_star : float
            The same everywhere, that of `base`.
        """
        _, cosine = self.base.delta_eddington
        # sigma_s* (1 - g*) = sigma_s', whatever the peak.
        return sigma_s_prime / (1.0 - cosine), cosine

    __repr__ = one_line


def _values(name: str, field: Field | None, constant: float, points: FloatArray) -> FloatArray:
    if field is None:
        return np.full(len(points), constant)
    try:
        values = np.asarray(field(points), dtype=np.float64)
    except InputError as error:
        raise InputError(f"{name} is not known everywhere: {error}", field=name) from error
    except (TypeError, ValueError) as error:
        raise InputError(f"{name} gives no numbers at points (n, 3): {error}.", field=name) from error
    if values.shape != (len(points),):
        raise InputError(
            f"{name} gives an array of shape {values.shape} for {len(points)} points; it must give one number "
            "for each.",
            field=name,
        )
    _refuse(name, values, ~np.isfinite(values), "a coefficient must be a finite number", points)
    return values


def _refuse(name: str, values: FloatArray, bad: BoolArray, reason: str, points: FloatArray) -> None:
    if bad.any():
        first = int(np.argmax(bad))
        raise InputError(f"{name} is {values[first]:g} at {as_text(points[first])}; {reason}.", field=name)
