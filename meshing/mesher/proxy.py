"""Decimate a surface within a measured distance, since fTetWild's time grows with its input triangles."""

from dataclasses import replace

import numpy as np

from tetlux.meshing.arrays import FloatArray, IntArray
from tetlux.meshing.errors import InputError
from tetlux.meshing.mesher.deviation import two_sided_distance
from tetlux.meshing.repair.crossings import count_self_intersections
from tetlux.meshing.repair.pinches import pull_apart
from tetlux.meshing.repair.topology import Edges, bodies, compact
from tetlux.meshing.resolution import FLAT
from tetlux.meshing.surface.surface import Surface
from tetlux.meshing.surface.triangles import signed_volume, triangle_areas

# Quadric decimation within a deviation d needs about this x area / (d x diagonal) triangles: 1.5 on a sphere, 5 to 10
# on organic and mechanical surfaces. It gives the first count; later counts follow from measured distances.
TRIANGLES_NEEDED = 6.0
# fast-simplification's `agg`: at its default, 7, the same distance needs twice the triangles; at 3 and below,
# decimation ends above the wanted count.
AGGRESSIVENESS = 4.0
# Proxies whose distance is measured, and triangle counts tried for each until a proxy is closed and manifold: quadric
# decimation occasionally merges sheets, and with a slightly different count it does not.
MEASURED_PROXIES = 6
COUNTS_TRIED = 4
# Sample points of the first measurement of a proxy; one that passes is measured again at DISTANCE_SAMPLES.
FIRST_SAMPLES = 1_500
# A proxy closer to the surface than this share of the allowed deviation has more triangles than needed.
USED_DEVIATION = 0.6
# A part with at most this many triangles, attached by an edge of four triangles, is a flap and is removed.
LARGEST_FLAP = 8
# Surfaces of fewer triangles are not decimated.
FEWEST_TRIANGLES = 300


def proxy(surface: Surface, deviation: float) -> Surface:
    """Decimate a surface within a two-sided distance of `deviation`.

    Parameters
    ----------
    surface : Surface
    deviation : float
        Largest distance, unit, measured by `two_sided_distance`.

    Returns
    -------
    Surface
        Closed, manifold, outward oriented, of as many bodies as `surface`, and free of self-intersections if
        `surface` is; `surface` itself if no coarser surface is.

    Raises
    ------
    InputError
        If `deviation` is not positive.

    References
    ----------
    Garland & Heckbert, Surface simplification using quadric error metrics, SIGGRAPH 1997.
    """
    if not np.isfinite(deviation) or deviation <= 0:
        raise InputError(f"deviation is {deviation:g}; give a length greater than 0.")
    separated = pull_apart(surface.points, surface.faces)
    if separated is None or len(separated[0]) == len(surface.points):
        return _decimate(surface, deviation)
    return _merge([_decimate(part, deviation) for part in _connected_parts(surface, *separated)], surface)


def _connected_parts(surface: Surface, points: FloatArray, faces: IntArray) -> list[Surface]:
    """The connected parts of a surface separated at pinches, without walls between bodies, which bound no volume."""
    body = bodies(len(points), faces)
    parts = []
    for number in range(int(body.max()) + 1):
        own = compact(points, faces[body == number])
        if abs(signed_volume(*own)) > FLAT * surface.diagonal * triangle_areas(*own)[1].sum():
            # Where a surface touches itself, its proxy may cross itself.
            parts.append(replace(surface, points=own[0], faces=own[1], overlaps=True))
    return parts


def _merge(parts: list[Surface], surface: Surface) -> Surface:
    first = np.cumsum([0, *(len(part.points) for part in parts)])
    return replace(
        surface,
        points=np.concatenate([part.points for part in parts]),
        faces=np.concatenate([part.faces + start for part, start in zip(parts, first, strict=False)]),
        repairs=(),
        warnings=(),
    )


