"""Meshes with a medium for each label."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from tests.meshes_made import cube_of_cubes
from tetlux.fem import (
    DiffuseLight,
    Emission,
    Light,
    Medium,
    PencilBeam,
    PointSource,
    Region,
    Solution,
    System,
    VaryingMedium,
    solve,
)
from tetlux.fem.media.coefficients import coefficients_on
from tetlux.meshing import InputError, TetMesh, box, mesh_from_arrays, refine

TISSUE, FLUID = Medium(sigma_a=0.02, sigma_s_prime=1.0, eta=1.4), Medium(sigma_a=0.004, sigma_s_prime=0.3, eta=1.4)
POINTS, TETRAHEDRA, PLACES = cube_of_cubes(5, 4.0)
INNER, ISLAND = ((PLACES >= 1) & (PLACES <= 3)).all(axis=1), (PLACES == 2).all(axis=1)
# A shell of fluid in tissue, with an island of tissue in it, as in every head.
SHELL = INNER & ~ISLAND
HEAD = mesh_from_arrays(POINTS, TETRAHEDRA, labels=np.where(SHELL, 1, 0), names={0: "tissue", 1: "fluid"})
LIGHT = [PointSource((10.0, 10.0, 19.0))]


def absorbed(mesh: TetMesh, media: Mapping[Any, Medium]) -> float:
    solution: Solution = solve(mesh, media, LIGHT, tolerance=0.9)
    return float(solution.power.absorbed)


def test_an_island_within_a_shell() -> None:
    # redbirdpy on this mesh, whose mass is consistent and whose fluence may dip below zero.
    solution = solve(HEAD, {0: TISSUE, 1: FLUID}, LIGHT, tolerance=0.9, mass="consistent", limit=False)
    assert solution.power.absorbed == pytest.approx(0.3434, abs=5e-5)
    assert solution.mesh is HEAD
    assert solution.power.balance_error == pytest.approx(0.0, abs=1e-12)
    # The default: lumped mass, no fluence below zero.
    assert absorbed(HEAD, {0: TISSUE, 1: FLUID}) == pytest.approx(0.33397, abs=1e-4)


def test_any_integers_and_names_are_labels() -> None:
    expected = absorbed(HEAD, {0: TISSUE, 1: FLUID})
    other = replace(HEAD, regions=np.where(SHELL, -5, 1000), labels={})
    for mesh, media in (
        (HEAD, {"tissue": TISSUE, "fluid": FLUID}),
        (HEAD, {"fluid": FLUID, 0: TISSUE}),
        (HEAD, {np.int64(1): FLUID, "0": TISSUE}),
        (other, {-5: FLUID, 1000: TISSUE}),
    ):
        assert absorbed(mesh, media) == pytest.approx(expected, rel=1e-9)


def test_channels_are_lists_within_or_around() -> None:
    one, two = absorbed(HEAD, {0: TISSUE, 1: FLUID}), absorbed(HEAD, {0: FLUID, 1: FLUID})
    media: Any
    for media in ({0: [TISSUE, FLUID], 1: FLUID}, [{0: TISSUE, 1: FLUID}, {"tissue": FLUID, "fluid": FLUID}]):
        solutions = solve(HEAD, media, LIGHT, tolerance=0.9)
        assert [each.power.absorbed for each in solutions] == pytest.approx([one, two], rel=1e-9)
    alone = mesh_from_arrays(POINTS, TETRAHEDRA, labels=np.full(len(TETRAHEDRA), 8))
    uniform = solve(alone, TISSUE, LIGHT, tolerance=0.9).power.absorbed
    assert absorbed(alone, {8: TISSUE}) == pytest.approx(uniform, rel=1e-12)


def test_labels_give_what_regions_give() -> None:
    core = box((12.0, 12.0, 12.0), center=(10.0, 10.0, 10.0))
    mesh = TetMesh(POINTS, TETRAHEDRA, regions=np.where(INNER, 1, 0))
    lights: list[Light] = [PencilBeam((10.1, 10.2, 30.0), (0, 0, -1)), DiffuseLight(0.01), Emission(0.001, region=1)]
    by_region = solve(mesh, TISSUE, lights, regions=[Region(core, FLUID)], tolerance=0.9)
    by_label = solve(
        replace(mesh, regions=np.where(INNER, 4, 3)),
        {4: FLUID, 3: TISSUE},
        [*lights[:2], Emission(0.001, region=4)],
        tolerance=0.9,
    )
    assert by_label.power.exited == pytest.approx(by_region.power.exited, rel=1e-9)
    assert by_label.fluence == pytest.approx(by_region.fluence, rel=1e-7)
    assert by_label.of_lights[2].power.incident == pytest.approx(0.001 * 12.0**3)


def test_a_field_is_that_of_its_label_only() -> None:
    def known(points: np.ndarray) -> np.ndarray:
        return np.where(np.abs(points - 10.0).max(axis=1) <= 6.0 + 1e-9, FLUID.sigma_a, np.nan)

    varying = VaryingMedium(base=FLUID, sigma_a=known)
    solution = solve(HEAD, {0: TISSUE, 1: varying}, LIGHT, tolerance=0.9)
    assert solution.power.absorbed == pytest.approx(absorbed(HEAD, {0: TISSUE, 1: FLUID}), rel=1e-9)


def test_a_system_of_labels() -> None:
    system = System(HEAD, {0: TISSUE, 1: FLUID})
    assert system.solve(LIGHT).power.absorbed == pytest.approx(absorbed(HEAD, {0: TISSUE, 1: FLUID}), rel=1e-9)


def test_a_cavity_is_a_boundary_and_said() -> None:
    hollow = mesh_from_arrays(POINTS, TETRAHEDRA[~ISLAND], labels=SHELL[~ISLAND].astype(int))
    solution = solve(hollow, {0: TISSUE, 1: FLUID}, LIGHT, tolerance=0.9)
    (said,) = (each for each in solution.warnings if "cavity" in each)
    wall = np.abs(hollow.points[hollow.boundary_faces].mean(axis=1) - 10.0).max(axis=1) < 3.0
    share = hollow.boundary_areas[wall] @ solution.exitance[hollow.boundary_triangles[wall]].mean(axis=1)
    assert said == (
        f"the mesh has a cavity of 64 mm³, whose wall is a boundary to the outside: {share:.2%} of the incident power "
        "leaves into it and counts as exited."
    )
    assert 0.02 < share < 0.1
    assert not any("cavity" in each for each in solve(HEAD, {0: TISSUE, 1: FLUID}, LIGHT, tolerance=0.9).warnings)
    two = TETRAHEDRA[~(((PLACES == [1, 2, 2]) | (PLACES == [3, 2, 2])).all(axis=1))]
    both = solve(mesh_from_arrays(POINTS, two), TISSUE, LIGHT, tolerance=0.9)
    assert any("2 cavities of 128 mm³, whose walls are boundaries" in each for each in both.warnings)


def test_a_void_is_said_by_its_label() -> None:
    clear = Medium(sigma_a=0.001, sigma_s_prime=0.01, eta=1.4)
    warnings = solve(HEAD, {0: TISSUE, 1: clear}, LIGHT, tolerance=0.9).warnings
    assert any(each.startswith("label 1 (fluid): it is 0.0") and "such a void" in each for each in warnings)


@pytest.mark.parametrize(
    ("media", "words"),
    [
        (TISSUE, r"the mesh has the labels 0 \(tissue\) and 1 \(fluid\) and one medium is given; give one for each"),
        ({0: TISSUE}, r"the mesh's label 1 \(fluid\) has no medium; give one for each"),
        ({}, r"the mesh's labels 0 \(tissue\) and 1 \(fluid\) have no medium"),
        ({0: TISSUE, 1: FLUID, 2: FLUID}, r"the mesh has no label 2; its labels are 0 \(tissue\) and 1 \(fluid\)"),
        ({0: TISSUE, "fluids": FLUID}, r'the mesh has no label "fluids"; did you mean "fluid"\?'),
        ({0: TISSUE, 1: FLUID, "fluid": FLUID}, r"label 1 \(fluid\) is given a medium twice"),
        ({0: TISSUE, 1: 3.0}, r"label 1 \(fluid\) is given 3.0; give it a Medium"),
        ({0: [TISSUE] * 3, 1: [FLUID] * 2}, r"label 1 \(fluid\) has 2 media for 3 channels"),
        ([TISSUE, {0: TISSUE, 1: FLUID}], "some channels have a medium and some have media by label"),
        ({0: TISSUE, 1: Medium(sigma_a=0.1, sigma_s_prime=1.0, eta=1.3)}, "refractive index of 1.3"),
        ({0: TISSUE, True: FLUID}, "the mesh has no label True"),
        (3.0, "the medium is 3.0; give a Medium, a list of channels, or media by label"),
    ],
)
def test_labels_and_media_that_do_not_go_together(media: Any, words: str) -> None:
    with pytest.raises(InputError, match=words):
        solve(HEAD, media, LIGHT)


def test_a_system_refuses_a_medium_of_a_label_that_the_mesh_does_not_have() -> None:
    mesh = replace(HEAD, regions=np.ones(len(TETRAHEDRA), dtype=np.int64), labels={1: "tissue"})
    with pytest.raises(InputError, match=r"the mesh has no label 7; its labels are 1 \(tissue\)"):
        coefficients_on(mesh, {1: TISSUE, 7: TISSUE})


def test_media_by_label_need_a_mesh_and_no_regions() -> None:
    with pytest.raises(InputError, match="media by label need a mesh with labelled tetrahedra"):
        solve(box((20.0, 20.0, 20.0)), {0: TISSUE}, LIGHT)
    core = Region(box((2.0, 2.0, 2.0), center=(10.0, 10.0, 10.0)), FLUID)
    with pytest.raises(InputError, match="leave them out where media are by label"):
        solve(HEAD, {0: TISSUE, 1: FLUID}, LIGHT, regions=[core])
    wrong: Any = FLUID
    with pytest.raises(InputError, match=r"a Medium is given where a region is wanted"):
        solve(HEAD, TISSUE, LIGHT, regions=[wrong])


@pytest.mark.parametrize("numbers", [(0, 1), (1, 0), (7, 3)])
def test_a_pencil_beam_into_the_top_layer_of_a_labelled_mesh(numbers: tuple[int, int]) -> None:
    """Where a beam enters the medium of that place counts, whatever its label: as by surfaces of regions."""
    top, bottom = Medium(sigma_a=0.2, sigma_s_prime=1.0, eta=1.4), Medium(sigma_a=0.01, sigma_s_prime=2.0, eta=1.4)
    below = PLACES[:, 2] < 4
    beam = [PencilBeam((10.1, 10.2, 30.0), (0, 0, -1))]
    # The body's medium is that of the top layer, where the beam enters.
    layer = Region(box((20.0, 20.0, 16.0), center=(10.0, 10.0, 8.0)), bottom)
    mesh = TetMesh(POINTS, TETRAHEDRA, regions=np.where(below, 1, 0))
    expected = solve(mesh, top, beam, regions=[layer], tolerance=0.9, subtract="nothing").power.exited
    labelled = replace(mesh, regions=np.where(below, *numbers))
    media = {numbers[0]: bottom, numbers[1]: top}
    found = solve(labelled, media, beam, tolerance=0.9, subtract="nothing").power.exited
    assert found == pytest.approx(expected, rel=1e-6)


def test_a_mesh_of_labels_may_be_refined_by_hand() -> None:
    fine = HEAD
    for _ in range(3):
        fine = refine(fine, np.ones(len(fine.tetrahedra), dtype=bool))
    # Eight times the tetrahedra: towards 0.3777, which two more steps give.
    assert absorbed(fine, {"tissue": TISSUE, "fluid": FLUID}) == pytest.approx(0.377, abs=0.002)
