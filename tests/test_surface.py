"""Reading, checking and mending surfaces."""

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh

from tetlux.meshing import InputError, Surface, box, cylinder, read_surface, slab, sphere, surface_from_arrays, torus
from tetlux.meshing.arrays import FloatArray, IntArray
from tetlux.meshing.repair import crossings
from tetlux.meshing.repair.crossings import count_self_intersections
from tetlux.meshing.search import proximity
from tetlux.meshing.search.proximity import cross_segments, overlapping_boxes
from tetlux.meshing.surface.solids import Box, Cylinder, Shape, Slab, Sphere, Torus


@pytest.fixture
def cube() -> tuple[FloatArray, IntArray]:
    surface = box((1.0, 2.0, 3.0))
    return surface.points.copy(), surface.faces.copy()


@pytest.mark.parametrize("suffix", ["stl", "stl_ascii", "obj", "ply", "off", "glb", "3mf"])
def test_every_format_reads_back_the_same_body(suffix: str, tmp_path: Path) -> None:
    path = tmp_path / f"ball.{suffix.split('_', maxsplit=1)[0]}"
    path.write_bytes(_exported(trimesh.creation.icosphere(subdivisions=2, radius=3.0), suffix))
    surface = read_surface(path, scale=2.0)
    assert len(surface.faces) == 320
    assert surface.volume == pytest.approx(8 * trimesh.creation.icosphere(subdivisions=2, radius=3.0).volume, rel=1e-5)
    assert surface.name == path.name


def _exported(mesh: trimesh.Trimesh, kind: str) -> bytes:
    data = mesh.export(file_type=kind)
    assert isinstance(data, str | bytes)
    return data.encode() if isinstance(data, str) else data


def test_shapes_have_the_volume_and_area_of_their_formulas() -> None:
    # Inscribed triangles: a little less than the smooth body, by under half a per cent.
    expected: list[tuple[Surface, float, float]] = [
        (sphere(2.0), 4 / 3 * np.pi * 8, 4 * np.pi * 4),
        (cylinder(2.0, 5.0), np.pi * 4 * 5, 2 * np.pi * 2 * 5 + 2 * np.pi * 4),
        (torus(5.0, 2.0), 2 * np.pi**2 * 5 * 4, 4 * np.pi**2 * 5 * 2),
    ]
    for surface, volume, area in expected:
        assert 0.99 * volume < surface.volume < volume
        assert 0.995 * area < surface.area < area
        assert surface.repairs == surface.warnings == ()
    assert box((1.0, 2.0, 3.0)).volume == pytest.approx(6.0)
    plate = slab(6.0, 2.0)
    assert plate.points[:, 2].max() == 0.0
    assert plate.points[:, 2].min() == -2.0
    assert plate.volume == pytest.approx(72.0)


def test_normals_point_outward(ball: Surface) -> None:
    middles = ball.points[ball.faces].mean(axis=1)
    assert (np.einsum("ij,ij->i", ball.normals, middles) > 0).all()


def test_inside_outside_and_nearest(ball: Surface) -> None:
    inside = ball.contains(np.array([[0.0, 0, 0], [0, 0, 9.9], [0, 0, 10.1], [50, 0, 0]]))
    assert inside.tolist() == [True, True, False, False]
    nearest, _ = ball.closest(np.array([[0.0, 0, 20.0]]))
    assert nearest[0] == pytest.approx([0, 0, 10], abs=0.05)


def test_a_ray_enters_and_leaves(ball: Surface) -> None:
    distances, faces = ball.crossings(np.array([0.3, 0.2, 30.0]), np.array([0.0, 0.0, -1.0]))
    height = np.sqrt(100 - 0.3**2 - 0.2**2)
    assert distances == pytest.approx([30 - height, 30 + height], abs=0.03)
    assert ball.normals[faces[0], 2] > 0 > ball.normals[faces[1], 2]


def test_an_inside_out_surface_is_turned(cube: tuple[FloatArray, IntArray]) -> None:
    points, faces = cube
    surface = surface_from_arrays(points, faces[:, ::-1])
    assert surface.volume == pytest.approx(6.0)
    assert "inside-out" in surface.repairs[0]


