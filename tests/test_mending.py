"""What is mended of a surface: seams, two-sided exports, holes, specks. Each has its body's volume afterwards."""

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from tests.fuzz.surfaces import bulging, cube_of_quads
from tetlux.cases.cli import main
from tetlux.meshing import InputError, Surface, box, cylinder, sphere, surface_from_arrays, tetrahedralize
from tetlux.meshing.arrays import FloatArray, IntArray
from tetlux.meshing.mesher.api import check_thickness
from tetlux.meshing.repair.caps import cap, triangulate_polygon
from tetlux.meshing.repair.specks import SPECK
from tetlux.meshing.repair.topology import Edges

BALL = sphere(10.0, subdivisions=2)
FINE = sphere(10.0, subdivisions=4)
Arrays = tuple[FloatArray, IntArray]


def together(*parts: Arrays) -> Arrays:
    first = np.cumsum([0, *(len(points) for points, _ in parts)])
    faces = [faces + start for (_, faces), start in zip(parts, first, strict=False)]
    return np.vstack([points for points, _ in parts]), np.vstack(faces)


def loose(points: FloatArray, faces: IntArray) -> Arrays:
    """Triangles that share no vertex."""
    return points[faces].reshape(-1, 3), np.arange(3 * len(faces)).reshape(-1, 3)


def strip_box(left: list[float], right: list[float]) -> Arrays:
    """A box 2 x 1 x 1 whose two halves, joined at x = 0, are cut at different heights along that seam's edges."""
    parts = []
    for sign, cuts in ((-1.0, left), (1.0, right)):
        z = np.array([0.0, *cuts, 1.0])
        ring = np.array([[sign, 0], [0, 0], [0, 1], [sign, 1]])
        for a, b in ((0, 1), (2, 3), (3, 0)):
            for low, high in pairwise(z):
                corners = np.array([[*ring[a], low], [*ring[b], low], [*ring[b], high], [*ring[a], high]])
                parts.append((corners, np.array([[0, 1, 2], [0, 2, 3]])))
        for height in (0.0, 1.0):
            corners = np.column_stack([ring, np.full(4, height)])
            parts.append((corners, np.array([[0, 2, 1], [0, 3, 2]])))
    return together(*parts)


@pytest.mark.parametrize(
    ("left", "right", "count"),
    [
        pytest.param([], [0.5], 2, id="one"),
        pytest.param([], [0.2, 0.4, 0.6, 0.9], 8, id="several on one edge"),
        pytest.param([0.3], [0.5], 4, id="on both sides of a seam"),
        pytest.param([0.3, 0.31, 0.8], [0.1, 0.5], 10, id="a chain"),
    ],
)
def test_vertices_on_edges_are_stitched(left: list[float], right: list[float], count: int) -> None:
    points, faces = strip_box(left, right)
    # Oblique and far: no coordinate is round, as in a file of seven digits.
    turn = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0]
    points = (20.0 * points @ turn + [3.0, 50.0, 7.0]).astype(np.float32)
    surface = surface_from_arrays(points, faces)
    assert surface.volume == pytest.approx(16_000, rel=1e-5)
    assert f"stitched {count} T-junctions." in surface.repairs
    assert surface.warnings == ()
    assert Edges(surface.faces).closed


def test_a_triangle_with_vertices_on_each_side_is_stitched() -> None:
    """A tetrahedron, one of whose faces is cut into four, and its neighbours not."""
    corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [0.5, 0, 0], [0.5, 0.5, 0], [0, 0.5, 0]])
    faces = [[0, 6, 4], [4, 5, 1], [6, 2, 5], [4, 6, 5], [0, 1, 3], [1, 2, 3], [2, 0, 3]]
    surface = surface_from_arrays(corners, faces)
    assert surface.volume == pytest.approx(1 / 6)
    assert surface.repairs == ("stitched 3 T-junctions.",)


def test_a_part_missing_is_no_seam() -> None:
    points, faces = strip_box([], [0.5])
    with pytest.raises(InputError, match="a hole of"):
        surface_from_arrays(points, faces[:-2])


def test_a_crack_of_hairs_is_joined() -> None:
    points, faces = loose(BALL.points, BALL.faces)
    apart = points + np.random.default_rng(0).normal(scale=1e-5, size=points.shape)
    surface = surface_from_arrays(apart, faces)
    assert surface.volume == pytest.approx(BALL.volume, rel=1e-5)
    assert len(surface.points) == len(BALL.points)
    assert any("hair cracks" in repair for repair in surface.repairs)


