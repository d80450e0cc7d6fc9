"""The curved surface that triangles stand for."""

from dataclasses import replace

import numpy as np
import pytest

from tetlux.cases.shipped import library_folder
from tetlux.meshing import Surface, box, cylinder, read_surface, sphere, torus
from tetlux.meshing.arrays import FloatArray, IntArray
from tetlux.meshing.surface import curved as patches
from tetlux.meshing.surface.triangles import triangle_areas
from tetlux.meshing.tets.queries import heights


def places_on(surface: Surface, count: int = 2000) -> tuple[IntArray, FloatArray]:
    """Random faces and points on them."""
    random = np.random.default_rng(1)
    faces = random.integers(len(surface.faces), size=count)
    weights = random.dirichlet([1.0, 1.0, 1.0], size=count)
    return faces, np.einsum("qi,qij->qj", weights, surface.points[surface.faces[faces]])


@pytest.mark.parametrize(("subdivisions", "gain"), [(2, 30), (3, 100), (4, 400)])
def test_triangles_of_a_sphere_become_a_sphere(subdivisions: int, gain: int) -> None:
    """At fourth order, where flat triangles are of second."""
    ball = sphere(10.0, subdivisions=subdivisions)
    faces, flat = places_on(ball)
    curved, normals = ball.on_curve(faces, flat)
    off = np.abs(np.linalg.norm(curved, axis=1) - 10.0).max()
    assert off < (10.0 - np.linalg.norm(flat, axis=1)).max() / gain
    assert np.einsum("ij,ij->i", normals, curved / np.linalg.norm(curved, axis=1, keepdims=True)).min() > np.cos(
        np.radians(0.3)
    )


def test_edges_that_are_meant_stay() -> None:
    cube = box((1.0, 2.0, 3.0))
    faces, flat = places_on(cube)
    curved, normals = cube.on_curve(faces, flat)
    np.testing.assert_allclose(curved, flat, atol=1e-12)
    np.testing.assert_allclose(normals, cube.normals[faces], atol=1e-12)


def test_a_cylinder_is_curvedbetween_flat_ends() -> None:
    can = cylinder(5.0, 10.0)
    faces, flat = places_on(can)
    curved, _ = can.on_curve(faces, flat)
    side = np.abs(can.normals[faces, 2]) < 0.5
    np.testing.assert_allclose(curved[~side], flat[~side], atol=1e-12)
    # Away from the rim, whose own edges stay straight.
    middle = side & (np.abs(flat[:, 2]) < 4.0)
    assert np.abs(np.hypot(*curved[middle, :2].T) - 5.0).max() < 2e-4
    assert np.abs(np.hypot(*flat[middle, :2].T) - 5.0).max() > 4e-3


def test_without_a_crease_angle_it_is_the_triangles_themselves() -> None:
    ball = replace(sphere(10.0, subdivisions=2), crease_angle=0.0)
    faces, flat = places_on(ball)
    curved, normals = ball.on_curve(faces, flat)
    assert (curved == flat).all()
    assert (normals == ball.normals[faces]).all()


def test_patches_meet_along_edges() -> None:
    """On a figure with creases and without: the middle of an edge is one point, whichever side it is taken from."""
    hare = read_surface(library_folder() / "hare.stl")
    edges: dict[tuple[int, int], list[int]] = {}
    for face, corners in enumerate(hare.faces.tolist()):
        for i in range(3):
            a, b = sorted((corners[i], corners[i - 1]))
            edges.setdefault((a, b), []).append(face)
    ends = np.array(list(edges))
    sides = np.array(list(edges.values()))
    middles = hare.points[ends].mean(axis=1)
    one, other = (hare.on_curve(sides[:, i], middles)[0] for i in (0, 1))
    gap = np.linalg.norm(one - other, axis=1) / np.linalg.norm(np.diff(hare.points[ends], axis=1)[:, 0], axis=1)
    assert gap.max() < 1e-12


def test_projecting_finds_the_curved_surface() -> None:
    ball = sphere(10.0)
    outward = np.random.default_rng(2).normal(size=(500, 3))
    outward /= np.linalg.norm(outward, axis=1, keepdims=True)
    points, normals = ball.project(10.3 * outward)
    assert np.abs(np.linalg.norm(points, axis=1) - 10.0).max() < 5e-5
    assert np.einsum("ij,ij->i", normals, outward).min() > 0.99999


@pytest.mark.parametrize("name", ["hare", "torus"])
def test_facets_of_a_fine_mesh_are_on_the_surface(name: str) -> None:
    """Distances of facets tell what refinement removes; by projections, .002 of the hare and .0003 would be left."""
    body = read_surface(library_folder() / "hare.stl") if name == "hare" else torus(10.0, 4.0)
    faces, flat = places_on(body)
    above = np.sort(heights(body, body.on_curve(faces, flat)[0]))
    assert above[-20] < 1e-4
    assert np.median(above) < 1e-6


def test_twelve_sides_are_all_sharp() -> None:
    """They bend by 30 degrees, give or take rounding."""
    prism = cylinder(5.0, 20.0, segments=12)
    faces, flat = places_on(prism)
    np.testing.assert_allclose(prism.on_curve(faces, flat)[0], flat, atol=1e-9)


def test_patches_of_a_large_surface_are_made_where_they_are_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    ring = torus(10.0, 4.0, segments=24)
    faces, places = places_on(ring)
    kept = ring.on_curve(faces, places)
    monkeypatch.setattr(patches, "MOST_KEPT", 0)
    for found, wanted in zip(replace(ring).on_curve(faces, places), kept, strict=True):
        np.testing.assert_allclose(found, wanted, atol=1e-12)


@pytest.mark.parametrize("surface", [sphere(3.0, subdivisions=2), cylinder(2.0, 5.0), torus(3.0, 1.0)])
def test_the_volume_between_the_surface_and_its_triangles(surface: Surface) -> None:
    """By the middles of the sides of each triangle, which integrate quadratic functions exactly."""
    corners, faces = surface.points[surface.faces], np.arange(len(surface.faces))
    heights = np.zeros(len(faces))
    for corner in range(3):
        middle = 0.5 * (corners[:, corner] + corners[:, corner - 1])
        heights += np.einsum("ij,ij->i", surface.on_curve(faces, middle)[0] - middle, surface.normals) / 3.0
    volume = float(heights @ triangle_areas(surface.points, surface.faces)[1])
    assert volume > 0.0
    assert surface.bulge == pytest.approx(volume / surface.volume, rel=1e-9)
