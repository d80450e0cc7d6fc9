"""Mesh a closed surface with tetrahedra by pytetwild (fTetWild), with checks of its input and its result."""

import importlib.util
import math
import time
from collections.abc import Sequence
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path

import numpy as np

from tetlux.meshing.arrays import FloatArray, IntArray
from tetlux.meshing.errors import InputError, RunError
from tetlux.meshing.mesher.acceptance import NotTheBodyError, check_body, has_lost_part, part_of
from tetlux.meshing.mesher.cache import cache_directory, is_entry, load_cached_mesh, mesh_key, store_cached_mesh
from tetlux.meshing.mesher.child import run_pytetwild
from tetlux.meshing.mesher.lengths import ENVELOPE, default_lengths
from tetlux.meshing.mesher.proxy import proxy
from tetlux.meshing.mesher.shells import make_shells
from tetlux.meshing.repair.topology import bodies, compact
from tetlux.meshing.resolution import DEBRIS
from tetlux.meshing.surface.surface import Surface
from tetlux.meshing.surface.triangles import body_sizes
from tetlux.meshing.tets.geometry import tetrahedron_volumes
from tetlux.meshing.tets.mesh import TetMesh
from tetlux.meshing.tets.refine import move_to_surface
from tetlux.meshing.tets.tagging import tag_tetrahedra

# Measured with the settings below on 2 cores, without the cache. Seconds are the least of four runs; the other columns
# are ranges over ten. Volume is relative to the surface's; deviation is a share of the diagonal, measured after
# boundary nodes were moved back onto the surface.
#
#   surface      faces    proxy    proxy / mesher / rest   tetrahedra   worst quality    volume   deviation
#   sphere       5,120      466      .09 /  .31 / .03       2.5k        .28 - .29        -2.4 %     .005
#   spot         5,856    1,136      .06 / 1.15 / .04       2.8 - 3.7k  .10 - .27        -1.9 %     .006 - .007
#   cow          5,804    2,550      .18 / 1.7  / .04       3.0 - 3.8k  .10 - .17        -1.2 %     .011 - .017
#   rocker-arm  20,088    1,272      .08 / 2.1  / .05       3.3 - 4.3k  .10 - .21        -1.1 %     .005 - .007
#   nefertiti   99,938    1,548      .28 / 1.65 / .11       2.3 - 3.5k  .10 - .17        -1.5 %     .008 - .013
#
# The deviation depends on neither the tolerance nor the mean free path: old and new boundary nodes are moved onto the
# surface, and the error estimate includes the remaining distance of facets. On spot, rocker-arm and nefertiti, 60 mean
# free paths across and at tolerances from .05 to .005, deviations from 0.5 to 2.5 times this one take the same time
# within 20 % and end with as many nodes.
#
# Default stop energy. Worst quality in six runs of spot, rocker-arm and nefertiti, and the mesher's seconds for each:
# 8: .13; 1.4, 2.4, 2.0. 9: .12; 1.5, 2.3, 1.9. 10: .08; 1.1, 1.8, 1.8. 14: .03. 30: .01, three times faster than 10.
STOP_ENERGY = 9.5
# Default seconds after which the mesher is stopped: ten times the time of slow bodies.
TIME_LIMIT = 300.0
# Factor on the deviation in the second attempt, which follows if the first mesh does not represent the surface.
SECOND_ATTEMPT = 0.3
# Bodies of a mean thickness 2 V/A below this share of their diagonal are refused. A plate 60 wide and 1, .5 or .25
# thick (.011, .0058, .0029) takes the mesher 2, 5 and over 60 s, with 2k and 8k tetrahedra in the first two; a needle
# 100 widths long (.005) takes 2 s, one of 1000 (.0005) over 60 s.
THINNEST = 0.002
NOT_INSTALLED = (
    "pytetwild, which fills surfaces with tetrahedra, is not installed, and pip has no wheel of it for Intel Macs; "
    "give tetrahedra in place of the surface, or build it: pip install pytetwild."
)