def test_corners_in_two_cells_of_a_grid_are_one() -> None:
    """Nearer than the tolerance, wherever a grid has its lines."""
    points, faces = loose(BALL.points, BALL.faces)
    step = 0.4e-7 * BALL.diagonal
    for seed in range(5):
        random = np.random.default_rng(seed)
        nudged = points + random.choice([0.0, step], size=(len(points), 1)) * np.array([1.0, 0.0, 0.0])
        surface = surface_from_arrays(nudged + random.uniform(size=3), faces)
        assert len(surface.points) == len(BALL.points)
        assert surface.repairs == ()


def test_what_is_thin_is_not_merged() -> None:
    plate = box((1.0, 1.0, 1e-6))
    assert len(surface_from_arrays(plate.points, plate.faces).points) == 8


def turned_over(faces: IntArray) -> IntArray:
    return np.asarray(faces[:, ::-1])


POINTS, FACES = BALL.points, BALL.faces
FLIPPED = np.where(np.random.default_rng(1).random((len(FACES), 1)) < 0.5, FACES, turned_over(FACES))


@pytest.mark.parametrize(
    "arrays",
    [
        pytest.param((POINTS, np.vstack([FACES, turned_over(FACES)])), id="all"),
        pytest.param((POINTS, np.vstack([turned_over(FACES), FACES])), id="all, the copy first"),
        pytest.param((POINTS, np.stack([FACES, turned_over(FACES)], axis=1).reshape(-1, 3)), id="in turn"),
        pytest.param((POINTS, np.vstack([FACES, turned_over(FACES[::3])])), id="some"),
        pytest.param((POINTS, np.vstack([FACES, FACES[::3]])), id="some the same way round"),
        pytest.param((POINTS, np.vstack([FACES, FACES, turned_over(FACES)])), id="thrice"),
        pytest.param((POINTS, np.vstack([FLIPPED, turned_over(FLIPPED)])), id="at random"),
        pytest.param(together((POINTS, FACES), (POINTS, turned_over(FACES))), id="with vertices of its own"),
        pytest.param(loose(POINTS, np.vstack([FACES, turned_over(FACES)])), id="with no vertex shared"),
    ],
)
def test_a_two_sided_export_is_one_body(arrays: Arrays) -> None:
    surface = surface_from_arrays(*arrays)
    assert surface.volume == pytest.approx(BALL.volume)
    assert len(surface.faces) == len(FACES)
    assert not surface.overlaps
    assert surface.warnings == ()


def _other_diagonals(cube: Surface) -> list[tuple[int, int, int]]:
    """The sides of a cube, each cut along its other diagonal, oriented outward."""
    found = []
    for normal in np.unique(np.round(cube.normals), axis=0):
        one, two = cube.faces[(np.round(cube.normals) == normal).all(axis=1)].tolist()
        first = next(i for i in range(3) if one[i] not in two)
        apex, start, end = (one[(first + i) % 3] for i in range(3))
        across = next(i for i in two if i not in one)
        found += [(apex, start, across), (apex, across, end)]
    return found


CUBE = box((10.0, 10.0, 10.0))
# The other diagonals of its sides.
OTHER = np.array([[a, b, c] for a, b, c in _other_diagonals(CUBE)])


@pytest.mark.parametrize("turn", [-1, 1], ids=["turned over", "the same way round"])
def test_two_sides_of_different_triangles_are_one_body(turn: int) -> None:
    for arrays in (
        (CUBE.points, np.vstack([CUBE.faces, OTHER[:, ::turn]])),
        together((CUBE.points, CUBE.faces), (CUBE.points, OTHER[:, ::turn])),
        together((CUBE.points, OTHER[:, ::turn]), (CUBE.points, CUBE.faces)),
    ):
        surface = surface_from_arrays(*arrays)
        assert surface.volume == pytest.approx(1000.0)
        assert len(surface.faces) == 12
        assert "kept one side of a two-sided surface, and removed the 12 triangles of the other." in surface.repairs
        assert surface.warnings == ()


def test_of_two_sides_the_finer_is_kept() -> None:
    for arrays in (
        together((POINTS, FACES), (FINE.points, turned_over(FINE.faces))),
        together((FINE.points, FINE.faces), (POINTS, turned_over(FACES))),
    ):
        surface = surface_from_arrays(*arrays)
        assert surface.volume == pytest.approx(FINE.volume)
        assert "kept one side of a two-sided surface, and removed the 320 triangles of the other." in surface.repairs


