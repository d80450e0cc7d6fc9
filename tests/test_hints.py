"""What a case file with a wrong word is answered: the word that was probably meant."""

from pathlib import Path

import pytest

from tetlux.cases.cli import main
from tetlux.cases.file.load import load_cases
from tetlux.cases.hints import did_you_mean, nearest_word
from tetlux.cases.synonyms import ALIASES, REMEDIES
from tetlux.meshing import InputError

CASE = """\
surface: {sphere: {radius: 10}}
medium: {sigma_a: 0.01, sigma_s_prime: 1.0, eta: 1.4}
lights:
  - pencil: {origin: [0, 0, 20], direction: [0, 0, -1]}
"""
MEDIUM = ("sigma_a", "eta", "sigma_s_prime", "sigma_s", "g", "phase", "boundary")


def refusal(text: str, folder: Path) -> str:
    (folder / "case.yaml").write_text(text, encoding="utf-8")
    with pytest.raises(InputError) as error:
        load_cases(folder / "case.yaml")
    return str(error.value).removeprefix(f"{folder / 'case.yaml'}, ")


@pytest.mark.parametrize(
    ("word", "key"),
    [
        *((word, "sigma_a") for word in ("mua", "mu_a", "Mu_A", "µa", "μ_a", "σ_a", "absorption", "sig_a", "sigma-a")),
        *((word, "sigma_s") for word in ("mus", "mu_s", "scattering", "sigmaS", "sigma_ss")),
        *(
            (word, "sigma_s_prime")
            for word in ("sigma_sp", "musp", "mus'", "mu_s'", "µs'", "sigma_s'", "mu_s_prime", "reduced_scattering")
        ),
        *((word, "eta") for word in ("n", "ior", "refractive_index", "index")),
        *((word, "g") for word in ("anisotropy", "G")),
        ("bound", "boundary"), ("xyzzy", None), ("", None), ("s", None),
    ],
)  # fmt: skip
def test_the_names_that_others_give_to_coefficients_are_known(word: str, key: str | None) -> None:
    assert nearest_word(word, MEDIUM) == key


def test_what_is_no_coefficient_here_is_told_by_those_that_are() -> None:
    assert did_you_mean("mu_t", MEDIUM) == "give its two parts, sigma_a and sigma_s; "
    assert did_you_mean("D", MEDIUM) == "give sigma_s_prime = 1/(3 D) - sigma_a; "
    # Where nothing of that is known the word is none of these.
    assert did_you_mean("D", ("origin", "power")) == ""


def test_every_alias_can_be_met() -> None:
    """One in capitals, say, would never be looked up."""
    for alias, keys in ALIASES.items():
        for key in keys:
            assert nearest_word(alias, ["first", key, "last"]) == key, alias
    for alias, (key, sentence) in REMEDIES.items():
        assert did_you_mean(alias, [key]) == sentence


@pytest.mark.parametrize(
    ("right", "wrong", "sentence"),
    [
        ("sigma_s_prime", "sigma_sp", 'line 2: medium.sigma_sp: unknown key; did you mean "sigma_s_prime" (reduced '
         "scattering coefficient, 1/unit)? the keys here are sigma_a, eta,"),
        ("sigma_a", "mua", 'medium.mua: unknown key; did you mean "sigma_a" (absorption coefficient, 1/unit)?'),
        ("origin", "position", 'lights[0].pencil.position: unknown key; did you mean "origin"?'),
        ("pencil", "laser", 'lights[0].laser: unknown key; did you mean "pencil"?'),
        ("pencil: {origin", "point: {origin", 'lights[0].point.origin: unknown key; did you mean "position"?'),
        ("radius", "diameter", 'surface.sphere.diameter: unknown key; give "radius", half of it;'),
        ("sphere", "ball", 'surface.ball: unknown key; did you mean "sphere"?'),
        ("surface", "geometry", 'geometry: unknown key; did you mean "surface"?'),
        ("lights", "sources", 'sources: unknown key; did you mean "lights"?'),
        ("surface:", "outputs: [png]\nsurface:", "outputs[0]: did you mean \"picture\"? expected 'surface', "
         "'volume', 'picture', 'viewer', 'figures', 'glb', 'mitsuba', 'film' or 'sensitivity', but found 'png'."),
        ("surface:", "unit: inches\nsurface:", "unit: did you mean \"in\"? expected"),
        ("surface:", "unit: milimeter\nsurface:", 'unit: did you mean "mm"? expected'),
        ("surface:", "picture: {colormap: grey}\nsurface:", 'picture.colormap: unknown key; did you mean "map" (the'),
        ("surface:", "picture: {channel: al}\nsurface:", 'there is no channel "al"; did you mean "all"? the channels'),
        ("surface:", "up: y\nsurface:", "up: write the axis as a vector, [0, 1, 0], but found 'y'."),
        ("surface:", "unit: leagues\nsurface:", "but found 'leagues'."),
        ("{sphere: {radius: 10}}", "bunny.stl", "but found 'bunny.stl'; write surface: {file: bunny.stl}."),
        ("{sigma_a: 0.01, sigma_s_prime: 1.0, eta: 1.4}", "marble", "write medium: {material: marble}."),
        ("surface:", "sigma_a: 1\nsurface:", 'sigma_a: unknown key; it belongs in "medium";'),
        ("- pencil", "- power: 1\n    pencil", 'lights[0].power: unknown key; it belongs in "pencil";'),
        ("- pencil", "- type: pencil\n    pencil", "lights[0].type: unknown key; write the kind of light as a key, as"),
        ("surface:", "detectors: [{name: a, fibre: {NA: 1}}]\nsurface:", 'did you mean "numerical_aperture"?'),
        ("surface:", "regions: [{shape: {}}]\nsurface:", 'regions[0].shape: unknown key; did you mean "surface"?'),
    ],
)  # fmt: skip
def test_a_wrong_word_is_answered_with_the_right_one(right: str, wrong: str, sentence: str, tmp_path: Path) -> None:
    assert sentence in refusal(CASE.replace(right, wrong), tmp_path)


@pytest.mark.parametrize(
    ("sweep", "sentence"),
    [
        ("medium.sigma_a: [0.1, -0.1]", "line 5: medium.sigma_a: in the run medium.sigma_a=-0.1: sigma_a is -0.1;"),
        ("medium.mua: [0.1]", 'line 5: sweep.medium.mua: unknown key; did you mean "medium.sigma_a"?'),
        ("medium.sigma_a: [0.1, 0.2], lights.0.pencil.power: [1, -1]",
         "lights[0].pencil.power: in the run medium.sigma_a=0.1,lights.0.pencil.power=-1: power is -1;"),
        # What is wrong with the body of one run is told at the surface, which all runs have.
        ("surface.sphere.radius: [10, 0.001]", "line 1: surface: in the run surface.sphere.radius=0.001: sphere is"),
    ],
)  # fmt: skip
def test_a_bad_member_of_a_sweep_is_named_by_its_values(sweep: str, sentence: str, tmp_path: Path) -> None:
    assert sentence in refusal(CASE + f"sweep: {{{sweep}}}\n", tmp_path)


def test_a_misspelt_option_is_answered_with_the_right_one(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["run", "hare", "--quit"])
    assert 'there is no option --quit; did you mean "--quiet"? see --help.' in capsys.readouterr().err