def test_mixed_winding_is_made_consistent(cube: tuple[FloatArray, IntArray]) -> None:
    points, faces = cube
    faces[[0, 3, 7]] = faces[[0, 3, 7], ::-1]
    surface = surface_from_arrays(points, faces)
    assert surface.volume == pytest.approx(6.0)
    assert any("winding" in r for r in surface.repairs)


def test_duplicates_and_collapsed_triangles_go(cube: tuple[FloatArray, IntArray]) -> None:
    points, faces = cube
    soup_points = points[faces].reshape(-1, 3)
    soup_faces = np.arange(len(soup_points)).reshape(-1, 3)
    faces = np.vstack([soup_faces, soup_faces[:1], [[0, 0, 1]]])
    surface = surface_from_arrays(soup_points, faces)
    assert len(surface.points) == 8
    assert len(surface.faces) == 12
    assert [r.split()[0] for r in surface.repairs] == ["merged", "removed", "removed"]
    assert surface_from_arrays(soup_points, soup_faces).repairs == ()


@pytest.mark.parametrize("missing", [[7], [7, 800, 801]])
def test_small_holes_are_closed(ball: Surface, missing: list[int]) -> None:
    surface = surface_from_arrays(ball.points, np.delete(ball.faces, missing, axis=0))
    assert surface.volume == pytest.approx(ball.volume, rel=1e-4)
    assert "small hole" in surface.repairs[0]


def test_a_missing_side_is_refused_with_its_place(cube: tuple[FloatArray, IntArray]) -> None:
    points, faces = cube
    with pytest.raises(InputError, match=r"box: the surface is open: a hole .* wide around \("):
        surface_from_arrays(points, faces[2:], name="box")


def test_self_intersection_is_counted() -> None:
    a, b = box((2.0, 2.0, 2.0)), box((2.0, 2.0, 2.0), center=(1.1, 0.9, 1.2))
    surface = surface_from_arrays(np.vstack([a.points, b.points]), np.vstack([a.faces, b.faces + 8]))
    assert any("crosses itself" in w for w in surface.warnings)
    assert any("2 bodies" in w for w in surface.warnings)
    # Mirror images cross edge on edge.
    a, b = sphere(6.0, subdivisions=2), sphere(6.0, subdivisions=2, center=(5.0, 0.0, 0.0))
    surface = surface_from_arrays(np.vstack([a.points, b.points]), np.vstack([a.faces, b.faces + len(a.points)]))
    assert any("crosses itself" in w for w in surface.warnings)


def test_a_cavity_is_refused() -> None:
    outer, inner = sphere(3.0, subdivisions=2), sphere(1.0, subdivisions=2)
    faces = np.vstack([outer.faces, inner.faces[:, ::-1] + len(outer.points)])
    with pytest.raises(InputError, match="cavity"):
        surface_from_arrays(np.vstack([outer.points, inner.points]), faces)


@pytest.mark.parametrize(
    ("points", "faces", "message"),
    [
        (np.zeros((0, 3)), np.zeros((0, 3)), "empty"),
        (np.zeros((5, 3)), np.zeros((0, 3)), "points but no triangles"),
        (np.zeros((4, 2)), [[0, 1, 2]], "shape"),
        (np.zeros((4, 3)), [[0, 1, 2, 3]], "shape"),
        (np.eye(4, 3), [[0, 1, 9]], "does not exist"),
        (np.eye(4, 3), [[0, 1, -1]], "does not exist"),
        ([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, np.nan]], [[0, 1, 3]], "not finite"),
        ([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, np.inf]], [[0, 1, 3]], "not finite"),
        (np.eye(4, 3), [[0, 1, 2]], "at least four"),
    ],
)
def test_arrays_that_bound_no_body(points: object, faces: object, message: str) -> None:
    with pytest.raises(InputError, match=message):
        surface_from_arrays(np.array(points), np.array(faces, dtype=int))


