"""The surfaces that the mesher is given, and how far it may stray from each."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from tetlux.meshing.resolution import DEVIATION_OF_THICKNESS
from tetlux.meshing.surface.surface import Surface
from tetlux.meshing.tets.nesting import nesting

# Default deviation of an inner surface: this share of its own diagonal, or of its region's mean thickness as above.
# Seconds of the mesher and what the inner ball's volume lacks, until refinement puts more nodes onto it, at .02, .03
# and .05: a twentieth of a ball's size, 3.4, 2.1, 1.5 and 3.9, 5.0, 8.0 %; 5 wide in the hare, which alone takes .9,
# 2.3, 2.2, 1.7 and 3.8, 4.9, 7.5 %. The proxy of each surface has its own deviation, without which the first would take
# two to four times as long; the envelope is one for all.
INNER_DEVIATION = 0.03
# A region whose inner ones leave it less than this share of its volume is filled by them.
LEFT = 1e-6


@dataclass(frozen=True)
class Shell:
    """A surface that the mesher is given: the body's or an inner one."""

    surface: Surface
    deviation: float
    # Whether another one touches it: decimated each on its own, they would not any more.
    touching: bool = False
    # The regions that it bounds together.
    regions: tuple[int, ...] = ()


def shells_of(surface: Surface, regions: Sequence[Surface], deviation: float) -> list[Shell]:
    """The body's surface and the inner ones, and how far the mesher may stray from each."""
    if len(regions) == 0:
        return [Shell(surface, deviation)]
    lie = nesting(surface, regions)
    surfaces = [surface, *(replace(s, name=f"region {i} ({s.name})") for i, s in enumerate(regions, 1))]
    by_thickness = []
    for i, each in enumerate(surfaces):
        held = [surfaces[j] for j, parent in enumerate(lie.parents, 1) if parent == i]
        own = each.volume - sum(inner.volume for inner in held)
        thickness = 2.0 * own / (each.area + sum(inner.area for inner in held))
        # Layers may fill it all.
        by_thickness.append(DEVIATION_OF_THICKNESS * thickness if own > LEFT * each.volume else math.inf)
    shells = [Shell(surface, min(deviation, by_thickness[0]), lie.touching[0], tuple(lie.within(0)))]
    for i, (each, parent) in enumerate(zip(surfaces[1:], lie.parents, strict=True), 1):
        # What is on either side of it may be thin.
        stray = min(deviation, INNER_DEVIATION * each.diagonal, by_thickness[i], by_thickness[parent])
        shells.append(Shell(each, stray, lie.touching[i], tuple(lie.within(i))))
    return shells
