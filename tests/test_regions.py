"""Regions: closed surfaces inside the body, and inside each other."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import permutations
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.conftest import block
from tetlux.meshing import (
    InputError,
    RunError,
    Surface,
    TetMesh,
    box,
    check_regions,
    cylinder,
    refine,
    slab,
    sphere,
    surface_from_arrays,
    tetrahedralize,
)
from tetlux.meshing.arrays import FloatArray, IntArray
from tetlux.meshing.files.meshes import read_mesh, write_mesh
from tetlux.meshing.mesher import api as mesher
from tetlux.meshing.mesher import shells
from tetlux.meshing.mesher.cache import load_cached_mesh, mesh_key, store_cached_mesh
from tetlux.meshing.tets.nesting import Nesting, nesting
from tetlux.meshing.tets.refine import move_to_surface
from tetlux.meshing.tets.tagging import tag_tetrahedra

OUTER, INNER = sphere(10.0, subdivisions=3), sphere(5.0, subdivisions=3)
LAYERS = [box((60.0, 60.0, 2.0), center=(0.0, 0.0, -1.0)), box((60.0, 60.0, 3.0), center=(0.0, 0.0, -3.5))]


@pytest.fixture(scope="module")
def concentric() -> TetMesh:
    return tetrahedralize(OUTER, [INNER])


@pytest.fixture(scope="module")
def layered() -> TetMesh:
    return tetrahedralize(slab(60.0, 10.0), LAYERS)


def volumes(mesh: TetMesh, count: int) -> FloatArray:
    return np.asarray(np.bincount(mesh.regions, mesh.volumes, count), dtype=np.float64)


def middles(mesh: TetMesh) -> FloatArray:
    return np.asarray(mesh.points[mesh.tetrahedra].mean(axis=1))


def cubes() -> TetMesh:
    """A block of 4 x 4 x 4 whose inner 2 x 2 x 2 are region 1: its middle is (0, 0, -2)."""
    mesh = block((4, 4, 4), (4.0, 4.0, 4.0))
    inner = (np.abs(middles(mesh) + np.array([0.0, 0.0, 2.0])) < 1.0).all(axis=1)
    return replace(mesh, regions=inner.astype(np.int64))


def test_a_mesh_has_one_region_unless_told() -> None:
    mesh = block((1, 1, 1), (1.0, 1.0, 1.0))
    assert mesh.regions.tolist() == [0] * 6
    assert len(mesh.interfaces[0]) == 0
    wrong: Any
    for wrong in (np.zeros(5, dtype=int), np.zeros(6)):
        with pytest.raises(InputError, match="numbers of regions"):
            replace(mesh, regions=wrong)


def test_interfaces_are_the_triangles_between_regions() -> None:
    mesh = cubes()
    faces, pairs, _ = mesh.interfaces
    assert len(faces) == 6 * 4 * 2
    assert (pairs == [0, 1]).all()
    # They face from the body to the region: towards its middle.
    corners = mesh.points[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert (np.einsum("ij,ij->i", normals, corners.mean(axis=1) - [0, 0, -2]) < 0).all()
    assert np.linalg.norm(normals, axis=1).sum() / 2 == pytest.approx(6 * 4)


def test_concentric_spheres(concentric: TetMesh) -> None:
    # Over seven runs the region was 3.1 to 3.2 % small, the whole body 2.3 to 2.4 %, the worst quality 0.28 to 0.39,
    # and middles of tetrahedra were within 4.63 of the centre or beyond 5.15.
    assert volumes(concentric, 2)[1] == pytest.approx(INNER.volume, rel=0.045)
    assert concentric.volume == pytest.approx(OUTER.volume, rel=0.03)
    assert concentric.quality.min() > 0.1
    away = np.linalg.norm(middles(concentric), axis=1)
    assert away[concentric.regions == 1].max() < 4.9
    assert away[concentric.regions == 0].min() > 4.9


def test_nodes_between_regions_are_on_the_inner_surface(concentric: TetMesh) -> None:
    points = concentric.points[np.unique(concentric.interfaces[0])]
    off = np.abs(np.linalg.norm(points, axis=1) - 5.0)
    # Over seven runs: all, by 1.5e-4 at most, since the smooth surface of 1,280 triangles is no exact sphere; the
    # mesher's own nodes are up to a hundredth of the radius off.
    assert (off < 3e-4).mean() > 0.97


def test_two_inclusions_off_centre() -> None:
    body = box((20.0, 20.0, 20.0))
    inner = [
        sphere(2.0, center=(3.0, 4.0, 5.0), subdivisions=2),
        sphere(3.0, center=(-3.0, -4.0, -5.0), subdivisions=2),
    ]
    mesh = tetrahedralize(body, inner)
    # Over seven runs: -0.9 to -0.1 %, the whole -0.03 to -0.01 %, and middles below 0.97 or above 1.04 radii.
    for found, surface in zip(volumes(mesh, 3)[1:], inner, strict=True):
        assert found == pytest.approx(surface.volume, rel=0.02)
    assert mesh.volume == pytest.approx(8000.0, rel=0.002)
    for region, (centre, radius) in enumerate((((3.0, 4.0, 5.0), 2.0), ((-3.0, -4.0, -5.0), 3.0)), 1):
        away = np.linalg.norm(middles(mesh) - centre, axis=1)
        assert away[mesh.regions == region].max() < radius
        assert away[mesh.regions != region].min() > radius


def test_three_levels_in_any_order() -> None:
    """The tags follow the order given; the nesting does not depend on it."""
    radii = (8.0, 6.0, 3.0)
    levels = {r: sphere(r, subdivisions=2) for r in radii}
    for order in permutations(radii):
        parents = nesting(OUTER, [levels[r] for r in order]).parents
        around = [0 if p == 0 else order[p - 1] for p in parents]
        assert dict(zip(order, around, strict=True)) == {8.0: 0, 6.0: 8.0, 3.0: 6.0}
    order = (6.0, 3.0, 8.0)
    mesh = tetrahedralize(OUTER, [levels[r] for r in order])
    away = np.linalg.norm(middles(mesh), axis=1)
    for i, r in enumerate(order, 1):
        below = {8.0: 6.0, 6.0: 3.0, 3.0: 0.0}[r]
        of_shells = levels[r].volume - (levels[below].volume if below else 0.0)
        # Over seven runs: -0.9 to +0.1 %, and middles below 0.97 of the outer radius or above 1.01 of the inner one.
        assert volumes(mesh, 4)[i] == pytest.approx(of_shells, rel=0.02)
        assert away[mesh.regions == i].max() < r
        assert away[mesh.regions == i].min() > below


def test_layers_that_share_sides_with_the_body_and_each_other(layered: TetMesh) -> None:
    # Over seven runs: 0.1 % off at most, the worst quality 0.09 to 0.21, and all nodes in their planes.
    assert volumes(layered, 3) == pytest.approx([18000.0, 7200.0, 10800.0], rel=0.003)
    assert layered.quality.min() > 0.05
    faces, pairs, _ = layered.interfaces
    for pair, height in (([1, 2], -2.0), ([0, 2], -5.0)):
        z = layered.points[faces[(pairs == pair).all(axis=1)]][:, :, 2]
        # Those at the rim, which belong to the body's surface too, included.
        assert (np.abs(z - height) < 1e-9).mean() > 0.97


def test_nodes_where_surfaces_meet_aslant_go_to_both() -> None:
    """A wedge on the body; going to one surface and then to the other once would leave the first."""
    mesh = block((4, 4, 4), (10.0, 10.0, 10.0))
    upper = middles(mesh)[:, 2] > -5.0
    x, y, z = mesh.points.T
    sheared = np.column_stack([0.98 * x, y, z + 0.5 * x * (1.0 - np.abs(z + 5.0) / 5.0)])
    top = box((10.0, 10.0, 5.0), center=(0.0, 0.0, -2.5))
    wedge = Surface(top.points + np.outer(top.points[:, 2] < -1.0, [0.0, 0.0, 0.5]) * top.points[:, :1], top.faces)
    mesh = TetMesh(sheared, mesh.tetrahedra, regions=upper.astype(np.int64))
    moved = move_to_surface(mesh, slab(10.0, 10.0), [wedge])
    points = moved.points[np.unique(mesh.interfaces[0])]
    assert points[:, 2] == pytest.approx(0.5 * points[:, 0] - 5.0, abs=1e-6)
    assert np.abs(points[:, 0]).max() == pytest.approx(5.0, abs=1e-6)


def test_layers_may_fill_the_body() -> None:
    """Three that touch are what fTetWild's own filter makes holes into."""
    mesh = tetrahedralize(slab(60.0, 10.0), [*LAYERS, box((60.0, 60.0, 5.0), center=(0.0, 0.0, -7.5))])
    # Over seven runs: 0.1 % off at most.
    assert not (mesh.regions == 0).any()
    assert volumes(mesh, 4)[1:] == pytest.approx([7200.0, 10800.0, 18000.0], rel=0.003)


