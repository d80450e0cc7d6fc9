"""What runs of several channels and lights write: one run of three channels and two lights is looked at all over."""

import csv
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import meshio
import numpy as np
import pytest
import pyvista
import trimesh

from tetlux.cases import solve as solve_module
from tetlux.cases.file.case import Case
from tetlux.cases.file.colours import LUMINANCE, preview, to_linear, to_srgb
from tetlux.cases.file.detectors import read_detectors
from tetlux.cases.file.load import load_cases
from tetlux.cases.run import run_case
from tetlux.cases.write.results import Results, collect_results
from tetlux.fem import Medium, PencilBeam, PointDetector, PointSource, System, read, solve
from tetlux.fem.outcome.extremes import extremes
from tetlux.fem.outcome.radiance import radiance
from tetlux.fem.outcome.solution import Solution
from tetlux.fem.outcome.surface_exitance import surface_exitance
from tetlux.fem.solve_scenes import solve_each
from tetlux.fem.sources.light import Light
from tetlux.meshing import Surface, box, sphere, torus
from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.tets.mesh import TetMesh

COLOURS = """\
surface: {box: {size: [8, 8, 8]}}
medium: {sigma_a: [0.01, 0.03, 0.1], sigma_s_prime: [1.0, 1.1, 1.2], eta: 1.4}
lights:
  - name: beam
    pencil: {origin: [1, 0, 9], direction: [0, 0, -1], power: [2, 1, 0]}
  - point: {position: [-1, -1, 2], power: 0.5}
detectors:
  - {name: top, point: [1, 0, 4]}
  - {name: side, fibre: {center: [4, 0, 0], radius: 0.5, numerical_aperture: 0.4}}
camera: {position: [20, 10, 30]}
tolerance: 0.3
"""
CHANNELS, LIGHTS = ("red", "green", "blue"), ("beam", "point_1")


@dataclass(frozen=True, eq=False)
class Finished:
    case: Case
    solutions: list[Solution]
    folder: Path
    summary: dict[str, Any]
    surface: meshio.Mesh

    @property
    def results(self) -> Results:
        return collect_results(self.case, self.solutions)


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Finished:
    folder = tmp_path_factory.mktemp("colours")
    (folder / "colours.yaml").write_text(COLOURS)
    (case,) = load_cases(folder / "colours.yaml")
    solved: list[Solution] = []

    def kept(*given: Any, **options: Any) -> list[Solution]:
        solved.extend(solve_each(*given, **options))
        return solved

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(solve_module, "solve_each", kept)
        target = run_case(case, folder / "out")
    summary = json.loads((target / "summary.json").read_text())
    return Finished(case, solved, target, summary, meshio.read(target / "surface.ply"))


def test_the_files_of_the_run(finished: Finished) -> None:
    names = ["detectors.csv", "picture.png", "summary.json", "surface.ply", "surface.vtp", "volume.vtu"]
    assert sorted(p.name for p in finished.folder.iterdir()) == names


def test_three_channels_of_one_list_are_three_single_runs(finished: Finished, tmp_path: Path) -> None:
    """On one mesh, since each single run would refine its own."""
    for i, together in enumerate(finished.solutions):
        text = COLOURS.replace("[0.01, 0.03, 0.1]", ["0.01", "0.03", "0.1"][i])
        text = text.replace("[1.0, 1.1, 1.2]", ["1.0", "1.1", "1.2"][i]).replace("[2, 1, 0]", ["2", "1", "1"][i])
        if i == 2:
            text = text.replace("  - name: beam\n    pencil", "# ")
        (tmp_path / "single.yaml").write_text(text)
        (case,) = load_cases(tmp_path / "single.yaml")
        alone = solve(case.surface, case.medium, case.lights, mesh=together.mesh)
        assert together.mesh is finished.solutions[0].mesh
        np.testing.assert_allclose(together.fluence, alone.fluence, atol=1e-6 * alone.fluence.max())
        power = finished.summary["channels"][i]["power"]
        assert power["exited"] == pytest.approx(alone.power.exited, rel=1e-6)
        assert power["incident"] == [2.5, 1.5, 0.5][i]
        assert abs(power["balance_error"]) < 1e-9