@pytest.mark.parametrize("apart", [1e-6, 1e-5], ids=["merged in part", "cracked"])
@pytest.mark.parametrize("turned", [0, 1])
def test_a_second_side_in_pieces_is_a_side(apart: float, turned: int) -> None:
    """Each face of the second cube has corners of its own, nearly those of the first, and some triangles are turned."""
    random = np.random.default_rng(5)
    (points, first), (others, second) = (cube_of_quads(random, bulging) for _ in range(2))
    second[turned:] = turned_over(second[turned:])
    moved = others + random.normal(scale=apart, size=others.shape)
    surface = surface_from_arrays(*together((points, first), (moved, second)))
    assert surface.volume == pytest.approx(surface_from_arrays(points, first).volume, rel=0.01)
    assert len(surface.faces) == len(first)
    assert surface.warnings == ()


def test_what_is_left_between_two_sides_is_refused() -> None:
    """Two slivers that share an edge: no surface that encloses a body."""
    corners = np.array([[0.0, 0, 0], [10, 0, 0.01], [10, 10, 0], [0, 10, 0.01]])
    sliver = np.array([[0, 2, 1], [0, 3, 2], [0, 1, 3], [1, 2, 3]])
    surface = surface_from_arrays(*together((corners, sliver), (corners + np.array([10.0, 0.0, 0.0]), sliver)))
    assert surface.overlaps
    with pytest.raises(InputError, match=r"touches itself: its two sides nearly cancel each other; .* export one side"):
        check_thickness(surface)


def test_an_open_body_whose_sides_differ_is_capped_as_one() -> None:
    top = CUBE.points[:, 2].max()
    sides = [faces[(CUBE.points[faces][:, :, 2] < top).any(axis=1)] for faces in (CUBE.faces, OTHER)]
    surface = surface_from_arrays(CUBE.points, np.vstack([sides[0], turned_over(sides[1])]), holes="close")
    assert surface.volume == pytest.approx(1000.0)
    assert surface.repairs[0] == "kept one side of a two-sided surface, and removed the 10 triangles of the other."


def test_a_wall_whose_sides_differ_goes_and_a_thin_body_stays() -> None:
    core, shell = 0.3 * CUBE.points, (POINTS, FACES)
    surface = surface_from_arrays(*together(shell, (core, turned_over(CUBE.faces)), (core, OTHER)))
    assert surface.volume == pytest.approx(BALL.volume)
    assert surface.repairs[-1] == "removed 24 triangles of a wall inside the body."
    corners = np.array([[0.0, 0, 0], [1, 0, 0.01], [1, 1, 0], [0, 1, 0.01]])
    flat = surface_from_arrays(corners, [[0, 2, 1], [0, 3, 2], [0, 1, 3], [1, 2, 3]])
    assert len(flat.faces) == 4
    octahedron = np.vstack([np.eye(3), -np.eye(3)])
    inscribed = np.array([[0, 1, 2], [1, 3, 2], [3, 4, 2], [4, 0, 2], [1, 0, 5], [3, 1, 5], [4, 3, 5], [0, 4, 5]])
    cavity = together((FINE.points, FINE.faces), (10.0 * octahedron, turned_over(inscribed)))
    assert len(surface_from_arrays(*cavity).faces) == len(FINE.faces) + 8


def test_two_sides_of_several_bodies_and_of_one_with_a_hole() -> None:
    two = together((POINTS, FACES), (POINTS + 30.0, FACES))
    both = two[0], np.vstack([two[1], turned_over(two[1])])
    assert surface_from_arrays(*both).volume == pytest.approx(2 * BALL.volume)
    mixed = two[0], np.vstack([two[1], turned_over(two[1][: len(FACES)])])
    assert surface_from_arrays(*mixed).volume == pytest.approx(2 * BALL.volume)
    open_one = FACES[:-1]
    surface = surface_from_arrays(POINTS, np.vstack([open_one, turned_over(open_one)]))
    assert surface.volume == pytest.approx(BALL.volume)
    assert surface.repairs == ("kept one side of 319 triangles given on both sides.", "closed 1 small hole.")


