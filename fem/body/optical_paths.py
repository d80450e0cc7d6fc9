"""Optical paths: coefficients and optical depth along straight lines through a body."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from tetlux.fem.body.partition import Pieces
from tetlux.meshing.arrays import BoolArray, FloatArray, IntArray

# A coefficient that varies is integrated over each piece by Simpson's rule on halves. Pieces are halved until the range
# of the coefficient over a piece, as an optical depth and weighted by the transmitted share of the light, is less than
# LARGEST_RANGE, at most MOST_HALVINGS times. An optical depth then has a relative error of 6e-4 where coefficients are
# linear or exponential along the path, and of 1e-3 behind a step from 0.4 to 2 (measured against closed forms).
LARGEST_RANGE = 2e-3
MOST_HALVINGS = 24
# Pieces are not halved beyond this number in all.
MOST_PIECES = 2_000_000
# Initial pieces: their lengths double OCTAVES times along the path, with STEPS pieces of each length.
OCTAVES, STEPS = 8, 8
# Weights of the values at the ends and quarters of a piece.
_SIMPSON = np.array([1.0, 4.0, 2.0, 4.0, 1.0]) / 12.0

# Absorption, reduced scattering, and delta-Eddington scattering sigma_s*, (3, n), 1/unit, of a region at points (n, 3).
LocalCoefficients = Callable[[int, FloatArray], FloatArray]


@dataclass(frozen=True, eq=False)
class OpticalPaths:
    """Paths (r,) divided into pieces (p,) with constant coefficients.

    Parameters
    ----------
    pieces : Pieces
    sigma_a, reduced_scattering, scattering : (p,) ndarray
        Absorption, reduced scattering, and delta-Eddington scattering sigma_s*, 1/unit.
    error : float
        Bound of the error of the optical depth of sigma_t' where coefficients vary, weighted by the transmitted share.
    """

    pieces: Pieces
    sigma_a: FloatArray
    reduced_scattering: FloatArray
    scattering: FloatArray
    error: float = 0.0

    @property
    def total_depths(self) -> FloatArray:
        """Optical depth of each whole path, the integral of sigma_t', (r,)."""
        extinction = self.sigma_a + self.reduced_scattering
        return np.asarray(np.bincount(self.pieces.rays, extinction * self.pieces.lengths), dtype=float)

    def distances_at(self, depths: FloatArray, *, delta_eddington: bool = False) -> FloatArray:
        """Distances along the paths at which given optical depths are reached.

        Parameters
        ----------
        depths : (r,) ndarray
            One for each path; beyond the end of a path its last piece continues.
        delta_eddington : bool
            Whether the depth is that of a beam, the integral of sigma_t*, in place of sigma_t'.

        Returns
        -------
        (r,) ndarray
            unit.
        """
        extinction = self.sigma_a + (self.scattering if delta_eddington else self.reduced_scattering)
        rays = self.pieces.rays
        before = depths_before(rays, extinction * self.pieces.lengths)
        passed = np.bincount(rays[before <= depths[rays]], minlength=len(depths))
        piece = np.searchsorted(rays, np.arange(len(depths))) + np.maximum(passed, 1) - 1
        return np.asarray(self.pieces.enter[piece] + (depths - before[piece]) / extinction[piece])

    @property
    def albedo(self) -> FloatArray:
        """Share of the light lost from each path that is scattered and not absorbed, (r,).

        It is the mean of the reduced albedo weighted by that loss, ``∫ alpha' e^-tau dtau / ∫ e^-tau dtau``, and in one
        medium the reduced albedo itself.
        """
        extinction, rays = self.sigma_a + self.reduced_scattering, self.pieces.rays
        depth = extinction * self.pieces.lengths
        lost = np.exp(-depths_before(rays, depth)) * -np.expm1(-depth)
        total = np.bincount(rays, lost)
        scattered = np.bincount(rays, lost * self.reduced_scattering / extinction)
        first = np.searchsorted(rays, np.arange(len(total)))
        # A path of length 0 loses nothing: take the albedo of its first piece.
        of_first = self.reduced_scattering[first] / extinction[first]
        return np.asarray(np.where(total > 0, scattered / np.where(total > 0, total, 1.0), of_first))


