"""Media of tissue from its chromophores, in Python and in case files."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tetlux.cases.file.case import Case
from tetlux.cases.file.load import load_cases
from tetlux.cases.file.spectra import read_spectrum
from tetlux.fem import Medium, Spectrum, tissue
from tetlux.fem.media.spectra import SPECTRA
from tetlux.meshing import InputError

SCATTERING: dict[str, Any] = {"a": 1.2, "b": 1.3, "eta": 1.4}


def absorption(wavelength: float, **amounts: Any) -> float:
    (medium,) = tissue(wavelengths=[wavelength], **amounts, **SCATTERING)
    return medium.sigma_a


def test_extinction_is_to_the_base_10_and_per_centimetre() -> None:
    """60 micromol/l HbO2 and 40 of HHb at 690 nm: ln(10) (276 60e-6 + 2051.96 40e-6)/cm, a tenth of that per mm."""
    assert absorption(690, hbo2=60e-6, hhb=40e-6) == pytest.approx(0.0227123, rel=1e-5)
    assert absorption(830, hbo2=60e-6, hhb=40e-6) == pytest.approx(0.0198394, rel=1e-5)
    # Blood of 2.3 mmol/l with 98 % oxygen at 800 nm absorbs some .43/mm.
    assert absorption(800, hbo2=0.98 * 2.3e-3, hhb=0.02 * 2.3e-3) == pytest.approx(0.43, rel=0.02)


def test_water_and_fat_count_by_their_share_of_the_volume() -> None:
    assert absorption(970, water=0.7) == pytest.approx(0.0336, rel=1e-12)
    assert absorption(930, fat=0.2, water=0.1) == pytest.approx(0.2 * 0.0131 + 0.1 * 0.01238, rel=1e-12)


def test_known_features_of_the_spectra() -> None:
    """A figure that was mistyped would show: peaks, and the isosbestic point near 797 nm."""
    for low in range(600, 1000, 10):
        for spectrum in SPECTRA.values():
            here, there = (spectrum.absorption_at(each, 1.0) for each in (low, low + 10))
            assert 0.4 < there / here < 2.1
    hbo2, hhb, water, fat = SPECTRA.values()
    assert hhb.absorption_at(760, 1.0) > max(hhb.absorption_at(each, 1.0) for each in (740, 780))
    assert hbo2.absorption_at(790, 1.0) < hhb.absorption_at(790, 1.0)
    assert hbo2.absorption_at(800, 1.0) > hhb.absorption_at(800, 1.0)
    assert max(range(900, 1000, 10), key=lambda each: water.absorption_at(each, 1.0)) == 980
    assert max(range(900, 1000, 10), key=lambda each: fat.absorption_at(each, 1.0)) == 930


def test_scattering_follows_its_power() -> None:
    near, far = tissue(wavelengths=[600, 1000], hbo2=1e-5, **SCATTERING)
    assert near.reduced_scattering == pytest.approx(1.2 * 1.2**-1.3, rel=1e-12)
    assert far.reduced_scattering == pytest.approx(1.2 * 2.0**-1.3, rel=1e-12)
    assert (near.eta, near.boundary) == (1.4, "exact")


def test_coefficients_are_in_the_unit_asked_for() -> None:
    (in_mm,), (in_m,) = (
        tissue(wavelengths=[750], hhb=1e-5, water=0.5, unit=unit, **SCATTERING) for unit in ("mm", "m")
    )
    assert in_m.sigma_a == pytest.approx(1000 * in_mm.sigma_a, rel=1e-12)
    assert in_m.reduced_scattering == pytest.approx(1000 * in_mm.reduced_scattering, rel=1e-12)


def test_a_substance_of_ones_own() -> None:
    dye = Spectrum((700.0, 800.0, 900.0), (5e4, 2e5, 1e4), kind="extinction")
    (medium,) = tissue(wavelengths=[800], water=0.5, others={"dye": (dye, 2e-7)}, **SCATTERING)
    assert medium.sigma_a == pytest.approx(0.5 * 0.002246 + math.log(10.0) * 0.004, rel=1e-12)
    # Between its wavelengths a spectrum never leaves their values.
    assert all(1e3 <= dye.absorption_at(each, 1.0) / math.log(10.0) * 1.000001 <= 2.00001e4 for each in range(700, 901))


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"hbo2": 60.0}, r"hbo2 is 60; give a concentration in mol/l \(1e-6 is one micromol/l\) from 0 to 0\.01\."),
        ({"hhb": -1e-6}, "hhb is -1e-06; give a concentration"),
        ({"water": math.nan}, "water is nan; give a fraction of the volume from 0 to 1"),
        ({"fat": 10.0}, "fat is 10; give a fraction of the volume"),
        ({"water": 0.7, "fat": 0.4}, r"the fractions of water, fat add up to 1\.1; they can be 1 together"),
        ({"wavelengths": [590], "hbo2": 1e-5}, "hbo2: the wavelength 590 nm is outside the spectrum, 600 to 1000 nm"),
        ({"wavelengths": [0.69], "water": 0.7}, r"water: the wavelength 0\.69 nm is outside"),
        ({"wavelengths": []}, "there are no wavelengths; give at least one, in nm"),
        ({"a": 0.0}, "a is 0; give the reduced scattering at 500 nm"),
        ({"b": math.inf}, "b is inf; give a finite number"),
        ({"unit": "km"}, 'unit "km" is not known'),
        ({"others": {"fat": (SPECTRA["fat"], 0.1)}}, 'a spectrum of "fat" is here already'),
    ],
)
def test_what_is_wrong_is_refused(wrong: dict[str, Any], words: str) -> None:
    with pytest.raises(InputError, match=words):
        tissue(**{"wavelengths": [690.0], **SCATTERING, **wrong})


CASE = """\
surface: {sphere: {radius: 10}}
medium:
  chromophores: CHROMOPHORES
  scattering: {a: 1.2, b: 1.3}
  wavelengths: [690, 830.5, 850]
  eta: 1.4
