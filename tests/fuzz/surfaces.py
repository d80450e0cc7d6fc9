"""Malformed surfaces: as arrays, and as files that are cut short, mislabelled or full of nonsense."""

import io
import json
import zipfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
import trimesh

from tetlux.meshing import Surface, box, cylinder, sphere, torus
from tetlux.meshing.arrays import FloatArray, IntArray

Arrays = tuple[FloatArray, IntArray]


@dataclass(frozen=True)
class Malformed:
    """A surface file by its name, with what it holds; `size` is that of the body that it should be, unit.

    `holes` is what the case file says of them.
    """

    name: str
    suffix: str
    content: bytes
    size: float = 20.0
    holes: str = "small"


def off(points: FloatArray, faces: IntArray) -> bytes:
    """A text that keeps every digit."""
    rows = [f"OFF\n{len(points)} {len(faces)} 0"]
    rows += [f"{x!r} {y!r} {z!r}" for x, y, z in np.asarray(points, dtype=float).tolist()]
    rows += [f"3 {a} {b} {c}" for a, b, c in faces.tolist()]
    return ("\n".join(rows) + "\n").encode()


def exported(surface: Surface, kind: str) -> bytes:
    """A surface in one of the formats that trimesh writes."""
    data = trimesh.Trimesh(surface.points, surface.faces, process=False).export(file_type=kind)
    assert isinstance(data, str | bytes)
    return data.encode() if isinstance(data, str) else data


def _ply(surface: Surface) -> bytes:
    """As text."""
    head = f"ply\nformat ascii 1.0\nelement vertex {len(surface.points)}\nproperty float x\nproperty float y\n"
    head += f"property float z\nelement face {len(surface.faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    rows = [" ".join(map(str, row)) for row in surface.points.tolist()]
    return "\n".join(
        [head + rows[0], *rows[1:], *(f"3 {a} {b} {c}" for a, b, c in surface.faces.tolist()), ""]
    ).encode()