def test_what_the_mesher_may_stray_follows_from_thickness_unless_nothing_is_left() -> None:
    for upper in np.random.default_rng(0).uniform(1.0, 4.0, 20):
        layers = [
            box((60.0, 60.0, upper), center=(0.0, 0.0, -0.5 * upper)),
            box((60.0, 60.0, 5.0 - upper), center=(0.0, 0.0, -0.5 * (upper + 5.0))),
        ]
        body, *_ = shells.make_shells(slab(60.0, 5.0), layers, 1.0)
        assert body.deviation == 1.0
    body, inner = shells.make_shells(OUTER, [sphere(9.9, subdivisions=3)], 2.0)
    # The gap is 0.1 wide, and both of its sides are to keep out of each other's way.
    assert (body.deviation, inner.deviation) == pytest.approx((0.025, 0.025), rel=0.02)
    body, inner = shells.make_shells(OUTER, [INNER], 0.6)
    assert body.deviation == 0.6
    assert inner.deviation == pytest.approx(shells.INNER_DEVIATION * 10.0 * np.sqrt(3), rel=0.01)


def test_a_thin_gap_stays_open() -> None:
    """Around it the surfaces as decimated by default would be more than its width off."""
    core = sphere(9.5, subdivisions=3)
    mesh = tetrahedralize(OUTER, [core])
    # Over seven runs: +1.7 to +2.5 % and -0.5 to -0.3 %.
    assert volumes(mesh, 2) == pytest.approx([OUTER.volume - core.volume, core.volume], rel=0.05)
    assert not np.isin(mesh.interfaces[0], mesh.boundary_nodes).any()
    assert set(mesh.regions[mesh.boundary_cells]) == {0}