def test_a_core_that_fills_its_shell_and_a_fin_go() -> None:
    core = 0.5 * POINTS
    shell = together((POINTS, FACES), (core, turned_over(FACES)), (core, FACES))
    surface = surface_from_arrays(*shell)
    assert surface.volume == pytest.approx(BALL.volume)
    assert surface.warnings == ()
    sheet = np.array([[20.0, 0, 0], [25, 0, 0], [25, 5, 0]]), np.array([[0, 1, 2], [2, 1, 0]])
    assert surface_from_arrays(*together((POINTS, FACES), sheet)).volume == pytest.approx(BALL.volume)


def test_a_missing_triangle_is_put_back() -> None:
    coarse = sphere(10.0, subdivisions=1)
    surface = surface_from_arrays(coarse.points, coarse.faces[1:])
    assert surface.volume == pytest.approx(coarse.volume)
    assert len(surface.points) == len(coarse.points)
    assert surface.repairs == ("closed 1 small hole.",)
    with pytest.raises(InputError, match=r"a hole of 3 edges, .* leave out surface.holes: refuse"):
        surface_from_arrays(coarse.points, coarse.faces[1:], holes="refuse")


def test_three_sides_of_a_tetrahedron_want_one_more() -> None:
    corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    surface = surface_from_arrays(corners, [[0, 2, 1], [0, 1, 3], [0, 3, 2]])
    assert surface.volume == pytest.approx(1 / 6)
    with pytest.raises(InputError, match="0 usable triangles"):
        surface_from_arrays(corners, [[1, 2, 3]])


def test_many_triangles_missing_at_random_are_capped() -> None:
    """Holes that touch, and single triangles left between them: what is capped is closed, whatever it is like."""
    for seed in range(5):
        left = np.random.default_rng(seed).permutation(FACES)[70:]
        surface = surface_from_arrays(POINTS, left, holes="close")
        assert surface.volume == pytest.approx(BALL.volume, rel=0.1)


def test_a_slit_is_closed_however_long() -> None:
    points, faces = box((20.0, 10.0, 5.0)).points, box((20.0, 10.0, 5.0)).faces
    # One triangle of the top gets corners of its own, a little lower: the slit round it has six edges.
    own = points[faces[0]] - [0.0, 0.0, 1e-3]
    apart = np.vstack([points, own]), np.vstack([faces[1:], [[8, 9, 10]]])
    surface = surface_from_arrays(*apart)
    assert surface.volume == pytest.approx(1000.0, rel=1e-3)


def cut(surface: Surface, keep: np.ndarray[tuple[int], np.dtype[np.bool_]]) -> Arrays:
    return surface.points, surface.faces[keep]


def heights(surface: Surface) -> FloatArray:
    return np.asarray(surface.points[surface.faces].mean(axis=1)[:, 2])


@pytest.mark.parametrize("level", [9.0, 5.0, 0.0, -5.0])
def test_an_open_base_is_capped_on_request(level: float) -> None:
    arrays = cut(FINE, heights(FINE) < level)
    with pytest.raises(
        InputError, match=r"a hole of \d+ edges, .* wide around \(.*\); cap it with surface.holes: close"
    ):
        surface_from_arrays(*arrays)
    surface = surface_from_arrays(*arrays, holes="close")
    lost = np.pi * (10.0 - level) ** 2 * (20.0 + level) / 3.0
    # The rim runs along triangles, half a triangle up and down.
    assert surface.volume == pytest.approx(FINE.volume - lost, abs=0.25 * np.pi * (100.0 - level**2))
    area = float(surface.repairs[0].split(": ")[1].split()[0])
    assert area == pytest.approx(np.pi * (100.0 - level**2), rel=0.06)
    assert surface.repairs[0].startswith("capped 1 hole: ")
    assert surface.warnings == ()


def test_a_tube_gets_a_cap_at_each_end() -> None:
    tube = cylinder(5.0, 20.0, segments=64)
    surface = surface_from_arrays(*cut(tube, np.abs(tube.normals[:, 2]) < 0.5), holes="close")
    assert surface.volume == pytest.approx(tube.volume)
    assert surface.warnings == ()
    assert surface.repairs[0].startswith("capped 2 holes: 78.41 mm² around (")


def test_the_largest_of_several_holes_is_named() -> None:
    height = heights(FINE)
    points, faces = cut(FINE, (height < 9.0) & (height > -5.0))
    words = r"a hole of 92 edges, 24\.\d+ wide around .*-5.*\), the largest of 2; cap it"
    for arrays in ((points, faces), (points, faces[::-1])):
        with pytest.raises(InputError, match=words):
            surface_from_arrays(*arrays)
    with pytest.raises(InputError, match='holes is "maybe"; give one of small, close, refuse'):
        surface_from_arrays(*arrays, holes="maybe")  # type: ignore[arg-type]


