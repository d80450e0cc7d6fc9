"""What is subtracted of point sources: it is a solution, it is nearly the half-space's, and it does no harm."""

from dataclasses import replace

import numpy as np
import pytest

from tests.conftest import TISSUE, block
from tetlux.fem import Medium, PencilBeam, PointSource, System, solve
from tetlux.fem.body.body import Body
from tetlux.fem.charges.kernel import equation_of
from tetlux.fem.exact import half_space
from tetlux.fem.known.charges import Charges
from tetlux.fem.known.images import MOST_IMAGE_CHARGES, charges_of
from tetlux.fem.known.patch import Patch, _any_inside, _point_cells, patch_of
from tetlux.fem.known.split import Subtract, split_lights
from tetlux.fem.operators.assembly import Lumping
from tetlux.meshing import Surface, TetMesh, box, slab, sphere, surface_from_arrays, tetrahedralize, torus
from tetlux.meshing.arrays import FloatArray

PLATE = slab(200.0, 100.0)
SOURCE = np.array([[0.0, 0.0, -1.0]])
ONE = np.ones(1)


def charged(points: FloatArray, powers: FloatArray, surface: Surface, medium: Medium, *, images: bool) -> Charges:
    """The charges of some points, which are few enough."""
    found = charges_of(points, powers, surface, medium, images=images)
    assert found is not None
    return found


@pytest.mark.parametrize("eta", [1.0, 1.4])
def test_charges_are_nearly_the_half_space(eta: float) -> None:
    medium = Medium(sigma_a=0.01, sigma_s_prime=1.0, eta=eta)
    charges = charged(SOURCE, ONE, PLATE, medium, images=True)
    rho = np.linspace(0.0, 3.0, 30)
    points = np.column_stack([rho, 0 * rho, 0 * rho])
    truth = half_space.point_fluence(medium, depth=1.0, points=np.column_stack([rho, 0 * rho, 0 * rho]))
    # Panels of two points: 1 % and 3 % off, and finite elements solve for what is left.
    assert charges.fluence(points) == pytest.approx(truth, rel=0.05)
    alone = charged(SOURCE, ONE, PLATE, medium, images=False)
    apart = np.hypot(rho, 1.0)
    free = np.exp(-medium.sigma_tr * apart) / (4.0 * np.pi * medium.diffusion * apart)
    np.testing.assert_allclose(alone.fluence(points), free, rtol=1e-12)


def test_charges_solve_the_equation_inside() -> None:
    charges = charged(SOURCE, ONE, PLATE, TISSUE, images=True)
    x, step = np.array([[0.7, -0.4, -2.0]]), 1e-3
    around = np.vstack([x + s * step * e for e in np.eye(3) for s in (-1, 1)])
    here = charges.fluence(x)[0]
    laplacian = (charges.fluence(around).sum() - 6.0 * here) / step**2
    assert laplacian == pytest.approx(TISSUE.sigma_tr**2 * here, rel=1e-4)
    values = charges.fluence(around)
    _, gradient = charges.fluence_and_gradient(x)
    np.testing.assert_allclose(gradient[0], (values[1::2] - values[::2]) / (2.0 * step), rtol=1e-5)


@pytest.mark.parametrize("gap", [4.0, 0.6, 0.4, 0.2, 0.05])
def test_images_never_lie_in_another_part_of_the_body(gap: float) -> None:
    """On the inner side of a ring the line of images points across the hole, at the other side."""
    ring = torus(10.0 + 0.5 * gap, 10.0)
    charges = charged(np.array([[1.0 + 0.5 * gap, 0.0, 0.0]]), ONE, ring, TISSUE, images=True)
    images = charges.positions[1:]
    assert not ring.contains(images).any()
    foot = np.array([0.5 * gap, 0.0, 0.0])
    clear = np.linalg.norm(ring.closest(images)[0] - images, axis=1)
    assert (clear >= 0.499 * np.linalg.norm(images - foot, axis=1)).all()
    assert len(images) < len(charged(SOURCE, ONE, PLATE, TISSUE, images=True).positions) - 1
    # A source deeper than the hole is wide has no image at all.
    assert (len(images) == 0) == (gap < 1)


