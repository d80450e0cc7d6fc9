"""Detectors and radiance: what is read of a solution, against the sphere's closed form."""

import math
from dataclasses import dataclass, replace
from typing import Any, cast

import numpy as np
import pytest
from scipy.integrate import quad

from tests.conftest import TISSUE
from tetlux.fem import Medium, Solution
from tetlux.fem.exact import sphere as exact
from tetlux.fem.media.fresnel import moments, reflectance
from tetlux.fem.outcome.detector_kinds import DiscDetector, FibreDetector, PointDetector
from tetlux.fem.outcome.detectors import read
from tetlux.fem.outcome.radiance import collected_share, radiance
from tetlux.meshing import InputError, Surface, box
from tetlux.meshing.arrays import FloatArray

DEPTH = 10.0 - TISSUE.mean_free_path


def series(gamma: float | FloatArray) -> FloatArray:
    return exact.point_exitance(TISSUE, radius=10.0, source_radius=DEPTH, gamma=gamma)


@dataclass(frozen=True)
class Known:
    """As much of a `Solution` as a detector needs, with the exitance of the closed form: no error of a mesh."""

    surface: Surface
    medium: Medium = TISSUE

    def exitance_on(self, points: FloatArray) -> FloatArray:
        return series(np.arccos(np.clip(points[:, 2] / np.linalg.norm(points, axis=1), -1.0, 1.0)))


def known(surface: Surface, eta: float = 1.4) -> Solution:
    return cast("Solution", Known(surface, replace(TISSUE, eta=eta)))


def mean_over_disc(tilt: float, radius: float) -> float:
    """Mean of the closed form over a flat disc that touches the sphere at a polar angle, by plain summation."""
    r = radius * np.sqrt((np.arange(400) + 0.5) / 400)[:, None]
    angle = 2.0 * np.pi * (np.arange(200) + 0.5) / 200
    x, y = r * np.cos(angle), r * np.sin(angle)
    height = 10.0 * math.cos(tilt) - x * math.sin(tilt)
    return float(series(np.arccos(height / np.sqrt(100.0 + x**2 + y**2))).mean())


def place(tilt: float) -> tuple[float, float, float]:
    return 10.0 * math.sin(tilt), 0.0, 10.0 * math.cos(tilt)


def test_a_point_reads_the_exitance_there(ball: Surface, ball_solution: Solution) -> None:
    reading = read(PointDetector((0.0, 10.3, 0.0)), known(ball))
    assert reading.exitance == pytest.approx(8.764252e-5, rel=1e-3)
    assert reading.position == pytest.approx((0.0, 10.0, 0.0), abs=1e-3)
    assert reading.normal == pytest.approx((0.0, 1.0, 0.0), abs=1e-3)
    assert (reading.area, reading.power) == (None, None)
    # Of a solution it is that of quadratic elements; where it is bright, linear ones differ by little.
    found = read(PointDetector((6.0, 0.0, 8.0)), ball_solution)
    assert found.exitance == pytest.approx(ball_solution.exitance_at(np.array([[6.0, 0.0, 8.0]]))[0], rel=0.03)


@pytest.mark.parametrize(("radius", "error"), [(0.1, 1e-5), (1.0, 1e-4), (4.0, 2e-4)])
def test_a_disc_at_the_pole_reads_its_mean(ball: Surface, radius: float, error: float) -> None:
    """Rings round the pole: ``2/R² ∫ M(atan(r/a)) r dr``; the nearest points are those of a triangulated sphere."""
    ring = quad(lambda r: float(series(math.atan(r / 10.0))) * r, 0.0, radius, epsabs=0.0, epsrel=1e-9)[0]
    reading = read(DiscDetector((0.0, 0.0, 10.0), radius), known(ball))
    assert reading.exitance == pytest.approx(2.0 * ring / radius**2, rel=error)
    assert reading.area == pytest.approx(math.pi * radius**2)
    assert reading.power == pytest.approx(2.0 * math.pi * ring, rel=error)


@pytest.mark.parametrize(("tilt", "radius"), [(0.2, 1.0), (0.5, 2.0), (2.0, 1.0)])
def test_a_disc_elsewhere_reads_its_mean(ball: Surface, tilt: float, radius: float) -> None:
    reading = read(DiscDetector(place(tilt), radius), known(ball))
    assert reading.exitance == pytest.approx(mean_over_disc(tilt, radius), rel=2e-4)


def test_a_disc_reads_a_solution(ball_solution: Solution) -> None:
    """Solved to 2 %, discs where it is bright are off by 0.1 % and 0.2 %."""
    for tilt, radius in ((0.0, 1.0), (0.0, 2.0), (0.5, 1.0)):
        reading = read(DiscDetector(place(tilt), radius), ball_solution)
        assert reading.exitance == pytest.approx(mean_over_disc(tilt, radius), rel=0.01)