def test_the_cap_of_a_wavy_rim_is_as_fine_as_the_rim_and_crosses_nothing() -> None:
    angle = 2 * np.pi * np.arange(200) / 200
    rim = np.column_stack([10 * np.cos(angle), 10 * np.sin(angle), 2 * np.cos(3 * angle)])
    inner, faces = cap(rim, np.arange(200), 200)
    points = np.vstack([rim, inner])
    edges = Edges(faces)
    assert (edges.triangles <= 2).all()
    assert (edges.triangles == 1).sum() == 200
    # A membrane stays within its rim.
    assert np.abs(inner).max(axis=0) == pytest.approx([9.7, 9.7, 1.9], abs=0.3)
    assert len(inner) > 500
    corners = points[faces]
    sides = np.linalg.norm(corners - corners[:, [1, 2, 0]], axis=2)
    assert sides.max() < 5 * np.linalg.norm(rim[1] - rim[0])
    area = 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1).sum()
    assert np.pi * 100 < area < 1.15 * np.pi * 100


@pytest.mark.parametrize("count", [24, 800])
def test_a_hollow_rim_is_covered_once(count: int) -> None:
    """A flat star: as much area as by the shoelace formula. Of a very long rim 1e-4 is folded."""
    angle = 2 * np.pi * np.arange(count) / count
    reach = 10 + 6 * np.cos(5 * angle)
    star = np.column_stack([reach * np.cos(angle), reach * np.sin(angle), np.zeros(count)])
    normal = np.cross(star, np.roll(star, -1, axis=0)).sum(axis=0)[2] / 2
    corners = star[triangulate_polygon(star)]
    twice = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, 2]
    assert twice.sum() / 2 == pytest.approx(normal)
    assert np.abs(twice).sum() / 2 == pytest.approx(normal, rel=1e-9 if count < 300 else 1e-3)


def outline(corners: list[tuple[float, float]], count: int) -> FloatArray:
    """A flat polygon whose edges are cut into `count` pieces."""
    start = np.array([(x, y, 0.0) for x, y in corners])
    shares = np.arange(count)[:, None] / count
    return np.vstack([a + shares * (b - a) for a, b in zip(start, np.roll(start, -1, axis=0), strict=True)])


TEETH = [point for i in range(4) for point in ((8 - 2 * i, 5), (7 - 2 * i, 5), (7 - 2 * i, 1), (6 - 2 * i, 1))]
CONCAVE = {
    "L": [(0, 0), (3, 0), (3, 1), (1, 1), (1, 3), (0, 3)],
    "comb": [(0, 0), (8, 0), *TEETH],
    "star": [((1 + i % 2) * np.cos(0.5 * i), (1 + i % 2) * np.sin(0.5 * i)) for i in range(12)],
}


def test_corners_of_a_very_long_rim_are_not_cut() -> None:
    """Every third vertex is triangulated first; without the corners among them 3e-4 of the area is folded."""
    star = outline(CONCAVE["star"], 53)
    corners = star[triangulate_polygon(star)]
    twice = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, 2]
    assert np.abs(twice).sum() == pytest.approx(np.cross(star, np.roll(star, -1, axis=0))[:, 2].sum(), rel=1e-9)


@pytest.mark.parametrize("count", [1, 10, 40])
@pytest.mark.parametrize("name", CONCAVE)
def test_the_cap_of_a_concave_flat_rim_does_not_leave_it(name: str, count: int) -> None:
    rim = outline(CONCAVE[name], count)
    inner, faces = cap(rim, np.arange(len(rim)), len(rim))
    points = np.vstack([rim, inner])
    twice = np.cross(points[faces[:, 1]] - points[faces[:, 0]], points[faces[:, 2]] - points[faces[:, 0]])
    area = np.cross(rim, np.roll(rim, -1, axis=0)).sum(axis=0)[2] / 2
    assert np.linalg.norm(twice, axis=1).sum() / 2 == pytest.approx(area, rel=1e-9)
    assert np.abs(twice.sum(axis=0) / 2) == pytest.approx([0, 0, area], rel=1e-9)


