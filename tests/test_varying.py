"""Media and fields that vary in space."""

import pickle

import numpy as np
import pytest

from tests.conftest import TISSUE, block
from tetlux.fem import Medium
from tetlux.fem.media.fields import grid_field, mesh_field
from tetlux.fem.media.varying import Field, VaryingMedium
from tetlux.meshing import InputError
from tetlux.meshing.arrays import FloatArray

POINTS = np.random.default_rng(5).uniform(-0.9, 0.9, (200, 3))
# Trilinear in x, y, z: what trilinear interpolation gives back.
CORNERS = np.array([-1.0, 1.0])


def trilinear(p: FloatArray) -> FloatArray:
    x, y, z = np.asarray(p, dtype=float).T
    return np.asarray(5.0 + x - 2.0 * y + 0.5 * z + 0.3 * x * y * z)


def affine(p: FloatArray) -> FloatArray:
    return np.asarray(5.0 + p @ np.array([1.0, -2.0, 0.5]))


def test_what_does_not_vary_is_the_base() -> None:
    sigma_a, sigma_s_prime = VaryingMedium(base=TISSUE, sigma_a=lambda p: 0.1 + p[:, 0] ** 2).at(POINTS)
    assert sigma_a == pytest.approx(0.1 + POINTS[:, 0] ** 2, rel=1e-15)
    assert sigma_s_prime.tolist() == [1.0] * 200
    sigma_a, sigma_s_prime = VaryingMedium(base=TISSUE, sigma_s_prime=affine).at(POINTS)
    assert sigma_a.tolist() == [0.01] * 200
    assert sigma_s_prime == pytest.approx(affine(POINTS), rel=1e-15)
    assert [len(part) for part in VaryingMedium(base=TISSUE, sigma_a=affine).at(np.zeros((0, 3)))] == [0, 0]


def test_the_forward_peak_is_that_of_the_base() -> None:
    base = Medium(sigma_a=0.01, sigma_s=10.0, g=0.9, eta=1.4)
    medium = VaryingMedium(base=base, sigma_s_prime=affine)
    scattering, cosine = medium.delta_eddington(medium.at(POINTS)[1])
    at_base, cosine_at_base = base.delta_eddington
    assert cosine == cosine_at_base == pytest.approx(0.9 / 1.9)
    assert scattering == pytest.approx(at_base * affine(POINTS) / base.reduced_scattering, rel=1e-12)


@pytest.mark.parametrize(
    ("name", "field", "message"),
    [
        (
            "sigma_a",
            lambda p: np.where(p[:, 0] > 0, 1.0, np.nan),
            r"^sigma_a is nan at \(-1, 0, 0\); a coefficient must",
        ),
        ("sigma_a", lambda p: p[:, 0], r"^sigma_a is -1 at \(-1, 0, 0\); a coefficient cannot be negative"),
        ("sigma_s_prime", lambda p: p[:, 0] - 0.5, r"^sigma_s_prime is -1.5 at \(-1, 0, 0\); light does not diffuse"),
        ("sigma_s_prime", lambda p: 0 * p[:, 0], r"^sigma_s_prime is 0 at \(1, 2, 3\); light does not diffuse"),
        ("sigma_s_prime", lambda p: p[:, 0] / 0.0, r"^sigma_s_prime is inf at \(1, 2, 3\)"),
        ("sigma_a", lambda p: p, r"^sigma_a gives an array of shape \(2, 3\) for 2 points; it must give one number"),
        ("sigma_a", lambda _: 1.0, r"^sigma_a gives an array of shape \(\) for 2 points"),
        ("sigma_a", lambda _: ["a", "b"], "^sigma_a gives no numbers at points"),
        (
            "sigma_a",
            grid_field(np.ones((1, 1, 1)), origin=(1, 2, 3), spacing=1),
            "^sigma_a is not known everywhere: the",
        ),
    ],
)
def test_values_that_cannot_be(name: str, field: Field, message: str) -> None:
    medium = VaryingMedium(base=TISSUE, **{name: field})
    with np.errstate(divide="ignore"), pytest.raises(InputError, match=message):
        medium.at(np.array([[1.0, 2.0, 3.0], [-1.0, 0.0, 0.0]]))


def test_no_absorption_is_allowed_and_no_scattering_is_not() -> None:
    assert VaryingMedium(base=TISSUE, sigma_a=lambda p: 0 * p[:, 0]).at(POINTS)[0].max() == 0.0
    void = Medium(sigma_a=0.1, sigma_s_prime=0.0, eta=1.4)
    with pytest.raises(InputError, match="sigma_s_prime is 0 at"):
        VaryingMedium(base=void, sigma_a=affine).at(POINTS)
    assert VaryingMedium(base=void, sigma_s_prime=affine).at(POINTS)[1] == pytest.approx(affine(POINTS))


def test_a_number_is_no_field() -> None:
    with pytest.raises(InputError, match=r"sigma_a is 0\.1; give a function of points, and what is constant"):
        VaryingMedium(base=TISSUE, sigma_a=0.1)  # type: ignore[arg-type]


def test_a_grid_is_trilinear_between_its_values() -> None:
    corners = np.stack(np.meshgrid(CORNERS, CORNERS, CORNERS, indexing="ij"), axis=-1)
    field = grid_field(trilinear(corners.reshape(-1, 3)).reshape(2, 2, 2), origin=(-1, -1, -1), spacing=2.0)
    assert field(POINTS) == pytest.approx(trilinear(POINTS), rel=1e-12)
    assert pickle.loads(pickle.dumps(field))(POINTS) == pytest.approx(field(POINTS))