def test_finely_divided_surfaces_that_touch_are_not_decimated_apart(monkeypatch: pytest.MonkeyPatch) -> None:
    def decimate(*_: object) -> Surface:
        raise AssertionError

    monkeypatch.setattr(mesher, "proxy", decimate)
    rod = cylinder(4.0, 8.0, segments=48)
    end = cylinder(4.0, 2.0, center=(0.0, 0.0, 3.0), segments=48)
    assert nesting(rod, [end]).touching == (True, True)
    mesh = tetrahedralize(rod, [end])
    # Over seven runs: -0.6 to -0.4 %, the worst quality 0.10 to 0.48.
    assert volumes(mesh, 2)[1] == pytest.approx(end.volume, rel=0.015)
    assert mesh.quality.min() > 0.05


def test_a_thin_plate_and_a_small_ball() -> None:
    plate, ball = box((8.0, 8.0, 0.8)), sphere(1.0, center=(0.0, 0.0, 7.0), subdivisions=2)
    mesh = tetrahedralize(OUTER, [plate, ball])
    # Over seven runs: -0.3 to 0 % and -1.4 to -0.7 %.
    assert volumes(mesh, 3)[1] == pytest.approx(plate.volume, rel=0.01)
    assert volumes(mesh, 3)[2] == pytest.approx(ball.volume, rel=0.03)


def test_refinement_keeps_regions_and_converges_at_second_order(concentric: TetMesh) -> None:
    """A chord's distance from its arc goes with its square, also inside the body."""
    outer, inner = sphere(10.0, subdivisions=5), sphere(5.0, subdivisions=5)
    mesh, errors, sizes = concentric, [], []
    for longest in (3.0, 1.5, 0.75):
        while True:
            near = np.zeros(len(mesh.points), dtype=bool)
            near[mesh.interfaces[0]] = True
            marked = near[mesh.tetrahedra].any(axis=1) & (mesh.longest_edges > longest)
            if not marked.any():
                break
            mesh = refine(mesh, marked, outer, [inner])
        corners = mesh.points[mesh.interfaces[0]]
        sizes.append(float(np.sqrt(((corners - corners[:, [1, 2, 0]]) ** 2).sum(axis=2).mean())))
        errors.append(1.0 - float(volumes(mesh, 2)[1]) / (500.0 * np.pi / 3.0))
    rates = np.diff(np.log(errors)) / np.diff(np.log(sizes))
    # Over seven runs: 1.86 to 1.88 and 1.99 to 2.02, and 0.0040 to 0.0042 at last.
    assert (np.abs(rates - 2.0) < 0.3).all()
    assert errors[-1] < 0.006
    away = np.linalg.norm(middles(mesh), axis=1)
    assert away[mesh.regions == 1].max() < 5.0
    assert away[mesh.regions == 0].min() > 4.95