def test_a_flat_surface_is_refused(cube: tuple[FloatArray, IntArray]) -> None:
    points, faces = cube
    for height in (0.0, 1e-12):
        with pytest.raises(InputError, match="flat"):
            surface_from_arrays(points * [1.0, 1.0, height], faces)


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("none.stl", None, "does not exist"),
        ("empty.stl", b"", "is empty"),
        ("prose.stl", b"It was a dark and stormy night; the rain fell in torrents.\n" * 9, "triangle"),
        ("prose.obj", b"It was a dark and stormy night.\n", "triangle"),
        ("prose.ply", b"It was a dark and stormy night.\n", "PLY mesh"),
        ("points.ply", b"", "no triangles"),
        ("figure.docx", b"PK", "not read"),
        ("cut.glb", b"glTF\x02\x00\x00\x00", "GLB mesh"),
        ("cut.3mf", b"PK\x03\x04", "3MF mesh"),
    ],
)
def test_files_that_are_no_surface(name: str, content: bytes | None, message: str, tmp_path: Path) -> None:
    path = tmp_path / name
    if name == "points.ply":
        content = _exported(trimesh.PointCloud(np.eye(3)), "ply")  # type: ignore[arg-type]
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(InputError, match=message) as caught:
        read_surface(path)
    assert name in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_folder_a_scale_and_a_unit_are_checked(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="is a folder"):
        read_surface(tmp_path)
    with pytest.raises(InputError, match="scale is -1"):
        read_surface(tmp_path / "a.stl", scale=-1.0)
    with pytest.raises(InputError, match='unit "furlong"'):
        sphere(1.0, unit="furlong")


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: sphere(0.0), "radius is 0"),
        (lambda: sphere(1.0, subdivisions=9), "subdivisions is 9"),
        (lambda: box((1.0, -1.0, 1.0)), "size along y"),
        (lambda: slab(1.0, float("nan")), "depth is nan"),
        (lambda: cylinder(1.0, 1.0, segments=3), "segments is 3"),
        (lambda: torus(1.0, 2.0), "minor is 2"),
        (lambda: torus(2.0, 1.0, segments=3), "segments is 3"),
    ],
)
def test_shapes_refuse_impossible_lengths(make: object, message: str) -> None:
    assert callable(make)
    with pytest.raises(InputError, match=message):
        make()


def test_vertices_that_no_triangle_uses_do_not_count(ball: Surface) -> None:
    far = np.vstack([ball.points, [[1e8, 0, 0], [np.nan, 0, 0]]])
    surface = surface_from_arrays(far, ball.faces)
    assert (surface.volume, surface.repairs) == (ball.volume, ())


def test_a_wall_between_two_bodies_goes() -> None:
    """Two boxes that share a side, each with its own triangles for it."""
    lower = box((2.0, 2.0, 2.0))
    # A mirror image has the same diagonal on both sides of the wall.
    upper = lower.points * [1, 1, -1] + [0, 0, 2]
    faces = np.vstack([lower.faces, lower.faces[:, ::-1] + 8])
    surface = surface_from_arrays(np.vstack([lower.points, upper]), faces)
    assert surface.volume == pytest.approx(16.0)
    assert len(surface.faces) == 20
    assert surface.warnings == ()


def test_a_klein_bottle_has_no_inside() -> None:
    count = 12
    i, j = np.meshgrid(np.arange(count), np.arange(count), indexing="ij")
    random = np.random.default_rng(0).normal(size=(count * count, 3))

    def node(a: IntArray, b: IntArray) -> IntArray:
        # Going round the first way turns the second way over.
        return np.asarray((a % count) * count + np.where(a >= count, -b, b) % count)

    corners = [node(i, j), node(i + 1, j), node(i + 1, j + 1), node(i, j + 1)]
    a, b, c, d = (x.ravel() for x in corners)
    with pytest.raises(InputError, match="no inside and outside"):
        surface_from_arrays(random, np.vstack([np.column_stack([a, b, c]), np.column_stack([a, c, d])]))


