"""A part of a body that has a medium of its own."""

from collections.abc import Sequence
from dataclasses import dataclass

from tetlux.fem.media.coefficients import AnyMedium
from tetlux.meshing.describe import one_line
from tetlux.meshing.errors import InputError
from tetlux.meshing.surface.surface import Surface


@dataclass(frozen=True, eq=False)
class Region:
    """A closed surface within the body, or within another region, and what it holds.

    Parameters
    ----------
    surface : Surface
        Inside the body's.
    medium : Medium, VaryingMedium, or sequence of these
        Of the refractive index of the body's; one for each of the body's where that is a sequence.
    """

    surface: Surface
    medium: AnyMedium | Sequence[AnyMedium]

    __repr__ = one_line


def check_list_of_regions(regions: Sequence[Region]) -> None:
    """Refuse what is no list of regions.

    Raises
    ------
    InputError
    """
    if not isinstance(regions, Sequence):
        raise InputError(f"regions are given in a list, and {type(regions).__name__} is none; write [Region(...)].")
    for region in regions:
        if not isinstance(region, Region):
            raise InputError(
                f"a {type(region).__name__} is given where a region is wanted; write Region(surface, medium), with the "
                "closed surface that bounds it."
            )


def only_medium(region: Region) -> AnyMedium:
    """The one medium of a region."""
    if isinstance(region.medium, AnyMedium):
        return region.medium
    raise InputError(f"a region has {len(region.medium)} media where one is wanted; give the one of this channel.")
