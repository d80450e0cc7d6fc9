"""A homogeneous scattering medium: its coefficients, and the parameters of diffusion that follow from them."""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Literal, get_args

from tetlux.fem.media.fresnel import boundary_factor_classic, boundary_factor_exact
from tetlux.fem.media.phase import PhaseFunction
from tetlux.meshing.describe import one_line
from tetlux.meshing.errors import InputError
from tetlux.meshing.html import html_table

BoundaryKind = Literal["exact", "classic"]


@dataclass(frozen=True, kw_only=True)
class Medium:
    """A homogeneous scattering medium.

    Scattering is given either as `sigma_s_prime`, or as `sigma_s` together with `g` or `phase`.

    Parameters
    ----------
    sigma_a : float
        Absorption coefficient, 1/unit.
    eta : float
        Refractive index relative to the outside.
    sigma_s_prime : float, optional
        Reduced scattering coefficient ``(1 - g) sigma_s``, 1/unit.
    sigma_s : float, optional
        Scattering coefficient, 1/unit.
    g : float, optional
        Mean cosine of the scattering angle (CS667 notes, definition 1.9 iv), between -1 and 1.
    phase : PhaseFunction, optional
        The phase function, see `tetlux.fem.media.phase`; Henyey-Greenstein's if only g is given.
    boundary : {"exact", "classic"}
        How the boundary factor A is computed: from the angular moments of Fresnel's reflectance, or by the fit of the
        published dipole.

    Raises
    ------
    InputError
        If a coefficient is negative, not finite, missing or given twice.

    Examples
    --------
    >>> medium = Medium(sigma_a=0.01, sigma_s=10.0, g=0.9, eta=1.4)
    >>> round(medium.reduced_scattering, 6), round(medium.mean_free_path, 6), round(medium.albedo, 6)
    (1.0, 0.990099, 0.990099)
    >>> round(medium.sigma_tr, 6), round(medium.extrapolation_length, 4)
    (0.174069, 1.9462)
    """

    sigma_a: float
    eta: float
    sigma_s_prime: float | None = None
    sigma_s: float | None = None
    g: float | None = None
    phase: PhaseFunction | None = None
    boundary: BoundaryKind = "exact"

    def __post_init__(self) -> None:
        for name in ("sigma_a", "eta", "sigma_s_prime", "sigma_s", "g"):
            value = getattr(self, name)
            if value is not None and not math.isfinite(value):
                raise InputError(f"{name} is {value}; give a finite number.", field=name)
        for name in ("sigma_a", "sigma_s_prime", "sigma_s"):
            value = getattr(self, name)
            if value is not None and value < 0:
                raise InputError(f"{name} is {value:g}; a coefficient cannot be negative.", field=name)
        if not 0.1 <= self.eta <= 10:
            raise InputError(f"eta is {self.eta:g}; give a refractive index between 0.1 and 10.", field="eta")
        if self.boundary not in get_args(BoundaryKind):
            kinds = " or ".join(f'"{kind}"' for kind in get_args(BoundaryKind))
            raise InputError(f'boundary is "{self.boundary}"; it is {kinds}.', field="boundary")
        self._check_scattering()
        if self.sigma_t_prime <= 0:
            raise InputError("the medium neither scatters nor absorbs; give a coefficient greater than 0.")
        if self.boundary == "classic":
            boundary_factor_classic(self.eta)

    def _check_scattering(self) -> None:
        given = [name for name in ("sigma_s", "g", "phase") if getattr(self, name) is not None]
        if self.sigma_s_prime is not None:
            if given:
                raise InputError(
                    f"{given[0]} is given together with sigma_s_prime; "
                    "give either sigma_s_prime, or sigma_s and g or a phase function.",
                    field=given[0],
                )
            return
        if self.sigma_s is None:
            raise InputError("scattering is missing; give either sigma_s_prime, or sigma_s and g or a phase function.")
        if len(given) == 1:
            raise InputError(
                "g is missing; sigma_s needs it (0 for isotropic scattering), or a phase function.", field="g"
            )
        if len(given) == 3:
            raise InputError(
                "g is given together with phase, which has a mean cosine of its own; give one of them.", field="g"
            )
        if not -1 < self.mean_cosine < 1:
            field, whose = ("g", "") if self.phase is None else ("phase", " has a mean cosine that")
            cosine = f"{self.mean_cosine:g}; it must be greater than -1 and less than 1."
            raise InputError(f"{field}{whose} is {cosine}", field=field)

    @cached_property
    def mean_cosine(self) -> float:
        """Mean cosine of the scattering angle; 0 if only sigma_s' is given, which is taken for isotropic scattering."""
        if self.phase is not None:
            return self.phase.mean_cosine
        return 0.0 if self.g is None else self.g

    @cached_property
    def reduced_scattering(self) -> float:
        """sigma_s' = (1 - g) sigma_s, 1/unit."""
        if self.sigma_s_prime is not None:
            return self.sigma_s_prime
        assert self.sigma_s is not None
        return (1.0 - self.mean_cosine) * self.sigma_s

    @property
    def sigma_t_prime(self) -> float:
        """sigma_t' = sigma_a + sigma_s', the reduced extinction coefficient (CS667 notes, eq. 8), 1/unit."""
        return self.sigma_a + self.reduced_scattering

    @property
    def mean_free_path(self) -> float:
        """Transport mean free path 1/sigma_t', unit."""
        return 1.0 / self.sigma_t_prime

    @property
    def albedo(self) -> float:
        """Reduced albedo alpha' = sigma_s'/sigma_t'."""
        return self.reduced_scattering / self.sigma_t_prime

    @property
    def diffusion(self) -> float:
        """Diffusion coefficient D = 1/(3 sigma_t') (CS667 notes, eq. 9), unit."""
        return 1.0 / (3.0 * self.sigma_t_prime)

    @property
    def sigma_tr(self) -> float:
        """Effective attenuation coefficient sqrt(sigma_a/D), 1/unit."""
        return math.sqrt(self.sigma_a / self.diffusion)

    @cached_property
    def boundary_factor(self) -> float:
        """Boundary factor A of ``E.n = phi/(2A)``."""
        if self.boundary == "classic":
            return boundary_factor_classic(self.eta)
        return boundary_factor_exact(self.eta)

    @property
    def extrapolation_length(self) -> float:
        """Extrapolation length zb = 2 A D: the fluence extrapolates to zero at this distance outside, unit."""
        return 2.0 * self.boundary_factor * self.diffusion

    @property
    def delta_eddington(self) -> tuple[float, float]:
        """Scattering coefficient, 1/unit, and mean cosine without the forward peak (Joseph 1976).

        ``sigma_s* = sigma_s (1 - f)`` and ``g* = (g - f)/(1 - f)``, which preserve sigma_s'. The share f of the forward
        peak is the second Legendre moment of the phase function: ``g²`` for Henyey-Greenstein's, so that
        ``g* = g/(1 + g)``. It is limited to 0 <= f <= max(g, 0), so that g* is negative only if g is: a second moment
        above g, as of two lobes, is partly due to backward scattering. If only sigma_s' is given, scattering is taken
        for isotropic: ``sigma_s* = sigma_s'`` and ``g* = 0``.
        """
        if self.sigma_s is None:
            return self.reduced_scattering, 0.0
        g = self.mean_cosine
        second = g**2 if self.phase is None else self.phase.second_moment
        peak = min(max(second, 0.0), max(g, 0.0))
        return self.sigma_s * (1.0 - peak), (g - peak) / (1.0 - peak)

    __repr__ = one_line

    def _repr_html_(self) -> str:
        rows = [
            ("absorption sigma_a", f"{self.sigma_a:.4g} /unit"),
            ("reduced scattering sigma_s'", f"{self.reduced_scattering:.4g} /unit"),
            ("refractive index eta", f"{self.eta:.4g}"),
            ("transport mean free path", f"{self.mean_free_path:.4g} unit"),
            ("reduced albedo", f"{self.albedo:.4g}"),
            ("effective attenuation sigma_tr", f"{self.sigma_tr:.4g} /unit"),
        ]
        return html_table("Medium", rows)