def test_a_cavity_is_one_inside_out_too() -> None:
    outer, inner = sphere(3.0, subdivisions=2), sphere(1.0, subdivisions=2)
    faces = np.vstack([outer.faces, inner.faces[:, ::-1] + len(outer.points)])[:, ::-1]
    with pytest.raises(InputError, match="cavity"):
        surface_from_arrays(np.vstack([outer.points, inner.points]), faces)


def test_thin_is_not_flat() -> None:
    assert box((1e4, 1.0, 1.0)).volume == pytest.approx(1e4)
    assert box((1e4, 1e4, 0.1)).volume == pytest.approx(1e7)


@pytest.mark.parametrize("length", [1e-9, 1e9])
def test_lengths_from_nano_to_giga(length: float) -> None:
    assert sphere(length).volume == pytest.approx(length**3 * sphere(1.0).volume)


@pytest.mark.parametrize("length", [1e-120, 1e110])
def test_lengths_beyond_arithmetic(length: float) -> None:
    with pytest.raises(InputError, match="absurdly"):
        sphere(length)
    cube = box((1.0, 1.0, 1.0))
    with pytest.raises(InputError, match="absurdly"):
        surface_from_arrays(cube.points * length, cube.faces)


def test_a_hole_of_a_twentieth_is_closed_and_one_of_a_fifth_is_not() -> None:
    ball = sphere(10.0, subdivisions=5)
    height = ball.points[ball.faces].mean(axis=1)[:, 2]
    round_one = (ball.faces == ball.points[:, 2].argmax()).any(axis=1)
    small = surface_from_arrays(ball.points, ball.faces[~round_one])
    assert small.repairs == ("closed 1 small hole.",)
    with pytest.raises(InputError, match="open"):
        surface_from_arrays(ball.points, ball.faces[height < 9.5])
    nudged = ball.points[ball.faces].reshape(-1, 3) * (1 + 1e-3 * (np.arange(3 * len(ball.faces)) % 2)[:, None])
    with pytest.raises(InputError, match="open"):
        surface_from_arrays(nudged, np.arange(len(nudged)).reshape(-1, 3))


@pytest.mark.parametrize("roughness", [0.0, 0.1, 0.3])
def test_self_intersections_are_those_of_every_edge_with_every_triangle(roughness: float) -> None:
    ball = sphere(1.0, subdivisions=2)
    points = ball.points + np.random.default_rng(0).normal(scale=roughness, size=ball.points.shape)
    edges = np.vstack([ball.faces[:, [i, (i + 1) % 3]] for i in range(3)])
    edge, face = (x.ravel() for x in np.meshgrid(np.arange(len(edges)), np.arange(len(ball.faces)), indexing="ij"))
    apart = (ball.faces[face][:, :, None] != edges[edge][:, None, :]).all(axis=(1, 2))
    edge, face = edge[apart], face[apart]
    start = points[edges[edge, 0]]
    t, _ = cross_segments(start, points[edges[edge, 1]] - start, points[ball.faces[face]])
    expected = len(np.unique(face[(t > 0) & (t < 1)]))
    assert (expected > 0) == (roughness > 0)
    assert count_self_intersections(points, ball.faces) == expected


