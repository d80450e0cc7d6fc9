"""Case files with a mesh in place of surface and medium."""

import csv
import json
from pathlib import Path

import meshio
import numpy as np
import pytest

from tests.meshes_made import cube_of_cubes
from tetlux.cases.cli import main
from tetlux.cases.file.load import load_cases
from tetlux.fem import Emission, Medium, PointSource, solve
from tetlux.meshing import InputError, TetMesh, read_mesh
from tetlux.meshing.files.meshes import write_mesh

POINTS, TETRAHEDRA, PLACES = cube_of_cubes(4, 5.0)
LABELS = np.where(PLACES[:, 2] < 2, 7, 3)
BONE, SKIN = "{sigma_a: 0.01, sigma_s_prime: 2.0, eta: 1.4}", "{sigma_a: 0.02, sigma_s_prime: 1.0, eta: 1.4}"
LABELLED = f"mesh: {{file: head.msh, labels: {{skin: {SKIN}, 7: {BONE}}}}}\n"
LIGHT = "lights: [{point: {position: [10, 10, 12]}}]\ntolerance: 0.9\n"


@pytest.fixture
def path(tmp_path: Path) -> Path:
    inverted = TETRAHEDRA.copy()
    inverted[0] = inverted[0][[1, 0, 2, 3]]
    data = {"region": [LABELS]}
    meshio.Mesh(POINTS, [("tetra", inverted)], cell_data=data).write(tmp_path / "turned.vtu")
    write_mesh(TetMesh(POINTS, TETRAHEDRA, regions=LABELS, labels={7: "bone", 3: "skin"}), tmp_path / "head.msh")
    return tmp_path / "case.yaml"


def refused(path: Path, text: str, words: str) -> None:
    path.write_text(text)
    with pytest.raises(InputError, match=words):
        load_cases(path)