def test_a_grid_has_its_own_spacing_along_each_axis() -> None:
    values = np.arange(3.0)[:, None, None] + 10.0 * np.arange(4)[:, None] + 100.0 * np.arange(5)
    field = grid_field(values.astype(np.uint16), origin=(1.0, 2.0, 3.0), spacing=(0.1, 1.0, 10.0))
    assert field(np.array([[1.15, 3.0, 23.0], [1.2, 5.0, 28.0]])) == pytest.approx([1.5 + 10 + 200, 2 + 30 + 250])


def test_a_grid_covers_its_voxels_and_no_more() -> None:
    field = grid_field(np.array([[[1.0, 3.0]]]), origin=(0, 0, 0), spacing=1.0)
    assert field(np.array([[0.5, -0.5, -0.5], [0, 0, 0.25], [0, 0, 1.5]])) == pytest.approx([1.0, 1.5, 3.0])
    message = r"grid from \(-0\.5, -0\.5, -0\.5\) to \(0\.5, 0\.5, 1\.5\) does not cover the body: at \(0, 0, 1\.6\)"
    with pytest.raises(InputError, match=message):
        field(np.array([[0, 0, 0], [0, 0, 1.6]]))
    with pytest.raises(InputError, match=r"at \(-0\.51, 0, 0\)"):
        field(np.array([[-0.51, 0, 0]]))


@pytest.mark.parametrize(
    ("values", "origin", "spacing", "message"),
    [
        (np.ones((2, 2)), (0, 0, 0), 1.0, r"needs values along x, y and z, and has the shape \(2, 2\)"),
        (np.ones((2, 0, 2)), (0, 0, 0), 1.0, r"has the shape \(2, 0, 2\)"),
        (np.array([[[1.0, np.nan]]]), (0, 0, 0), 1.0, "1 of 2 values of the grid are not finite"),
        (np.array([[[1j]]]), (0, 0, 0), 1.0, "of type complex128; give real numbers"),
        (np.ones((1, 1, 1)), (0, 0), 1.0, "origin is .*; give three finite coordinates"),
        (np.ones((1, 1, 1)), (0, 0, np.nan), 1.0, "origin is"),
        (np.ones((1, 1, 1)), (0, 0, 0), 0.0, "spacing is 0.0; give one length greater than 0, or three"),
        (np.ones((1, 1, 1)), (0, 0, 0), (1, 1), "spacing is"),
    ],
)
def test_grids_that_cannot_be(
    values: FloatArray, origin: tuple[float, float, float], spacing: float, message: str
) -> None:
    with pytest.raises(InputError, match=message):
        grid_field(values, origin=origin, spacing=spacing)


CUBE = block((3, 3, 3), (2.0, 2.0, 2.0))  # z from -2 to 0
INSIDE = POINTS - [0.0, 0.0, 1.0]


def test_a_mesh_is_linear_between_its_nodes() -> None:
    field = mesh_field(CUBE, affine(CUBE.points))
    assert field(INSIDE) == pytest.approx(affine(INSIDE), rel=1e-12)
    assert field(CUBE.points) == pytest.approx(affine(CUBE.points), rel=1e-6)


def test_a_mesh_has_one_value_in_each_tetrahedron() -> None:
    field = mesh_field(CUBE, np.arange(len(CUBE.tetrahedra)), at="tetrahedra")
    middles = CUBE.points[CUBE.tetrahedra].mean(axis=1)
    assert field(middles).tolist() == list(range(len(CUBE.tetrahedra)))


def test_a_hair_outside_a_mesh_the_nearest_value_holds() -> None:
    # A hundredth of a diagonal of 2 sqrt(3) is 0.0346.
    field = mesh_field(CUBE, affine(CUBE.points))
    out, on = np.array([[1.03, 0.1, -1.0], [0.0, 0.0, 0.03]]), np.array([[1.0, 0.1, -1.0], [0.0, 0.0, 0.0]])
    assert field(out) == pytest.approx(affine(on), rel=1e-9)
    assert mesh_field(CUBE, np.full(len(CUBE.tetrahedra), 7.0), at="tetrahedra")(out).tolist() == [7.0, 7.0]
    message = r"mesh of the values does not cover the body: at \(1\.04, 0, -1\) it has no value, 0\.04 mm outside"
    with pytest.raises(InputError, match=message):
        field(np.array([[0.0, 0.0, -1.0], [1.04, 0.0, -1.0], [1.01, 0.0, -1.0]]))


def test_values_that_do_not_go_with_their_mesh() -> None:
    with pytest.raises(InputError, match=r"mesh of 64 nodes needs as many values, and not an array of shape \(162,\)"):
        mesh_field(CUBE, np.ones(162))
    with pytest.raises(InputError, match=r"mesh of 162 tetrahedra needs as many values, and not .* \(64, 3\)"):
        mesh_field(CUBE, np.ones((64, 3)), at="tetrahedra")
    with pytest.raises(InputError, match="1 of 64 values of the mesh are not finite"):
        mesh_field(CUBE, np.where(np.arange(64) == 5, np.inf, 1.0))
    with pytest.raises(InputError, match='values are at "faces"; they are at "nodes" or "tetrahedra"'):
        mesh_field(CUBE, np.ones(64), at="faces")  # type: ignore[arg-type]