def paths_of(
    pieces: Pieces, starts: FloatArray, directions: FloatArray, varying: Sequence[int], local: LocalCoefficients
) -> OpticalPaths:
    """Compute the coefficients along paths that are divided at the borders of regions.

    Parameters
    ----------
    pieces : Pieces
    starts, directions : (r, 3) ndarray
        Of the paths; directions are unit vectors.
    varying : sequence of int
        The regions in which coefficients vary.
    local : callable
        See `LocalCoefficients`.

    Returns
    -------
    OpticalPaths
        With more pieces where coefficients vary.
    """
    varies = np.isin(pieces.regions, varying)
    pieces = _grade(pieces, varies)
    integrand = _Integrand(starts, directions, local)
    means, ranges = integrand.means_and_ranges(pieces)
    for _ in range(MOST_HALVINGS if varies.any() else 0):
        halved = _weigh_by_transmission(pieces, means, ranges) > LARGEST_RANGE
        if not halved.any() or len(pieces.rays) + halved.sum() > MOST_PIECES:
            break
        counts = 1 + halved
        pieces, new = _halve(pieces, halved)
        means, ranges = np.repeat(means, counts, axis=1), np.repeat(ranges, counts)
        means[:, new], ranges[new] = integrand.means_and_ranges(pieces.select(new))
    error = float(_weigh_by_transmission(pieces, means, ranges).max(initial=0.0))
    return OpticalPaths(pieces, means[0], means[1], means[2], error)


@dataclass(frozen=True, eq=False)
class _Integrand:
    """Coefficients along paths, to be integrated over pieces."""

    starts: FloatArray
    directions: FloatArray
    local: LocalCoefficients

    def means_and_ranges(self, pieces: Pieces) -> tuple[FloatArray, FloatArray]:
        """Mean coefficients (3, p) of pieces, and how much the optical depth of each varies with its place (p,)."""
        values = self._values(pieces)
        spread = np.ptp(values, axis=2)
        largest = np.maximum(np.ptp(values[0] + values[1], axis=1), spread[1])
        return values @ _SIMPSON, pieces.lengths * largest

    def _values(self, pieces: Pieces) -> FloatArray:
        """Coefficients at the ends and quarters of each piece, (3, p, 5)."""
        along = pieces.enter[:, None] + np.linspace(0.0, 1.0, 5) * pieces.lengths[:, None]
        points = self.starts[pieces.rays, None] + along[:, :, None] * self.directions[pieces.rays, None]
        values = np.empty((3, len(pieces.rays), 5))
        for region in np.unique(pieces.regions).tolist():
            inside = pieces.regions == region
            values[:, inside] = self.local(region, points[inside].reshape(-1, 3)).reshape(3, -1, 5)
        return values


def _weigh_by_transmission(pieces: Pieces, means: FloatArray, ranges: FloatArray) -> FloatArray:
    """Ranges (p,) times the share of the light that reaches each piece."""
    depths = (means[0] + means[1]) * pieces.lengths
    return ranges * np.exp(-depths_before(pieces.rays, depths))


def _halve(pieces: Pieces, halved: BoolArray) -> tuple[Pieces, IntArray]:
    """Halve some pieces: all pieces, and the numbers of the lower and then the upper halves among them."""
    counts = 1 + halved
    upper = np.cumsum(counts)[halved] - 1
    lower = upper - 1
    middle = 0.5 * (pieces.enter + pieces.leave)[halved]
    finer = pieces.select(np.repeat(np.arange(len(counts)), counts))
    finer.leave[lower], finer.enter[upper] = middle, middle
    return finer, np.concatenate([lower, upper])


def _grade(pieces: Pieces, varies: BoolArray) -> Pieces:
    """Divide the pieces in which coefficients vary, finely towards the start of each."""
    octaves = np.concatenate([[0.0], 2.0 ** np.arange(1 - OCTAVES, 1)])
    shares = np.concatenate([np.linspace(low, high, STEPS + 1)[1:] for low, high in pairwise(octaves)])
    counts = np.where(varies, len(shares), 1)
    first = np.cumsum(counts) - counts
    owner = np.repeat(np.arange(len(counts)), counts)
    place = np.arange(len(owner)) - first[owner]
    low = np.where(varies[owner], np.concatenate([[0.0], shares])[place], 0.0)
    high = np.where(varies[owner], shares[place], 1.0)
    enter, length = pieces.enter[owner], pieces.lengths[owner]
    return Pieces(pieces.rays[owner], enter + low * length, enter + high * length, pieces.regions[owner])


def depths_before(rays: IntArray, depths: FloatArray) -> FloatArray:
    """Sum the depths of the pieces before each one on its own path.

    Parameters
    ----------
    rays : (p,) ndarray
        The path of each piece, ascending.
    depths : (p,) ndarray
        Optical depth of each piece, along each path.

    Returns
    -------
    (p,) ndarray
    """
    total = np.cumsum(depths)
    before = total - depths
    first = np.diff(rays, prepend=-1) > 0
    return np.asarray(before - before[first][np.cumsum(first) - 1])
