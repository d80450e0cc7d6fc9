"""Where the first mesh is to be fine."""

import numpy as np

from tests.conftest import block
from tetlux.fem import Deposit, MeshHints
from tetlux.fem.grading import grade_mesh, places_to_resolve


def test_of_several_channels_the_finest_counts() -> None:
    """Light that is seen in several media at the same places, and some that only one of them has."""
    places = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 2.0, 0.0]])
    deposits = [Deposit(hints=MeshHints(0.5, places[:2])), Deposit(hints=MeshHints(0.2, places))]
    for order in (deposits, deposits[::-1]):
        points, resolutions = places_to_resolve([*order, Deposit(hints=MeshHints(0.1, places[1:2]))])
        assert sorted(points.tolist()) == sorted(places.tolist())
        found = dict(zip(map(tuple, points.tolist()), resolutions.tolist(), strict=True))
        assert found == {(0.0, 0.0, 0.0): 0.2, (1.0, 0.0, 0.0): 0.1, (0.0, 2.0, 0.0): 0.2}
    points, resolutions = places_to_resolve([Deposit()])
    assert points.shape == (0, 3)
    assert resolutions.shape == (0,)


def test_no_tetrahedron_is_longer_than_its_distance_from_the_light() -> None:
    """Or than what resolves the light that is nearest, of several."""
    mesh = block((3, 3, 3), (6.0, 6.0, 6.0))
    points, resolutions = np.array([[-1.0, 0.5, -1.0], [2.0, -1.0, -4.0]]), np.array([0.3, 1.5])
    finer = grade_mesh(mesh, mesh.surface, points, resolutions, 100_000)
    middles = finer.points[finer.tetrahedra].mean(axis=1)
    apart = np.linalg.norm(middles[:, None] - points, axis=2)
    allowed = np.maximum(apart.min(axis=1), resolutions[apart.argmin(axis=1)])
    assert (finer.longest_edges <= allowed).all()
    assert finer.longest_edges.max() > 1.5
    # It stops before there are too many.
    assert grade_mesh(mesh, mesh.surface, points, resolutions, len(mesh.tetrahedra)) is mesh