def stl(points: FloatArray, faces: IntArray, claimed: int | None = None) -> bytes:
    """A binary STL, whose head may claim another number of triangles."""
    rows = np.zeros(len(faces), dtype=[("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("rest", "<u2")])
    with np.errstate(over="ignore"):
        rows["corners"] = points[faces]
    return b"\0" * 80 + np.uint32(len(faces) if claimed is None else claimed).tobytes() + rows.tobytes()


def together(*parts: Arrays) -> Arrays:
    """Several surfaces as one."""
    first = np.cumsum([0, *(len(points) for points, _ in parts)])
    return (
        np.vstack([points for points, _ in parts]),
        np.vstack([faces + start for (_, faces), start in zip(parts, first, strict=False)]),
    )


def arrays_of(surface: Surface) -> Arrays:
    return surface.points, surface.faces


def grid(
    rows: int, columns: int, place: Callable[[FloatArray, FloatArray], FloatArray], *, twist: bool = False
) -> Arrays:
    """A band of two triangles a cell, whose columns close on themselves, turned over if it is twisted."""
    u, v = np.meshgrid(np.arange(columns) / columns, np.linspace(0.0, 1.0, rows + 1))
    i, j = (x.ravel() for x in np.meshgrid(np.arange(rows), np.arange(columns), indexing="ij"))

    def node(row: IntArray, column: IntArray) -> IntArray:
        over = twist & (column == columns)
        return np.asarray(np.where(over, rows - row, row) * columns + column % columns)

    a, b, c, d = node(i, j), node(i, j + 1), node(i + 1, j + 1), node(i + 1, j)
    return place(u, v).reshape(-1, 3), np.vstack([np.column_stack([a, b, c]), np.column_stack([a, c, d])])


def _moebius(u: FloatArray, v: FloatArray) -> FloatArray:
    angle, across = 2.0 * np.pi * u, 6.0 * (v - 0.5)
    reach = 10.0 + across * np.cos(0.5 * angle)
    return np.stack([reach * np.cos(angle), reach * np.sin(angle), across * np.sin(0.5 * angle)], axis=-1)


def _pipe(u: FloatArray, v: FloatArray) -> FloatArray:
    angle = 2.0 * np.pi * u
    return np.stack([5.0 * np.cos(angle), 5.0 * np.sin(angle), 20.0 * v], axis=-1)


def _klein(rows: int = 24, columns: int = 24) -> Arrays:
    """The figure-of-eight immersion of the bottle."""
    u, v = np.meshgrid(np.arange(columns) / columns, np.arange(rows) / rows)
    half, tube = np.pi * u, 2.0 * np.pi * v
    reach = 8.0 + 3.0 * (np.cos(half) * np.sin(tube) - np.sin(half) * np.sin(2.0 * tube))
    height = 3.0 * (np.sin(half) * np.sin(tube) + np.cos(half) * np.sin(2.0 * tube))
    points = np.stack([reach * np.cos(2.0 * half), reach * np.sin(2.0 * half), height], axis=-1).reshape(-1, 3)
    i, j = (x.ravel() for x in np.meshgrid(np.arange(rows), np.arange(columns), indexing="ij"))

    def node(row: IntArray, column: IntArray) -> IntArray:
        return np.asarray(np.where(column == columns, -row, row) % rows * columns + column % columns)

    a, b, c, d = node(i, j), node(i, j + 1), node(i + 1, j + 1), node(i + 1, j)
    return points, np.vstack([np.column_stack([a, b, c]), np.column_stack([a, c, d])])


def _sheet(count: int = 10) -> Arrays:
    x, y = np.meshgrid(np.linspace(0.0, 10.0, count), np.linspace(0.0, 10.0, count))
    points = np.column_stack([x.ravel(), y.ravel(), np.sin(x.ravel())])
    i, j = (k.ravel() for k in np.meshgrid(np.arange(count - 1), np.arange(count - 1), indexing="ij"))
    a = i * count + j
    return points, np.vstack(
        [np.column_stack([a, a + 1, a + count + 1]), np.column_stack([a, a + count + 1, a + count])]
    )


def _layer(thickness: float) -> Arrays:
    """Two sheets back to back and nothing between their rims but a hem."""
    points, faces = _sheet()
    count = len(points)
    upper = points + [0.0, 0.0, thickness]
    order = np.sort(np.vstack([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
    edges = np.vstack([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    _, inverse, uses = np.unique(order, axis=0, return_inverse=True, return_counts=True)
    a, b = edges[uses[inverse.ravel()] == 1].T
    hem = np.vstack([np.column_stack([a, a + count, b]), np.column_stack([b, a + count, b + count])])
    return np.vstack([points, upper]), np.vstack([faces[:, ::-1], faces + count, hem[:, ::-1]])


def bodies(seed: int = 0) -> Iterator[tuple[str, Arrays]]:
    """Surfaces that are open, tangled, turned, doubled, nested or hardly there, about 20 across."""
    random = np.random.default_rng((6, seed))
    ball = sphere(10.0, subdivisions=2)
    cube, fine = box((14.0, 14.0, 14.0)), sphere(10.0, subdivisions=3)
    p, f = arrays_of(ball)
    count = len(f)
    for missing in (1, 2, 5, 20, 100, 200, count - 3, count - 1):
        yield f"ball without {missing} random triangles", (p, f[random.permutation(count)[missing:]])
    for height in (-9.0, -5.0, 0.0, 5.0, 9.0, 9.7):
        yield f"ball open above {height}", (p, f[p[f].mean(axis=1)[:, 2] < height])
    for missing in range(1, 12, 2):
        yield f"cube without {missing} triangles", (cube.points, cube.faces[missing:])
    soup = p[f].reshape(-1, 3)
    for gap in (1e-9, 1e-7, 1e-6, 1e-4, 1e-2, 1.0):
        apart = soup + random.normal(scale=gap, size=soup.shape)
        yield f"triangles {gap:g} apart", (apart, np.arange(len(soup)).reshape(-1, 3))
    fins = np.column_stack([f[:5, 0], f[:5, 1], len(p) + np.arange(5)])
    yield "five fins", (np.vstack([p, 1.3 * p[:5]]), np.vstack([f, fins]))
    yield "an edge with three triangles to itself", (np.vstack([p, [[0.0, 0, 0]]]), np.vstack([f, [[0, 1, len(p)]]]))
    yield "a triangle within", together((p, f), (0.1 * p[f[0]], np.array([[0, 1, 2]])))
    yield "a triangle outside", together((p, f), (3.0 * p[f[0]], np.array([[0, 1, 2]])))
    yield "a wall within the cube", (cube.points, np.vstack([cube.faces, [[0, 1, 6], [0, 6, 7]]]))
    touching = together((p, f), (p + 2.0 * p[0], f))
    yield "two balls at a vertex", touching
    shifted = together(arrays_of(cube), (cube.points + [14.0, 14.0, 0.0], cube.faces))
    yield "two cubes along an edge", shifted
    yield "two cubes at a corner", together(arrays_of(cube), (cube.points + 14.0, cube.faces))
    yield "two cubes on a side", together(arrays_of(cube), (cube.points + [14.0, 0.0, 0.0], cube.faces))
    yield "two cubes on half a side", together(arrays_of(cube), (cube.points + [14.0, 7.0, 0.0], cube.faces))
    yield "two cubes a hair apart", together(arrays_of(cube), (cube.points + [14.0 + 1e-9, 0.0, 0.0], cube.faces))
    yield (
        "two cubes a hair into each other",
        together(arrays_of(cube), (cube.points + [14.0 - 1e-6, 3.0, 2.0], cube.faces)),
    )
    pinched = p.copy()
    pinched[np.abs(p[:, 2]) < 1.0] *= [1e-12, 1e-12, 1.0]
    yield "a waist of no width", (pinched, f)
    merged = p.copy()
    merged[p[:, 2] > 9.0] = merged[p[:, 2] < -9.0][0]
    yield "two poles at one place", (merged, f)
    for roughness in (0.01, 0.1, 0.5, 2.0, 10.0, 100.0):
        yield f"noise of {roughness:g}", (p + random.normal(scale=roughness, size=p.shape), f)
    yield "vertices in any order", (random.permutation(p), f)
    yield "triangles at random", (p, random.integers(0, len(p), (300, 3)))
    yield (
        "a cloud of tetrahedra",
        together(
            *(
                (
                    random.normal(size=(4, 3)) + random.normal(scale=8, size=3),
                    np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]),
                )
                for _ in range(40)
            )
        ),
    )
    for step in (0.0, 0.01, 5.0, 19.0, 19.99, 20.0, 20.01):
        yield f"two balls {step:g} apart", together((p, f), (p + [step, 0.0, 0.0], f))
    yield "two fine balls crossing", together(arrays_of(fine), (fine.points + [7.0, 1.0, 2.0], fine.faces))
    u = torus(6.0, 4.0, segments=24)
    swollen = u.points.copy()
    swollen[:, :2] *= 1.0 - 7.0 / np.linalg.norm(swollen[:, :2], axis=1)[:, None]
    yield "a ring through its middle", (swollen, u.faces)
    yield "inside out", (p, f[:, ::-1])
    for share in (0.003, 0.01, 0.1, 0.5, 0.9):
        turned = f.copy()
        some = random.random(count) < share
        turned[some] = turned[some, ::-1]
        yield f"{share:.1%} turned over", (p, turned)
    yield "one of two bodies inside out", together((p, f), (p + [30.0, 0.0, 0.0], f[:, ::-1]))
    half = np.where((p[f].mean(axis=1)[:, 2] > 0)[:, None], f, f[:, ::-1])
    yield "a half turned over", (p, half)
    yield "a mirror image", (p * [1.0, 1.0, -1.0], f)
    for times in (2, 3, 4, 10):
        yield f"every triangle {times} times", (p, np.vstack([f] * times))
    yield "every triangle back to back", (p, np.vstack([f, f[:, ::-1]]))
    yield "some triangles back to back", (p, np.vstack([f, f[:40, ::-1]]))
    yield "some triangles thrice", (p, np.vstack([f, f[:40], f[:40]]))
    yield "every body twice", together((p, f), (p, f))
    yield "triangles that are points", (p, np.vstack([f, np.repeat(np.arange(50)[:, None], 3, axis=1)]))
    yield "triangles that are edges", (p, np.vstack([f, f[:50][:, [0, 1, 1]]]))
    collinear = np.vstack([cube.points, 0.5 * (cube.points[cube.faces[0, 0]] + cube.points[cube.faces[0, 1]])])
    yield "a triangle on a line", (collinear, np.vstack([cube.faces, [[*cube.faces[0, :2], len(cube.points)]]]))
    a, b, c = cube.faces[0]
    split = np.vstack([cube.faces[1:], [[a, 8, c], [8, b, c]]])
    yield "a vertex on an edge of another", (collinear, split)
    yield "a slit filled by a triangle of no area", (collinear, np.vstack([split, [[a, b, 8]]]))
    for factor in (1e2, 1e4, 1e6, 1e8, 1e12):
        yield f"a needle {factor:g} long", (p * [1.0 / factor, 1.0 / factor, 1.0], f)
        yield f"a plate a {factor:g}th thick", (p * [1.0, 1.0, 1.0 / factor], f)
    for reach in (3.0, 100.0, 1e4, 1e9):
        spike = p.copy()
        spike[0] *= reach
        yield f"a spike of {reach:g}", (spike, f)
    cone = cylinder(10.0, 20.0, segments=64)
    slim = cone.points.copy()
    slim[cone.points[:, 2] > 0, :2] *= 1e-9
    yield "a tip of needles", (slim, cone.faces)
    for sides in (100, 2000):
        angle = 2 * np.pi * np.arange(sides) / sides
        rim = np.column_stack([10 * np.cos(angle), 10 * np.sin(angle), np.zeros(sides)])
        i = np.arange(sides)
        j = (i + 1) % sides
        yield (
            f"{sides} needles in two fans",
            (
                np.vstack([rim, [[0, 0, 10], [0, 0, -10]]]),
                np.vstack(
                    [np.column_stack([i, j, np.full(sides, sides)]), np.column_stack([j, i, np.full(sides, sides + 1)])]
                ),
            ),
        )
    for inner in (0.5, 0.99, 0.999999, 1.0 - 1e-12, 0.01, 1e-6):
        yield f"a ball of {inner:.7g} within", together((p, f), (inner * p, f))
        yield f"a cavity of {inner:.7g} within", together((p, f), (inner * p, f[:, ::-1]))
    yield "five nested balls", together(*((s * p, f) for s in (1.0, 0.8, 0.6, 0.4, 0.2)))
    yield (
        "five nested balls, every other one inside out",
        together(*((s * p, f if i % 2 == 0 else f[:, ::-1]) for i, s in enumerate((1.0, 0.8, 0.6, 0.4, 0.2)))),
    )
    yield "a ball within that touches", together((p, f), (0.5 * p + 0.5 * p[0], f))
    yield "a cube within that touches a side", together(arrays_of(cube), (0.5 * cube.points + [3.5, 0, 0], cube.faces))
    octahedron = (
        np.vstack([np.eye(3), -np.eye(3)]),
        np.array([[0, 1, 2], [1, 3, 2], [3, 4, 2], [4, 0, 2], [1, 0, 5], [3, 1, 5], [4, 3, 5], [0, 4, 5]]),
    )
    places = 5.0 * np.stack(np.meshgrid(*[np.arange(4)] * 3), axis=-1).reshape(-1, 3)
    yield "64 bodies", together(*((octahedron[0] + at, octahedron[1]) for at in places))
    yield (
        "a ball and 30 crumbs",
        together((p, f), *((1e-3 * octahedron[0] + 3.0 * p[i], octahedron[1]) for i in range(30))),
    )
    yield "a sheet", _sheet()
    yield "a sheet with two sides", (_sheet()[0], np.vstack([_sheet()[1], _sheet()[1][:, ::-1]]))
    for thickness in (0.0, 1e-12, 1e-9, 1e-6, 1e-3, 0.1, -0.1, -1.0):
        yield f"a layer {thickness:g} thick", _layer(thickness)
    yield "a strip twisted once", grid(4, 60, _moebius, twist=True)
    yield "a strip torn where it is twisted", grid(4, 60, _moebius)
    yield "a pipe without ends", grid(10, 24, _pipe)
    yield "a Klein bottle", _klein()
    projective = np.array(
        [[0, 1, 4], [0, 4, 3], [0, 3, 5], [0, 5, 2], [0, 2, 1], [1, 2, 3], [1, 3, 5], [1, 5, 4], [2, 5, 4], [2, 4, 3]]
    )
    yield "a projective plane", (10.0 * random.normal(size=(6, 3)), projective)
    corners = 10.0 * np.array([[1.0, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]])
    four = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]])
    yield "a tetrahedron", (corners, four)
    yield "a tetrahedron inside out", (corners, four[:, ::-1])
    for flat in (1e-1, 1e-3, 1e-6, 1e-9, 1e-15, 0.0):
        yield f"a tetrahedron {flat:g} flat", (corners * [1.0, 1.0, flat], four)
    for left in (1, 2, 3):
        yield f"a tetrahedron of {left} triangles", (corners, four[:left])
    yield "an octahedron", (10.0 * octahedron[0], octahedron[1])
    ring = np.array([[np.cos(t), np.sin(t), 0.0] for t in 2 * np.pi * np.arange(5) / 5])
    ten = np.vstack([[[i, (i + 1) % 5, 5], [(i + 1) % 5, i, 6]] for i in range(5)])
    yield "ten triangles", (10.0 * np.vstack([ring, [[0, 0, 1], [0, 0, -1]]]), ten)
    for bad in (np.nan, np.inf, -np.inf, 1e308, 1e200, 1e39):
        one = p.copy()
        one[7, 1] = bad
        yield f"one coordinate {bad:g}", (one, f)
        yield f"all coordinates {bad:g}", (np.full_like(p, bad), f)
    yield "a vertex of nothing that is nan", (np.vstack([p, [[np.nan] * 3]]), f)
    yield "all at one place", (np.full_like(p, 3.0), f)
    yield "all on a line", (p * [0.0, 0.0, 1.0], f)
    yield "all on a plane", (p * [1.0, 1.0, 0.0], f)
    for index in (len(p), 2**31, 2**40, -1, -(2**40)):
        names = f.copy()
        names[5, 1] = index
        yield f"a vertex of number {index}", (p, names)


def placed() -> Iterator[Malformed]:
    """Balls far from the origin and of odd lengths, in a format that keeps every digit and one that does not."""
    ball = sphere(10.0, subdivisions=2)
    for exponent in range(3, 19, 3):
        points = ball.points + 10.0**exponent * np.array([1.0, -1.0, 0.5])
        yield Malformed(f"a ball 1e{exponent} away, all digits", "off", off(points, ball.faces))
        yield Malformed(f"a ball 1e{exponent} away, seven digits", "stl", stl(points, ball.faces))
    for exponent in (-300, -40, -35, -20, -9, -6, 6, 9, 20, 35, 40, 150, 300):
        points = ball.points * 10.0**exponent
        size = 20.0 * 10.0**exponent
        yield Malformed(f"a ball of 1e{exponent}, all digits", "off", off(points, ball.faces), size)
        yield Malformed(f"a ball of 1e{exponent}, seven digits", "stl", stl(points, ball.faces), size)
    for size in (2e-5, 2e-2, 2e4, 2e8):
        yield Malformed(f"a ball in a unit {20 / size:g} off", "stl", exported(ball, "stl"), size)


def files(seed: int = 0) -> Iterator[Malformed]:
    """Files that are cut short, full of nonsense, wrongly named, or that lie about what they hold."""
    random = np.random.default_rng((7, seed))
    ball = sphere(10.0, subdivisions=2)
    p, f = arrays_of(ball)
    kinds = ("stl", "obj", "ply", "off", "glb", "3mf")
    right = {kind: exported(ball, kind) for kind in kinds}
    right["gltf"] = json.dumps({"asset": {"version": "2.0"}, "scenes": [], "nodes": [], "meshes": []}).encode()
    text = exported(ball, "stl_ascii")
    for kind, content in right.items():
        for share in (0.001, 0.02, 0.3, 0.6, 0.9, 0.999):
            yield Malformed(f"{kind} cut at {share:.1%}", kind, content[: max(1, int(share * len(content)))])
        yield Malformed(f"{kind} of nothing", kind, b"")
        yield Malformed(f"{kind} of blanks", kind, b" \n" * 50)
        yield Malformed(f"{kind} of noughts", kind, bytes(3000))
        yield Malformed(f"{kind} of noise", kind, random.bytes(5000))
        head = content[: min(len(content), 120)]
        yield Malformed(f"{kind} of noise with its head", kind, head + random.bytes(5000))
        for damage in (1, 20, 400):
            spoilt = bytearray(content)
            for at in random.integers(0, len(spoilt), damage):
                spoilt[at] = random.integers(0, 256)
            yield Malformed(f"{kind} with {damage} wrong bytes", kind, bytes(spoilt))
        for other in kinds:
            if other != kind:
                yield Malformed(f"{kind} that is {other}", kind, right[other])
    texts = {"stl": text, "obj": right["obj"], "off": right["off"], "ply": _ply(ball)}
    for kind, content in texts.items():
        yield Malformed(f"{kind} in capitals", kind, content.upper())
        yield Malformed(f"{kind} in lower case", kind, content.lower())
        for coding in ("utf-16", "utf-16-le", "utf-16-be", "utf-32"):
            wide = content.decode().encode(coding)
            yield Malformed(f"{kind} in {coding}", kind, wide)
            yield Malformed(f"{kind} in {coding}, cut within a character", kind, wide[: len(wide) // 3 | 1])
            spoilt = bytearray(wide)
            for at in random.integers(0, len(spoilt), 20):
                spoilt[at] = random.integers(0, 256)
            yield Malformed(f"{kind} in {coding} with wrong bytes", kind, bytes(spoilt))
    for share in (0.1, 0.5, 0.95):
        yield Malformed(f"STL text cut at {share:.0%}", "stl", text[: int(share * len(text))])
    yield Malformed("STL text with commas", "stl", text.replace(b".", b","))
    yield Malformed("STL text of nan", "stl", text.replace(b"vertex ", b"vertex nan "))
    yield Malformed("STL text with a name in latin-1", "stl", b"solid pl\xe4tt" + text[text.index(b"\n") :])
    yield Malformed("a binary STL that begins with solid", "stl", b"solid".ljust(80) + right["stl"][80:])
    for claimed in (0, 1, len(f) - 1, len(f) + 1, 2**31, 2**32 - 1):
        yield Malformed(f"STL that claims {claimed} triangles", "stl", stl(p, f, claimed))
    yield Malformed("OBJ of points", "obj", b"".join(b"v %f %f %f\n" % tuple(x) for x in p))
    yield Malformed("OBJ of lines", "obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nl 1 2 3\n")
    yield Malformed("OBJ of nothing but triangles", "obj", b"f 1 2 3\nf 3 2 1\n")
    square = b"".join(b"v %d %d %d\n" % (x, y, z) for x in (0, 9) for y in (0, 9) for z in (0, 9))
    quads = b"f 1 2 4 3\nf 5 7 8 6\nf 1 5 6 2\nf 3 4 8 7\nf 1 3 7 5\nf 2 6 8 4\n"
    yield Malformed("OBJ of quads", "obj", square + quads, 15.0)
    yield Malformed(
        "OBJ that counts backwards",
        "obj",
        square + quads.translate(bytes.maketrans(b"", b"")).replace(b"f 1 2 4 3", b"f -8 -7 -5 -6"),
        15.0,
    )
    yield Malformed("OBJ that counts from nought", "obj", square + b"f 0 1 3\nf 4 6 7\n")
    yield Malformed("OBJ with a far number", "obj", square + quads + b"f 1 2 99\n")
    yield Malformed("OBJ with a huge number", "obj", square + quads + b"f 1 2 99999999999999999999999\n")
    yield Malformed("OBJ with texture and normals", "obj", square + b"f 1/1/1 2//1 4/3\n")
    yield Malformed("OBJ with a triangle of two", "obj", square + quads + b"f 1 2\n", 15.0)
    yield Malformed("OBJ with words for numbers", "obj", square.replace(b"9", b"nine") + quads)
    yield Malformed("OBJ of two coordinates", "obj", b"v 0 0\nv 1 0\nv 0 1\nf 1 2 3\n")
    yield Malformed("OBJ whose material is a device", "obj", b"mtllib /dev/zero\n" + right["obj"])
    yield Malformed("OBJ whose material is missing", "obj", b"mtllib none.mtl\nusemtl x\n" + right["obj"])
    yield Malformed("OBJ whose material is up there", "obj", b"mtllib ../../../../etc/passwd\n" + right["obj"])
    yield Malformed("OBJ in latin-1", "obj", b"# gr\xf6\xdfe\no pl\xe4tt\n" + right["obj"])
    yield Malformed("OBJ with a byte order mark", "obj", b"\xef\xbb\xbf" + right["obj"])
    yield Malformed("OBJ with carriage returns", "obj", right["obj"].replace(b"\n", b"\r"))
    yield Malformed("OBJ on one line", "obj", right["obj"].replace(b"\n", b" "))
    yield Malformed("OBJ of ten million blanks", "obj", b" " * 10_000_000)
    ply_head = "ply\nformat {} 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\nelement face {}\nproperty list {} int vertex_indices\nend_header\n"
    for form in ("ascii", "binary_little_endian", "binary_big_endian", "binary_middle_endian", ""):
        for vertices, faces in ((0, 0), (10**12, 0), (3, 10**12), (-1, 1), (10**30, 1), (3, 1)):
            content = ply_head.format(form, vertices, faces, "uchar").encode()
            body = b"0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n" if form == "ascii" else bytes(36) + b"\x03" + bytes(12)
            yield Malformed(f"PLY, {form or 'no form'}, of {vertices} vertices, {faces} faces", "ply", content + body)
    yield Malformed(
        "PLY of a long list",
        "ply",
        ply_head.format("binary_little_endian", 3, 1, "uint").encode() + bytes(36) + b"\xff" * 40,
    )
    yield Malformed(
        "PLY without an end to its head", "ply", ply_head.format("ascii", 3, 1, "uchar").encode()[:-11] + b"0 0 0\n" * 9
    )
    yield Malformed(
        "PLY of lists of floats",
        "ply",
        ply_head.format("ascii", 3, 1, "float").encode() + b"0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n",
    )
    yield Malformed("PLY of unknown properties", "ply", right["ply"].replace(b"float x", b"quark x", 1))
    yield Malformed(
        "PLY whose picture is a device",
        "ply",
        right["ply"].replace(b"element vertex", b"comment TextureFile /dev/zero\nelement vertex", 1),
    )
    for counts in (
        "0 0 0",
        "8 0 0",
        "0 12 0",
        "1000000000000 3 0",
        "3 1000000000000 0",
        "-1 -1 0",
        "x y z",
        "3",
        "3.5 1 0",
    ):
        yield Malformed(f"OFF of {counts}", "off", f"OFF\n{counts}\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n".encode())
    yield Malformed("OFF of polygons", "off", b"OFF\n5 1 0\n0 0 0\n4 0 0\n4 4 0\n2 1 0\n0 4 0\n5 0 1 2 3 4\n")
    yield Malformed("OFF of lines", "off", b"OFF\n2 1 0\n0 0 0\n4 0 0\n2 0 1\n")
    yield Malformed("OFF of points", "off", b"OFF\n2 2 0\n0 0 0\n4 0 0\n1 0\n1 1\n")
    yield Malformed("COFF with colours", "off", b"COFF\n3 1 0\n0 0 0 1 1 1 1\n4 0 0 1 1 1 1\n0 4 0 1 1 1 1\n3 0 1 2\n")
    yield Malformed("OFF with comments", "off", right["off"].replace(b"\n", b" # x\n", 5))
    yield Malformed("OFF with broken numbers", "off", right["off"].replace(b"0.", b"0,"))
    for uri in ("/dev/zero", "../../../../etc/passwd", "none.bin", "data:;base64,AAAA", "http://localhost:9/x", ""):
        data = {
            "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
            "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
            "accessors": [
                {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"},
                {"bufferView": 0, "componentType": 5123, "count": 3, "type": "SCALAR"},
            ],
            "bufferViews": [{"buffer": 0, "byteLength": 36}], "buffers": [{"byteLength": 36, "uri": uri}],
        }  # fmt: skip
        yield Malformed(f"GLTF whose data is in {uri!r}", "gltf", json.dumps(data).encode())
    cyclic = {"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"children": [0]}]}
    yield Malformed("GLTF whose node is its own child", "gltf", json.dumps(cyclic).encode())
    yield Malformed("GLTF of brackets", "gltf", b"[" * 100_000)
    yield Malformed("GLTF that is a list", "gltf", b"[1, 2]")
    yield Malformed("GLB of 4 GB", "glb", b"glTF\x02\x00\x00\x00\xff\xff\xff\xff\xff\xff\xff\x7fJSON{}")
    yield Malformed("GLB whose scene is nothing", "glb", b"glTF\x02\x00\x00\x00\x16\x00\x00\x00\x02\x00\x00\x00JSON{}")
    for kind in ("model", "entities", "brackets", "nothing", "much"):
        buffer = io.BytesIO()
        with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
            if kind == "model":
                archive.writestr("3D/3dmodel.model", "<model><resources/></model>")
            elif kind == "entities":
                laughs = "".join(f'<!ENTITY l{i + 1} "{f"&l{i};" * 10}">' for i in range(9))
                archive.writestr("3D/3dmodel.model", f'<!DOCTYPE m [<!ENTITY l0 "ha">{laughs}]><model>&l9;</model>')
            elif kind == "brackets":
                archive.writestr("3D/3dmodel.model", "<a>" * 100_000)
            elif kind == "much":
                archive.writestr("3D/3dmodel.model", b" " * 100_000_000)
        yield Malformed(f"3MF of {kind}", "3mf", buffer.getvalue())
    for kind in right:
        yield Malformed(f"10 MB of noise as {kind}", kind, random.bytes(10_000_000))
    yield Malformed("a picture as STL", "stl", b"\x89PNG\r\n\x1a\n" + random.bytes(500))
    for suffix in ("vtk", "vtu", "msh", "step", "x3d", "dae", "zip", "txt", "STL ", "", "stl.gz"):
        yield Malformed(f"an ending of {suffix!r}", suffix, right["stl"])


def _half_split(surface: Surface, count: int, random: np.random.Generator, stray: float) -> Arrays:
    """T-junctions: edges get a vertex that only one of their two triangles knows, somewhere along them."""
    points, faces = list(surface.points), surface.faces.tolist()
    for i in random.permutation(len(faces))[:count]:
        a, b, c = faces[i]
        along = random.uniform(0.05, 0.95)
        points.append((1.0 - along) * points[a] + along * points[b] + random.normal(scale=stray, size=3))
        new = len(points) - 1
        faces[i] = [a, new, c]
        faces.append([new, b, c])
    return np.array(points), np.array(faces)


def bulging(places: FloatArray) -> FloatArray:
    return np.asarray(10.0 * places / np.linalg.norm(places, axis=1, keepdims=True))


def flat(places: FloatArray) -> FloatArray:
    return 8.0 * places


def cube_of_quads(random: np.random.Generator, shape: Callable[[FloatArray], FloatArray], count: int = 5) -> Arrays:
    """A cube of quads, moved by `shape`, each cut along either of its diagonals."""
    i, j = (k.ravel() for k in np.meshgrid(*[np.linspace(-1.0, 1.0, count + 1)] * 2, indexing="ij"))
    square = np.column_stack([i, j, np.ones_like(i)])
    sides = [sign * np.roll(square, axis, axis=1) for axis in range(3) for sign in (1, -1)]
    corner = (np.arange(count)[:, None] * (count + 1) + np.arange(count)).ravel()
    a, b, c, d = corner, corner + count + 1, corner + count + 2, corner + 1
    parts = []
    for side in sides:
        cut = random.random(len(corner))[:, None] < 0.5
        first = np.where(cut, np.column_stack([a, b, c]), np.column_stack([a, b, d]))
        faces = np.vstack([first, np.where(cut, np.column_stack([a, c, d]), np.column_stack([b, c, d]))])
        points = shape(side)
        normals = np.cross(points[faces[:, 1]] - points[faces[:, 0]], points[faces[:, 2]] - points[faces[:, 0]])
        outward = np.einsum("ij,ij->i", normals, points[faces].mean(axis=1)) > 0
        parts.append((points, np.where(outward[:, None], faces, faces[:, ::-1])))
    return together(*parts)


def exports(seed: int = 0) -> Iterator[tuple[str, Arrays]]:
    """What CAD programs, scanners and modellers write: T-junctions, two sides, corners nearly at one place, specks."""
    random = np.random.default_rng((8, seed))
    ball, cube = sphere(10.0, subdivisions=2), box((14.0, 14.0, 14.0))
    p, f = arrays_of(ball)
    for surface, what in ((ball, "ball"), (cube, "cube")):
        for count in (1, 3, 10, 300):
            for stray in (0.0, 1e-6, 1e-4, 1e-2):
                arrays = _half_split(surface, count, random, stray)
                yield f"a {what} with {count} T-junctions, {stray:g} off", arrays
    for share in (0.02, 0.3, 0.9):
        double = f[random.random(len(f)) < share]
        yield f"{share:.0%} of a ball on both sides", (p, random.permutation(np.vstack([f, double[:, ::-1]])))
        yield (
            f"{share:.0%} of a ball left out on both sides",
            (p, np.vstack([f, f[:, ::-1]])[: int(2 * share * len(f))]),
        )
    stitched = _half_split(ball, 20, random, 0.0)
    yield "T-junctions on both sides", (stitched[0], np.vstack([stitched[1], stitched[1][:, ::-1]]))
    for shape in (bulging, flat):
        one, other = cube_of_quads(random, shape), cube_of_quads(random, shape)
        for stray in (0.0, 1e-9, 1e-6, 1e-4, 1e-2):
            moved = other[0] + random.normal(scale=stray, size=other[0].shape)
            yield f"{shape.__name__} sides of other diagonals, {stray:g} off", together(one, (moved, other[1][:, ::-1]))
        for share in (0.02, 0.5, 0.98):
            some = other[1][random.random(len(other[1])) < share]
            yield f"{share:.0%} of {shape.__name__} sides on other diagonals", (one[0], np.vstack([one[1], some]))
        turned = np.where(random.random(len(other[1]))[:, None] < 0.5, other[1], other[1][:, ::-1])
        yield f"{shape.__name__} sides of other diagonals, in any winding", together(one, (other[0], turned))
    soup = p[f].reshape(-1, 3)
    for gap in (0.2e-7, 0.5e-7, 1e-7, 2e-7, 1e-6, 1e-5):
        apart = soup + random.choice([0.0, gap * 34.6], size=soup.shape)
        yield f"corners {gap:g} of the size apart", (apart, np.arange(len(soup)).reshape(-1, 3))
    # Cubes have the fewest triangles of the shapes that are as large as a ball of radius 1.
    crumb = box((2.0, 2.0, 2.0))
    for size in (1e-6, 1e-3, 0.05, 0.2, 0.5, 1.0):
        for count in (1, 30, 1200):
            at = random.normal(scale=20.0, size=(count, 3))
            crumbs = [(size * crumb.points + place, crumb.faces) for place in at]
            yield f"{count} specks of {size:g}", together((p, f), *crumbs)
        open_ones = [(size * crumb.points + place, crumb.faces[3:]) for place in random.normal(scale=20.0, size=(9, 3))]
        yield f"9 open specks of {size:g}", together((p, f), *open_ones)


# Bodies with holes, which are also read with all of them closed.
OPEN = (
    "ball without",
    "ball open",
    "cube without",
    "a sheet",
    "a strip",
    "a pipe",
    "five fins",
    "a layer 0.1",
    "9 open",
)


def surfaces(seed: int = 0) -> Iterator[Malformed]:
    """All of them; what is random in them depends on the seed."""
    for name, (points, faces) in (*bodies(seed), *exports(seed)):
        yield Malformed(name, "off", off(points, faces))
        if name.startswith(OPEN):
            yield Malformed(f"{name}, holes closed", "off", off(points, faces), holes="close")
    yield from placed()
    yield from files(seed)