lights:
  - point: {position: [0, 0, 5]}
"""
BLOOD = "{hbo2: 60e-6, hhb: 40e-6, water: 0.7, fat: 0.1}"

Load = Callable[..., Case]


@pytest.fixture
def load(tmp_path: Path) -> Load:
    def loaded(chromophores: str = BLOOD, more: str = "") -> Case:
        (tmp_path / "arm.yaml").write_text(CASE.replace("CHROMOPHORES", chromophores) + more, encoding="utf-8")
        return load_cases(tmp_path / "arm.yaml")[0]

    return loaded


def test_wavelengths_are_channels(load: Load) -> None:
    case = load()
    expected = tissue(wavelengths=[690, 830.5, 850], hbo2=60e-6, hhb=40e-6, water=0.7, fat=0.1, unit="mm", **SCATTERING)
    assert case.channel_names == ("690", "830.5", "850")
    assert [channel.medium for channel in case.channels] == expected
    assert load(more="channels: [a, b, c]\n").channel_names == ("a", "b", "c")


def test_the_unit_of_the_case_is_that_of_the_coefficients(load: Load) -> None:
    first = load(more="unit: cm\n").channels[0].medium
    assert isinstance(first, Medium)
    assert first.reduced_scattering == pytest.approx(12 * (690 / 500) ** -1.3, rel=1e-12)


REGION = """\
regions:
  - surface: {sphere: {radius: 2}}
    medium: {chromophores: {water: 0.9}, scattering: {a: 1, b: 1}, wavelengths: [690, WAVELENGTH, 850], eta: 1.4}
