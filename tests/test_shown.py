"""How solutions are handed to PyVista, drawn by it, and shown in notebooks."""

import re
from html import unescape
from typing import Any

import numpy as np
import pytest

from tests.conftest import TISSUE
from tetlux.fem import ChargeSolution, PointDetector, PointSource, Solution, plan, solve
from tetlux.meshing import InputError, Surface, TetMesh, sphere


@pytest.fixture(scope="module")
def by_charges() -> ChargeSolution:
    solution = solve(sphere(10.0), TISSUE, [PointSource((0, 0, 5))], model="charges")
    assert isinstance(solution, ChargeSolution)
    return solution


def blocks_of(solution: Solution | ChargeSolution) -> Any:
    return solution.to_pyvista()


def table_of(shown: Any) -> dict[str, str]:
    cells = re.findall(r"<th[^>]*>(.*?)</th><td[^>]*>(.*?)</td>", shown._repr_html_())
    return {unescape(name): unescape(value) for name, value in cells}


def test_pyvista_gets_all_arrays(ball_solution: Solution) -> None:
    blocks = blocks_of(ball_solution)
    surface, volume = blocks["surface"], blocks["volume"]
    np.testing.assert_allclose(surface["exitance"], ball_solution.exitance_on(surface.points))
    np.testing.assert_allclose(surface["valid"], ball_solution.valid_on(np.asarray(surface.points)))
    np.testing.assert_array_equal(volume["fluence"], ball_solution.fluence)
    np.testing.assert_array_equal(volume.cells_dict[10], ball_solution.mesh.tetrahedra)
    assert surface.volume == pytest.approx(4 / 3 * np.pi * 1000, rel=0.01)
    assert volume.volume == pytest.approx(ball_solution.mesh.volume)


def test_modulated_light_has_amplitude_and_phase(ball_mesh: TetMesh) -> None:
    solution = solve(ball_mesh, TISSUE, [PointSource((0, 0, 5))], frequency=1e8)
    assert isinstance(solution, Solution)
    blocks = blocks_of(solution)
    surface, volume = blocks["surface"], blocks["volume"]
    np.testing.assert_allclose(surface["exitance"], np.abs(solution.exitance_on(surface.points)))
    assert 0 < surface["phase"].min() < surface["phase"].max() < 90
    assert volume["phase"].max() > volume["phase"].min()
    assert not np.iscomplexobj(volume["fluence"])
    assert table_of(solution)["exited power"].endswith("%)")


def test_a_solution_without_mesh_has_a_surface(by_charges: ChargeSolution) -> None:
    blocks = blocks_of(by_charges)
    assert blocks.keys() == ["surface"]
    with pytest.raises(InputError, match="without a mesh cannot be cut; leave cut out"):
        by_charges.plot(cut="x", show=False)


def test_plot_colours_by_the_field(ball_solution: Solution) -> None:
    def mapper(**options: Any) -> Any:
        return ball_solution.plot(show=False, **options).mapper

    exitance = blocks_of(ball_solution)["surface"]["exitance"]
    drawn = mapper()
    assert drawn.lookup_table.log_scale
    assert drawn.scalar_range[1] == pytest.approx(exitance.max())
    assert drawn.scalar_range[0] == pytest.approx(max(exitance.min(), 1e-6 * exitance.max()))
    assert not mapper(field="valid").lookup_table.log_scale
    assert not mapper(log=False).lookup_table.log_scale
    cut = mapper(cut="x").dataset
    assert cut.volume == pytest.approx(0.5 * ball_solution.mesh.volume, rel=0.02)
    assert cut.active_scalars_name == "fluence"
    with pytest.raises(InputError, match='there is no field "radiance" here; the fields are exitance, valid, fluence'):
        mapper(field="radiance")


def test_notebooks_show_tables(ball: Surface, ball_mesh: TetMesh, by_charges: ChargeSolution) -> None:
    assert table_of(ball) == {"triangles": "5,120", "size": "20 x 20 x 20 mm", "volume": "4180 mm³"}
    assert table_of(ball_mesh)["tetrahedra"] == f"{len(ball_mesh.tetrahedra):,}"
    layered = TetMesh(ball_mesh.points, ball_mesh.tetrahedra, "mm", (ball_mesh.tetrahedra[:, 0] % 2), {1: "fat"})
    assert {"region 0", "region fat"} < table_of(layered).keys()
    medium = table_of(TISSUE)
    assert medium["transport mean free path"] == "0.9901 unit"
    assert medium["reduced scattering sigma_s'"] == "1 /unit"
    assert table_of(by_charges)["model"] == "charges"
    solution = solve(ball_mesh, TISSUE, [PointSource((0, 0, 5))], detectors=[PointDetector((10, 0, 0))])
    rows = table_of(solution)
    assert rows["mesh"].startswith(f"{len(ball_mesh.points):,} nodes")
    assert re.fullmatch(r"[\d.e-]+ W/mm² ± [\d.e-]+ %", rows["reading 1"])
    assert rows["incident power"] == "1 W (100 %)"
    chosen = plan(ball, TISSUE, [PointSource((0, 0, 5))], tolerance=0.02)
    assert "plan: " in chosen._repr_html_()
    assert set(table_of(chosen)) >= {"charges", "full", "closed-form", "truncated"}