def test_holes_are_closed_by_the_case_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arrays = cut(BALL, heights(BALL) < 5.0)
    lines = ["v " + " ".join(map(str, point)) for point in arrays[0].tolist()]
    lines += ["f " + " ".join(str(k + 1) for k in face) for face in arrays[1].tolist()]
    (tmp_path / "scan.obj").write_text("\n".join(lines))
    case = tmp_path / "case.yaml"
    text = "surface: {file: scan.obj, holes: HOLES}\nmedium: {sigma_a: .01, sigma_s_prime: 1, eta: 1.4}\n"
    text += "lights: [{diffuse: {irradiance: 1}}]\n"
    case.write_text(text.replace("HOLES", "close"))
    assert main(["check", str(case)]) == 0
    assert "capped 1 hole: " in capsys.readouterr().out
    for word, message in (("small", "surface.holes: close"), ("refuse", "surface.holes: refuse"), ("yes", "close")):
        case.write_text(text.replace("HOLES", word))
        assert main(["check", str(case)]) == 2
        assert message in capsys.readouterr().err
    case.write_text(text.replace("file: scan.obj", "sphere: {radius: 9}").replace("HOLES", "close"))
    assert main(["check", str(case)]) == 2
    assert "holes applies to a surface file" in capsys.readouterr().err


def crumb(size: float, *center: float) -> Arrays:
    small = box((size, size, size), center=(center[0], center[1], center[2]))
    return small.points, small.faces


def test_specks_are_dropped_with_their_place() -> None:
    specks = [crumb(0.1, 14.0, 0.0, 0.0), crumb(0.05, 0.0, 0.0, -30.0), crumb(0.1, 1.0, 2.0, 3.0)]
    # One lies far away, one within, and that one is a bubble.
    specks[2] = specks[2][0], turned_over(specks[2][1])
    surface = surface_from_arrays(*together((POINTS, FACES), *specks))
    assert surface.volume == pytest.approx(BALL.volume)
    assert surface.warnings == ()
    (repair,) = surface.repairs
    assert repair.startswith("dropped 3 specks of up to 0.17 mm, smaller than the mesh can show, at (14, ")
    assert "(1, 2, 3)" in repair


def test_a_small_body_is_no_speck_and_is_meshed() -> None:
    """A cube of 1 beside a ball of 20: 2.4e-4 of the volume, which was dropped as the mesher's debris."""
    surface = surface_from_arrays(*together((POINTS, FACES), crumb(1.0, 14.0, 0.0, 0.0)))
    assert surface.repairs == ()
    mesh = tetrahedralize(surface, cache=False)
    beyond = mesh.points[mesh.tetrahedra].mean(axis=1)[:, 0] > 12
    corners = mesh.points[mesh.tetrahedra[beyond]]
    volumes = np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1])) / 6
    assert volumes.sum() == pytest.approx(1.0, rel=0.1)


def test_what_is_thin_but_a_part_of_the_volume_is_no_speck() -> None:
    """A plate below the mesher's resolution that has 1 % of the volume is not dropped without a warning."""
    plate = box((20.0, 20.0, 0.1), center=(0.0, 0.0, 14.0))
    surface = surface_from_arrays(*together((POINTS, FACES), (plate.points, plate.faces)))
    assert surface.repairs == ()
    assert surface.volume == pytest.approx(BALL.volume + 40.0)


def test_bodies_of_one_size_are_no_specks() -> None:
    beads = [(0.05 * POINTS + [20.0 * i, 0.0, 0.0], FACES) for i in range(20)]
    assert surface_from_arrays(*together(*beads)).volume == pytest.approx(20 * 0.05**3 * BALL.volume)


def test_a_wider_scene_makes_larger_specks() -> None:
    """The mesher's deviation goes with the diagonal of all that is kept: a cube of 1 is kept at 14, not at 140."""
    near, far = crumb(1.0, 14.0, 0.0, 0.0), crumb(3.0, 0.0, 200.0, 0.0)
    assert surface_from_arrays(*together((POINTS, FACES), near)).repairs == ()
    surface = surface_from_arrays(*together((POINTS, FACES), near, far))
    assert surface.repairs == ("dropped a speck of up to 1.7 mm, smaller than the mesh can show, at (14, 0, 0).",)


def test_the_limit_of_a_speck() -> None:
    deviation = 0.01 * BALL.diagonal
    for factor, dropped in ((0.9, 1), (1.2, 0)):
        # Of a cube 2 V / A is a third of its side.
        size = factor * 3.0 * SPECK * deviation
        surface = surface_from_arrays(*together((POINTS, FACES), crumb(size, 14.0, 0.0, 0.0)))
        assert len(surface.repairs) == dropped
