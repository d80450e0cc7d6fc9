"""Charges fitted to a body and its light: as many as the tolerance needs, where the residual is large."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from tetlux.fem.charges.check import Quality, quality_of
from tetlux.fem.charges.field import ChargeField
from tetlux.fem.charges.fit import Factors, factorise
from tetlux.fem.charges.kernel import Equation, NumberArray
from tetlux.fem.charges.places import FINER, HIGH, LOW, Places, distance_from, places_for
from tetlux.fem.charges.samples import Samples, Spacing
from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.surface.surface import Surface

# The first fit, and how many times more charges the next one has. Estimate in % by 300 charges after 100, and after 100
# and 170, which takes .08 s longer: hare .47 / .42, its ear 1.6 / .94, spot 1.8 / 1.5.
FIRST, GROWTH = 100, 1.73
# Where it ends: as many are fitted in some 5 s.
MOST = 1600
# Charges are higher where an earlier fit was this good, which shows that the body is smooth. Estimate in % by 300
# charges 2 / 3 spacings high: ball .024 / .017, box .045 / .012, cylinder .031 / .014, torus .037 / .050, hare .43 /
# .46, rocker-arm .63 / .93.
SMOOTH = 0.003
# The spacing shrinks as this power of the residual, averaged over so many points, as far as that is this factor from
# its mean or more, which is noise otherwise. Error in % by 300 charges on ball, torus, hare, spot for several of these:
# power 0: .004, .16, .81, 2.6; .4 from 1 on: .017, .037, .46, 1.6; .5 from 2 on: .005, .043, .50, 1.8.
POWER, ALIKE, NOISE = 0.5, 12, 2.0
# New points take the mean of so many old ones.
AROUND = 6
# Beside finite elements: charges are enough when the estimate of theirs alone is this share of the tolerance, or at so
# many, which take .2 s. The next fit has as many as it takes if the estimate falls with this power of their number, but
# no less and no more than these factors. If they leave more than the last number, they are no help.
ENOUGH, MOST_BESIDE, RATE, LEAST_GROWTH, MOST_GROWTH, HOPELESS = 0.6, 600, 2.0, 1.4, 2.2, 0.2


@dataclass(frozen=True, eq=False)
class Drive:
    """What light there is, in one column for each of s lights.

    Attributes
    ----------
    points : (p, 3) ndarray
        Sources inside the body.
    powers : (p, s) ndarray
        W.
    inflow : (s,) ndarray
        What the residual has to be on the whole surface, W/unit²: 0 but for diffuse light.
    """

    points: FloatArray
    powers: NumberArray
    inflow: NumberArray


@dataclass(frozen=True, eq=False)
class FittedCharges:
    """Charges outside a body, fitted to its lights.

    Attributes
    ----------
    field : ChargeField
        Of the sources, which come first, and of the fitted charges; a column of strengths for each light.
    drive : Drive
    places : Places
    factors : Factors
        Of the weighted equations; for other lights at the same places.
    quality : Quality
        Of the sum of all lights.
    residual : (n,) ndarray
        Of the sum of all lights at the points that were checked, W/unit².
    """

    field: ChargeField
    drive: Drive
    places: Places
    factors: Factors
    quality: Quality
    residual: NumberArray


def fit_charges(
    surface: Surface, equation: Equation, drive: Drive, *, tolerance: float, most: int = MOST
) -> FittedCharges:
    """Fit charges until the estimated error of the exitance is within the tolerance, or there are enough.

    Parameters
    ----------
    surface : Surface
    equation : Equation
    drive : Drive
    tolerance : float
        Relative L2 error of the exitance.
    most : int
        Charges at which it ends in any case, about.
    """
    best = None
    for fitted in levels(surface, equation, drive, most=most):
        if best is None or fitted.quality.estimate < best.quality.estimate:
            best = fitted
        if best.quality.estimate <= tolerance:
            break
    assert best is not None
    return best


def levels(surface: Surface, equation: Equation, drive: Drive, *, most: int = MOST) -> Iterator[FittedCharges]:
    """Fit ever more charges, about `most` of them at last."""
    spacing = distance = distance_from(surface, drive.points)
    # Steps of equal factors, so that the last is a whole one.
    steps = max(0, round(np.log(most / FIRST) / np.log(GROWTH)))
    height = LOW
    for step in range(steps + 1):
        count = round(most * (FIRST / most) ** ((steps - step) / max(steps, 1)))
        places = places_for(surface, spacing, distance, count, height)
        fitted = fit_at(places, equation, drive)
        yield fitted
        height = HIGH if fitted.quality.estimate <= SMOOTH else LOW
        spacing = _finer(places.checked, np.abs(fitted.residual) * places.checked.spacing)


def fit_within(surface: Surface, equation: Equation, drive: Drive, *, tolerance: float) -> FittedCharges | None:
    """Fit as many charges as pay where finite elements solve for what they leave.

    Parameters
    ----------
    surface : Surface
    equation : Equation
    drive : Drive
    tolerance : float
        Relative L2 error of the exitance, of both together.

    Returns
    -------
    FittedCharges or None
        None if they leave so much that it would be better to start from something else.
    """
    spacing = distance = distance_from(surface, drive.points)
    best, count, height = None, FIRST, LOW
    while True:
        fitted = fit_at(places_for(surface, spacing, distance, count, height), equation, drive)
        estimate = fitted.quality.estimate
        if best is None or estimate < best.quality.estimate:
            best = fitted
        short = best.quality.estimate / (ENOUGH * tolerance)
        if short <= 1.0 or LEAST_GROWTH * count > MOST_BESIDE:
            return best if best.quality.estimate <= HOPELESS else None
        count = min(round(count * np.clip(short ** (1.0 / RATE), LEAST_GROWTH, MOST_GROWTH)), MOST_BESIDE)
        height = HIGH if estimate <= SMOOTH else LOW
        spacing = _finer(fitted.places.checked, np.abs(fitted.residual) * fitted.places.checked.spacing)


def fit_at(places: Places, equation: Equation, drive: Drive) -> FittedCharges:
    """Fit charges at given places."""
    samples, checked = places.fitted, places.checked
    weights = places.weights[:, None]
    factors = factorise(weights * equation.residual_of_each(samples.points, samples.normals, places.charges))
    missing = drive.inflow - equation.residual_of_each(samples.points, samples.normals, drive.points) @ drive.powers
    strengths = factors.solve(weights * missing)
    field = ChargeField(equation, np.vstack([drive.points, places.charges]), np.vstack([drive.powers, strengths]))
    exitance, residual = field.exitance_and_residual(checked.points, checked.normals)
    off = (residual - drive.inflow).sum(axis=1)
    quality = quality_of(equation, checked, FINER * checked.spacing, exitance.sum(axis=1), off)
    return FittedCharges(field, drive, places, factors, quality, off)


def _finer(samples: Samples, felt: FloatArray) -> Spacing:
    """Spacing, up to a factor, that is finer where what is felt of the residual (n,) is large."""
    tree = cKDTree(samples.points)
    count = min(ALIKE, len(samples))
    _, near = tree.query(samples.points, k=count)
    local = np.sqrt(np.square(felt)[near].mean(axis=1))
    off = np.log(np.maximum(local, np.finfo(float).tiny))
    off -= off.mean()
    off = np.sign(off) * np.maximum(np.abs(off) - np.log(NOISE), 0.0)
    wanted = (np.log(samples.spacing) - POWER * off)[near].mean(axis=1)

    def spacing(points: FloatArray) -> FloatArray:
        _, around = tree.query(points, k=min(AROUND, count))
        return np.asarray(np.exp(wanted[around].mean(axis=1)))

    return spacing