"""


def test_regions_have_chromophores_too(load: Load) -> None:
    (region,) = load(more=REGION.replace("WAVELENGTH", "830.5")).regions
    assert region.medium == tuple(tissue(wavelengths=[690, 830.5, 850], water=0.9, a=1, b=1, eta=1.4))
    words = r"regions\[0\].medium.wavelengths.* these are 690, 780, 850 nm, and medium has 690, 830.5, 850 nm"
    with pytest.raises(InputError, match=words):
        load(more=REGION.replace("WAVELENGTH", "780"))


def test_a_sweep_over_a_concentration(load: Load) -> None:
    case = load(more="sweep: {medium.chromophores.hbo2: [0.0, 1.0e-5]}\n")
    assert case.channels[0].medium == tissue(wavelengths=[690], hhb=40e-6, water=0.7, fat=0.1, **SCATTERING)[0]


DYE = "{others: {dye: {file: dye.txt, concentration: 1e-6}}}"


@pytest.mark.parametrize(
    "text",
    ["# dye\nnm;eps\n900;1e4\n650;5e4\n\n800;2e5\n", "650, 5e4\n800, 2e5\n900, 1e4", "650\t5e4\n800  2e5\n900 1e4"],
)
def test_a_spectrum_from_a_file(load: Load, tmp_path: Path, text: str) -> None:
    (tmp_path / "dye.txt").write_text(text, encoding="utf-8")
    dye = Spectrum((650.0, 800.0, 900.0), (5e4, 2e5, 1e4), "extinction")
    assert read_spectrum(tmp_path / "dye.txt", "extinction") == dye
    medium = load(DYE).channels[2].medium
    assert isinstance(medium, Medium)
    assert medium.sigma_a == pytest.approx(dye.absorption_at(850, 1e-6), rel=1e-12)
    # The same figures as those of a pure substance: 1/mm and no logarithm.
    medium = load("{others: {dye: {file: dye.txt, fraction: 1e-6}}}").channels[2].medium
    assert isinstance(medium, Medium)
    assert medium.sigma_a == pytest.approx(dye.absorption_at(850, 1e-6) * 10 / math.log(10), rel=1e-12)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (None, r"dye\.txt is not a file; give a text file of wavelengths and values"),
        ("700 1\n", "holds 1 rows; give a wavelength"),
        ("700 1\n800 2 3\n", r'line 2: "800 2 3" is not a wavelength and a value; give two numbers'),
        ("700 1\n800 x\n", 'line 2: "800 x" is not'),
        ("700 1\n700 2\n", "the wavelengths of a spectrum must ascend, without repetition"),
        ("700 1\n800 -2\n", "the value at 800 nm is -2; give finite values of 0 or more"),
        ("700 1\n850 2\n", "dye: the wavelength 690 nm is outside the spectrum, 700 to 850 nm"),
        ("680 1\n850 2e3\n900 nan\n", "the value at 900 nm is nan"),
    ],
)
def test_what_is_no_spectrum_is_refused(load: Load, tmp_path: Path, text: str | None, words: str) -> None:
    if text is not None:
        (tmp_path / "dye.txt").write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=rf"arm\.yaml.*medium\..*{words}"):
        load(DYE)


@pytest.mark.parametrize(
    ("chromophores", "words"),
    [
        ("{hbo2: 60}", r"line 3.*medium\.chromophores\.hbo2.*hbo2 is 60; give a concentration"),
        ("{water: 0.7, fat: 0.7}", r"medium.*the fractions of water, fat add up to 1\.4"),
        ("{hbo: 1e-6}", r'unknown key; did you mean "hbo2" \(oxygenated haemoglobin, mol/l of tissue\)\?'),
        ("{others: {dye: {file: dye.txt}}}", "give either concentration, with a file of molar extinction, or fraction"),
        ("{others: {hhb: {file: dye.txt, fraction: 0}}}", 'a spectrum of "hhb" is here already'),
        ("{}\n  sigma_a: 0.1", "medium.sigma_a.*unknown key"),
    ],
)
def test_what_is_wrong_in_a_case_is_said_in_its_place(
    load: Load, tmp_path: Path, chromophores: str, words: str
) -> None:
    (tmp_path / "dye.txt").write_text("600 1\n1000 2\n", encoding="utf-8")
    with pytest.raises(InputError, match=words):
        load(chromophores)


def test_a_wavelength_is_given_once(tmp_path: Path) -> None:
    text = CASE.replace("CHROMOPHORES", BLOOD).replace("830.5", "690.0")
    (tmp_path / "arm.yaml").write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=r"medium\.wavelengths.*a wavelength is given twice; leave one of the two out"):
        load_cases(tmp_path / "arm.yaml")
