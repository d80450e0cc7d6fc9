"""Lights in a body of one even medium, solved by charges: what `tetlux.fem.solve` calls for ``model="charges"``."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from tetlux.fem.charges.adapt import MOST
from tetlux.fem.charges.solution import ChargeSolution, Entry, charge_solution
from tetlux.fem.lights.deposit import Deposit, Light
from tetlux.fem.medium import Medium
from tetlux.fem.solution import Power
from tetlux.fem.stopwatch import Stopwatch
from tetlux.meshing.errors import InputError
from tetlux.meshing.surface import Surface

_INSTEAD = 'solve it with model "full".'


def solve_with_charges(
    surface: Surface, medium: Medium, lights: Sequence[Light], *, tolerance: float = 0.02, most: int = MOST
) -> ChargeSolution:
    """Solve for lights in a body of one even medium, without a mesh.

    Parameters
    ----------
    surface : Surface
    medium : Medium
    lights : sequence of Light
        Points, beams that are points, and diffuse light; they add up.
    tolerance : float
        Wanted relative L2 error of the exitance.
    most : int
        Charges at which fitting ends even if the tolerance is not met; the solution then carries a warning.

    Returns
    -------
    ChargeSolution

    Raises
    ------
    InputError
        If a light does not go with the body, or is none of those.

    Examples
    --------
    >>> from tetlux.fem import Medium, PencilBeam
    >>> from tetlux.meshing import sphere
    >>> tissue = Medium(sigma_a=0.01, sigma_s_prime=1.0, eta=1.4)
    >>> solution = solve_with_charges(sphere(10.0), tissue, [PencilBeam((0, 0, 20), (0, 0, -1))])
    >>> float(solution.exitance_at([(0, 0, 10)])[0])  # doctest: +SKIP
    """
    watch = Stopwatch()
    with watch.stage("surface"):
        deposits = [light.deposit_in(surface, medium) for light in lights]
        for light, deposit in zip(lights, deposits, strict=True):
            _check(light, deposit)
    with watch.stage("solve"):
        owners = np.repeat(np.arange(len(deposits)), [len(deposit.points) for deposit in deposits])
        powers = np.zeros((len(owners), len(deposits)))
        powers[np.arange(len(owners)), owners] = np.concatenate([deposit.powers for deposit in deposits])
        points = np.vstack([deposit.points for deposit in deposits])
        entries = [_entry(deposit) for deposit in deposits]
        solution = charge_solution(surface, medium, points, powers, entries, tolerance=tolerance, most=most)
    warnings = [*surface.warnings, *(warning for deposit in deposits for warning in deposit.warnings)]
    if not solution.error_estimate <= tolerance:
        warnings.append(
            f"the tolerance of {tolerance:g} was not met: the estimated error is {solution.error_estimate:.2g} with "
            f"{len(solution.fitted.places.charges)} charges; solve it with finite elements."
        )
    return replace(solution, seconds=watch.read(), warnings=list(dict.fromkeys(warnings)))


def _entry(deposit: Deposit) -> Entry:
    known = Power(deposit.incident, deposit.specular, deposit.absorbed, 0.0, deposit.ballistic)
    return Entry(known, float(deposit.irradiance), float(deposit.transmitted_irradiance))


def _check(light: Light, deposit: Deposit) -> None:
    """Refuse a light that is no sum of points and even diffuse light."""
    name = type(light).__name__
    if len(deposit.starts) or deposit.on_mesh is not None:
        raise InputError(f'{name} leaves light along lines or by facets, and model "charges" has points; {_INSTEAD}')
    if np.any(deposit.emission):
        raise InputError(f'{name} emits light throughout, and model "charges" has points; {_INSTEAD}')
    if np.ndim(deposit.irradiance) or np.ndim(deposit.transmitted_irradiance):
        raise InputError(f'{name} is not even over the surface, as model "charges" needs it; {_INSTEAD}')