def test_the_summary_has_channels_and_lights(finished: Finished) -> None:
    channels = finished.summary["channels"]
    assert [channel["name"] for channel in channels] == list(CHANNELS)
    assert [[light["name"] for light in channel["lights"]] for channel in channels] == [
        ["beam", "point_1"], ["beam", "point_1"], ["point_1"]
    ]  # fmt: skip
    for channel, spec in zip(channels, finished.case.channels, strict=True):
        assert channel["sigma_tr"] == spec.medium.sigma_tr  # type: ignore[union-attr]
        for key, total in channel["power"].items():
            if key != "balance_error":
                assert sum(light["power"][key] for light in channel["lights"]) == pytest.approx(total, abs=1e-12)
        values = finished.surface.point_data[f"exitance_{channel['name']}"]
        assert channel["exitance"]["max"] == pytest.approx(values.max(), rel=1e-12)
    assert channels[0]["lights"][1]["power"]["incident"] == 0.5


def test_the_surface_has_the_exitance_of_each(finished: Finished) -> None:
    values, points = finished.surface.point_data, finished.surface.points
    for channel, solution in zip(CHANNELS, finished.solutions, strict=True):
        np.testing.assert_allclose(values[f"exitance_{channel}"], solution.exitance_on(points), rtol=1e-9, atol=1e-15)
        parts = [values[f"exitance_{light}_{channel}"] for light in LIGHTS]
        np.testing.assert_allclose(sum(parts), values[f"exitance_{channel}"], rtol=1e-9)
    for light in LIGHTS:
        np.testing.assert_allclose(
            sum(values[f"exitance_{light}_{channel}"] for channel in CHANNELS), values[f"exitance_{light}"], rtol=1e-9
        )
    np.testing.assert_allclose(sum(values[f"exitance_{c}"] for c in CHANNELS), values["exitance"], rtol=1e-9)
    assert not values["exitance_beam_blue"].any()
    assert values["exitance_beam_red"].max() > 1.5 * values["exitance_beam_green"].max()


def test_vtk_shows_all_that_the_ply_holds(finished: Finished) -> None:
    """Readers of VTK find no values in a PLY."""
    shown = pyvista.read(finished.folder / "surface.vtp")
    ply, colours = finished.surface, finished.results.preview[0]
    assert shown.active_scalars_name == "exitance"
    assert set(shown.point_data) == {*ply.point_data, "preview"}
    for name, values in ply.point_data.items():
        # meshio takes bytes for signed ones.
        np.testing.assert_array_equal(shown.point_data[name], values.astype(shown.point_data[name].dtype))
    np.testing.assert_array_equal(shown.point_data["preview"], colours)
    np.testing.assert_array_equal(shown.points, ply.points)
    np.testing.assert_array_equal(shown.regular_faces, ply.cells_dict["triangle"])
    assert shown.field_data["units"] == ["lengths in mm, exitance in W/mm^2"]
    assert shown.field_data["case"] == ["colours"]


def test_the_summary_repeats_the_case_as_it_ran(finished: Finished) -> None:
    told = finished.summary["as_ran"]
    assert told["source"] == str(finished.case.source)
    assert told["sweep"] == {}
    assert told["scene"]["lights"][0] == {
        "name": "beam",
        "pencil": {"origin": [1, 0, 9], "direction": [0, 0, -1], "power": [2, 1, 0], "radius": 0, "deposit": "point"},
    }
    assert told["scene"]["lights"][1]["name"] == "point_1"
    assert told["scene"]["tolerance"] == 0.3
    channels = finished.summary["channels"]
    assert [(each["name"], [row["name"] for row in each["media"]]) for each in channels] == [
        (name, ["body"]) for name in CHANNELS
    ]
    (blue,) = channels[2]["media"]
    assert (blue["sigma_a"], blue["sigma_s_prime"], blue["eta"]) == (0.1, 1.2, 1.4)
    assert blue["albedo"] == pytest.approx(1.2 / 1.3)
    assert blue["mean_free_path"] == pytest.approx(1 / 1.3)
    assert blue["sigma_tr"] == pytest.approx(np.sqrt(3 * 0.1 * 1.3))


