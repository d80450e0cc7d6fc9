"""Malformed inputs: each gets one sentence and exit code 2, or is mended and runs."""

from collections import Counter
from functools import partial

import pytest

from tests.fuzz.outcome import Outcome
from tests.fuzz.runs import check_case_files, check_surfaces, check_volumes, in_a_folder, run_surfaces

# To measure coverage here would more than double the time of the suite's longest tests.
pytestmark = pytest.mark.no_cover


def sound(outcomes: list[Outcome], *, least: int, refused: int) -> None:
    """Hold outcomes against what is promised; most of what is malformed has to be noticed."""
    assert [(each.name[:2000], each.violation) for each in outcomes if each.violation] == []
    endings = Counter(each.code for each in outcomes)
    assert len(outcomes) >= least
    assert endings[2] >= refused


def test_fifteen_hundred_case_files() -> None:
    sound(in_a_folder(partial(check_case_files, count=750)), least=1500, refused=1420)


def test_more_than_two_hundred_surfaces() -> None:
    sound(in_a_folder(check_surfaces), least=400, refused=300)


def test_more_than_two_hundred_volumes_and_images() -> None:
    sound(in_a_folder(check_volumes), least=240, refused=190)


# One of each sort that is let pass.
SOLVED = (
    "triangles 1e-09 apart",
    "a triangle within",
    "two cubes on a side",
    "two balls 19.99 apart",
    "one of two bodies inside out",
    "a half turned over",
    "a slit filled by a triangle of no area",
    "a ball of 0.5 within",
    "a tetrahedron inside out",
    "ten triangles",
    "a ball 1e6 away, all digits",
    "a ball of 1e9, seven digits",
)


@pytest.mark.slow
def test_what_is_let_pass_is_solved() -> None:
    outcomes = in_a_folder(partial(run_surfaces, limit=300.0, names=SOLVED))
    assert {each.name: each.violation or each.words for each in outcomes if each.code != 0} == {}
    assert len(outcomes) == len(SOLVED)
