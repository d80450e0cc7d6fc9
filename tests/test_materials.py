"""Materials by name."""

import math
import re
from dataclasses import replace

import pytest

from tetlux.fem import Medium, PointSource, solve
from tetlux.fem.media.materials import MATERIALS, material
from tetlux.meshing import InputError, sphere

# Diffuse reflectances that Jensen 2001 publishes beside the coefficients, red, green and blue.
REFLECTANCES = {
    "apple": (0.85, 0.84, 0.53),
    "chicken2": (0.32, 0.16, 0.10),
    "cream": (0.98, 0.90, 0.73),
    "ketchup": (0.16, 0.01, 0.00),
    "marble": (0.83, 0.79, 0.75),
    "potato": (0.77, 0.62, 0.21),
    "skimmilk": (0.81, 0.81, 0.69),
    "skin1": (0.44, 0.22, 0.13),
    "spectralon": (1.00, 1.00, 1.00),
    "wholemilk": (0.91, 0.88, 0.76),
}


def dipole_reflectance(medium: Medium) -> float:
    """The total diffuse reflectance of the dipole (Jensen 2001), with the fit of A that it uses."""
    a = replace(medium, boundary="classic").boundary_factor
    q = math.sqrt(3.0 * (1.0 - medium.albedo))
    return 0.5 * medium.albedo * (1.0 + math.exp(-4.0 / 3.0 * a * q)) * math.exp(-q)


@pytest.mark.parametrize("name", REFLECTANCES)
def test_coefficients_give_the_published_reflectances(name: str) -> None:
    """A figure that was mistyped would show."""
    assert [dipole_reflectance(m) for m in material(name)] == pytest.approx(REFLECTANCES[name], abs=0.01)


def test_all_materials_can_be_had() -> None:
    for name in MATERIALS:
        for medium in material(name):
            assert medium.eta == (1.5 if name == "marble" else 1.3)
    red, green, blue = material("skin2")
    assert (red.sigma_a, green.reduced_scattering, blue.sigma_a) == (0.013, 1.59, 0.145)


@pytest.mark.parametrize(
    ("unit", "factor"), [("nm", 1e-6), ("um", 1e-3), ("mm", 1.0), ("cm", 10.0), ("m", 1000.0), ("in", 25.4)]
)
def test_coefficients_are_in_the_unit_asked_for(unit: str, factor: float) -> None:
    _, green, _ = material("marble", unit=unit)
    assert green.reduced_scattering == pytest.approx(2.62 * factor, rel=1e-14)
    assert green.sigma_a == pytest.approx(0.0041 * factor, rel=1e-14)


def test_what_absorbs_nothing_gives_all_of_its_light_back() -> None:
    red = material("spectralon")[0]
    assert (red.albedo, red.sigma_tr) == (1.0, 0.0)
    solution = solve(sphere(1.0), red, [PointSource((0.0, 0.0, 0.7))])
    assert solution.power.exited == pytest.approx(1.0, abs=1e-6)
    assert solution.power.absorbed == pytest.approx(0.0, abs=1e-6)


def test_what_is_not_known_is_refused() -> None:
    known = "the materials here are " + re.escape(", ".join(MATERIALS)) + r"\.$"
    with pytest.raises(InputError, match=r'"Marbel" is not known; did you mean "marble"\? ' + known):
        material("Marbel")
    with pytest.raises(InputError, match='"gold" is not known; ' + known):
        material("gold")
    with pytest.raises(InputError, match=r'unit "km" is not known; it is one of nm, um, mm, cm, m, in\.'):
        material("marble", unit="km")