def test_the_surface_has_what_is_valid_in_all_channels(finished: Finished) -> None:
    values, points = finished.surface.point_data, finished.surface.points
    each = [solution.valid_at(points) for solution in finished.solutions]
    np.testing.assert_allclose(values["valid"], np.min(each, axis=0), rtol=1e-6, atol=1e-6)
    # Near the beam, that one; far away the channel that absorbs most.
    assert not np.allclose(values["valid"], each[0])
    least = [channel["validity"]["least_valid"] for channel in finished.summary["channels"]]
    # Measured: .30 to .32, .29 to .33, and .54 to .63 without the beam, as nodes come to lie.
    assert max(least[:2]) < 0.4 < least[2] - 0.05


def test_the_surface_has_radiance_towards_the_camera(finished: Finished) -> None:
    values, points = finished.surface.point_data, finished.surface.points
    eye = finished.case.camera
    assert eye is not None
    for channel, solution in zip(CHANNELS, finished.solutions, strict=True):
        np.testing.assert_allclose(values[f"radiance_{channel}"], radiance(solution, points, eye), rtol=1e-9)
    np.testing.assert_allclose(sum(values[f"radiance_{c}"] for c in CHANNELS), values["radiance"], rtol=1e-9)
    inner = np.abs(points).max(axis=1) == 4
    away = inner & (points[:, 2] < -3.999) & (np.abs(points[:, :2]).max(axis=1) < 3.9)
    assert away.any()
    assert not values["radiance"][away].any()


def test_the_surface_has_colours_that_programs_read(finished: Finished) -> None:
    head = (finished.folder / "surface.ply").read_bytes().split(b"end_header")[0].decode("ascii")
    white = finished.summary["preview_white"]
    assert f"comment red, green, blue: sRGB preview, white is {white:.6g} W/mm^2" in head
    assert "property uchar red\nproperty uchar green\nproperty uchar blue\n" in head
    values = finished.surface.point_data
    linear = np.column_stack([values[f"exitance_{channel}"] for channel in CHANNELS]) / white
    expected = np.round(255 * to_srgb(linear))
    # meshio takes bytes without a sign for bytes with one.
    given = np.column_stack([values[channel] for channel in CHANNELS]).astype(np.uint8)
    np.testing.assert_array_equal(given, expected)
    # Some of it is burnt out and most is not: 99 % of the area is darker than white.
    assert 0 < (linear @ LUMINANCE > 1).mean() < 0.6
    loaded: Any = trimesh.load(finished.folder / "surface.ply", process=False)
    np.testing.assert_array_equal(loaded.visual.vertex_colors[:, :3], given)
    assert loaded.is_watertight


def test_the_volume_has_the_fluence_of_each(finished: Finished) -> None:
    volume = meshio.read(finished.folder / "volume.vtu")
    assert sorted(volume.point_data) == ["fluence_blue", "fluence_green", "fluence_red"]
    for channel, solution in zip(CHANNELS, finished.solutions, strict=True):
        np.testing.assert_array_equal(volume.point_data[f"fluence_{channel}"], solution.fluence)


