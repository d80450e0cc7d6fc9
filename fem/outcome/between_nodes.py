"""The fluence between the nodes of a mesh."""

from collections.abc import Sequence

import numpy as np

from tetlux.fem.known.fitted_patch import FittedPatch
from tetlux.fem.known.patch import Patch
from tetlux.meshing.arrays import FloatArray, IntArray, NumberArray

# The fluence at one node of a facet divided by that at another: up to where it is linear between them, from where its
# logarithm is, and from where they are too far apart for either.
MILD, STEEP, MOST_FADING = 2.0, 4.0, 1e4


def interpolate(
    fluence: NumberArray,
    patches: Sequence[Patch],
    points: FloatArray,
    cells: IntArray,
    nodes: IntArray,
    weights: FloatArray,
) -> NumberArray:
    """The fluence at points of tetrahedra: linear between nodes, but for what is subtracted, which is exact.

    Parameters
    ----------
    fluence : (n,) ndarray
        At the nodes, W/unit².
    patches : sequence of Patch
    points : (q, 3) ndarray
        Unit.
    cells : (q,) ndarray
        The tetrahedron that each lies in.
    nodes : (q, c) ndarray
        Nodes of the tetrahedron, or of one of its faces.
    weights : (q, c) ndarray
        Barycentric coordinates.

    Returns
    -------
    (q,) ndarray
        W/unit².
    """
    linear = (weights * fluence[nodes]).sum(axis=1)
    subtracted, interpolated = np.zeros((2, len(points)), fluence.dtype)
    for patch in patches:
        inside = patch.cells[cells]
        subtracted[inside] += patch.charges.fluence(points[inside])
        interpolated[inside] += (weights[inside] * patch.at_nodes[nodes[inside]]).sum(axis=1)
    found = linear + (subtracted - interpolated)
    if np.iscomplexobj(found):
        return np.asarray(found)
    # Where light fades within a tetrahedron, adding the difference may give a negative value; scaling by the ratio
    # cannot.
    below = (found < 0) & (linear >= 0)
    shares = below & (subtracted >= 0) & (interpolated > 0)
    found[shares] = linear[shares] * subtracted[shares] / interpolated[shares]
    if any(isinstance(patch, FittedPatch) for patch in patches):
        # They may be below zero where they are off by more than there is light; beside a bright node the linear
        # function is far larger than either.
        rest = below & ~shares
        found[rest] = np.minimum(linear[rest], np.abs(subtracted[rest]))
    return np.asarray(found)


def follow_fading(fluence: NumberArray, values: NumberArray, weights: FloatArray) -> NumberArray:
    """The fluence (q,) on facets, where its logarithm is linear between nodes that light fades much between.

    Light fades exponentially, far below the linear function between nodes that are far apart. Between nodes that differ
    little the linear function stays, since its mean is right and that of the other too low; in between the two mix.

    Parameters
    ----------
    fluence : (q,) ndarray
        Linear between nodes, W/unit².
    values : (q, 3) ndarray
        At the nodes, W/unit².
    weights : (q, 3) ndarray
        Barycentric coordinates.
    """
    size = np.abs(values)
    least, most = size.min(axis=1), size.max(axis=1)
    steep = (least > 0) & (most > MILD * least) & (most < MOST_FADING * least)
    # Phases differ by less than a quarter of a turn; real values have one sign.
    ratios = values[steep] / values[steep, :1]
    turns_little = (ratios.real > 0).all(axis=1)
    rows, ratios = np.flatnonzero(steep)[turns_little], ratios[turns_little]
    powers = (weights[rows] * np.log(ratios)).sum(axis=1) / weights[rows].sum(axis=1)
    share = np.minimum(np.log(most[rows] / least[rows] / MILD) / np.log(STEEP / MILD), 1.0)
    followed = np.array(fluence)
    followed[rows] += share * (values[rows, 0] * np.exp(powers) - fluence[rows])
    return followed
