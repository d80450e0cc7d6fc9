"""Phase functions: the angular distribution of scattered light, and the moments of it that diffusion needs.

A phase function p gives the power scattered per solid angle, 1/sr, as a function of the cosine mu of the scattering
angle, with ``2 pi ∫-1..1 p dmu = 1``. Diffusion needs its first moment g, the mean cosine (CS667 notes, definition
1.9 iv), and the delta-Eddington approximation its second, the mean of ``(3 mu² - 1)/2``.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.describe import one_line
from tetlux.meshing.errors import InputError

# Largest difference of a table's integral over all directions from 1.
NORMALISATION = 0.02


class PhaseFunction(Protocol):
    """A phase function: its first two Legendre moments, and its value at each angle.

    Attributes
    ----------
    mean_cosine : float
        The first Legendre moment g, between -1 and 1.
    second_moment : float
        The second Legendre moment, the mean of ``(3 mu² - 1)/2``.
    """

    @property
    def mean_cosine(self) -> float: ...  # noqa: D102

    @property
    def second_moment(self) -> float: ...  # noqa: D102

    def __call__(self, cosine: npt.ArrayLike) -> FloatArray:
        """Scattered share per solid angle, 1/sr, at cosines (...) of the scattering angle."""
        ...


@dataclass(frozen=True)
class Lobes:
    """A weighted sum of Henyey-Greenstein lobes (Henyey & Greenstein 1941); the l-th Legendre moment of one is ``g^l``.

    Parameters
    ----------
    cosines : tuple of float
        Mean cosine g of each lobe.
    shares : tuple of float
        Share of each lobe in the scattered power; the shares sum to 1.
    """

    cosines: tuple[float, ...]
    shares: tuple[float, ...]

    @property
    def mean_cosine(self) -> float:
        """The first Legendre moment."""
        return sum(share * g for g, share in zip(self.cosines, self.shares, strict=True))

    @property
    def second_moment(self) -> float:
        """The second Legendre moment."""
        return sum(share * g**2 for g, share in zip(self.cosines, self.shares, strict=True))

    def __call__(self, cosine: npt.ArrayLike) -> FloatArray:
        """Scattered share per solid angle, 1/sr, at cosines (...) of the scattering angle."""
        mu = np.asarray(cosine, dtype=float)
        value = np.zeros_like(mu)
        for g, share in zip(self.cosines, self.shares, strict=True):
            value += share * (1.0 - g**2) / (4.0 * np.pi * (1.0 + g**2 - 2.0 * g * mu) ** 1.5)
        return value


@dataclass(frozen=True)
class Table:
    """A tabulated phase function, interpolated linearly in the angle; `table` makes and checks one.

    Parameters
    ----------
    angles : tuple of float
        Scattering angles, radians, ascending from 0 to pi.
    values : tuple of float
        Scattered share per solid angle at these angles, 1/sr, normalised.
    mean_cosine, second_moment : float
        The first two Legendre moments.
    """

    angles: tuple[float, ...]
    values: tuple[float, ...]
    mean_cosine: float
    second_moment: float

    def __call__(self, cosine: npt.ArrayLike) -> FloatArray:
        """Scattered share per solid angle, 1/sr, at cosines (...) of the scattering angle."""
        angle = np.arccos(np.clip(np.asarray(cosine, dtype=float), -1.0, 1.0))
        return np.asarray(np.interp(angle, self.angles, self.values))

    __repr__ = one_line


def henyey_greenstein(g: float) -> Lobes:
    """The Henyey-Greenstein phase function (Henyey & Greenstein 1941).

    Parameters
    ----------
    g : float
        Mean cosine, greater than -1 and less than 1.

    Returns
    -------
    Lobes

    Raises
    ------
    InputError
        If g is out of range.

    Examples
    --------
    >>> phase = henyey_greenstein(0.9)
    >>> phase.mean_cosine, round(phase.second_moment, 6)
    (0.9, 0.81)
    >>> phase([1.0, -1.0]).round(6).tolist()
    [15.11972, 0.002204]
    """
    _check_cosine("g", g)
    return Lobes((g,), (1.0,))


def two_term(g1: float, g2: float, share: float) -> Lobes:
    """A sum of two Henyey-Greenstein lobes, commonly one forward and one backward.

    Parameters
    ----------
    g1, g2 : float
        Mean cosines of the lobes, greater than -1 and less than 1.
    share : float
        Share of the first lobe in the scattered power, from 0 to 1.

    Returns
    -------
    Lobes

    Raises
    ------
    InputError
        If an argument is out of range.

    Examples
    --------
    >>> from tetlux.fem import Medium
    >>> lobes = two_term(0.9, -0.2, share=0.95)
    >>> round(lobes.mean_cosine, 3)
    0.845
    >>> tissue = Medium(sigma_a=0.01, sigma_s=10.0, phase=lobes, eta=1.4)
    """
    _check_cosine("g1", g1)
    _check_cosine("g2", g2)
    if not 0 <= share <= 1:
        raise InputError(f"share is {share:g}; give the share of the first lobe, from 0 to 1.")
    return Lobes((g1, g2), (share, 1.0 - share))


def table(angles: npt.ArrayLike, values: npt.ArrayLike) -> Table:
    """Make a phase function from a table, interpolated linearly in the angle.

    The values are divided by their integral over all directions, which may differ from 1 by up to 2 % because of
    rounding and linear interpolation.

    Parameters
    ----------
    angles : (k,) array_like
        Scattering angles in degrees, ascending from 0 to 180.
    values : (k,) array_like
        Scattered share per solid angle at these angles, 1/sr.

    Returns
    -------
    Table

    Raises
    ------
    InputError
        If the angles do not ascend from 0 to 180, a value is negative or not finite, or the integral over all
        directions, ``2 pi ∫ p sin(theta) dtheta``, is off 1 by more than 2 %.

    Examples
    --------
    >>> from math import pi
    >>> isotropic = table([0, 90, 180], [1 / (4 * pi)] * 3)
    """
    theta, p = np.asarray(angles, dtype=float), np.asarray(values, dtype=float)
    if theta.ndim != 1 or theta.shape != p.shape or len(theta) < 2:
        raise InputError(
            f"a phase function's table needs as many values as angles, at least two: it has {p.size} and {theta.size}."
        )
    if not (np.diff(theta) > 0).all() or theta[0] != 0 or theta[-1] != 180:
        raise InputError("the angles of a phase function's table must ascend from 0 to 180 degrees.")
    if not (np.isfinite(p) & (p >= 0)).all():
        row = int(np.argmin(np.isfinite(p) & (p >= 0)))
        raise InputError(f"the phase function is {p[row]:g} at {theta[row]:g} degrees; give numbers of 0 or more.")
    theta = np.radians(theta)
    # The integrands are linear functions times sines and cosines: 16 points integrate them to rounding.
    x, w = np.polynomial.legendre.leggauss(16)
    half = 0.5 * np.diff(theta)[:, None]
    angle = (theta[:-1, None] + half * (1.0 + x)).ravel()
    weight = 2.0 * np.pi * (half * w).ravel() * np.sin(angle) * np.interp(angle, theta, p)
    total = float(weight.sum())
    if abs(total - 1.0) > NORMALISATION:
        raise InputError(
            f"the phase function integrates to {total:.4g} over all directions, not to 1; multiply its values by "
            f"{1.0 / total:.4g}, or give more rows where it is steep."
            if total > 0
            else "the phase function is 0 at all angles; give values in 1/sr."
        )
    mu = np.cos(angle)
    return Table(
        tuple(theta.tolist()),
        tuple((p / total).tolist()),
        float(weight @ mu) / total,
        float(weight @ (1.5 * mu**2 - 0.5)) / total,
    )


def _check_cosine(name: str, g: float) -> None:
    if not -1 < g < 1:
        raise InputError(f"{name} is {g:g}; a mean cosine is greater than -1 and less than 1.")