def test_a_run_writes_everything(path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path.write_text(
        LABELLED.replace("head.msh", "turned.vtu").replace("skin:", "3:")
        + LIGHT
        + "detectors: [{name: above, disc: {center: [10, 10, 20], radius: 2}}]\noutputs: [surface, volume]\n"
    )
    out = path.parent / "out"
    assert main(["run", str(path), "--out", str(out)]) == 0
    printed = capsys.readouterr().out
    assert printed.count("1 of 384 tetrahedra were inverted and have been turned.") == 1
    summary = json.loads((out / "case" / "summary.json").read_text())
    assert summary["mesh"]["tetrahedra"] == 384
    assert summary["mesh"]["surface_deviation"] == pytest.approx(0.0, abs=1e-9)
    assert summary["mesh"]["labels"] == [
        {"label": 3, "name": None, "volume": pytest.approx(4000.0)},
        {"label": 7, "name": None, "volume": pytest.approx(4000.0)},
    ]
    assert summary["repairs"] == ["1 of 384 tetrahedra were inverted and have been turned."]
    assert not set(summary["repairs"]) & set(summary["warnings"])
    media = {3: Medium(sigma_a=0.02, sigma_s_prime=1.0, eta=1.4), 7: Medium(sigma_a=0.01, sigma_s_prime=2.0, eta=1.4)}
    expected = solve(read_mesh(path.parent / "turned.vtu"), media, [PointSource((10, 10, 12))], tolerance=0.9)
    (channel,) = summary["channels"]
    assert channel["power"]["absorbed"] == pytest.approx(expected.power.absorbed, rel=1e-9)
    # Both labels have the same share of the boundary, and the first one counts.
    assert (channel["sigma_tr"], channel["albedo"]) == (media[3].sigma_tr, media[3].albedo)
    assert [medium["sigma_tr"] for medium in channel["media"]] == [each.sigma_tr for each in media.values()]
    again = read_mesh(out / "case" / "volume.vtu")
    assert again.region_volumes == pytest.approx({3: 4000.0, 7: 4000.0})
    surface = meshio.read(out / "case" / "surface.ply")
    assert surface.points.min(axis=0) == pytest.approx([0, 0, 0])
    assert surface.points.max(axis=0) == pytest.approx([20, 20, 20])
    with (out / "case" / "detectors.csv").open(encoding="utf-8") as file:
        assert float(next(csv.DictReader(file))["power [W]"]) > 0


def test_check_describes_the_mesh(path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path.write_text(
        LABELLED.replace("file: head.msh", "file: head.msh, scale: 0.1")
        + "unit: cm\n"
        + LIGHT.replace("10, 10, 12", "1, 1, 1.2")
    )
    # A body a tenth as large has fewer mean free paths.
    assert main(["check", str(path)]) == 0
    first, *rest = capsys.readouterr().out.splitlines()
    assert first.endswith("125 nodes, 384 tetrahedra, 2 x 2 x 2 cm")
    assert rest == ["  label 3 (skin): 192 tetrahedra, 4 cm³", "  label 7 (bone): 192 tetrahedra, 4 cm³"]


def test_channels_sweeps_and_emission(path: Path) -> None:
    path.write_text(
        LABELLED.replace("sigma_a: 0.01", "sigma_a: [0.01, 0.02]")
        + "lights: [{emission: {density: 1, region: bone}}, {emission: {density: 1, region: 3}}]\n"
        + "sweep: {mesh.labels.skin.sigma_a: [0.1, 0.2], mesh.labels.7.sigma_s_prime: [1.5, 2.5], mesh.scale: [1, 2]}\n"
    )
    cases = load_cases(path)
    assert len(cases) == 8
    last = cases[-1]
    assert last.name == "case/mesh.labels.skin.sigma_a=0.2,mesh.labels.7.sigma_s_prime=2.5,mesh.scale=2"
    assert last.mesh is not None
    assert last.mesh.volume == pytest.approx(64000.0)
    one, two = last.channels
    assert isinstance(two.media, dict)
    assert (two.media[3].sigma_a, two.media[7].sigma_a, two.media[7].sigma_s_prime) == (0.2, 0.02, 2.5)
    assert list(one.lights.values()) == [Emission(1.0, 7), Emission(1.0, 3)]
    assert not last.has_single_medium


def test_coefficients_from_files_are_those_of_their_label(path: Path) -> None:
    # Known in the upper half only.
    np.save(path.parent / "a.npy", np.full((2, 2, 2), 0.05))
    field = "{array: {file: a.npy, origin: [5, 5, 12.5], spacing: [10, 10, 5]}}"
    path.write_text(LABELLED.replace("sigma_a: 0.02", f"sigma_a: {field}") + LIGHT)
    assert main(["run", str(path), "--out", str(path.parent / "out")]) == 0
    refused(
        path, LABELLED.replace("sigma_a: 0.01", f"sigma_a: {field}") + LIGHT, r"mesh\.labels\.7\.sigma_a: .*not cover"
    )


def test_the_array_of_labels_is_a_key(path: Path) -> None:
    data = {"one": [LABELS], "two": [PLACES[:, 0]]}
    meshio.Mesh(POINTS, [("tetra", TETRAHEDRA)], cell_data=data).write(path.parent / "two.vtu")
    text = f"mesh: {{file: two.vtu, array: one, labels: {{3: {SKIN}, 7: {BONE}}}}}\n" + LIGHT
    path.write_text(text)
    assert load_cases(path)[0].mesh is not None
    refused(path, text.replace("array: one, ", ""), r"mesh\.labels\.3: the mesh has no label \"3\"; its labels are 0")
    refused(path, text.replace("array: one", "array: three"), r'mesh: .*two\.vtu: it holds no array "three"')


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (LABELLED + "surface: {sphere: {radius: 1}}\n", r"line 1: mesh: mesh replaces .*; leave surface out"),
        (LABELLED + f"medium: {SKIN}\n", "leave medium out"),
        (
            LABELLED + f"regions: [{{surface: {{sphere: {{radius: 1}}}}, medium: {SKIN}}}]\ncompare: [dipole]\n",
            "leave regions and compare out",
        ),
        ("surface: {sphere: {radius: 10}}\n", "medium is missing; a case needs surface and medium, or mesh"),
        (f"medium: {SKIN}\n", "surface is missing; a case needs surface and medium, or mesh"),
        (
            LABELLED.replace("skin:", "skim:"),
            r'line 1: mesh\.labels\.skim: the mesh has no label "skim"; did you mean "sk',
        ),
        (LABELLED.replace("skin:", "4:"), r'mesh\.labels\.4: the mesh has no label "4"; its labels are 3 \(skin\)'),
        (LABELLED.replace("skin:", "bone:"), r"mesh\.labels\.7: label 7 \(bone\) has two media; give it one"),
        (
            f"mesh: {{file: head.msh, labels: {{7: {BONE}}}}}\n",
            r"mesh\.labels: the mesh's label 3 \(skin\) has no medium",
        ),
        ("mesh: {file: head.msh, labels: {}}\n", r"mesh\.labels"),
        ("mesh: {file: head.msh, labels: 3}\n", r"mesh\.labels: expected keys and values"),
        ("mesh: {file: head.msh}\n", r"mesh\.labels: this key is missing"),
        (LABELLED.replace("sigma_a: 0.01", "sigma_b: 0.01"), r"mesh\.labels\.7\.sigma_b: unknown key; did you mean"),
        (LABELLED.replace("sigma_a: 0.01", "sigma_a: -1"), r"mesh\.labels\.7\.sigma_a: sigma_a is -1"),
        (LABELLED.replace("eta: 1.4}}", "eta: 1.3}}"), r"mesh\.labels: a region's refractive index of 1\.3"),
        (LABELLED.replace("head.msh", "none.msh"), r"line 1: mesh: .*none\.msh does not exist"),
        (LABELLED.replace("head.msh", "head.msh, scale: 1e-6"), r"mesh.*absurdly small for diffusion"),
    ],
)
def test_what_does_not_go_with_a_mesh(path: Path, text: str, words: str) -> None:
    refused(path, text + LIGHT, words)


def test_regions_of_emission_are_labels(path: Path) -> None:
    text = LABELLED + "lights: [{emission: {density: 1, region: brain}}]\n"
    refused(path, text, r'lights\[0\]\.emission\.region: there is no region "brain"; the regions here are .*skin')