def _decimate(surface: Surface, deviation: float) -> Surface:
    """Decimate a manifold surface; the surface itself if no coarser one is close enough, closed and manifold."""
    if len(surface.faces) <= FEWEST_TRIANGLES:
        return surface
    target = min(TRIANGLES_NEEDED * surface.area / (deviation * surface.diagonal), 0.5 * len(surface.faces))
    # Scaled to unit size about the origin, since fast-simplification's thresholds are absolute.
    origin, size = surface.points.mean(axis=0), surface.diagonal
    fine: tuple[FloatArray, IntArray] = (surface.points - origin) / size, surface.faces
    # Do most of the decimation once instead of once per attempt.
    base = _decimate_to(*fine, int(5 * target)) if len(surface.faces) > 10 * target else fine
    best = surface
    for _ in range(MEASURED_PROXIES):
        count = int(max(target, FEWEST_TRIANGLES))
        if count >= 0.8 * len(best.faces):
            break
        if count > 0.6 * len(base[1]):
            base = fine
        coarse = _decimate_soundly(surface, base, count, origin, size)
        if coarse is None:
            target *= 2.0
            continue
        distance = two_sided_distance(coarse, surface, FIRST_SAMPLES)
        if distance <= deviation:
            distance = two_sided_distance(coarse, surface)
        if distance <= deviation:
            best = coarse
            if distance > USED_DEVIATION * deviation or count <= FEWEST_TRIANGLES:
                break
        # The distance of a chord from its arc grows with the edge squared, and so with the inverse of the count.
        target = count * np.clip(distance / (0.8 * deviation), 0.2, 4.0)
    return best


def _decimate_soundly(
    surface: Surface, base: tuple[FloatArray, IntArray], count: int, origin: FloatArray, size: float
) -> Surface | None:
    """Decimate to about `count` triangles; None if no result is manifold with as many bodies as the surface."""
    expected = int(bodies(len(surface.points), surface.faces).max()) + 1
    for attempt in range(COUNTS_TRIED):
        target = int(count * (1.0 + 0.04 * attempt))
        if target >= len(base[1]):
            return None
        p, f = _decimate_to(*base, target)
        if len(f) < 4 or not _is_manifold(f):
            continue
        body = bodies(len(p), f)
        if int(body.max()) + 1 != expected or any(signed_volume(p, f[body == i]) <= 0 for i in range(expected)):
            continue
        if not surface.overlaps and count_self_intersections(p, f):
            continue
        return replace(surface, points=p * size + origin, faces=f, repairs=(), warnings=())
    return None


def _decimate_to(points: FloatArray, faces: IntArray, count: int) -> tuple[FloatArray, IntArray]:
    from fast_simplification import simplify  # noqa: PLC0415

    points, faces = simplify(points, faces.astype(np.int32), target_count=count, agg=AGGRESSIVENESS)
    return compact(np.asarray(points, dtype=np.float64), _remove_flaps(faces.astype(np.int64)))


def _remove_flaps(faces: IntArray) -> IntArray:
    """Remove the flaps of quadric decimation at thin places: a few triangles attached by an edge of four triangles.

    Most flaps are two triangles back to back; some are a tetrahedron.
    """
    from scipy.sparse import coo_matrix  # noqa: PLC0415
    from scipy.sparse.csgraph import connected_components  # noqa: PLC0415

    edges = Edges(faces)
    if (edges.triangles == 2).all():
        return faces
    plain = np.flatnonzero(edges.triangles[edges.edge] == 2)
    pairs = plain[np.argsort(edges.edge[plain], kind="stable")].reshape(-1, 2) % len(faces)
    graph = coo_matrix((np.ones(len(pairs)), pairs.T), shape=(len(faces), len(faces)))
    _, part = connected_components(graph, directed=False)
    return faces[np.bincount(part)[part] > LARGEST_FLAP]


def _is_manifold(faces: IntArray) -> bool:
    """Whether each edge has two triangles, which traverse it in opposite directions."""
    edges = Edges(faces)
    return bool((edges.triangles == 2).all() and (edges.balance == 0).all())