def test_parts_of_a_tetrahedron_are_in_its_region() -> None:
    mesh = cubes()
    marked = np.random.default_rng(0).random(len(mesh.tetrahedra)) < 0.3
    fine = refine(mesh, marked)
    inside = (np.abs(middles(fine) + np.array([0.0, 0.0, 2.0])) < 1.0).all(axis=1)
    assert (fine.regions == inside).all()
    assert volumes(fine, 2) == pytest.approx([56.0, 8.0])


def test_the_middle_of_an_edge_through_a_region_stays_where_it_is() -> None:
    """Both ends of such an edge are on the inner surface, and the edge is not."""
    mesh = block((3, 3, 3), (3.0, 3.0, 3.0))
    inner = np.asarray((np.abs(middles(mesh) - [0.0, 0.0, -1.5]) < 0.5).all(axis=1))
    mesh = replace(mesh, regions=inner.astype(np.int64))
    body, around = slab(3.0, 3.0), sphere(0.8, center=(0.0, 0.0, -1.5))
    seen = 0
    # Longest edges first: the diagonal through the inner cube, then those of its sides.
    for between in (0, 6):
        marked = np.ones(len(mesh.tetrahedra), dtype=bool)
        straight, fine = refine(mesh, marked), refine(mesh, marked, body, [around])
        new = np.arange(len(mesh.points), len(fine.points))
        moved = new[np.linalg.norm(fine.points[new] - straight.points[new], axis=1) > 1e-9]
        assert (moved == np.intersect1d(new, fine.interfaces[0])).all()
        assert len(moved) == between
        seen += int((np.abs(straight.points[new] - [0.0, 0.0, -1.5]) < 1e-9).all(axis=1).sum())
        assert seen == 1
        mesh = straight


def test_a_mesh_with_more_regions_than_surfaces_is_refused() -> None:
    mesh = replace(cubes(), regions=2 * cubes().regions)
    with pytest.raises(InputError, match="region 2, and 1 inner surfaces"):
        refine(mesh, np.ones(len(mesh.tetrahedra), dtype=bool), OUTER, [INNER])


@pytest.mark.parametrize("kept", [True, False])
def test_tetrahedra_in_the_envelope_follow_their_neighbours(kept: bool) -> None:
    """Without nodes on the surface, or where it is far off, each answers for itself."""
    mesh = block((8, 8, 8), (4.0, 4.0, 4.0))
    inside = np.asarray((np.abs(middles(mesh) + np.array([0.0, 0.0, 2.0])) < 1.0).all(axis=1))
    body = box((4.0, 4.0, 4.0), center=(0.0, 0.0, -2.0))
    inner = box((2.0, 2.0, 2.0), center=(0.13, 0.0, -2.0))
    alone = inner.contains(middles(mesh))
    on = np.isclose(np.abs(mesh.points + np.array([0.0, 0.0, 2.0])).max(axis=1), 1.0)
    # Those along the cube's edges, all of whose corners are on it, answer for themselves in any case.
    some = ~on[mesh.tetrahedra].all(axis=1)
    assert (alone != inside)[some].sum() > 40
    tags = tag_tetrahedra(mesh.points, mesh.tetrahedra, body, [inner], 0.2 if kept else 0.01)
    assert (tags == (inside if kept else alone))[some].all()
    # What is outside the body is in no region, though its surface as decimated may leave the body's.
    for regions, tag in (([], 0), ([body], 1)):
        tags = tag_tetrahedra(mesh.points, mesh.tetrahedra, inner, regions, 0.2)
        assert (tags == np.where(inside, tag, -1))[some].all()


