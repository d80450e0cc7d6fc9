"""Rays against triangles: by Embree, and by VTK's locator where Embree has no wheel."""

import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from tests.conftest import TISSUE, needs
from tetlux.fem import CollimatedBeam, EnvironmentLight, PencilBeam, Solution, System
from tetlux.fem.lights import Light
from tetlux.meshing import Surface, TetMesh, box, sphere, tetrahedralize, torus
from tetlux.meshing.arrays import FloatArray, IntArray
from tetlux.meshing.search import rays
from tetlux.meshing.search.embree import Embree
from tetlux.meshing.search.rays import OFFSET, RayCaster
from tetlux.meshing.search.vtk_rays import RayLocator

ENGINES = [Embree, RayLocator]
RING = torus(10.0, 3.0)


@pytest.fixture(params=[pytest.param(Embree, marks=needs("embreex"), id="embree"), pytest.param(RayLocator, id="vtk")])
def engine(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> str:
    monkeypatch.setattr(rays, "ENGINE", request.param)
    return str(request.param.__name__)


def caster(surface: Surface) -> RayCaster:
    return RayCaster(surface.points, surface.faces)


def unit(vectors: FloatArray) -> FloatArray:
    return np.asarray(vectors / np.linalg.norm(vectors, axis=1)[:, None])


def random_rays(surface: Surface, count: int) -> tuple[FloatArray, FloatArray]:
    """From inside and outside, half of them aimed at the body's box."""
    random = np.random.default_rng(5)
    low, high = surface.points.min(axis=0), surface.points.max(axis=0)
    starts = random.uniform(low - 0.5 * (high - low), high + 0.5 * (high - low), (count, 3))
    towards = random.normal(size=(count, 3))
    towards[::2] = random.uniform(low, high, (len(towards[::2]), 3)) - starts[::2]
    return starts, unit(towards)


def by_brute_force(surface: Surface, starts: FloatArray, directions: FloatArray) -> tuple[FloatArray, IntArray]:
    """Every ray against every triangle (Möller & Trumbore 1997), in double precision."""
    a, b, c = (surface.points[surface.faces[:, corner]] for corner in range(3))
    distances, faces = np.full(len(starts), np.inf), np.full(len(starts), -1)
    for ray, (start, direction) in enumerate(zip(starts, directions, strict=True)):
        across = np.cross(direction, c - a)
        scale = 1.0 / np.einsum("ij,ij->i", b - a, across)
        u = scale * np.einsum("ij,ij->i", start - a, across)
        beside = np.cross(start - a, b - a)
        v = scale * (beside @ direction)
        along = scale * np.einsum("ij,ij->i", c - a, beside)
        met = (u >= 0) & (v >= 0) & (u + v <= 1) & (along > OFFSET * surface.diagonal)
        if met.any():
            faces[ray] = int(np.where(met, along, np.inf).argmin())
            distances[ray] = along[faces[ray]]
    return distances, faces


@pytest.mark.parametrize("surface", [RING, box((3.0, 2.0, 7.0))], ids=["ring", "box"])
def test_random_rays_meet_what_brute_force_says(surface: Surface, engine: str) -> None:
    starts, directions = random_rays(surface, 1000)
    distances, faces = caster(surface).first(starts, directions)
    expected, expected_faces = by_brute_force(surface, starts, directions)
    assert 0.2 < np.isfinite(expected).mean() < 0.9
    assert (faces == expected_faces).all()
    assert distances == pytest.approx(expected, rel=1e-12, abs=1e-12 * surface.diagonal)


def test_no_ray_passes_between_triangles(monkeypatch: pytest.MonkeyPatch) -> None:
    """From inside towards vertices, the middles of edges and places near them (Embree misses one in a thousand)."""
    monkeypatch.setattr(rays, "ENGINE", RayLocator)
    ball = sphere(10.0)
    corners = ball.points[ball.faces]
    for share in (0.0, 1.0 / 3.0, 0.5):
        aims = ((1.0 - share) * corners + share * np.roll(corners, 1, axis=1)).reshape(-1, 3)
        for start in ([0.0, 0.0, 0.0], [1.0, -2.0, 0.3]):
            distances, faces = caster(ball).first(np.broadcast_to(start, aims.shape), unit(aims - start))
            assert (faces >= 0).all()
            assert distances == pytest.approx(np.linalg.norm(aims - start, axis=1), rel=1e-9)


def test_rays_along_faces_and_edges(engine: str) -> None:
    """A ray in the plane of a face meets the faces at its ends or nothing; beside it, it is in or out."""
    cube = caster(box((2.0, 2.0, 2.0)))
    for beside, expected in ((1.0 - 1e-4, 4.0), (1.0 + 1e-4, np.inf)):
        for across in (0.0, 0.3, 1.0 - 1e-4):
            distances, faces = cube.first(np.array([[-5.0, across, beside]]), np.array([[1.0, 0.0, 0.0]]))
            assert distances == pytest.approx(expected, rel=1e-12)
            assert (faces >= 0) == np.isfinite(expected)
    for across in (0.0, 1.0):
        (distance,), _ = cube.first(np.array([[-5.0, across, 1.0]]), np.array([[1.0, 0.0, 0.0]]))
        assert min(abs(distance - 4.0), abs(distance - 6.0)) < 1e-9 or distance == np.inf


def test_what_is_behind_or_at_the_start_is_not_met(engine: str) -> None:
    cube = caster(box((2.0, 2.0, 2.0)))
    down, up = [0.0, 0.0, -1.0], [0.0, 0.0, 1.0]
    starts = np.array([[0.1, 0.2, 1.0], [0.1, 0.2, 1.0], [0.1, 0.2, 0.0], [0.1, 0.2, 2.0], [0.1, 5.0, 0.0]])
    distances, faces = cube.first(starts, np.array([down, up, up, up, down]))
    assert distances == pytest.approx([2.0, np.inf, 1.0, np.inf, np.inf])
    assert ((faces >= 0) == np.isfinite(distances)).all()


@pytest.mark.parametrize("away", [1e3, 1e9, 1e15, 1e150])
def test_rays_from_far_away(engine: str, away: float) -> None:
    cube = caster(box((2.0, 2.0, 2.0)))
    starts = np.array([[0.1, 0.2, away], [0.1, 0.2, away], [away, 0.2, 0.1], [away, away, away]])
    directions = np.array([[0.0, 0.0, -1.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [0.0, 0.0, -1.0]])
    distances, faces = cube.first(starts, directions)
    assert distances == pytest.approx([away - 1.0, np.inf, np.inf, np.inf], rel=1e-12)
    assert (faces[1:] == -1).all()


def test_the_far_end_is_met(engine: str) -> None:
    """By a ray from far away that passes everything else."""
    near = np.array([[0.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    two = RayCaster(np.concatenate([near, near + np.array([10.0, 1.0, 0.0])]), np.arange(6).reshape(2, 3))
    distances, faces = two.first(np.array([[-1000.0, 1.2, 0.2]]), np.array([[1.0, 0.0, 0.0]]))
    assert (distances[0], faces[0]) == (pytest.approx(1010.0), 1)


@pytest.mark.parametrize(("scale", "shift"), [(1e-9, 0.0), (1e9, 0.0), (1.0, 1e6), (1e-3, 1e3)])
def test_lengths_and_places_do_not_matter(engine: str, scale: float, shift: float) -> None:
    starts, directions = random_rays(RING, 500)
    distances, faces = caster(RING).first(starts, directions)
    moved = RayCaster(scale * RING.points + shift, RING.faces)
    found, found_faces = moved.first(scale * starts + shift, directions)
    assert (found_faces == faces).all()
    assert found == pytest.approx(scale * distances, rel=1e-9, abs=1e-8 * scale)


def test_what_is_no_number_meets_nothing(engine: str) -> None:
    starts = np.array([[np.nan, 0.0, 0.0], [0.0, 0.0, 0.0], [np.inf, 0.0, 0.0]])
    directions = np.array([[0.0, 0.0, 1.0], [np.nan, 0.0, 1.0], [0.0, 0.0, 1.0]])
    with np.errstate(invalid="ignore"):
        distances, faces = caster(RING).first(starts, directions)
    assert (faces == -1).all()
    assert (distances == np.inf).all()


def test_types_and_shapes(engine: str) -> None:
    for count in (0, 1, 2):
        starts = np.tile([10.0, 0.0, 0.0], (count, 1))
        directions = np.broadcast_to(np.array([0.0, 0.0, 1.0]), (count, 3))
        distances, faces = caster(RING).first(starts, directions)
        assert distances.shape == faces.shape == (count,)
        assert (str(distances.dtype), str(faces.dtype)) == ("float64", "int64")
        assert distances == pytest.approx(np.full(count, 3.0), rel=0.02)


@pytest.fixture(scope="module")
def ring() -> TetMesh:
    """A body that shades itself."""
    return tetrahedralize(RING, edge_length=1.5)


@needs("embreex")
@pytest.mark.parametrize(
    "light",
    [
        PencilBeam((18.0, 1.0, 20.0), (-0.4, -0.1, -1.0), deposit="line"),
        CollimatedBeam((1.0, 0.3, -0.4), irradiance=1.0),
        EnvironmentLight(np.linspace(0.2, 1.0, 8 * 16).reshape(8, 16)),
    ],
    ids=["pencil", "collimated", "environment"],
)
def test_solutions_are_the_same(light: Light, ring: TetMesh, monkeypatch: pytest.MonkeyPatch) -> None:
    found: list[Solution] = []
    for engine in ENGINES:
        monkeypatch.setattr(rays, "ENGINE", engine)
        # Copies, which have cast no rays.
        found.append(System(replace(ring), TISSUE, replace(RING)).solve([light]))
    embree, vtk = found
    # Rays that graze an edge count on one side or the other.
    assert np.linalg.norm(vtk.exitance - embree.exitance) < 1e-3 * np.linalg.norm(embree.exitance)
    assert vtk.power.exited == pytest.approx(embree.power.exited, rel=1e-4)
    assert abs(vtk.power.balance_error) < 1e-9


@pytest.mark.parametrize(
    ("missing", "engine"), [pytest.param([], "Embree", marks=needs("embreex")), (["embreex"], "RayLocator")]
)
def test_the_engine_is_the_one_that_is_installed(missing: list[str], engine: str) -> None:
    hide = f"import sys; sys.modules.update(dict.fromkeys({missing}))"
    code = f"{hide}; from tetlux.meshing.search import rays; print(rays.ENGINE)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert engine in done.stdout
