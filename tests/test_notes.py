"""Notes: sentences that programs can tell apart."""

import json
import pickle
from copy import copy
from dataclasses import replace

import numpy as np
import pytest

from tests.conftest import TISSUE
from tests.meshes_made import cube_of_cubes
from tetlux.fem import Medium, PencilBeam, PointSource, Region, Solution, solve
from tetlux.fem.body.body import Body
from tetlux.meshing import InputError, Surface, TetMesh, mesh_from_arrays, sphere, surface_from_arrays
from tetlux.meshing.notes import Note, add_prefix, codes_of, in_region

NOTE = Note("low-albedo", "the reduced albedo is 0.5.", region="core", value=0.5)


def parts(note: str) -> tuple[object, ...]:
    assert isinstance(note, Note)
    return note.code, note.region, note.value


def test_a_note_is_its_sentence() -> None:
    assert NOTE == "core: the reduced albedo is 0.5."
    assert json.dumps([NOTE]) == '["core: the reduced albedo is 0.5."]'
    assert str(NOTE) in {NOTE}
    assert codes_of([NOTE, "a plain sentence."]) == {"low-albedo"}


@pytest.mark.parametrize("copied", [pickle.loads(pickle.dumps(NOTE)), copy(NOTE)])
def test_a_copied_note_keeps_its_code(copied: Note) -> None:
    """Results of the stress map's processes come back as such copies."""
    assert copied == NOTE
    assert parts(copied) == parts(NOTE)


def test_a_prefix_keeps_the_code() -> None:
    both = add_prefix(in_region(NOTE, "heart"), "in red: ")
    assert both == "in red: heart: the reduced albedo is 0.5."
    assert parts(both) == ("low-albedo", "heart", 0.5)
    assert in_region(both, "lung") == "in red: lung: the reduced albedo is 0.5."
    assert add_prefix("a sentence.", "in red: ") == "in red: a sentence."
    assert in_region("a sentence.", "lung") == "lung: a sentence."


def test_warnings_of_a_solution_are_notes(ball: Surface, ball_mesh: TetMesh) -> None:
    source = [PointSource((0.0, 0.0, 9.0))]
    coarse = solve(ball, TISSUE, source, mesh=ball_mesh, tolerance=1e-4, subtract="nothing")
    assert coarse.warnings
    assert all(isinstance(warning, Note) for warning in coarse.warnings)
    assert "tolerance-missed" in codes_of(coarse.warnings)
    (missed,) = [
        warning
        for warning in coarse.warnings
        if isinstance(warning, Note) and warning.value is not None and warning.code == "tolerance-missed"
    ]
    assert missed.value == coarse.error_estimate
    dark = solve(ball, Medium(sigma_a=1.0, sigma_s_prime=1.0, eta=1.4), source, mesh=ball_mesh)
    assert "low-albedo" in codes_of(dark.warnings)
    line = PencilBeam((0.0, 0.0, 20.0), (0.0, 0.0, -1.0), deposit="line").deposit_in(Body(ball, (TISSUE,)))
    assert codes_of(line.warnings) == {"beam-singular"}


def test_a_note_of_a_region_names_it() -> None:
    body, core = sphere(10.0, subdivisions=3), sphere(4.0, subdivisions=2)
    absorbing = Medium(sigma_a=1.0, sigma_s_prime=1.0, eta=1.4)
    solution = solve(body, TISSUE, [PointSource((0.0, 0.0, 9.0))], regions=[Region(core, absorbing)], tolerance=0.5)
    (note,) = [warning for warning in solution.warnings if isinstance(warning, Note) and warning.region]
    assert parts(note) == ("low-albedo", "region 1", 0.5)
    assert note.startswith("region 1: the reduced albedo is 0.5")


def test_warnings_of_a_surface_are_notes(ball: Surface) -> None:
    points, faces = np.vstack([ball.points, ball.points + 30.0]), np.vstack([ball.faces, ball.faces + len(ball.points)])
    two = surface_from_arrays(points, faces)
    assert [parts(warning) for warning in two.warnings] == [("several-bodies", None, 2)]


def test_warnings_of_a_mesh_of_labels_are_notes() -> None:
    points, tetrahedra, places = cube_of_cubes(5, 4.0)
    hollow = (places != 2).any(axis=1)
    labels = np.where(places[hollow][:, 2] >= 3, 7, 1)
    count = len(points)
    # Its upper part with nodes of its own, which are joined; and the whole twice, apart.
    doubled = np.where((labels == 7)[:, None], tetrahedra[hollow] + count, tetrahedra[hollow])
    both = np.vstack([points, points, points + 100.0, points + 100.0])
    mesh = mesh_from_arrays(
        both, np.vstack([doubled, doubled + 2 * count]), labels=np.tile(labels, 2), names={7: "lid"}
    )
    absorbing = Medium(sigma_a=1.0, sigma_s_prime=1.0, eta=1.4)
    solution = solve(mesh, {"lid": absorbing, 1: TISSUE}, [PointSource((10.0, 10.0, 4.0))], tolerance=0.5)
    assert all(isinstance(warning, Note) for warning in solution.warnings)
    assert {"mesh-repaired", "several-bodies", "cavities", "low-albedo"} <= codes_of(solution.warnings)
    (note,) = [warning for warning in solution.warnings if isinstance(warning, Note) and warning.region]
    assert note.startswith(f"{note.region}: the reduced albedo is 0.5")
    assert note.region is not None
    assert "lid" in note.region


def test_an_error_keeps_what_is_wrong_and_what_to_do() -> None:
    error = InputError("radius is -1", field="radius", remedy="give a length greater than 0")
    for one in (error, pickle.loads(pickle.dumps(error))):
        assert str(one) == "radius is -1; give a length greater than 0."
        assert (one.text, one.field, one.remedy) == ("radius is -1", "radius", "give a length greater than 0")
    assert str(InputError("a sentence.")) == "a sentence."


def test_a_solution_tells_its_residual(ball_solution: Solution) -> None:
    assert 0 < ball_solution.residual < 1e-10
    assert ball_solution.iterations >= 0
    assert replace(ball_solution, residual=1.0).residual == 1.0
