"""Bodies and meshes that several tests share, and which of them need a library that may be missing."""

import os
from collections.abc import Iterator
from importlib.util import find_spec

import numpy as np
import pytest
from skfem import MeshTet1

from tetlux.fem import Medium, PointSource, Solution, solve
from tetlux.meshing import Surface, TetMesh, sphere, tetrahedralize

TISSUE = Medium(sigma_a=0.01, sigma_s_prime=1.0, eta=1.4)


def needs(*packages: str) -> pytest.MarkDecorator:
    """Skip a test where a library is missing that pip leaves out on some platforms; in CI it runs, and fails."""
    missing = [package for package in packages if find_spec(package) is None]
    skipped = bool(missing) and not os.environ.get("CI")
    return pytest.mark.skipif(skipped, reason=f"{' and '.join(missing)} not installed")


@pytest.fixture(autouse=True, scope="session")
def _own_mesh_cache(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Tests read and write no mesh of the user's cache."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("TETLUX_CACHE_DIR", str(tmp_path_factory.mktemp("meshes")))
        yield


@pytest.fixture(scope="session")
def ball() -> Surface:
    """The sphere of radius 10 that has a closed form."""
    return sphere(10.0)


@pytest.fixture(scope="session")
def ball_mesh(ball: Surface) -> TetMesh:
    return tetrahedralize(ball)


@pytest.fixture(scope="session")
def ball_solution(ball: Surface) -> Solution:
    """Default settings: a point source one mean free path below the pole."""
    return solve(ball, TISSUE, [PointSource((0.0, 0.0, 10.0 - TISSUE.mean_free_path))])


def block(counts: tuple[int, int, int], size: tuple[float, float, float]) -> TetMesh:
    """A box cut into cubes of six tetrahedra, its upper face at z = 0: the same on every machine."""
    axes = [np.linspace(-0.5 * s, 0.5 * s, n + 1) for s, n in zip(size, counts, strict=True)]
    axes[2] -= 0.5 * size[2]
    mesh = MeshTet1.init_tensor(*axes).oriented()
    return TetMesh(np.ascontiguousarray(mesh.p.T), np.ascontiguousarray(mesh.t.T).astype(np.int64))