def tetrahedralize(
    surface: Surface,
    regions: Sequence[Surface] = (),
    *,
    edge_length: float | None = None,
    deviation: float | None = None,
    epsilon: float | None = None,
    stop_energy: float = STOP_ENERGY,
    time_limit: float = TIME_LIMIT,
    cache: bool | str | Path = True,
) -> TetMesh:
    """Mesh the inside of a closed surface with tetrahedra that conform to the closed surfaces of its regions.

    The surfaces are decimated within a measured distance, pytetwild meshes the result in a separate process, and the
    nodes on surfaces are moved onto the given ones. Meshes are cached on disk.

    Parameters
    ----------
    surface : Surface
    regions : sequence of Surface
        Closed surfaces inside the body or inside each other, in any order; see `check_regions`. A tetrahedron is in
        region i if surface i, counted from 1, is the innermost that contains it, and in region 0 if none contains it.
    edge_length : float, optional
        Target edge length, unit; a twelfth of the bounding box's diagonal if not given. Edges are shorter where
        thin parts need it.
    deviation : float, optional
        Largest distance of the mesher's boundary from `surface` before its nodes are moved back, unit. If not
        given, it follows from `epsilon`, or else is a hundredth of the diagonal, and less for thin bodies. It is
        smaller for small inner surfaces and thin regions. Gaps between surfaces that are thinner may be closed.
    epsilon : float, optional
        fTetWild's envelope: the largest distance between its input surface and its boundary, as a share of the
        diagonal; 0.55 of `deviation` if not given.
    stop_energy : float
        fTetWild's AMIPS energy at which a tetrahedron is good enough; 3 is a regular one.
    time_limit : float
        Seconds until the mesher is stopped; 300 if not given.
    cache : bool, str or Path
        Whether to use the mesh cache in the user's cache directory, or another directory for it.

    Returns
    -------
    TetMesh

    Raises
    ------
    InputError
        If `edge_length`, `deviation`, `epsilon`, `stop_energy` or `time_limit` is not positive, or an inner surface
        bounds no region of the body, see `check_regions`.
    RunError
        If the mesher is not installed, crashes, exceeds the time limit, or returns a mesh of another body.

    Notes
    -----
    fTetWild (Hu et al. 2020) is not deterministic: the number of nodes varies by about one per cent between runs.

    Examples
    --------
    >>> from tetlux.meshing import sphere
    >>> mesh = tetrahedralize(sphere(10.0))
    >>> 2000 < len(mesh.tetrahedra) < 4000
    True
    >>> abs(mesh.volume / sphere(10.0).volume - 1.0) < 0.04
    True
    """
    for name, value in (
        ("edge_length", edge_length),
        ("deviation", deviation),
        ("epsilon", epsilon),
        ("stop_energy", stop_energy),
        ("time_limit", time_limit),
    ):
        if value is not None and not 0 < value < math.inf:
            raise InputError(f"{name} is {value:g}; give a number greater than 0.")
    if not _is_installed():
        raise RunError(f"{surface.name}: {NOT_INSTALLED}")
    if deviation is None and epsilon is None:
        check_thickness(surface)
    target_length, deviation, envelope = default_lengths(surface, edge_length, deviation, epsilon)
    directory = None if cache is False else cache_directory() if cache is True else Path(cache)
    key = ""
    if directory is not None:
        key = _key(surface, regions, target_length, deviation, envelope, stop_energy)
        cached = load_cached_mesh(key, directory, surface.unit)
        if cached is not None:
            return cached
    mesh = _mesh_body(surface, target_length, deviation, envelope, stop_energy, time_limit, regions)
    if directory is not None:
        store_cached_mesh(key, directory, mesh)
    return mesh


def is_cached(surface: Surface, regions: Sequence[Surface] = ()) -> bool:
    """Whether the mesh that `tetrahedralize` makes by default is in the user's cache."""
    directory = cache_directory()
    # Surfaces need not be hashed where the cache has no mesh at all.
    if directory is None or next(directory.glob("*.npz"), None) is None or not _is_installed():
        return False
    return is_entry(_key(surface, regions, *default_lengths(surface), STOP_ENERGY), directory)


def _is_installed() -> bool:
    return importlib.util.find_spec("pytetwild") is not None


def _key(
    surface: Surface, regions: Sequence[Surface], length: float, deviation: float, envelope: float, stop: float
) -> str:
    """The cache key of a mesh."""
    versions = {name.replace("-", "_"): version(name) for name in ("pytetwild", "fast-simplification")}
    lengths = {"edge_length": length, "deviation": deviation, "envelope": envelope}
    return mesh_key(surface, regions, **lengths, stop_energy=stop, **versions)


def check_thickness(surface: Surface) -> None:
    """Refuse a body that is so thin that the mesher would take minutes.

    Raises
    ------
    InputError
    """
    thickness = 2.0 * surface.volume / surface.area
    if thickness >= THINNEST * surface.diagonal:
        return
    share = thickness / surface.diagonal
    thin = f"{surface.name} is {thickness:.3g} {surface.unit} thick on average, {share:.1g} of its size, and"
    if surface.overlaps:
        raise InputError(
            f"{thin} crosses or touches itself: its two sides nearly cancel each other; if it is a two-sided export, "
            "export one side."
        )
    raise InputError(
        f"{thin} below {THINNEST:g} tetrahedra that fit into it are too many; make it thicker, or take a smaller piece "
        "of it."
    )


