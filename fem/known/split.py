"""`SplitLights`: the lights of a scene, split into what is known in closed form and what finite elements solve for."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal, get_args

import numpy as np

from tetlux.fem.body.body import Body
from tetlux.fem.inputs import DEFAULT_TOLERANCE
from tetlux.fem.known.beam_as_charges import beam_as_charges
from tetlux.fem.known.charges import Charges
from tetlux.fem.known.fitted import FittedLight, fit_light
from tetlux.fem.known.images import MOST_IMAGE_CHARGES, charges_of
from tetlux.fem.known.kept_fits import KeptFits
from tetlux.fem.media.coefficients import AnyMedium
from tetlux.fem.media.medium import Medium
from tetlux.fem.sources.deposit import Deposit
from tetlux.fem.sources.light import Light
from tetlux.meshing.arrays import BoolArray, FloatArray, IntArray
from tetlux.meshing.describe import one_line
from tetlux.meshing.errors import InputError
from tetlux.meshing.surface.surface import Surface

# Points in more different media than this stay on the mesh, since each medium takes a solution of its own.
MOST_MEDIA = 4

Subtract = Literal["fitted", "half-space", "free-space", "nothing"]
# Fitted charges of all lights; lights that come later are left to the half-space.
MOST_FITTED = 20_000


@dataclass(frozen=True, eq=False)
class SplitLights:
    """Lights, split into what charges give in closed form and the right-hand side for finite elements.

    Attributes
    ----------
    deposits : tuple of Deposit
        What each light deposits in the body; beams without width as points, where these are subtracted.
    charges : tuple of Charges
        Subtracted on patches of the mesh: points of the deposits with their images.
    owners : tuple of int
        The number of the light that each of `charges` belongs to.
    fitted : mapping of int to FittedLight
        Charges fitted to the surface, by the number of the light that they are subtracted from.
    remaining : tuple of Deposit
        What of each light is not subtracted: the right-hand side on the mesh.
    """

    deposits: tuple[Deposit, ...]
    charges: tuple[Charges, ...]
    owners: tuple[int, ...]
    fitted: Mapping[int, FittedLight]
    remaining: tuple[Deposit, ...]

    @property
    def warnings(self) -> list[str]:
        """What a user should know of the lights."""
        return [warning for deposit in self.deposits for warning in deposit.warnings]

    def deposits_if(self, *, fitted: bool) -> list[Deposit]:
        """The deposits of lights that charges are fitted to, or those of all other lights."""
        return [deposit for light, deposit in enumerate(self.deposits) if (light in self.fitted) == fitted]

    @property
    def has_negative_source(self) -> bool:
        """Whether charges have a negative source, so that the exact fluence of the equation may be below zero."""
        return any(charges.has_negative_source for charges in self.charges)

    __repr__ = one_line


def split_lights(
    lights: Sequence[Light],
    body: Body,
    subtract: Subtract,
    tolerance: float = DEFAULT_TOLERANCE,
    readings: tuple[FloatArray, float] | None = None,
    *,
    kept: KeptFits | None = None,
    scene: int = 0,
    shift: complex = 0.0,
    refit: bool = True,
) -> SplitLights:
    """Split the lights of a scene into what is subtracted and what is left to finite elements.

    Parameters
    ----------
    lights : sequence of Light
    body : Body
    subtract : {"fitted", "half-space", "free-space", "nothing"}
        "fitted" is for a body whose surface is the true one; what cannot be fitted has "half-space".
    tolerance : float
        Relative L2 error of the exitance, of what is fitted and the mesh together.
    readings : (d, 3) ndarray and float, optional
        Points of the surface that are read, and wanted relative error of each reading.
    kept : KeptFits, optional
        Fits of earlier solutions, which are followed; new ones are added.
    scene : int
        The number of the scene, by which patches are kept.
    shift : complex
        What the equation adds to sigma_a, 1/unit: 0 for steady light.
    refit : bool
        Whether charges that follow kept fits have strengths; else only their places are wanted.

    Raises
    ------
    InputError
        If there is no light, or one of them does not go with the body or the medium.
    """
    if subtract not in get_args(Subtract):
        raise InputError(f'subtract is "{subtract}"; it is "fitted", "half-space", "free-space" or "nothing".')
    check_lights(lights)
    if len(lights) == 0:
        raise InputError("there is no light; give at least one.")
    deposits: list[Deposit] = []
    charges: list[Charges] = []
    owners: list[int] = []
    remaining: list[Deposit] = []
    fitted: dict[int, FittedLight] = {}
    left = 0 if subtract == "nothing" else MOST_IMAGE_CHARGES
    images = subtract in ("fitted", "half-space")
    for number, light in enumerate(lights):
        deposit = light.deposit_in(body)
        if subtract == "fitted" and sum(len(one.charges.positions) for one in fitted.values()) < MOST_FITTED:
            found_fit = _fit(light, deposit, body, tolerance, readings, kept, shift, refit)
            if found_fit is not None:
                fitted[number] = found_fit
                deposits.append(deposit)
                remaining.append(_without_points(deposit))
                continue
        if body.only_medium is not None:
            known, rest, found = _charges_in_one_medium(
                deposit, body.surface, body.only_medium, images=images, most=left, shift=shift
            )
        else:
            known, rest, found = _charges_in_several(deposit, body, images=images, most=left, shift=shift)
        left -= sum(len(some.positions) for some in found)
        charges += [replace(each, name=f"{scene}: {number}.{k} {light!r}") for k, each in enumerate(found)]
        owners += [number] * len(found)
        deposits.append(known)
        remaining.append(rest)
    return SplitLights(tuple(deposits), tuple(charges), tuple(owners), fitted, tuple(remaining))


def _fit(
    light: Light,
    deposit: Deposit,
    body: Body,
    tolerance: float,
    readings: tuple[FloatArray, float] | None,
    kept: KeptFits | None,
    shift: complex,
    refit: bool,
) -> FittedLight | None:
    """Fit charges to a light, placed as in its kept fit if there is one; None if charges would not do."""
    medium = body.only_medium
    if medium is None or len(deposit.terms.points) == 0:
        return None
    chosen, like = (False, None) if kept is None else kept.find(repr(light), deposit.hints.resolution)
    if chosen and like is None:
        return None
    found = fit_light(
        deposit, body.surface, medium, tolerance=tolerance, readings=readings, like=like, shift=shift, refit=refit
    )
    if kept is not None and not chosen:
        kept.keep(repr(light), deposit.hints.resolution, found)
    return found


def replace_fitted(subtract: Subtract) -> Subtract:
    """Subtract the half-space in place of fitted charges, where no true surface is known."""
    return "half-space" if subtract == "fitted" else subtract


def check_lights(lights: Sequence[Light]) -> None:
    """Refuse anything but a list of lights.

    Raises
    ------
    InputError
    """
    if not isinstance(lights, Sequence):
        raise InputError(
            f"lights are given in a list, and those of several scenes in a list of lists, but {lights!r} is none; "
            "write [light], or [[light], [another]]."
        )
    for light in lights:
        if not hasattr(light, "deposit_in"):
            raise InputError(f"{light!r} is no light; give lights such as PencilBeam or DiffuseLight.")


def check_scenes(scenes: Sequence[Sequence[Light]]) -> None:
    """Refuse anything but a list of lists of lights, and an empty one.

    Raises
    ------
    InputError
    """
    if not isinstance(scenes, Sequence):
        raise InputError("scenes are given in a list, and the lights of each in a list; write [[light], [another]].")
    for lights in scenes:
        check_lights(lights)
    if len(scenes) == 0:
        raise InputError("there is no scene; give the lights of at least one.")


def _charges_in_one_medium(
    deposit: Deposit, surface: Surface, medium: Medium, *, images: bool, most: int, shift: complex
) -> tuple[Deposit, Deposit, list[Charges]]:
    """A deposit as it is subtracted, what is left of it, and what is subtracted: as much as can be afforded."""
    # Beams too and with images, or points alone, at least without.
    trials = [(deposit, _without_points(deposit), images), (deposit, _without_points(deposit), False)]
    if len(deposit.terms.segments):
        trials.insert(0, (*beam_as_charges(deposit, medium), images))
    for bright, faint, with_images in trials:
        points, powers = bright.terms.points, bright.terms.powers
        if 0 < len(points) <= most:
            some = charges_of(points, powers, surface, medium, images=with_images, most=most, shift=shift)
            if some is not None:
                return bright, faint, [some]
    return deposit, deposit, []


def _charges_in_several(
    deposit: Deposit, body: Body, *, images: bool, most: int, shift: complex
) -> tuple[Deposit, Deposit, list[Charges]]:
    """The same for points in regions, each within its own region and, where the medium varies, where it is the same.

    What is subtracted solves the equation of one medium and no other, so it ends where that medium does. Images serve
    where the region is also what bounds the body nearest to the source.
    """
    points, powers = deposit.terms.points, deposit.terms.powers
    if len(points) == 0:
        return deposit, deposit, []
    places = body.region_at(points)
    outermost = body.region_at(body.just_inside(points)) == places
    found, rest = [], np.ones(len(places), dtype=bool)
    for region in np.unique(places).tolist():
        of_region = body.by_label[region]
        for medium, inside in _media_at(of_region, points, np.flatnonzero(places == region)):
            if most <= 0:
                break
            some = charges_of(
                points[inside],
                powers[inside],
                body.surface,
                medium,
                images=images & outermost[inside],
                most=most,
                region=region if len(body.media) > 1 else None,
                varying=None if isinstance(of_region, Medium) else of_region,
                shift=shift,
            )
            if some is not None:
                most -= len(some.positions)
                rest[inside] = False
                found.append(some)
    return deposit, _keep_points(deposit, rest), found


def _media_at(medium: AnyMedium, points: FloatArray, some: IntArray) -> list[tuple[Medium, IntArray]]:
    """What a region's medium is at some of the points (n, 3), and which of these it is at; none if it is too many."""
    if isinstance(medium, Medium):
        return [(medium, some)]
    values, kind = np.unique(np.column_stack(medium.at(points[some])), axis=0, return_inverse=True)
    if len(values) > MOST_MEDIA:
        return []
    base = medium.base
    return [
        (
            Medium(sigma_a=sigma_a, sigma_s_prime=reduced, eta=base.eta, boundary=base.boundary),
            some[kind.reshape(-1) == i],
        )
        for i, (sigma_a, reduced) in enumerate(values.tolist())
    ]


def _without_points(deposit: Deposit) -> Deposit:
    return _keep_points(deposit, np.zeros(len(deposit.terms.points), dtype=bool))


def _keep_points(deposit: Deposit, some: BoolArray) -> Deposit:
    return replace(deposit, terms=deposit.terms.select_points(some))