def test_the_cache_tells_regions_and_remembers_them(tmp_path: Path) -> None:
    small = sphere(4.0, subdivisions=3)
    keys = [
        mesh_key(OUTER, inner, version="1")
        for inner in ((), (INNER,), (small,), (INNER, small), (small, INNER), (replace(INNER, crease_angle=0.0),))
    ]
    assert len(set(keys)) == len(keys)
    mesh = cubes()
    store_cached_mesh("a", tmp_path, mesh)
    again = load_cached_mesh("a", tmp_path, "mm")
    assert again is not None
    assert (again.regions == mesh.regions).all()
    for regions in (None, mesh.regions[:-1], mesh.regions - 1, mesh.regions.astype(np.float64)):
        content = {"points": mesh.points, "tetrahedra": mesh.tetrahedra, "key": np.array("a")}
        if regions is not None:
            content["regions"] = regions
        np.savez(tmp_path / "a.npz", **content)  # type: ignore[arg-type]
        assert load_cached_mesh("a", tmp_path, "mm") is None


def test_the_mesher_runs_once_for_the_same_regions(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    runs: list[Sequence[Surface]] = []

    def make(*given: object) -> TetMesh:
        runs.append(given[-1])  # type: ignore[arg-type]
        return cubes()

    monkeypatch.setattr(mesher, "_mesh_body", make)
    first = tetrahedralize(OUTER, [INNER], cache=tmp_path)
    second = tetrahedralize(OUTER, [INNER], cache=tmp_path)
    # Nor is what would have been refused taken for the same.
    assert mesh_key(OUTER, [INNER]) != mesh_key(OUTER, [replace(INNER, unit="cm")])
    assert (first.regions == second.regions).all()
    assert runs == [[INNER]]
    tetrahedralize(OUTER, cache=tmp_path)
    assert len(runs) == 2


@pytest.mark.parametrize("suffix", [".vtu", ".msh"])
def test_files_hold_regions(suffix: str, tmp_path: Path) -> None:
    path = tmp_path / f"cubes{suffix}"
    write_mesh(cubes(), path)
    assert (read_mesh(path).regions == cubes().regions).all()
    write_mesh(block((1, 1, 1), (1.0, 1.0, 1.0)), path)
    assert b"region" not in path.read_bytes()


def merged(*parts: Surface) -> Surface:
    first = np.cumsum([0, *(len(part.points) for part in parts)])
    faces = [part.faces + start for part, start in zip(parts, first, strict=False)]
    return surface_from_arrays(np.concatenate([p.points for p in parts]), np.concatenate(faces), name="parts")


BODY = box((10.0, 10.0, 10.0))


@pytest.mark.parametrize(
    ("inner", "message"),
    [
        (
            [sphere(1.0, center=(20, 0, 0))],
            r"region 1 \(sphere\) lies outside the body \(box\), around \(20, 0, 0\); move",
        ),
        ([box((2, 2, 2), center=(6, 0, 0))], "region 1 .* lies outside the body"),
        ([sphere(20.0)], r"region 1 \(sphere\) holds the body \(box\) and not the other way round"),
        (
            [sphere(1.0), sphere(1.0, center=(4.5, 0, 0))],
            r"region 2 .* crosses the surface of the body .* around \(5, ",
        ),
        ([box((2, 20, 2))], "region 1 .* crosses the surface of the body"),
        ([box((2, 2, 2), center=(5, 0, 0))], "region 1 .* crosses the surface of the body"),
        ([merged(sphere(1.0), sphere(1.0, center=(20, 0, 0)))], r"region 1 \(parts\) crosses .* around \("),
        ([sphere(2.0), sphere(2.0, center=(1, 0, 0))], r"region 1 .* and region 2 .* cross each other around \("),
        ([box((2, 4, 1)), box((4, 2, 1))], "region 1 .* and region 2 .* cross each other"),
        # No edge of one runs through a triangle of the other, clear of its rim.
        ([box((2, 2, 2)), box((2, 2, 2), center=(1, 1, 0))], "region 1 .* and region 2 .* cross each other"),
        ([BODY], r"region 1 \(box\) is the whole body; give its medium to the body"),
        ([sphere(2.0), sphere(1.0), sphere(2.0)], "region 1 .* and region 3 .* are the same surface"),
        ([sphere(1.0, unit="cm")], "region 1 .* is in cm and the body in mm; give both in one unit"),
    ],
)
def test_surfaces_that_bound_no_region(inner: list[Surface], message: str) -> None:
    with pytest.raises(InputError, match=message):
        check_regions(BODY, inner)
    with pytest.raises(InputError, match=message):
        tetrahedralize(BODY, inner, cache=False)


def test_surfaces_that_bound_regions() -> None:
    check_regions(BODY, [])
    # Nested both ways; touching along a face, at a part of it, along an edge, at a point; two bodies in one.
    cube = box((2, 2, 2))
    for inner in (
        [cube, box((4, 4, 4))],
        [box((4, 4, 4)), cube],
        [cube, box((2, 2, 2), center=(2, 0, 0))],
        [cube, box((2, 2, 2), center=(2, 1, 0))],
        [cube, box((2, 2, 2), center=(2, 2, 0))],
        [cube, box((2, 2, 2), center=(2, 2, 2))],
        [cube, box((2, 2, 2), center=(4, 0, 0))],
        [box((4, 4, 4)), box((2, 2, 2), center=(1, 0, 0))],
        [merged(sphere(1.0), sphere(1.0, center=(3, 0, 0)))],
    ):
        check_regions(BODY, inner)
    assert nesting(BODY, [cube, box((4, 4, 4))]).parents == (2, 0)
    assert nesting(BODY, [cube, box((2, 2, 2), center=(2, 1, 0))]) == Nesting((0, 0), (False, True, True))
    assert nesting(slab(60.0, 10.0), LAYERS).touching == (True, True, True)


def test_the_same_at_every_scale() -> None:
    for scale in (1e-9, 1e9):
        body, inner = (Surface(s.points * scale, s.faces) for s in (BODY, sphere(1.0, center=(4.5, 0, 0))))
        with pytest.raises(InputError, match="crosses"):
            check_regions(body, [inner])
        check_regions(body, [Surface(INNER.points * 0.2 * scale, INNER.faces)])


def test_a_region_that_the_mesher_lost_is_missed(monkeypatch: pytest.MonkeyPatch) -> None:
    """A mesh without nodes where the region is."""
    whole = block((3, 3, 3), (10.0, 10.0, 10.0))
    points = (whole.points + np.array([0.0, 0.0, 5.0])) / BODY.diagonal
    epsilons: list[float] = []

    def run(*_: object, epsilon: float, **__: object) -> tuple[FloatArray, IntArray]:
        epsilons.append(epsilon)
        return points, whole.tetrahedra

    monkeypatch.setattr(mesher, "run_pytetwild", run)
    with pytest.raises(RunError, match=r"region 1 \(sphere\): the mesh lost it, .*; leave it out, or make it larger\."):
        tetrahedralize(BODY, [sphere(0.2, center=(0.1, 0.2, 0.3))], cache=False)
    assert epsilons[1] == pytest.approx(mesher.SECOND_ATTEMPT * epsilons[0])
    with pytest.raises(
        RunError, match=r"region 1 \(sphere\): the mesh's area is .* make them thicker, or leave them out\."
    ):
        tetrahedralize(BODY, [sphere(3.0)], cache=False)


def test_a_region_that_would_keep_the_mesher_busy_for_minutes_is_refused() -> None:
    check_regions(sphere(10.0), [sphere(0.2, subdivisions=2)])
    with pytest.raises(InputError, match=r"region 2 is 0\.1\d* mm across, less than 0\.5% of the body"):
        check_regions(sphere(10.0), [sphere(0.2, subdivisions=2), sphere(0.04, center=(3.0, 0.0, 0.0))])


def test_nested_regions_are_decimated_as_the_body_is(monkeypatch: pytest.MonkeyPatch) -> None:
    """Four spheres of 5,120 triangles each: the mesher is given a sixth of them."""
    given: list[int] = []

    def count_triangles(_: FloatArray, faces: IntArray, **__: Any) -> None:
        given.append(len(faces))
        raise RunError("enough")

    monkeypatch.setattr(mesher, "run_pytetwild", count_triangles)
    with pytest.raises(RunError, match="enough"):
        tetrahedralize(sphere(40.0), regions=[sphere(radius) for radius in (36.0, 34.0, 30.0)], cache=False)
    assert len(given) == 1
    assert given[0] < 5120
