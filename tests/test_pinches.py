"""Surfaces whose parts touch along edges or at vertices: pulled apart, mended, decimated and meshed."""

from dataclasses import replace

import numpy as np
import pytest

from tetlux.meshing import Surface, box, sphere, surface_from_arrays, tetrahedralize
from tetlux.meshing.arrays import FloatArray, IntArray
from tetlux.meshing.mesher import api as mesher
from tetlux.meshing.mesher import child as child_mesher
from tetlux.meshing.mesher.deviation import two_sided_distance
from tetlux.meshing.mesher.proxy import proxy
from tetlux.meshing.repair.pinches import parts_of, pull_apart
from tetlux.meshing.repair.topology import Edges, bodies
from tetlux.meshing.surface.subdivide import number_triangle_edges, split_edges
from tetlux.meshing.surface.triangles import signed_volume

BALL = sphere(10.0)


def merged(*parts: Surface) -> Surface:
    first = np.cumsum([0, *(len(part.points) for part in parts)])
    faces = [part.faces + start for part, start in zip(parts, first, strict=False)]
    return surface_from_arrays(np.concatenate([p.points for p in parts]), np.concatenate(faces))


def mirrored(surface: Surface, place: FloatArray) -> Surface:
    """The mirror image of a ball about the origin in the plane through a place of it, along its surface there."""
    normal = place / np.linalg.norm(place)
    points = surface.points - 2.0 * ((surface.points - place) @ normal)[:, None] * normal
    return replace(surface, points=points, faces=surface.faces[:, ::-1])


def middle_of_an_edge() -> FloatArray:
    return np.asarray(BALL.points[BALL.faces[7, :2]].mean(axis=0))


def with_tetrahedra(count: int, size: float, *, inside_out: bool = False) -> Surface:
    """The ball with tetrahedra that stand on edges of it."""
    parts, used = [BALL], set[int]()
    for a, b in BALL.faces[:, :2].tolist():
        if len(parts) <= count and not {a, b} & used:
            used |= {a, b}
            ends = BALL.points[[a, b]]
            up = ends.mean(axis=0) / np.linalg.norm(ends.mean(axis=0))
            aside = np.cross(ends[1] - ends[0], up)
            aside *= 0.3 * size / np.linalg.norm(aside)
            points = np.vstack([ends, ends.mean(axis=0) + size * up + aside, ends.mean(axis=0) + size * up - aside])
            faces = np.array([[0, 1, 2], [1, 0, 3], [0, 2, 3], [1, 3, 2]])
            outward = signed_volume(points, faces) > 0
            parts.append(Surface(points, faces if outward != inside_out else faces[:, ::-1]))
    assert len(parts) == count + 1
    return merged(*parts)


def voxels() -> tuple[Surface, int]:
    """A block of 4 x 4 x 4 voxels, some of them missing, each face of 2 x 4² triangles; and how many there are."""
    full = np.pad(np.random.default_rng(0).random((4, 4, 4)) < 0.75, 1)
    cells = np.argwhere(full)
    square = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
    corners = []
    for axis in range(3):
        for side in (0, 1):
            neighbours = cells.copy()
            neighbours[:, axis] += 2 * side - 1
            free = cells[~full[tuple(neighbours.T)]]
            quad = np.insert(square if side else square[::-1], axis, side, axis=1)
            # The second and third axes turn the other way about the middle one.
            corners.append(free[:, None] + (quad[::-1] if axis == 1 else quad))
    quads = np.concatenate(corners)
    points, number = np.unique(quads.reshape(-1, 3), axis=0, return_inverse=True)
    number = number.reshape(-1, 4)
    places, faces = points.astype(np.float64), np.concatenate([number[:, :3], number[:, [0, 2, 3]]])
    for _ in range(2):
        edges = number_triangle_edges(faces)
        places, faces, _ = split_edges(places, faces, edges, np.ones(len(edges[0]), dtype=bool))
    return surface_from_arrays(places, faces), len(cells)


def assert_manifold(points: FloatArray, faces: IntArray) -> None:
    edges = Edges(faces)
    assert (edges.triangles == 2).all()
    assert (edges.balance == 0).all()
    # One fan at each vertex: as many sides in a ring as go round.
    assert len(np.unique(faces)) == len(points)
    again = pull_apart(points, faces)
    assert again is not None
    assert len(again[0]) == len(points)


@pytest.mark.parametrize(
    ("surface", "parts"),
    [
        (merged(box((1, 1, 1)), box((1, 1, 1), center=(1, 1, 0))), 2),
        (merged(box((1, 1, 1)), box((1, 1, 1), center=(1, 1, 1))), 2),
        (merged(BALL, mirrored(BALL, middle_of_an_edge())), 2),
        (merged(BALL, mirrored(BALL, BALL.points[3])), 2),
        (voxels()[0], 1),
    ],
)
def test_parts_that_touch_come_apart(surface: Surface, parts: int) -> None:
    apart = pull_apart(surface.points, surface.faces)
    assert apart is not None
    assert len(apart[0]) > len(surface.points)
    assert_manifold(*apart)
    assert signed_volume(*apart) == pytest.approx(surface.volume, rel=1e-12)
    assert bodies(len(apart[0]), apart[1]).max() + 1 == parts
    labels = parts_of(surface.points, surface.faces)
    assert labels is not None
    assert labels.max() + 1 == parts


