"""What light meets on straight paths through a body: coefficients piece by piece, and the optical depth."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from tetlux.fem.body.partition import Pieces
from tetlux.meshing.arrays import BoolArray, FloatArray, IntArray

# A coefficient that varies is taken at the ends and quarters of each piece. Pieces are halved until the range of these
# values over a piece, as optical depth and by the share of light that gets there, is this much at most, or so often.
# Held against closed forms, an optical depth is then right to 6e-4 of itself where coefficients are linear or
# exponential along the path, and to 1e-3 behind a step from 0.4 to 2.
UNEVEN = 2e-3
HALVINGS = 24
# Pieces at which halving stops all the same.
MOST_PIECES = 2_000_000
# The first pieces: their lengths double this often along the path, and of each length there are so many.
OCTAVES, STEPS = 8, 8
_SIMPSON = np.array([1.0, 4.0, 2.0, 4.0, 1.0]) / 12.0

# Absorption, reduced scattering, and scattering with the forward peak taken out, (3, n) 1/unit, at points (n, 3) of a
# region.
Local = Callable[[int, FloatArray], FloatArray]


@dataclass(frozen=True, eq=False)
class OpticalPaths:
    """Paths in pieces that each have one set of coefficients, in the order of the paths and along each of them.

    Parameters
    ----------
    rays : (p,) ndarray
        The path of each piece; each path has one at least.
    enter, leave : (p,) ndarray
        Where it begins and ends, along the path, unit.
    sigma_a, reduced, scattering : (p,) ndarray
        Absorption, reduced scattering, and scattering coefficient with the forward peak taken out, 1/unit.
    error : float
        How much of optical depth sigma_t' may be amiss at most where coefficients vary, by the share of light that gets
        there.
    """

    rays: IntArray
    enter: FloatArray
    leave: FloatArray
    sigma_a: FloatArray
    reduced: FloatArray
    scattering: FloatArray
    error: float = 0.0

    @property
    def totals(self) -> FloatArray:
        """Optical depth, the integral of sigma_t', along each path, (r,)."""
        return np.asarray(
            np.bincount(self.rays, (self.sigma_a + self.reduced) * (self.leave - self.enter)), dtype=float
        )

    def place(self, depths: FloatArray, *, peaked: bool = False) -> FloatArray:
        """How far along each path a given optical depth (r,) is reached, (r,), unit.

        Parameters
        ----------
        depths : (r,) ndarray
            Beyond the end of a path its last piece goes on.
        peaked : bool
            Of a beam with the forward peak left in it, sigma_t*, in place of sigma_t'.
        """
        extinction = self.sigma_a + (self.scattering if peaked else self.reduced)
        before = _before(self.rays, extinction * (self.leave - self.enter))
        passed = np.bincount(self.rays[before <= depths[self.rays]], minlength=len(depths))
        piece = np.searchsorted(self.rays, np.arange(len(depths))) + np.maximum(passed, 1) - 1
        return np.asarray(self.enter[piece] + (depths - before[piece]) / extinction[piece])

    @property
    def albedo(self) -> FloatArray:
        """Share of each path's light that is scattered and not absorbed, (r,).

        The mean of the reduced albedo over where light is lost, ``∫ alpha' e^-tau dtau / ∫ e^-tau dtau``: in one medium
        that is the reduced albedo.
        """
        extinction = self.sigma_a + self.reduced
        depth = extinction * (self.leave - self.enter)
        lost = np.exp(-_before(self.rays, depth)) * -np.expm1(-depth)
        whole = np.bincount(self.rays, lost)
        scattered = np.bincount(self.rays, lost * self.reduced / extinction)
        first = np.searchsorted(self.rays, np.arange(len(whole)))
        # A path without length is all in its first piece.
        of_first = self.reduced[first] / extinction[first]
        return np.asarray(np.where(whole > 0, scattered / np.where(whole > 0, whole, 1.0), of_first))


