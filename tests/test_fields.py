"""Fields from files, and what is said of bad ones."""

from pathlib import Path
from typing import Any

import meshio
import numpy as np
import pytest
from PIL import Image

from tests.conftest import TISSUE, block
from tetlux.cases.file.fields import read_array_field, read_image_field, read_mesh_field
from tetlux.fem import grid_field
from tetlux.fem.media.varying import VaryingMedium
from tetlux.meshing import InputError
from tetlux.meshing.files.meshes import write_mesh

CUBE = block((3, 3, 3), (2.0, 2.0, 2.0))
MIDDLES = CUBE.points[CUBE.tetrahedra].mean(axis=1)
PLACE: dict[str, Any] = {"origin": (0.0, 0.0, 0.0), "spacing": 1.0}
# Rows, columns.
SLICE = np.array([[0, 51, 102, 153], [10, 20, 30, 40], [204, 230, 250, 255]], dtype=np.uint8)


def linear(p: np.ndarray) -> Any:
    return 1.0 + 0.2 * p[:, 0] - 0.1 * p[:, 1]


@pytest.fixture
def mesh_file(tmp_path: Path) -> Path:
    """Nodes and tetrahedra with values; some tetrahedra turned inside out, and a triangle on a node of its own."""
    tetrahedra = CUBE.tetrahedra.copy()
    tetrahedra[::3] = tetrahedra[::3][:, [1, 0, 2, 3]]
    points = np.vstack([CUBE.points, [[50.0, 0.0, 0.0]]])
    meshio.Mesh(
        points,
        [("tetra", tetrahedra), ("triangle", np.array([[0, 1, len(points) - 1]]))],
        point_data={"nodal": np.append(linear(CUBE.points), np.nan), "arrows": np.ones((len(points), 3))},
        cell_data={"constant": [np.arange(len(tetrahedra), dtype=float), np.array([np.nan])]},
    ).write(tmp_path / "tissue.vtu")
    return tmp_path / "tissue.vtu"


def test_values_of_a_mesh(mesh_file: Path) -> None:
    assert read_mesh_field(mesh_file, "nodal")(MIDDLES) == pytest.approx(linear(MIDDLES), rel=1e-12)
    assert read_mesh_field(mesh_file, "constant")(MIDDLES).tolist() == list(range(len(CUBE.tetrahedra)))
    scaled = read_mesh_field(mesh_file, "nodal", scale=10.0)
    assert scaled(10.0 * MIDDLES) == pytest.approx(linear(MIDDLES), rel=1e-12)


def test_a_mesh_that_tetlux_wrote_makes_a_medium(tmp_path: Path) -> None:
    write_mesh(CUBE, tmp_path / "volume.vtu", {"mu_a": linear(CUBE.points)})
    medium = VaryingMedium(base=TISSUE, sigma_a=read_mesh_field(tmp_path / "volume.vtu", "mu_a"))
    assert medium.at(MIDDLES)[0] == pytest.approx(linear(MIDDLES), rel=1e-12)
    with pytest.raises(InputError, match=r"sigma_a is not known everywhere: the mesh .* at \(0, 0, 9\)"):
        medium.at(np.array([[0.0, 0.0, 9.0]]))


def test_meshes_that_cannot_be(mesh_file: Path) -> None:
    folder = mesh_file.parent
    with pytest.raises(InputError, match=r'holds no array "mu"; the arrays there are: nodal, arrows, constant\.'):
        read_mesh_field(mesh_file, "mu")
    with pytest.raises(InputError, match=r'tissue.vtu, array "arrows": a mesh of 64 nodes needs .* shape \(64, 3\)'):
        read_mesh_field(mesh_file, "arrows")
    with pytest.raises(InputError, match="scale is 0; give a factor greater than 0"):
        read_mesh_field(mesh_file, "nodal", scale=0.0)
    with pytest.raises(InputError, match=r"none.vtu does not exist or is no file"):
        read_mesh_field(folder / "none.vtu", "nodal")
    whole = mesh_file.read_bytes()
    for share in (0.0, 0.3, 0.7, 0.97):
        (folder / "cut.vtu").write_bytes(whole[: int(share * len(whole))])
        with pytest.raises(InputError, match=r"cut.vtu is not a readable VTU mesh; export it again"):
            read_mesh_field(folder / "cut.vtu", "nodal")
    (folder / "mesh.stl").write_bytes(whole)
    with pytest.raises(InputError, match=r'"\.stl" files are not read here; give \.vtu'):
        read_mesh_field(folder / "mesh.stl", "nodal")
    meshio.Mesh(CUBE.points, [("triangle", np.array([[0, 1, 2]]))]).write(folder / "flat.vtu")
    with pytest.raises(InputError, match=r"flat.vtu holds no tetrahedra"):
        read_mesh_field(folder / "flat.vtu", "nodal")
    meshio.Mesh(CUBE.points, [("tetra", CUBE.tetrahedra)], {"mu": np.full(64, np.nan)}).write(folder / "nan.vtu")
    with pytest.raises(InputError, match=r'nan.vtu, array "mu": 64 of 64 values of the mesh are not finite'):
        read_mesh_field(folder / "nan.vtu", "mu")


