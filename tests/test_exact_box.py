"""The closed form of a box: against the slab, against its own balance of power, and its symmetries."""

import numpy as np
import pytest

from tests.conftest import TISSUE
from tetlux.fem import Medium
from tetlux.fem.exact import box, slab
from tetlux.meshing import InputError


def test_a_wide_box_is_a_slab() -> None:
    rho = np.array([0.3, 1.0, 3.0, 8.0])
    for face, z in (("front", 2.0), ("back", -2.0)):
        points = np.column_stack([rho, 0.0 * rho, 0.0 * rho + z])
        found = box.point_exitance(TISSUE, size=(60.0, 60.0, 4.0), source=(0.0, 0.0, 1.0), points=points)
        truth = slab.point_exitance(TISSUE, thickness=4.0, depth=1.0, rho=rho, face=face)  # type: ignore[arg-type]
        assert found == pytest.approx(truth, rel=1e-9)


@pytest.mark.parametrize("sigma_a", [0.0, 1e-9])
def test_all_power_leaves_where_nothing_absorbs(sigma_a: float) -> None:
    """Gauss points on the six faces; the source is near an edge."""
    medium = Medium(sigma_a=sigma_a, sigma_s_prime=1.0, eta=1.4)
    size, source = np.array([6.0, 5.0, 4.0]), (2.0, 0.5, 1.0)
    x, w = np.polynomial.legendre.leggauss(16)
    u, v = (each.ravel() for each in np.meshgrid(x, x))
    weights, total = np.outer(w, w).ravel(), 0.0
    for axis in range(3):
        others = [other for other in range(3) if other != axis]
        for side in (-1.0, 1.0):
            points = np.zeros((len(u), 3))
            points[:, axis] = 0.5 * side * size[axis]
            points[:, others[0]], points[:, others[1]] = 0.5 * size[others[0]] * u, 0.5 * size[others[1]] * v
            exitance = box.point_exitance(medium, size=tuple(size.tolist()), source=source, points=points)
            total += 0.25 * size[others].prod() * float(weights @ exitance)
    assert total == pytest.approx(1.0, abs=1e-4)


def test_any_edge_may_be_the_third() -> None:
    """Two different sums, over modes along different edges, where the point is as far along one as along the other."""
    sizes, source = (4.0, 6.0, 8.0), (1.0, 0.4, 3.0)
    around = [[2.0, 1.4 + step, 3.5] for step in (-1e-9, 1e-9)]
    first, second = box.point_exitance(TISSUE, size=sizes, source=source, points=around)
    assert first == pytest.approx(second, rel=1e-7)
    assert first > 0


def test_it_holds_where_light_has_faded_by_many_decades() -> None:
    """In a wide box, far along the face, as in the slab."""
    absorbing = Medium(sigma_a=0.2, sigma_s_prime=0.8, eta=1.4)
    points = np.array([[24.0, 18.0, 4.0], [28.0, 5.0, -4.0]])
    found = box.point_exitance(absorbing, size=(90.0, 90.0, 8.0), source=(0.0, 0.0, 3.0), points=points)
    for value, point, face in zip(found, points, ("front", "back"), strict=True):
        rho = np.hypot(*point[:2])
        truth = slab.point_exitance(absorbing, thickness=8.0, depth=1.0, rho=np.array([rho]), face=face)  # type: ignore[arg-type]
        assert value == pytest.approx(float(truth[0]), rel=1e-5)
    assert found.max() < 1e-11


def test_bad_arguments_are_named() -> None:
    size = (4.0, 4.0, 4.0)
    with pytest.raises(InputError, match="outside the box"):
        box.point_fluence(TISSUE, size=size, source=(0.0, 0.0, 0.0), points=[[0.0, 0.0, 2.1]])
    with pytest.raises(InputError, match="too close for the series of the box"):
        box.point_fluence(TISSUE, size=size, source=(0.0, 0.0, 1.9999999), points=[[0.0, 0.0, 2.0]])
    with pytest.raises(InputError, match="not inside the box"):
        box.point_fluence(TISSUE, size=size, source=(0.0, 0.0, 3.0), points=[[0.0, 0.0, 2.0]])
