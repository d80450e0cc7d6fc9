"""Where the first mesh is to be fine."""

import numpy as np

from tetlux.fem import Deposit, Medium
from tetlux.fem.grading import lit_points


def test_of_several_channels_the_finest_counts() -> None:
    """Light that is seen in several media at the same places, and some that only one of them has."""
    places = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 2.0, 0.0]])
    deposits = [Deposit(lit=places[:2], resolution=0.5), Deposit(lit=places, resolution=0.2)]
    for order in (deposits, deposits[::-1]):
        points, resolutions = lit_points(
            [*order, Deposit(lit=places[1:2], resolution=0.1)], Medium(sigma_a=0.1, sigma_s_prime=1.0, eta=1.4)
        )
        assert sorted(points.tolist()) == sorted(places.tolist())
        found = dict(zip(map(tuple, points.tolist()), resolutions.tolist(), strict=True))
        assert found == {(0.0, 0.0, 0.0): 0.2, (1.0, 0.0, 0.0): 0.1, (0.0, 2.0, 0.0): 0.2}
    points, resolutions = lit_points([Deposit()], Medium(sigma_a=0.1, sigma_s_prime=1.0, eta=1.4))
    assert points.shape == (0, 3)
    assert resolutions.shape == (0,)
