"""Bodies and meshes that several tests share, how tests are spread over processes, and which may be skipped."""

import os
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path

# Tests run in as many processes as there are cores, where threads that wait for each other in dense linear algebra
# cost up to ten times as much. NumPy reads it when it is imported.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
import pytest
from skfem import MeshTet1

from tetlux.fem import Medium, PointSource, Solution, solve
from tetlux.meshing import Surface, TetMesh, sphere, tetrahedralize
from tetlux.meshing.host.blocks import THREADS

TISSUE = Medium(sigma_a=0.01, sigma_s_prime=1.0, eta=1.4)
# Each process holds up to 1.6 GB.
MOST_PROCESSES = 4


def pytest_xdist_auto_num_workers(config: pytest.Config) -> int:
    """As many processes as cores, up to four; none for a single file, so that breakpoints work there."""
    files = {Path(argument.partition("::")[0]) for argument in config.args}
    if len(files) == 1 and files.pop().is_file():
        return 0
    return min(THREADS, MOST_PROCESSES)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Files with slow tests go first, so that no process is left with one of them at the end."""
    slow = {item.path for item in items if item.get_closest_marker("slow")}
    items.sort(key=lambda item: item.path not in slow)


def needs(*packages: str) -> pytest.MarkDecorator:
    """Skip a test where a library is missing that pip leaves out on some platforms; in CI it runs, and fails."""
    missing = [package for package in packages if find_spec(package) is None]
    skipped = bool(missing) and not os.environ.get("CI")
    return pytest.mark.skipif(skipped, reason=f"{' and '.join(missing)} not installed")


@pytest.fixture(autouse=True, scope="session")
def _own_mesh_cache(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Tests read and write no mesh of the user's cache, and learn nothing; all processes of a run share one cache."""
    folder = tmp_path_factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:
        folder = folder.parent
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("TETLUX_CACHE_DIR", str(folder / "meshes"))
        patch.setenv("TETLUX_LEARN", "0")
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