def test_detectors_are_read_for_every_channel_and_light(finished: Finished) -> None:
    with (finished.folder / "detectors.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert list(rows[0]) == [
        "name", "kind", "channel", "light", "x [mm]", "y [mm]", "z [mm]", "exitance [W/mm²]", "power [W]",
        "relative_error", "model_error",
    ]  # fmt: skip
    whose = [
        (channel, light) for channel in CHANNELS for light in ("all", *LIGHTS) if (channel, light) != ("blue", "beam")
    ]
    assert [(row["name"], row["channel"], row["light"]) for row in rows] == [
        (name, *one) for name in ("top", "side") for one in whose
    ]
    values = {(row["name"], row["channel"], row["light"]): row for row in rows}
    red = finished.solutions[0]
    top = PointDetector((1.0, 0.0, 4.0))
    whole, beam = read(top, red), read(top, red.of_lights[0])
    assert float(values["top", "red", "all"]["exitance [W/mm²]"]) == pytest.approx(whole.exitance, rel=1e-9)
    assert float(values["top", "red", "beam"]["exitance [W/mm²]"]) == pytest.approx(beam.exitance, rel=1e-9)
    assert float(values["top", "red", "all"]["relative_error"]) == pytest.approx(whole.relative_error, rel=0.01)
    # How far diffusion is to be trusted is known of all lights together.
    assert values["top", "red", "beam"]["model_error"] == ""
    # A point has no power; of what leaves a fibre's disc about the square of its aperture is within that.
    assert values["top", "red", "all"]["power [W]"] == ""
    side = values["side", "green", "all"]
    leaving = float(side["exitance [W/mm²]"]) * np.pi * 0.25
    assert float(side["power [W]"]) == pytest.approx(0.16 * leaving, rel=0.08)
    summary = finished.summary["detectors"]
    assert len(summary) == len(rows)
    assert {key: summary[0][key] for key in list(summary[0])[:7]} == {
        "name": "top", "kind": "point", "channel": "red", "light": "all", "position": [1.0, 0.0, 4.0],
        "exitance": float(rows[0]["exitance [W/mm²]"]), "power": None,
    }  # fmt: skip


def test_one_channel_and_one_light_have_no_names_beside(tmp_path: Path) -> None:
    (tmp_path / "plain.yaml").write_text(
        "surface: {box: {size: [8, 8, 8]}}\nmedium: {sigma_a: 0.01, sigma_s_prime: 1, eta: 1.4}\n"
        "lights: [{point: {position: [0, 0, 0]}}]\ncamera: {position: [0, 0, 30]}\noutputs: [surface]\ntolerance: 0.3\n"
        "detectors: [{name: top, disc: {center: [0, 0, 4], radius: 1}}]\n"
    )
    (case,) = load_cases(tmp_path / "plain.yaml")
    folder = run_case(case, tmp_path / "out")
    assert sorted(meshio.read(folder / "surface.ply").point_data) == ["exitance", "radiance", "valid"]
    summary = json.loads((folder / "summary.json").read_text())
    assert "lights" not in summary["channels"][0]
    assert "preview_white" not in summary
    assert [(row["channel"], row["light"]) for row in summary["detectors"]] == [("all", "all")]
    # A run without detectors takes the old readings away.
    (tmp_path / "plain.yaml").write_text((tmp_path / "plain.yaml").read_text().split("detectors")[0])
    run_case(load_cases(tmp_path / "plain.yaml")[0], tmp_path / "out")
    assert not (folder / "detectors.csv").exists()


def test_vertices_are_chosen_by_all_channels_together(finished: Finished) -> None:
    case, solutions = finished.case, finished.solutions
    results = collect_results(case, solutions)
    given = len(case.surface.points)
    np.testing.assert_array_equal(results.surface.points[:given], case.surface.points)
    assert len(results.surface.points) > 10 * given
    # The point source lights a corner where the beam's channel alone would not ask for more.
    total = sum(solution.exitance_on(results.surface.points) for solution in solutions)
    np.testing.assert_allclose(results.exitance(), total, rtol=1e-9)
    assert read_detectors(case.detectors, [("red", "all", solutions[0])])[0]["exitance"] > 0