@pytest.mark.parametrize("mass", ["lumped", "consistent"])
def test_what_is_subtracted_does_not_change_where_the_solution_converges_to(mass: Lumping) -> None:
    """A source well inside a block, on a mesh that resolves it: plain P1, and both subtractions."""
    mesh = block((20, 20, 20), (10.0, 10.0, 10.0))
    light = [PointSource((0.0, 0.0, -5.0))]
    ways: list[Subtract] = ["nothing", "free-space", "half-space"]
    plain, free, half = (solve(mesh, TISSUE, light, mass=mass, subtract=s) for s in ways)
    weights = mesh.boundary_node_areas
    for other in (plain, free):
        gap = np.sqrt(weights @ (other.exitance - half.exitance) ** 2 / (weights @ half.exitance**2))
        assert gap < 0.01
        assert other.power.exited == pytest.approx(half.power.exited, rel=0.004)
    assert max(abs(s.power.balance_error) for s in (plain, free, half)) < 1e-9


def test_a_few_hundred_nodes_do_for_a_source_below_the_surface() -> None:
    """A slab's exitance to some per cent at once, where plain P1 on the same mesh is far off."""
    mesh = block((12, 12, 6), (30.0, 30.0, 10.0))
    light = [PointSource((0.3, 0.2, -1.0))]
    rho = np.linspace(0.0, 6.0, 40)
    points = np.column_stack([0.3 + rho, 0.2 + 0 * rho, 0 * rho])
    truth = half_space.point_exitance(TISSUE, depth=1.0, rho=rho)
    weights = rho

    def error(subtract: Subtract) -> float:
        found = solve(mesh, TISSUE, light, subtract=subtract).exitance_at(points)
        return float(np.sqrt(weights @ (found - truth) ** 2 / (weights @ truth**2)))

    # Measured 0.9 %, 26 % and 61 %.
    assert error("half-space") < 0.02
    assert error("nothing") > 10 * error("half-space")
    assert error("free-space") > 3 * error("half-space")


def test_a_source_at_a_node_has_a_finite_fluence() -> None:
    mesh = block((4, 4, 4), (4.0, 4.0, 4.0))
    solution = solve(mesh, TISSUE, [PointSource((0.0, 0.0, -2.0))])
    assert np.isfinite(solution.fluence).all()
    assert abs(solution.power.balance_error) < 1e-9


def test_values_between_nodes_are_those_of_the_closed_form() -> None:
    """Close to a source deep inside, fluence is 1/(4 pi D r): the mesh is far too coarse to show that itself."""
    mesh = block((10, 10, 10), (40.0, 40.0, 40.0))
    solution = solve(mesh, TISSUE, [PointSource((0.0, 0.0, -20.0))])
    r = np.array([0.1, 0.5, 1.0])
    found = solution.fluence_at(np.column_stack([r, 0 * r, 0 * r - 20.0]))
    free = np.exp(-TISSUE.sigma_tr * r) / (4.0 * np.pi * TISSUE.diffusion * r)
    np.testing.assert_allclose(found, free, rtol=0.05)


def test_a_wide_beam_is_subtracted_too(ball: Surface, ball_mesh: TetMesh) -> None:
    beam = PencilBeam((0.0, 0.0, 20.0), (0.0, 0.0, -1.0), radius=1.0)
    solution = solve(ball, TISSUE, [beam], mesh=ball_mesh)
    assert solution.patches[0].charges.sources == 127
    assert abs(solution.power.balance_error) < 1e-9


def test_many_lights_on_one_mesh(ball: Surface, ball_mesh: TetMesh) -> None:
    """A system solves as `solve` does, and each light's solution knows nothing of the others."""
    lights = [PointSource((0.0, 0.0, 8.5)), PointSource((5.0, 0.0, -5.0), power=2.0)]
    system = System(ball_mesh, TISSUE, ball)
    for light in lights:
        assert system.solve([light]).fluence == pytest.approx(solve(ball, TISSUE, [light], mesh=ball_mesh).fluence)
    together = system.solve(lights)
    apart = sum(system.solve([light]).fluence for light in lights)
    assert together.fluence == pytest.approx(apart, rel=1e-8)