def test_parts_that_share_a_wall_stay_one() -> None:
    """The diagonals of the wall differ on its sides, which so are triangles of their own."""
    both = merged(box((1, 1, 1)), box((1, 1, 1), center=(1, 0, 0)))
    apart = pull_apart(both.points, both.faces)
    assert apart is not None
    assert_manifold(*apart)
    part = bodies(len(apart[0]), apart[1])
    volumes = [signed_volume(apart[0], apart[1][part == i]) for i in range(2)]
    assert sorted(volumes) == pytest.approx([0.0, 2.0])
    mesh = tetrahedralize(both, cache=False)
    assert mesh.volume == pytest.approx(2.0, rel=1e-3)
    assert bodies(len(mesh.points), mesh.tetrahedra).max() == 0


@pytest.mark.parametrize("count", [1, 60])
def test_specks_that_hang_on_an_edge_are_left_out(count: int) -> None:
    for inside_out in (False, True):
        surface = with_tetrahedra(count, 1.0, inside_out=inside_out)
        assert len(surface.faces) == len(BALL.faces)
        assert surface.volume == pytest.approx(BALL.volume, rel=1e-12)
        what = "removed a small part that hung" if count == 1 else f"removed {count} small parts that hung"
        assert surface.repairs[-1].startswith(f"{what} on the body by an edge or a vertex only")
        assert not surface.warnings


def test_a_part_inside_out_on_an_edge_is_turned() -> None:
    other = mirrored(BALL, middle_of_an_edge())
    surface = merged(BALL, replace(other, faces=other.faces[:, ::-1]))
    assert surface.volume == pytest.approx(2.0 * BALL.volume, rel=1e-12)
    assert "turned a part that was inside out outward." in surface.repairs
    assert surface.warnings == (
        "1 edge is shared by more than two triangles: parts of the body touch there, and no light passes where they "
        "share an edge only.",
    )


def test_a_cavity_that_touches_the_surface_stays_one() -> None:
    top = BALL.points[5]
    cavity = replace(BALL, points=0.4 * BALL.points + 0.6 * top, faces=BALL.faces[:, ::-1])
    surface = merged(BALL, cavity)
    assert surface.volume == pytest.approx((1.0 - 0.4**3) * BALL.volume, rel=1e-12)
    assert not [words for words in surface.repairs if "turned" in words]


@pytest.mark.parametrize(
    ("surface", "share"),
    [
        # Parts of 0.2 % and more are no specks.
        (with_tetrahedra(20, 12.0), 0.5),
        (merged(BALL, mirrored(BALL, middle_of_an_edge())), 0.1),
        (merged(BALL, mirrored(BALL, BALL.points[3])), 0.1),
        (voxels()[0], 0.2),
    ],
    ids=["tetrahedra", "edge", "vertex", "voxels"],
)
def test_pinched_surfaces_are_decimated(surface: Surface, share: float) -> None:
    deviation = 0.0045 * surface.diagonal
    coarse = proxy(surface, deviation)
    assert len(coarse.faces) < share * len(surface.faces)
    assert coarse.volume == pytest.approx(surface.volume, rel=0.03)
    assert two_sided_distance(coarse, surface) <= 1.0001 * deviation
    assert_manifold(coarse.points, coarse.faces)


@pytest.mark.parametrize("place", [middle_of_an_edge(), BALL.points[3]], ids=["edge", "vertex"])
def test_balls_that_touch_are_meshed_at_once(place: FloatArray, monkeypatch: pytest.MonkeyPatch) -> None:
    given: list[int] = []
    run = child_mesher.run_pytetwild

    def counted(points: FloatArray, faces: IntArray, **rest: float) -> tuple[FloatArray, IntArray]:
        given.append(len(faces))
        return run(points, faces, **rest)  # type: ignore[arg-type]

    monkeypatch.setattr(mesher, "run_pytetwild", counted)
    surface = merged(BALL, mirrored(BALL, place))
    mesh = tetrahedralize(surface, cache=False)
    assert len(given) == 1
    assert given[0] < 1500
    assert mesh.volume == pytest.approx(surface.volume, rel=0.05)
    assert mesh.quality.min() > 0.1


def test_a_body_of_voxels_keeps_its_volume() -> None:
    surface, count = voxels()
    assert any("edges are shared by more than two triangles" in words for words in surface.warnings)
    mesh = tetrahedralize(surface, cache=False)
    assert mesh.volume == pytest.approx(count, rel=0.01)
