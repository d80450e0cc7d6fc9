"""The surfaces that are given to the mesher, each with its allowed deviation."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from tetlux.meshing.resolution import DEVIATION_OF_THICKNESS
from tetlux.meshing.surface.surface import Surface
from tetlux.meshing.tets.nesting import nesting

# Default deviation of an inner surface, as a share of its own diagonal (or less in thin regions). Measured at .02, .03
# and .05, as seconds of the mesher and the missing volume of an inner ball before refinement:
#   ball of 1/20 of the body's size: 3.4, 2.1, 1.5 s; 3.9, 5.0, 8.0 %
#   ball 5 wide in the hare (.9 s without it): 2.3, 2.2, 1.7 s; 3.8, 4.9, 7.5 %
# The proxy of each surface has its own deviation (with a common one the first case takes 2 to 4 times as long); the
# envelope is common.
INNER_DEVIATION = 0.03
# A region whose inner regions leave less than this share of its volume is filled by them, as by layers.
EMPTY_REGION = 1e-6


@dataclass(frozen=True)
class Shell:
    """A surface that is given to the mesher: the body's or an inner one."""

    surface: Surface
    deviation: float
    # Whether it touches another shell. Touching shells are not decimated, since they would separate.
    touching: bool = False
    # All regions inside it.
    regions: tuple[int, ...] = ()


def make_shells(surface: Surface, regions: Sequence[Surface], deviation: float) -> list[Shell]:
    """Make the shells of the body and of its regions, each with its deviation."""
    if len(regions) == 0:
        return [Shell(surface, deviation)]
    nested = nesting(surface, regions)
    surfaces = [surface, *(replace(s, name=f"region {i} ({s.name})") for i, s in enumerate(regions, 1))]
    by_thickness = []
    for i, each in enumerate(surfaces):
        children = [surfaces[j] for j, parent in enumerate(nested.parents, 1) if parent == i]
        own = each.volume - sum(inner.volume for inner in children)
        thickness = 2.0 * own / (each.area + sum(inner.area for inner in children))
        # Layers may fill the whole region.
        by_thickness.append(DEVIATION_OF_THICKNESS * thickness if own > EMPTY_REGION * each.volume else math.inf)
    shells = [Shell(surface, min(deviation, by_thickness[0]), nested.touching[0], tuple(nested.within(0)))]
    for i, (each, parent) in enumerate(zip(surfaces[1:], nested.parents, strict=True), 1):
        # The regions on both sides of it may be thin.
        limit = min(deviation, INNER_DEVIATION * each.diagonal, by_thickness[i], by_thickness[parent])
        shells.append(Shell(each, limit, nested.touching[i], tuple(nested.within(i))))
    return shells