def stack(folder: Path, names: tuple[str, ...] = ("s1.png", "s2.png", "s10.png")) -> Path:
    """Slices, each 10 brighter than the one before."""
    for number, name in enumerate(names):
        Image.fromarray((SLICE // 2 + 10 * number).astype(np.uint8)).save(folder / name)
    return folder


def test_a_stack_of_images(tmp_path: Path) -> None:
    """Columns along x, rows along y, and slices along z, in the order of their numbers."""
    (tmp_path / "notes.txt").write_text("not a slice")
    field = read_image_field(stack(tmp_path), origin=(5.0, 6.0, 7.0), spacing=(1.0, 2.0, 0.5), values=(0.1, 0.355))
    points = np.array([[8.0, 6.0, 7.0], [5.0, 10.0, 7.5], [8.0, 10.0, 8.0], [5.5, 6.0, 7.25]])
    grey = [153 // 2, 204 // 2 + 10, 255 // 2 + 20, 0.25 * (0 + 25 + 10 + 35)]
    assert field(points) == pytest.approx(0.1 + 0.001 * np.array(grey), rel=1e-6)
    with pytest.raises(InputError, match="does not cover the body"):
        field(np.array([[5.0, 6.0, 9.0]]))


@pytest.mark.parametrize("kind", ["bits", "bytes", "words", "pages"])
def test_black_and_white_are_the_values_given(tmp_path: Path, kind: str) -> None:
    white = SLICE >= 200
    if kind == "bits":
        Image.fromarray(white).save(tmp_path / "a.tif")
    elif kind == "bytes":
        Image.fromarray(white.astype(np.uint8) * np.uint8(255)).save(tmp_path / "a.png")
    elif kind == "words":
        Image.fromarray(white.astype(np.uint16) * np.uint16(65535)).save(tmp_path / "a.png")
    else:
        pages = [Image.fromarray((white * 255 * part).astype(np.uint8)) for part in (0, 1)]
        pages[0].save(tmp_path / "a.tif", save_all=True, append_images=pages[1:])
    file = next(tmp_path.iterdir())
    height = float(kind == "pages")
    corners = np.array([[0.0, 0.0, height], [3.0, 2.0, height]])
    for path in (file, tmp_path):
        assert read_image_field(path, **PLACE, values=(0.5, 2.0))(corners) == pytest.approx([0.5, 2.0])
        # White may stand for less than black.
        assert read_image_field(path, **PLACE, values=(2.0, 0.5))(corners) == pytest.approx([2.0, 0.5])


def test_images_that_cannot_be(tmp_path: Path) -> None:
    def read(path: Path) -> None:
        read_image_field(path, **PLACE, values=(0.0, 1.0))

    with pytest.raises(InputError, match="holds no images; give a folder of PNG or TIFF slices"):
        read(tmp_path)
    with pytest.raises(InputError, match=r"none does not exist or is no file"):
        read(tmp_path / "none")
    stack(tmp_path)
    Image.fromarray(SLICE[:2]).save(tmp_path / "s3.png")
    message = r"s3.png has 4 x 2 pixels, mode L, and .*s1.png has 4 x 3 pixels, mode L; give slices of one size"
    with pytest.raises(InputError, match=message):
        read(tmp_path)
    Image.fromarray(SLICE.astype(np.uint16)).save(tmp_path / "s3.png")
    with pytest.raises(InputError, match=r"s3.png has 4 x 3 pixels, mode I;16, and"):
        read(tmp_path)
    Image.fromarray(np.dstack([SLICE] * 3)).save(tmp_path / "s3.png")
    with pytest.raises(InputError, match=r"s3.png is not a grey image of 8 or 16 bits \(its mode is RGB\)"):
        read(tmp_path)
    (tmp_path / "s3.png").write_text("no image")
    with pytest.raises(InputError, match=r"s3.png is not a readable image; export it again"):
        read(tmp_path)
    with pytest.raises(InputError, match=r"values are .*; give two finite numbers"):
        read_image_field(tmp_path / "s1.png", **PLACE, values=(0.0, np.nan))
    with pytest.raises(InputError, match=r"values are .*; give two finite numbers up to 1e\+30"):
        read_image_field(tmp_path / "s1.png", **PLACE, values=(-1.2e297, 0.1))
    with pytest.raises(InputError, match=r"s1.png: spacing is -1"):
        read_image_field(tmp_path / "s1.png", origin=(0, 0, 0), spacing=-1, values=(0.0, 1.0))


@pytest.mark.parametrize(("name", "compression"), [("a.png", None), ("a.tif", None), ("a.tif", "tiff_lzw")])
def test_images_cut_short(tmp_path: Path, name: str, compression: str | None) -> None:
    """Of pages that are not there any more Pillow only warns."""
    noise = [Image.fromarray(np.random.default_rng(i).integers(0, 256, (20, 30), dtype=np.uint8)) for i in range(3)]
    more: dict[str, Any] = {}
    if name == "a.tif":
        more = {"save_all": True, "append_images": noise[1:], "compression": compression}
    noise[0].save(tmp_path / name, **more)
    whole = (tmp_path / name).read_bytes()
    # The last bytes are no pixels.
    for length in range(0, len(whole) - 20, 23):
        (tmp_path / name).write_bytes(whole[:length])
        with pytest.raises(InputError, match="is not a readable image"):
            read_image_field(tmp_path / name, **PLACE, values=(0.0, 1.0))


def test_arrays(tmp_path: Path) -> None:
    values = np.arange(24.0).reshape(2, 3, 4)
    np.save(tmp_path / "mu.npy", values)
    field = read_array_field(tmp_path / "mu.npy", **PLACE)
    assert field(np.array([[1.0, 2.0, 3.0], [0.5, 0.0, 0.0]])) == pytest.approx([23.0, 6.0])
    whole = (tmp_path / "mu.npy").read_bytes()
    for length in (0, 5, 50, len(whole) - 8):
        (tmp_path / "cut.npy").write_bytes(whole[:length])
        with pytest.raises(InputError, match=r"cut.npy is not a readable array of numbers"):
            read_array_field(tmp_path / "cut.npy", **PLACE)
    np.save(tmp_path / "objects.npy", np.array([None]), allow_pickle=True)
    with pytest.raises(InputError, match=r"objects.npy is not a readable array of numbers"):
        read_array_field(tmp_path / "objects.npy", **PLACE)
    for bad, message in (
        (np.where(values == 3, np.nan, values), "mu.npy: 1 of 24 values of the grid are not finite"),
        (values[0], r"mu.npy: a grid needs values along x, y and z, and has the shape \(3, 4\)"),
        (values.astype(str), "mu.npy: the values of the grid are of type"),
    ):
        np.save(tmp_path / "mu.npy", bad)
        with pytest.raises(InputError, match=message):
            read_array_field(tmp_path / "mu.npy", **PLACE)
    with pytest.raises(InputError, match=r'"\.txt" files are not read|does not exist'):
        read_array_field(tmp_path / "mu.txt", **PLACE)


def test_a_spacing_that_no_quotient_survives_is_refused() -> None:
    with pytest.raises(InputError, match=r"spacing is .*; give lengths of at least 1e-30"):
        grid_field(np.ones((2, 2, 2)), origin=(0, 0, 0), spacing=1e-320)
    with pytest.raises(InputError, match="origin is"):
        grid_field(np.ones((2, 2, 2)), origin=(1e300, 0, 0), spacing=1.0)