def test_spheres_of_all_sizes_share_one_shape() -> None:
    """A wide curved body and its images: nothing in it knows a length but the mean free path."""
    for scale in (1e-3, 1e3):
        medium = Medium(sigma_a=0.01 / scale, sigma_s_prime=1.0 / scale, eta=1.4)
        charges = charged(scale * np.array([[0.3, 0.2, 9.0]]), ONE, sphere(10.0 * scale), medium, images=True)
        plain = charged(np.array([[0.3, 0.2, 9.0]]), ONE, sphere(10.0), TISSUE, images=True)
        np.testing.assert_allclose(charges.positions / scale, plain.positions, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(charges.strengths, plain.strengths, rtol=1e-9)


def test_more_charges_than_can_be_afforded_are_none() -> None:
    few = charged(SOURCE, ONE, PLATE, TISSUE, images=True)
    count = len(few.positions)
    assert charges_of(SOURCE, ONE, PLATE, TISSUE, images=True, most=count) is not None
    assert charges_of(SOURCE, ONE, PLATE, TISSUE, images=True, most=count - 1) is None


def two_boxes(gap: float) -> Surface:
    """Cubes of edge 10, one above the other, the lower one's upper face at z = 0."""
    cube = box((10.0, 10.0, 10.0))
    apart = np.array([0.0, 0.0, 5.0])
    points = np.vstack([cube.points - apart, cube.points + apart + [0.0, 0.0, gap]])
    return surface_from_arrays(points, np.vstack([cube.faces, cube.faces + len(cube.points)]))


def test_a_body_close_by_changes_nothing() -> None:
    """The images of a source would lie in it."""
    light = [PointSource((0.0, 0.0, -1.0))]
    alone = solve(slab(10.0, 10.0), TISSUE, light)
    beside = solve(two_boxes(0.2), TISSUE, light)
    assert beside.power.exited == pytest.approx(alone.power.exited, rel=0.005)
    assert beside.error_estimate <= 0.02


@pytest.mark.parametrize(("subtract", "depth"), [("half-space", 1e-7), ("free-space", 1e-7)])
def test_a_source_next_to_the_surface_loses_no_power(subtract: Subtract, depth: float) -> None:
    """No integral over facets sees it there, so it is not subtracted."""
    mesh = block((16, 16, 8), (8.0, 8.0, 4.0))
    light = [PointSource((0.3, 0.2, -depth))]
    near = solve(mesh, TISSUE, light, subtract=subtract)
    assert not near.patches[0].cells.any()
    # The sum of all loads is the power that goes in, and what exits is that of a source a little deeper.
    deeper = solve(mesh, TISSUE, [PointSource((0.3, 0.2, -0.01))])
    assert near.power.exited == pytest.approx(deeper.power.exited, rel=0.02)


def test_a_patch_too_coarse_for_its_source_is_dropped() -> None:
    """A mesh whose tetrahedra are larger than all that happens: plain P1 is the better answer there."""
    ring = torus(7.0, 6.0)
    mesh = tetrahedralize(ring)
    light = [PointSource((1.02, 0.0, 0.0))]
    solution = solve(ring, TISSUE, light, mesh=mesh)
    plain = solve(ring, TISSUE, light, mesh=mesh, subtract="nothing")
    assert solution.power.exited == pytest.approx(plain.power.exited, rel=0.05)
    assert min(solution.power.absorbed, solution.power.exited) > 0


def test_lights_share_the_charges_that_can_be_afforded(ball: Surface) -> None:
    """A wide beam goes without images, or without anything; a source beside it keeps what it has."""
    point = PointSource((0.0, 0.0, -9.0))
    for radius, most in ((2.5, 1), (20.0, 0)):
        wide = PencilBeam((0.0, 0.0, 30.0), (0.0, 0.0, -1.0), radius=min(radius, 9.0))
        split = split_lights([point, wide], Body(ball, (TISSUE,)), "half-space")
        assert len(split.charges[0].positions) > 1
        assert sum(len(c.positions) for c in split.charges) <= MOST_IMAGE_CHARGES
        assert sum(float(d.terms.powers.sum()) for d in split.remaining) + sum(
            float(c.strengths[: c.sources].sum()) for c in split.charges
        ) == pytest.approx(sum(float(d.terms.powers.sum()) for d in split.deposits))
        assert len(split.charges) >= 1 + most


@pytest.fixture(scope="module")
def ring_mesh() -> TetMesh:
    """Concave: what lies in its hole sees it all round."""
    return tetrahedralize(torus(6.0, 2.5), edge_length=1.5)


def test_faces_of_a_patch_are_its_boundary(ring_mesh: TetMesh) -> None:
    middles = ring_mesh.points[ring_mesh.tetrahedra].mean(axis=1)
    for cells in (middles[:, 0] > 2.0, middles[:, 0] < -50.0, middles[:, 0] > -50.0, np.arange(len(middles)) % 3 == 0):
        patch = Patch(ring_mesh, NO_CHARGES, cells, np.zeros(len(ring_mesh.points)))
        faces, on_boundary = patch.faces
        expected = set()
        if cells.any():
            alone = TetMesh(ring_mesh.points, ring_mesh.tetrahedra[cells])
            expected = {turned(face) for face in alone.boundary_faces.tolist()}
        assert len(faces) == len(expected)
        assert {turned(face) for face in faces.tolist()} == expected
        outer = {turned(face) for face in ring_mesh.boundary_faces.tolist()}
        assert [turned(face) in outer for face in faces.tolist()] == on_boundary.tolist()


@pytest.mark.parametrize("height", [-1e-2, -1e-5, 1e-5])
def test_an_image_in_the_body_or_next_to_it_drops_the_patch(height: float) -> None:
    """The integrals over the facet next to it would not see it, nor the ledger that they are wrong."""
    mesh = block((4, 4, 4), (4.0, 4.0, 4.0))
    facets = mesh.points[mesh.boundary_faces]
    above = facets[np.flatnonzero(mesh.surface.normals[:, 2] > 0.5)[5]].mean(axis=0)
    everywhere = np.ones(len(mesh.points), dtype=bool)
    for up, sound in ((height, False), (0.5, True)):
        positions = np.array([[0.1, 0.2, -1.5], np.add(above, [0.0, 0.0, up])])
        charges = Charges(equation_of(TISSUE), positions, np.array([1.0, -0.5]), 0.01, sources=1, medium=TISSUE)
        assert patch_of(mesh, charges, everywhere).cells.any() == sound


NO_CHARGES = Charges(equation_of(TISSUE), np.zeros((0, 3)), np.zeros(0), 1.0, sources=0, medium=TISSUE)


def turned(face: list[int]) -> tuple[int, ...]:
    """The same triangle, seen from the same side, from its smallest corner on."""
    first = face.index(min(face))
    return tuple(face[first:] + face[:first])


def test_points_are_found_in_a_concave_body_by_the_way_from_its_boundary(ring_mesh: TetMesh) -> None:
    """And those outside are known to be, as the box tree knows both; also a hair from the boundary."""
    random = np.random.default_rng(3)
    points = random.uniform(-9.0, 9.0, (3000, 3)) * [1.0, 1.0, 0.3]
    hairs = 1e-6 * ring_mesh.diagonal * random.choice([-1.0, 1.0], (300, 1)) * ring_mesh.surface.normals[:300]
    points[100:400] = ring_mesh.points[ring_mesh.boundary_faces[:300]].mean(axis=1) + hairs
    truly, _ = ring_mesh.locate(points)
    assert 0.2 < (truly >= 0).mean() < 0.8
    foot, face, _ = ring_mesh.closest_boundary(points)
    # The box tree takes points that lie outside by a millionth of a tetrahedron for inside: here none may be so near.
    apart = np.linalg.norm(points - foot, axis=1) > 3e-7 * ring_mesh.diagonal
    assert apart[100:400].all()
    points, truly, foot, face = points[apart], truly[apart], foot[apart], face[apart]
    found = _point_cells(ring_mesh, points, foot, face)
    assert ((found >= 0) == (truly >= 0)).all()
    # Between two tetrahedra either is right.
    inside = np.flatnonzero(found >= 0)
    assert ring_mesh.barycentric(points[inside], found[inside]).min() > -1e-8
    cells = ring_mesh.points[ring_mesh.tetrahedra].mean(axis=1)[:, 0] > 0.0
    charges = replace(NO_CHARGES, positions=points[:1], strengths=ONE)
    patch = Patch(ring_mesh, charges, cells, np.zeros(len(ring_mesh.points)))
    for point, home in zip(points[1:400], truly[1:400].tolist(), strict=True):
        assert _any_inside(patch, point[None]) == (home >= 0 and bool(cells[home]))
    assert _any_inside(patch, points[1:])
    assert not _any_inside(patch, points[1:][truly[1:] < 0])
