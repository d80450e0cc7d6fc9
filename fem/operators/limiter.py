"""Limit a fluence to be nonnegative: what a node lacks is taken from its neighbours, and no power is lost.

With lumped mass the matrix keeps the fluence from going below zero where no angle between faces is obtuse (Brandts,
Korotov & Křížek 2007); meshers return others too, where the fluence overshoots in the dark by up to some per cent of
its maximum. The fluence at a node times the sum of its row of the matrix is the power that is absorbed in its part of
the volume and leaves through its part of the boundary. Moving this power from node to node leaves the ledger as it is;
it is moved to the nearest nodes that lack it.
"""

import numpy as np

from tetlux.meshing.arrays import FloatArray, IntArray, divide_or_zero

# Sweeps from neighbour to neighbour; what is still missing after them is taken from all nodes in proportion.
SWEEPS = 10
# Divisors below this count as 0, since quotients could overflow.
SMALLEST_DIVISOR = 1e-250


def limit_to_nonnegative(fluence: FloatArray, edges: IntArray, weights: FloatArray) -> tuple[FloatArray, float]:
    """Raise a fluence to zero where it is negative, and lower it at the nodes around.

    Parameters
    ----------
    fluence : (n,) ndarray
        W/unit².
    edges : (e, 2) ndarray
        Pairs of neighbours.
    weights : (n,) ndarray
        Power that is absorbed or leaves through the boundary for a fluence of 1 at each node, unit². None is negative.

    Returns
    -------
    fluence : (n,) ndarray
        None below zero, and the sum of weights times fluence as before. Where that sum is below 1e-250, nodes together
        lack more than they have: those below zero are then raised to it, and the sum grows.
    limited_power : float
        Power that was taken from some nodes and given to others, W.
    """
    power = weights * fluence
    total = float(power.sum())
    if fluence.min(initial=0.0) >= 0:
        return fluence, 0.0
    deficit, available = np.maximum(-power, 0.0), np.maximum(power, 0.0)
    limited_power = float(deficit.sum())
    if total < SMALLEST_DIVISOR:
        return np.maximum(fluence, 0.0), limited_power

    def ratio(a: FloatArray, b: FloatArray) -> FloatArray:
        return divide_or_zero(a, b, SMALLEST_DIVISOR)

    def at_nodes(nodes: IntArray, values: FloatArray) -> FloatArray:
        return np.asarray(np.bincount(nodes, values, minlength=len(power)), dtype=np.float64)

    for _ in range(SWEEPS):
        pairs = edges[(deficit[edges] > 0).any(axis=1)]
        if len(pairs) == 0:
            break
        takers, givers = np.concatenate([pairs, pairs[:, ::-1]]).T
        # Each taker asks its neighbours in proportion to what they have; a giver gives no more than it has.
        asked = ratio(deficit, at_nodes(takers, available[givers]))[takers] * available[givers]
        given = asked * np.minimum(ratio(available, at_nodes(givers, asked)), 1.0)[givers]
        deficit = np.maximum(deficit - at_nodes(takers, given), 0.0)
        available = np.maximum(available - at_nodes(givers, given), 0.0)
    # The total is kept to rounding.
    available *= ratio(np.array(total), available.sum())
    return np.where(weights > 0, ratio(available, weights), np.maximum(fluence, 0.0)), limited_power
