"""What the lights of a scene put into a body: what is known in closed form, and what is left to the mesh."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

from tetlux.fem.lights.deposit import Deposit, Light
from tetlux.fem.line_charges import in_points
from tetlux.fem.medium import Medium
from tetlux.fem.subtraction import MOST_CHARGES, Charges, charges_of
from tetlux.meshing.errors import InputError
from tetlux.meshing.surface import Surface

Subtract = Literal["half-space", "free-space", "nothing"]


@dataclass(frozen=True, eq=False)
class Sources:
    """Lights, as a mesh needs them.

    Attributes
    ----------
    deposits : tuple of Deposit
        What each light leaves in the body; beams without width as points, where these are subtracted.
    charges : tuple of Charges
        The points among that, where these are subtracted.
    owners : tuple of int
        The light of each of these.
    on_mesh : tuple of Deposit
        What of each light is left to be put on the nodes.
    """

    deposits: tuple[Deposit, ...]
    charges: tuple[Charges, ...]
    owners: tuple[int, ...]
    on_mesh: tuple[Deposit, ...]

    @property
    def warnings(self) -> list[str]:
        """What a user should know of the lights."""
        return [warning for deposit in self.deposits for warning in deposit.warnings]


def sources_of(
    lights: Sequence[Light], surface: Surface, medium: Medium, subtract: Subtract, *, uniform: bool = True
) -> Sources:
    """Let lights fall into a body, which may be of one medium throughout.

    Raises
    ------
    InputError
        If there is no light, or one of them does not go with the body or the medium.
    """
    if subtract not in ("half-space", "free-space", "nothing"):
        raise InputError(f'subtract is "{subtract}"; it is "half-space", "free-space" or "nothing".')
    if len(lights) == 0:
        raise InputError("there is no light; give at least one.")
    deposits: list[Deposit] = []
    charges: list[Charges] = []
    owners: list[int] = []
    on_mesh: list[Deposit] = []
    left = 0 if subtract == "nothing" else MOST_CHARGES
    images = subtract == "half-space"
    for number, light in enumerate(lights):
        deposit = light.deposit_in(surface, medium, uniform=uniform)
        no_points = replace(deposit, points=deposit.points[:0], powers=deposit.powers[:0])
        # As many as can be afforded: beams too and with images, or points alone, at least without.
        trials = [(deposit, no_points, images), (deposit, no_points, False)]
        if len(deposit.starts):
            trials.insert(0, (*in_points(deposit, medium), images))
        known, rest = deposit, deposit
        for bright, faint, with_images in trials:
            if not 0 < len(bright.points) <= left:
                continue
            some = charges_of(bright.points, bright.powers, surface, medium, images=with_images, most=left)
            if some is not None:
                left -= len(some.positions)
                charges.append(some)
                owners.append(number)
                known, rest = bright, faint
                break
        deposits.append(known)
        on_mesh.append(rest)
    return Sources(tuple(deposits), tuple(charges), tuple(owners), tuple(on_mesh))