def _mesh_body(
    surface: Surface,
    edge_length: float,
    deviation: float,
    envelope: float,
    stop_energy: float,
    time_limit: float,
    regions: Sequence[Surface] = (),
) -> TetMesh:
    """Mesh the body; if the first mesh does not match the surface, mesh again within a smaller deviation."""
    end = time.monotonic() + time_limit
    shells = make_shells(surface, regions, deviation)
    if len(regions) > 0:
        envelope = min(envelope, *(ENVELOPE * shell.deviation for shell in shells))
    # Where two surfaces touch, fTetWild loses the orientation of their triangles, so its inside test fails.
    filtered = not any(shell.touching for shell in shells)

    def attempt(share: float) -> TetMesh:
        coarse = [
            shell.surface if shell.touching else proxy(shell.surface, share * (1.0 - ENVELOPE) * shell.deviation)
            for shell in shells
        ]
        seconds = end - time.monotonic()
        mesh = _mesh_proxies(
            surface, regions, coarse, edge_length, share * envelope, stop_energy, seconds, time_limit, filtered
        )
        for shell in shells:
            check_body(part_of(mesh, shell), shell.surface, share * shell.deviation)
        return mesh

    try:
        mesh = attempt(1.0)
        lost = any(has_lost_part(mesh, shell) for shell in shells)
    except NotTheBodyError:
        lost = True
    return attempt(SECOND_ATTEMPT) if lost else mesh


def _mesh_proxies(
    surface: Surface,
    regions: Sequence[Surface],
    coarse: Sequence[Surface],
    edge_length: float,
    envelope: float,
    stop_energy: float,
    seconds: float,
    time_limit: float,
    filtered: bool,
) -> TetMesh:
    """Mesh the proxies of the surfaces, and move the nodes on the proxies to the surfaces."""
    # Scaled to unit size about the origin, since some of fTetWild's tolerances are absolute.
    origin, size = surface.points.mean(axis=0), surface.diagonal
    first = np.cumsum([0, *(len(each.points) for each in coarse)])
    points, tetrahedra = run_pytetwild(
        (np.concatenate([each.points for each in coarse]) - origin) / size,
        np.concatenate([each.faces + start for each, start in zip(coarse, first, strict=False)]),
        edge_length=edge_length / size,
        # fTetWild takes epsilon relative to the diagonal of its input.
        epsilon=envelope / coarse[0].diagonal,
        stop_energy=stop_energy,
        seconds=seconds,
        time_limit=time_limit,
        name=surface.name,
        filtered=filtered,
    )
    points = points * size + origin
    tags = tag_tetrahedra(points, tetrahedra, coarse[0], coarse[1:], envelope) if len(regions) > 0 else None
    mesh = _remove_debris(points, tetrahedra, surface, tags)
    return move_to_surface(mesh, surface, regions)


def _remove_debris(points: FloatArray, tetrahedra: IntArray, surface: Surface, tags: IntArray | None = None) -> TetMesh:
    """Make a mesh without flat tetrahedra, debris, unused nodes and tetrahedra tagged as outside (-1).

    Debris are small separate tetrahedra that fTetWild leaves inside its envelope, beside the body.
    """
    if tags is not None:
        tetrahedra, tags = tetrahedra[tags >= 0], tags[tags >= 0]
    if len(tetrahedra) == 0 or not np.isfinite(points).all():
        raise RunError(f"{surface.name}: the mesher returned no tetrahedra; repair the surface in a mesh editor.")
    volumes = tetrahedron_volumes(points, tetrahedra)
    if (volumes < 0).any():
        raise RunError(f"{surface.name}: the mesher returned inverted tetrahedra; repair the surface in a mesh editor.")
    keep = volumes > 0
    component = bodies(len(points), tetrahedra)
    share = np.bincount(component, volumes) / volumes.sum()
    keep &= share[component] > _largest_debris(surface)
    mesh = TetMesh(*compact(points, tetrahedra[keep]), surface.unit)
    return mesh if tags is None else replace(mesh, regions=tags[keep])


def _largest_debris(surface: Surface) -> float:
    """The share of the volume below which a connected component is debris: less than any body of the surface has."""
    if surface.overlaps:
        return DEBRIS
    volume, _ = body_sizes(surface.points, surface.faces, bodies(len(surface.points), surface.faces))
    return min(DEBRIS, 0.5 * float(volume.min() / volume.sum()))