@pytest.mark.parametrize("portion", [1 << 18, 50])
def test_boxes_that_overlap_are_found_once(portion: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(proximity, "BOX_PAIRS_AT_ONCE", portion)
    random = np.random.default_rng(0)
    low = random.uniform(size=(300, 3))
    # Sizes over three orders of magnitude, and some boxes that are points.
    high = low + 10.0 ** random.uniform(-3, 0, (300, 1)) * random.integers(0, 2, (300, 3))
    found = [(min(i, j), max(i, j)) for a, b in overlapping_boxes(low, high) for i, j in zip(a, b, strict=True)]
    touch = ((low[:, None] <= high) & (low <= high[:, None])).all(axis=2)
    assert sorted(found) == list(zip(*np.nonzero(np.triu(touch, 1)), strict=True))


def test_one_box_overlaps_nothing() -> None:
    assert [len(i) for i, _ in overlapping_boxes(np.zeros((1, 3)), np.ones((1, 3)))] == [0]


def test_a_tangle_is_refused() -> None:
    ball = sphere(1.0, subdivisions=2)
    shuffled = np.random.default_rng(0).permutation(ball.points)
    with pytest.raises(InputError, match=r"crosses itself at 3\d\d of 320 triangles, a tangle"):
        surface_from_arrays(shuffled, ball.faces)


def test_triangles_that_do_not_join_are_told_at_once() -> None:
    ball = sphere(10.0, subdivisions=5)
    soup = ball.points[ball.faces].reshape(-1, 3) + np.random.default_rng(0).normal(scale=1e-3, size=(61440, 3))
    with pytest.raises(InputError, match="61,440 of 61,440 edges belong to one triangle only"):
        surface_from_arrays(soup, np.arange(61440).reshape(-1, 3))


def test_a_surface_in_thousands_of_bodies_is_refused() -> None:
    grain = sphere(0.1, subdivisions=1)
    places = np.stack(np.meshgrid(*[np.arange(11.0)] * 3), axis=-1).reshape(-1, 3)
    points = (places[:, None] + grain.points).reshape(-1, 3)
    faces = (len(grain.points) * np.arange(len(places))[:, None, None] + grain.faces).reshape(-1, 3)
    with pytest.raises(InputError, match=r"falls into 1,331 bodies .* more than 1,000"):
        surface_from_arrays(points, faces)
    few = surface_from_arrays(points[: 40 * len(grain.points)], faces[: 40 * len(grain.faces), ::-1])
    assert few.repairs == ("turned 40 inside-out surfaces outward.",)


def test_needles_side_by_side_are_looked_at_so_far_only(monkeypatch: pytest.MonkeyPatch) -> None:
    """Their number squared pairs overlap: 10,000 in a fan took a minute, 100,000 would hours."""
    monkeypatch.setattr(crossings, "PAIRS", (30, 0))
    tin = cylinder(10.0, 0.1, segments=600)
    assert any("was not looked at" in warning for warning in tin.warnings)


def test_a_body_far_away_is_as_exact_as_its_digits() -> None:
    ball = sphere(10.0, subdivisions=2)
    assert surface_from_arrays(ball.points + 1e6, ball.faces).warnings == ()
    rounded = surface_from_arrays((ball.points + 1e6).astype(np.float32), ball.faces)
    assert any("rounded to 0.2% of its size" in warning for warning in rounded.warnings)
    with pytest.raises(InputError, match="far from the origin"):
        surface_from_arrays((ball.points + 1e9).astype(np.float32), ball.faces)


def test_winding_is_mended_in_each_of_many_parts() -> None:
    ball = sphere(10.0, subdivisions=3)
    random = np.random.default_rng(0)
    turned = np.where((random.random(len(ball.faces)) < 0.3)[:, None], ball.faces[:, ::-1], ball.faces)
    two = np.vstack([turned, turned[:, ::-1] + len(ball.points)])
    surface = surface_from_arrays(np.vstack([ball.points, ball.points + 30.0]), two)
    assert surface.volume == pytest.approx(2 * ball.volume)
    assert surface.repairs[0] == "made the winding of the triangles consistent."


@pytest.mark.skipif(os.name != "posix", reason="needs pipes and devices")
def test_pipes_and_devices_are_no_surfaces(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.stl")
    (tmp_path / "zero.ply").symlink_to("/dev/zero")
    for name in ("pipe.stl", "zero.ply"):
        with pytest.raises(InputError, match="is no file but a device"):
            read_surface(tmp_path / name)
    with pytest.raises(InputError, match="does not exist"):
        read_surface(tmp_path / ("x" * 5000 + ".stl"))


SHAPES = {
    "sphere": (sphere(3.0, center=(1.0, 2.0, 3.0)), Sphere(3.0, (1.0, 2.0, 3.0))),
    "box": (box((1.0, 2.0, 3.0), center=(5.0, 0.0, -5.0)), Box((1.0, 2.0, 3.0), (5.0, 0.0, -5.0))),
    "slab": (slab(60.0, 10.0), Slab(60.0, 10.0)),
    "cylinder": (cylinder(2.0, 5.0, center=(0.0, 0.0, 9.0)), Cylinder(2.0, 5.0, (0.0, 0.0, 9.0))),
    "torus": (torus(3.0, 1.0, center=(0.0, 4.0, 0.0)), Torus(3.0, 1.0, (0.0, 4.0, 0.0))),
}


@pytest.mark.parametrize("name", SHAPES)
def test_a_built_in_surface_knows_its_shape(name: str) -> None:
    surface, shape = SHAPES[name]
    assert surface.name == name
    assert surface.shape == shape
    assert replace(surface, name="other", crease_angle=0.0).shape == shape
    # Vertices that are moved, even by a millionth, are those of another body.
    assert replace(surface, points=(1.0 + 1e-6) * surface.points).shape is None
    assert replace(surface, points=surface.points + np.array([0.0, 0.0, 1e-6])).shape is None
    assert surface_from_arrays(surface.points, surface.faces).shape is None


@pytest.mark.parametrize(
    ("shape", "inside", "outside"),
    [
        (Sphere(3.0), (0.0, 0.0, 1.0, 2.0), (0.0, 4.0, 3.0, 2.0)),
        (Box((2.0, 4.0, 6.0)), (0.5, 0.0, 0.0, 0.5), (1.0 + 3.0, 2.0 + 4.0, 0.0, 5.0)),
        (Slab(20.0, 4.0), (0.0, 0.0, -1.0, 1.0), (0.0, 0.0, 2.0, 2.0)),
        (Cylinder(2.0, 10.0), (1.5, 0.0, 0.0, 0.5), (0.0, 5.0, 9.0, 5.0)),
        (Torus(3.0, 1.0), (3.0, 0.0, 0.5, 0.5), (0.0, 0.0, 0.0, 2.0)),
    ],
)
def test_distances_from_shapes(
    shape: Shape, inside: tuple[float, float, float, float], outside: tuple[float, float, float, float]
) -> None:
    places = np.array([inside, outside])
    assert shape.distance(places[:, :3]) == pytest.approx(places[:, 3], rel=1e-12)


@pytest.mark.parametrize("distance", [1e-5, 0.1, 5.0])
def test_what_is_near_is_what_the_nearest_point_says(distance: float) -> None:
    surface = box((20.0, 20.0, 1.0))
    random = np.random.default_rng(0)
    weights = random.dirichlet([1.0, 1.0, 1.0], 200)
    corners = surface.points[surface.faces[random.integers(len(surface.faces), size=200)]]
    queries = np.einsum("qi,qij->qj", weights, corners) + random.normal(size=(200, 3)) * distance
    near = surface.near(queries, distance)
    assert 0 < near.sum() < 200
    assert (near == (np.linalg.norm(surface.closest(queries)[0] - queries, axis=1) <= distance)).all()


@pytest.mark.parametrize("size", [1e-6, 1.0, 1e6])
def test_a_check_of_a_built_in_surface_finds_nothing(size: float) -> None:
    """Regular shapes are made without one."""
    middle = (-300.0 * size, 20.0 * size, 100.0 * size)
    shapes = [
        sphere(size, center=middle),
        sphere(size, subdivisions=1),
        box((size, 2.0 * size, 30.0 * size), center=middle),
        slab(40.0 * size, 2.0 * size),
        cylinder(size, 30.0 * size),
        cylinder(20.0 * size, size),
        torus(10.0 * size, 2.0 * size),
    ]
    for made in shapes:
        checked = surface_from_arrays(made.points, made.faces, unit=made.unit, name=made.name)
        assert not checked.repairs
        assert not checked.warnings
        assert (checked.overlaps, checked.name, checked.unit) == (made.overlaps, made.name, made.unit)
        np.testing.assert_array_equal(checked.points, made.points)
        np.testing.assert_array_equal(checked.faces, made.faces)
