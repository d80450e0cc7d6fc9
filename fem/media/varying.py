"""Media whose absorption and scattering vary in space."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from tetlux.fem.media.medium import Medium
from tetlux.meshing.arrays import BoolArray, FloatArray
from tetlux.meshing.describe import as_text, one_line
from tetlux.meshing.errors import InputError

# A function from points (n, 3) to values (n,) of a coefficient, 1/unit; it raises InputError where it has no value.
Field = Callable[[FloatArray], FloatArray]


@dataclass(frozen=True, kw_only=True)
class VaryingMedium:
    """A medium whose coefficients vary in space.

    Parameters
    ----------
    base : Medium
        Its refractive index, boundary and phase function hold everywhere, and so does the coefficient for which no
        field is given.
    sigma_a, sigma_s_prime : Field, optional
        Absorption and reduced scattering coefficients, 1/unit, as functions from points (n, 3) to values (n,), such as
        `grid_field` and `mesh_field` make.

    Raises
    ------
    InputError
        If a field is not a function.

    Examples
    --------
    >>> base = Medium(sigma_a=0.01, sigma_s_prime=1.0, eta=1.4)
    >>> medium = VaryingMedium(base=base, sigma_a=lambda points: 0.01 + 0.001 * points[:, 2])
    >>> sigma_a, sigma_s_prime = medium.at(np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 10.0]]))
    >>> sigma_a.tolist(), sigma_s_prime.tolist()
    ([0.01, 0.02], [1.0, 1.0])
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
        """Evaluate the coefficients.

        Parameters
        ----------
        points : (n, 3) ndarray
            Unit.

        Returns
        -------
        sigma_a, sigma_s_prime : (n,) ndarray
            1/unit.

        Raises
        ------
        InputError
            If a field does not return one number for each point, a coefficient is negative or not finite somewhere, or
            sigma_s' is 0 somewhere: light does not diffuse where it is not scattered.
        """
        sigma_a = _evaluate("sigma_a", self.sigma_a, self.base.sigma_a, points)
        sigma_s_prime = _evaluate("sigma_s_prime", self.sigma_s_prime, self.base.reduced_scattering, points)
        _refuse_where("sigma_a", sigma_a, ~(sigma_a >= 0), "a coefficient cannot be negative", points)
        reason = "light does not diffuse where it is not scattered; give a coefficient greater than 0"
        _refuse_where("sigma_s_prime", sigma_s_prime, ~(sigma_s_prime > 0), reason, points)
        return sigma_a, sigma_s_prime

    def delta_eddington(self, sigma_s_prime: FloatArray) -> tuple[FloatArray, float]:
        """Scattering coefficients and mean cosine without the forward peak, see `Medium.delta_eddington`.

        Parameters
        ----------
        sigma_s_prime : (n,) ndarray
            As `at` returns them, 1/unit.

        Returns
        -------
        sigma_s_star : (n,) ndarray
            1/unit.
        g_star : float
            The mean cosine of `base`, which holds everywhere.
        """
        _, cosine = self.base.delta_eddington
        # sigma_s* (1 - g*) = sigma_s' for every share of the peak.
        return sigma_s_prime / (1.0 - cosine), cosine

    __repr__ = one_line


def _evaluate(name: str, field: Field | None, constant: float, points: FloatArray) -> FloatArray:
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
    _refuse_where(name, values, ~np.isfinite(values), "a coefficient must be a finite number", points)
    return values


def _refuse_where(name: str, values: FloatArray, bad: BoolArray, reason: str, points: FloatArray) -> None:
    if bad.any():
        first = int(np.argmax(bad))
        raise InputError(f"{name} is {values[first]:g} at {as_text(points[first])}; {reason}.", field=name)