@pytest.mark.parametrize(
    # The standard's own knee, and values by its formula: 1.055 x^(1/2.4) - .055.
    ("linear", "encoded"), [(0.0, 0.0), (0.0031308, 0.0404499), (0.5, 0.7353570), (0.18, 0.4613561), (1.0, 1.0)],
)  # fmt: skip
def test_srgb_is_that_of_the_standard(linear: float, encoded: float) -> None:
    assert to_srgb(np.array(linear)) == pytest.approx(encoded, abs=1e-6)
    assert to_linear(np.array(encoded)) == pytest.approx(linear, abs=1e-6)


def test_white_is_what_99_percent_of_the_area_stay_below() -> None:
    """Corners of a large triangle count more than those of a small one."""
    cube = box((1.0, 1.0, 1.0))
    grey = np.repeat(np.arange(1.0, 9.0)[:, None], 3, axis=1)
    colours, white = preview(cube, grey)
    assert white == pytest.approx(8.0)
    np.testing.assert_array_equal(colours[:, 0], np.round(255 * to_srgb(np.arange(1.0, 9.0) / 8.0)))
    points: FloatArray = np.vstack([cube.points, 0.01 * cube.points + 3.0])
    both = Surface(points, np.vstack([cube.faces, cube.faces + 8]))
    _, white = preview(both, np.vstack([grey, 100.0 * grey]))
    assert white == pytest.approx(8.0)
    colours, white = preview(cube, np.zeros((8, 3)))
    assert white == 0
    assert not colours.any()


@pytest.mark.parametrize("kind", ["two lights", "flat", "shape with parts"])
def test_the_extremes_without_vertices_are_those_of_the_surface_written(kind: str) -> None:
    medium = Medium(sigma_a=0.01, sigma_s_prime=1.0, eta=1.4)
    ball, block, ring = sphere(10.0), box((20.0, 30.0, 10.0)), torus(10.0, 4.0)
    scenes: dict[str, tuple[Surface, list[Light]]] = {
        "two lights": (ball, [PencilBeam((0.0, 0.0, 20.0), (0.2, 0.1, -1.0)), PointSource((3.0, 0.0, -7.0))]),
        "flat": (block, [PencilBeam((3.0, 2.0, 20.0), (0.0, 0.0, -1.0))]),
        "shape with parts": (ring, [PointSource((10.0, 0.0, 2.0))]),
    }
    surface, lights = scenes[kind]
    solution = solve(surface, medium, lights, tolerance=0.1)
    points, values = extremes(solution)
    np.testing.assert_allclose(values, solution.exitance_on(points), rtol=1e-12)
    everywhere = surface_exitance(solution)[1]
    assert values.max() == pytest.approx(everywhere.max(), rel=0.01)
    # Between vertices it is darker still: by 1 to 6 % on ten meshes of the ring, once by more than 10.
    assert 0.75 * everywhere.min() < values.min() < 1.01 * everywhere.min()


def test_the_extremes_of_a_run_do_not_depend_on_those_before_it() -> None:
    """Places that were tried for one light on a mesh are kept, and none of them is taken for another light's."""
    medium = Medium(sigma_a=0.01, sigma_s_prime=1.0, eta=1.4)
    ball = sphere(10.0)
    first = solve(ball, medium, [PencilBeam((0.0, 0.0, 20.0), (0.2, 0.1, -1.0))], tolerance=0.1)
    extremes(first)
    same = TetMesh(first.mesh.points, first.mesh.tetrahedra, first.mesh.unit, first.mesh.regions)
    for position in ((3.0, 0.0, -7.0), (-8.0, 0.0, 0.0)):
        found = [extremes(System(mesh, medium, ball).solve([PointSource(position)]))[0] for mesh in (first.mesh, same)]
        np.testing.assert_allclose(found[0], found[1], rtol=1e-12, atol=1e-12)
