"""A ball of layers with a point source: against one medium, against another way to solve, and its power."""

import numpy as np
import pytest

from tetlux.fem import Medium
from tetlux.fem.exact import layered_ball, sphere
from tetlux.meshing import InputError

TISSUE = Medium(sigma_a=0.01, sigma_s_prime=1.0, eta=1.4)
CORE, SHELL = Medium(sigma_a=0.2, sigma_s_prime=2.0, eta=1.4), Medium(sigma_a=0.02, sigma_s_prime=0.8, eta=1.4)
GAMMA = np.radians([0.0, 5.0, 30.0, 90.0, 180.0])


@pytest.mark.parametrize("radii", [[10.0], [4.0, 10.0], [3.0, 7.0, 9.5, 10.0]])
def test_layers_of_one_medium_are_a_ball(radii: list[float]) -> None:
    media = [TISSUE] * len(radii)
    right = sphere.point_exitance(TISSUE, radius=10.0, source_radius=9.8, gamma=GAMMA)
    assert layered_ball.point_exitance(media, radii, source_radius=9.8, gamma=GAMMA) == pytest.approx(right, rel=1e-9)


def test_nearly_one_medium_is_nearly_a_ball() -> None:
    other = Medium(sigma_a=0.01001, sigma_s_prime=1.0, eta=1.4)
    media = [other, TISSUE, other]
    right = sphere.point_exitance(TISSUE, radius=10.0, source_radius=9.0, gamma=GAMMA)
    found = layered_ball.point_exitance(media, [6.0, 8.0, 10.0], source_radius=9.0, gamma=GAMMA)
    assert found == pytest.approx(right, rel=3e-3)
    assert (found < right).all()


def test_the_power_that_leaves_is_that_of_radial_light() -> None:
    """By reciprocity it is y(r0), if y obeys the equation with ``D y' + y/(2A) = 1/(2A)`` at the surface."""
    inner, source, outer = 5.0, 8.0, 10.0
    nodes, weights = np.polynomial.legendre.leggauss(400)
    exitance = layered_ball.point_exitance([CORE, SHELL], [inner, outer], source_radius=source, gamma=np.arccos(nodes))
    total = 2.0 * np.pi * outer**2 * float(weights @ exitance)
    # y = a sinh(k r)/r in the core, (b e^{k r} + c e^{-k r})/r in the shell.
    k, q, zb = CORE.sigma_tr, SHELL.sigma_tr, SHELL.extrapolation_length

    def shell(r: float) -> np.ndarray:
        return np.array([[np.exp(q * r), np.exp(-q * r)], [q * np.exp(q * r), -q * np.exp(-q * r)]]) / r

    def slope(r: float) -> np.ndarray:
        value, rate = shell(r)
        return np.asarray(rate - value / r)

    core = np.sinh(k * inner) / inner, (k * np.cosh(k * inner) - np.sinh(k * inner) / inner) / inner
    matrix = np.array(
        [
            [core[0], *-shell(inner)[0]],
            [CORE.diffusion * core[1], *(-SHELL.diffusion * slope(inner))],
            [0.0, *(zb * slope(outer) + shell(outer)[0])],
        ]
    )
    _, *parts = np.linalg.solve(matrix, [0.0, 0.0, 1.0])
    assert total == pytest.approx(float(shell(source)[0] @ parts), rel=1e-9)


def test_what_is_no_layered_ball_is_refused() -> None:
    with pytest.raises(InputError, match="ascending"):
        layered_ball.point_exitance([CORE, SHELL], [10.0, 5.0], source_radius=9.0, gamma=0.0)
    with pytest.raises(InputError, match="outermost layer"):
        layered_ball.point_exitance([CORE, SHELL], [5.0, 10.0], source_radius=4.0, gamma=0.0)
