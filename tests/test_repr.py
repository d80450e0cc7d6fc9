"""What a user sees who types the name of an object: one line with its size, units and figures."""

import numpy as np
import pytest

from tetlux.fem import (
    Emission,
    EnvironmentLight,
    Medium,
    PencilBeam,
    PointSource,
    Region,
    Solution,
    System,
    VaryingMedium,
    grid_field,
    solve,
    table,
)
from tetlux.fem.body.body import Body
from tetlux.meshing import Surface, TetMesh, box, sphere
from tetlux.meshing.describe import LONGEST_LINE

TISSUE = Medium(sigma_a=0.01, sigma_s_prime=1.0, eta=1.4)


def test_a_surface_and_a_mesh_say_their_size(ball: Surface, ball_mesh: TetMesh) -> None:
    # Of the faceted ball, 4/3 pi 10³ less 0.2 %.
    assert repr(ball) == 'Surface("sphere", 5,120 triangles, 20 x 20 x 20 mm, volume 4.18e+03 mm³)'
    assert repr(box((1.0, 2.0, 3.0), unit="cm")) == 'Surface("box", 12 triangles, 1 x 2 x 3 cm, volume 6 cm³)'
    line = f"TetMesh({len(ball_mesh.points):,} nodes, {len(ball_mesh.tetrahedra):,} tetrahedra, "
    assert repr(ball_mesh).startswith(line)
    assert repr(ball_mesh).endswith(" mm³)")
    one = TetMesh(np.vstack([np.zeros(3), np.eye(3)]), np.array([[0, 1, 2, 3]]), "in", np.array([1]))
    assert repr(one) == "TetMesh(4 nodes, 1 tetrahedron, 1 x 1 x 1 in, volume 0.167 in³)"


def test_a_solution_says_what_leaves_and_how_well_it_is_known(ball_solution: Solution) -> None:
    text = repr(ball_solution)
    assert text.startswith(f"Solution({len(ball_solution.mesh.points):,} nodes, exitance ")
    assert f"to {ball_solution.exitance.max():.3g} W/mm², {ball_solution.power.exited:.4g} of 1 W exited" in text
    assert f"estimated error {ball_solution.error_estimate:.2%}" in text


def test_parts_of_a_solution_are_counted(ball_mesh: TetMesh) -> None:
    both = solve(ball_mesh, TISSUE, [PointSource((0.0, 0.0, 3.0)), Emission(0.001)])
    assert ", 2 lights" in repr(both)
    assert "light" not in repr(both.of_lights[0])
    assert "error" not in repr(both.of_lights[0])


def test_whatever_holds_arrays_is_one_line(ball_solution: Solution) -> None:
    mesh, surface = ball_solution.mesh, ball_solution.surface
    system = System(mesh, TISSUE, surface)
    field = grid_field(np.full((4, 4, 4), 0.01), origin=(-20.0, -20.0, -20.0), spacing=15.0)
    beam, angles = PencilBeam((0.0, 0.0, 20.0), (0.0, 0.0, -1.0)), list(range(181))
    for thing in (
        ball_solution, *ball_solution.patches, ball_solution.patches[0].charges, ball_solution.validity, mesh, surface,
        system, system.coefficients, system.plain, Region(surface, TISSUE), VaryingMedium(base=TISSUE, sigma_a=field),
        EnvironmentLight(np.ones((64, 128))), beam.deposit_in(Body(surface, (TISSUE,))),
        table(angles, [0.25 / np.pi] * 181),
    ):  # fmt: skip
        text = repr(thing)
        assert len(text) <= LONGEST_LINE, text
        assert "\n" not in text
        assert text.startswith(type(thing).__name__)


@pytest.mark.parametrize(
    ("medium", "text"),
    [
        (TISSUE, "Medium(sigma_a=0.01, eta=1.4, sigma_s_prime=1.0)"),
        (Medium(sigma_a=0.0, sigma_s=10.0, g=0.9, eta=1.0), "Medium(sigma_a=0.0, eta=1.0, sigma_s=10.0, g=0.9)"),
    ],
)
def test_a_medium_says_what_was_given(medium: Medium, text: str) -> None:
    assert repr(medium) == text
    region = Region(sphere(3.0, unit="mm"), medium)
    assert repr(region).endswith(f"medium={text})")