def paths_of(
    pieces: Pieces, starts: FloatArray, directions: FloatArray, varying: Sequence[int], local: Local
) -> OpticalPaths:
    """Find the coefficients along paths that are cut at the borders of regions.

    Parameters
    ----------
    pieces : Pieces
    starts, directions : (r, 3) ndarray
        Of the paths.
    varying : sequence of int
        The regions in which coefficients vary.
    local : Local
    """
    varies = np.isin(pieces.regions, varying)
    rays, enter, leave, regions = _graded(pieces, varies)

    def values_of(some: IntArray) -> FloatArray:
        """Coefficients at five places along each of some pieces, (3, p, 5)."""
        places = enter[some, None] + np.linspace(0.0, 1.0, 5) * (leave - enter)[some, None]
        points = starts[rays[some], None] + places[:, :, None] * directions[rays[some], None]
        values = np.empty((3, len(some), 5))
        for region in np.unique(regions[some]).tolist():
            mine = regions[some] == region
            values[:, mine] = local(region, points[mine].reshape(-1, 3)).reshape(3, -1, 5)
        return values

    def summed_up(some: IntArray) -> tuple[FloatArray, FloatArray]:
        """Mean coefficients (3, p) of some pieces, and how much optical depth is uneven in each (p,)."""
        values = values_of(some)
        spread = np.ptp(values, axis=2)
        return values @ _SIMPSON, (leave - enter)[some] * np.maximum(np.ptp(values[0] + values[1], axis=1), spread[1])

    means, uneven = summed_up(np.arange(len(rays)))
    for _ in range(HALVINGS if varies.any() else 0):
        before = _before(rays, (means[0] + means[1]) * (leave - enter))
        halved = uneven * np.exp(-before) > UNEVEN
        if not halved.any() or len(rays) + halved.sum() > MOST_PIECES:
            break
        counts = 1 + halved
        upper = np.cumsum(counts)[halved] - 1
        lower = upper - 1
        middle = 0.5 * (enter + leave)[halved]
        rays, regions = np.repeat(rays, counts), np.repeat(regions, counts)
        enter, leave, uneven = (np.repeat(each, counts) for each in (enter, leave, uneven))
        means = np.repeat(means, counts, axis=1)
        leave[lower], enter[upper] = middle, middle
        new = np.concatenate([lower, upper])
        means[:, new], uneven[new] = summed_up(new)
    before = _before(rays, (means[0] + means[1]) * (leave - enter))
    error = float((uneven * np.exp(-before)).max(initial=0.0))
    return OpticalPaths(rays, enter, leave, means[0], means[1], means[2], error)


def _graded(pieces: Pieces, varies: BoolArray) -> tuple[IntArray, FloatArray, FloatArray, IntArray]:
    """Rays, ends and regions of pieces, those in which coefficients vary cut finely towards their beginning."""
    octaves = np.concatenate([[0.0], 2.0 ** np.arange(1 - OCTAVES, 1)])
    shares = np.concatenate([np.linspace(low, high, STEPS + 1)[1:] for low, high in pairwise(octaves)])
    counts = np.where(varies, len(shares), 1)
    first = np.cumsum(counts) - counts
    rays, regions = np.repeat(pieces.rays, counts), np.repeat(pieces.regions, counts)
    owner = np.repeat(np.arange(len(counts)), counts)
    place = np.arange(len(owner)) - first[owner]
    low = np.where(varies[owner], np.concatenate([[0.0], shares])[place], 0.0)
    high = np.where(varies[owner], shares[place], 1.0)
    length = (pieces.leave - pieces.enter)[owner]
    return rays, pieces.enter[owner] + low * length, pieces.enter[owner] + high * length, regions


def _before(rays: IntArray, depths: FloatArray) -> FloatArray:
    """Sum of the depths of what comes before each piece on its own path, (p,)."""
    total = np.cumsum(depths)
    before = total - depths
    first = np.diff(rays, prepend=-1) > 0
    return np.asarray(before - before[first][np.cumsum(first) - 1])