def test_a_fibre_collects_within_its_aperture(ball: Surface) -> None:
    def share(aperture: float, eta: float) -> float:
        solution = known(ball, eta=eta)
        whole = read(DiscDetector((0.0, 10.0, 0.0), 0.5), solution)
        part = read(FibreDetector((0.0, 10.0, 0.0), 0.5, aperture), solution)
        assert part.exitance == whole.exitance
        assert part.power is not None
        assert whole.power is not None
        return float(part.power) / float(whole.power)

    # Lambert: sin² of the angle, and all of it at right angles.
    assert share(1.0, 1.0) == pytest.approx(1.0, rel=1e-12)
    assert share(0.5, 1.0) == pytest.approx(0.25, rel=1e-12)
    assert share(1.0, 1.4) == pytest.approx(1.0, rel=1e-12)
    # Along the normal the transmittance is 4 eta/(1 + eta)²; of all, by reciprocity, eta² (1 - 2 C1).
    passed = 1.4**2 * (1.0 - 2.0 * moments(1.4)[0])
    assert share(0.01, 1.4) == pytest.approx(0.01**2 * 4 * 1.4 / 2.4**2 / passed, rel=1e-6)


@pytest.mark.parametrize("eta", [0.75, 1.0, 1.33, 1.5])
@pytest.mark.parametrize("aperture", [0.22, 0.9, 1.0])
def test_the_share_agrees_with_plain_summation(eta: float, aperture: float) -> None:
    edge = math.asin(aperture)
    theta = (np.arange(200_000) + 0.5) * edge / 200_000
    passed = 1.0 - reflectance(np.cos(theta), 1.0 / eta)
    plain = float((2.0 * passed * np.cos(theta) * np.sin(theta)).sum() * edge / len(theta))
    assert collected_share(eta, aperture) == pytest.approx(plain, abs=1e-7)


def test_radiance_adds_up_over_the_hemisphere(ball: Surface) -> None:
    """``∫ L cos d omega`` is the share of M that radiance accounts for."""
    solution, count = known(ball, eta=1.4), 400
    mu = (np.arange(count) + 0.5) / count
    far = 1e5 * np.column_stack([mu, np.sqrt(1.0 - mu**2), np.zeros(count)])
    seen = radiance(solution, np.tile([[10.0, 0.0, 0.0]], (count, 1)), far)
    exitance = read(PointDetector((10.0, 0.0, 0.0)), solution).exitance
    assert 2.0 * np.pi * (seen * mu).mean() == pytest.approx(collected_share(1.4, 1.0) * exitance, rel=1e-4)


def test_radiance_along_the_normal_and_from_behind(ball: Surface) -> None:
    solution = known(ball)
    seen = radiance(solution, [[0.0, 0.0, 10.0], [0.0, 0.0, -10.0]], [0.0, 0.0, 50.0])
    assert seen[0] == pytest.approx(4 * 1.4 / 2.4**2 * float(series(0.0)) / math.pi, rel=1e-4)
    assert seen[1] == 0.0
    # Where indices match nothing is reflected, at no angle.
    assert radiance(known(ball, eta=1.0), [[0.0, 0.0, -10.0]], [0.0, 0.0, 50.0])[0] == 0.0
    for points, viewer, message in (
        ([0.0, 0.0, 10.0], [0, 0, 50], r"points must be finite coordinates \(n, 3\)"),
        ([[0.0, 0.0, math.nan]], [0, 0, 50], "points must be finite"),
        ([[0.0, 0.0, 10.0]], [0, 50], "viewer must be three finite coordinates"),
        ([[0.0, 0.0, 10.0]], [[0, 0, 50]] * 2, "viewer must be three finite coordinates"),
    ):
        with pytest.raises(InputError, match=message):
            radiance(solution, points, viewer)


@pytest.mark.parametrize(
    ("make", "given", "message"),
    [
        (PointDetector, ((0, 0, math.nan),), "position is .*; give three finite coordinates"),
        (DiscDetector, ((0, 0), 1.0), "center is .*; give three finite coordinates"),
        (DiscDetector, ((0, 0, 10), 0.0), "radius is 0; give a length greater than 0"),
        (FibreDetector, ((0, 0, 10), math.inf, 0.2), "radius is inf"),
        (FibreDetector, ((0, 0, 10), 1.0, 0.0), "numerical_aperture is 0; it must be greater than 0 and at most 1"),
        (FibreDetector, ((0, 0, 10), 1.0, 1.1), "numerical_aperture is 1.1"),
    ],
)
def test_detectors_that_cannot_be(make: Any, given: tuple[Any, ...], message: str) -> None:
    with pytest.raises(InputError, match=message):
        make(*given)


def test_detectors_that_are_not_on_the_body(ball: Surface) -> None:
    solution = known(ball)
    # 5 % of a diagonal of 20 sqrt(3).
    read(PointDetector((0.0, 0.0, 11.7)), solution)
    with pytest.raises(
        InputError, match=r"position \(0, 0, 11.8\) is 1.8 mm from the surface, more than 5% of .* 1.73; "
    ):
        read(PointDetector((0.0, 0.0, 11.8)), solution)
    read(DiscDetector((0.0, 0.0, 8.6), 1.5), solution)
    with pytest.raises(
        InputError, match=r"center \(0, 0, 8.4\) is 1.6 mm from the surface, more than its radius, 1.5;"
    ):
        read(DiscDetector((0.0, 0.0, 8.4), 1.5), solution)
    with pytest.raises(
        InputError, match=r"radius 6 at .* does not lie on the surface, which bends away or ends 1\.65 mm"
    ):
        read(DiscDetector((0.0, 0.0, 10.0), 6.0), solution)
    cube = known(box((10.0, 10.0, 10.0)))
    read(DiscDetector((4.0, 0.0, 5.0), 1.0), cube)
    with pytest.raises(InputError, match="does not lie on the surface"):
        read(DiscDetector((4.6, 0.0, 5.0), 1.0), cube)
