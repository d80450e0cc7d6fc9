"""Malformed case files: right ones mutated by hypothesis, random text and bytes, and traps made by hand."""

import copy
import datetime
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from hypothesis import strategies as st
from PIL import Image

from tests.meshes_made import cube_of_cubes
from tetlux.meshing import TetMesh, box
from tetlux.meshing.files.meshes import write_mesh

QUICK = getattr(yaml, "CSafeDumper", yaml.SafeDumper)
RIGHT = [
    yaml.safe_load(text)
    for text in (
        """
name: plate
unit: cm
surface: {slab: {width: 6, depth: 1}}
medium: {sigma_a: 0.1, sigma_s_prime: 10.0, eta: 1.4}
lights:
  - pencil: {origin: [0, 0, 2], direction: [0, 0, -1], power: 0.5}
  - point: {position: [0, 0, -0.5]}
tolerance: 0.05
outputs: [surface]
compare: [robin, images]
sweep: {medium.sigma_a: [0.1, 0.2], lights.0.pencil.power: [1, 2]}
""",
        """
surface: {file: cube.stl, scale: 1.0, crease_angle: 0}
medium: {sigma_a: 0.01, sigma_s: 10.0, g: [0.9, 0.8, 0.7], eta: 1.4, boundary: classic}
channels: [red, green, blue]
regions:
  - name: core
    surface: {box: {size: [2, 2, 2], center: [0, 0, 0]}}
    medium: {sigma_a: [0.1, 0.1, 0.2], sigma_s_prime: 1.0, eta: 1.4}
lights:
  - name: sun
    collimated: {direction: [0, 0, -1], irradiance: [1.0, 0.9, 0.0]}
  - collimated: {direction: [1, 0, 0], power: 2.0, spot: {gaussian: {center: [-9, 0, 0], radius: 1}}}
  - collimated: {direction: [0, 0, -1], irradiance: 1, spot: {image: {file: spot.png, center: [0, 0, 9], width: 5}}}
  - diffuse: {irradiance: 1.0}
  - emission: {density: 0.1, region: core}
  - environment: {file: spot.png, brightest: 1.0}
detectors:
  - {name: here, point: [0, 0, 5]}
  - {name: there, disc: {center: [5, 0, 0], radius: 1}}
  - {name: fibre, fibre: {center: [0, 5, 0], radius: 0.5, numerical_aperture: 0.4}}
tolerance: {exitance: 0.05, detectors: 0.02}
camera: {position: [0, 0, 50]}
outputs: [surface, volume, picture]
sweep: {tolerance.detectors: [0.02, 0.01], zip: {detectors.0.point.0: [0, 1], up: [[0, 0, 1], [0, 1, 0]]}}
""",
        """
surface: {box: {size: [10, 10, 10]}}
medium: {material: marble}
lights: [{collimated: {direction: [0, 1, -1], irradiance: 1, spot: {rectangle: {center: [0, 0, 0], width: 2, height: 1}}}}]
""",
        """
surface: {box: {size: [10, 10, 10]}}
medium:
  sigma_a: {array: {file: values.npy, origin: [-6, -6, -6], spacing: 4}}
  sigma_s_prime: {volume: {file: values.vtu, name: coefficient, scale: 1}}
  eta: 1
lights: [{diffuse: {irradiance: 1}}]
""",
        """
surface: {box: {size: [10, 10, 10]}}
medium:
  sigma_a: {images: {files: spot.png, origin: [-5, -5, 0], spacing: [1, 1, 20], values: [0.01, 0.1]}}
  sigma_s: 10
  phase: {two_term: {g1: 0.9, g2: -0.3, share: 0.9}}
  eta: 1.33
lights: [{pencil: {origin: [0, 0, 20], direction: [0, 0, -1], radius: 1.0, deposit: line}}]
detectors: [{name: here, disc: {center: [0, 0, 5], radius: 1}}]
tolerance: {detectors: 0.02}
up: [0, 1, 0]
sweep:
  medium.eta: {start: 1.2, stop: 1.4, num: 2, scale: log}
  sample: {method: random, size: 2, seed: 1, medium.sigma_s: {start: 9, stop: 11}, up: [[0, 0, 1], [0, 1, 0]]}
""",
        """
mesh:
  file: head.msh
  scale: 1.0
  labels:
    1: {sigma_a: [0.1, 0.2], sigma_s_prime: 1, eta: 1.4}
    bone: {sigma_a: 0.1, sigma_s: 10, g: 0.9, eta: 1.4}
lights: [{point: {position: [5.1, 5.2, 5.3]}}, {emission: {density: 1, region: bone}}]
tolerance: 0.9
sweep: {mesh.labels.bone.sigma_a: [0.1, 0.2], mesh.labels.1.eta: [1.4]}
""",
        """
surface: {box: {size: [10, 10, 10]}}
medium:
  - {sigma_a: 0.1, sigma_s_prime: 1, eta: 1.4}
  - {sigma_a: 0.1, sigma_s: 2, eta: 1.4, phase: {table: {angles: [0, 90, 180], values: [3, 1, 1]}}}
lights: [{point: {position: [0, 0, 0], power: [1, 2]}}]
""",
    )
]
# What stands in place of a right value.
WRONG: list[Any] = [
    *(None, True, False, 0, -1, 1, 2, 3, 0.5, -0.5, 1e-320, 1e-30, 1e30, 1e200, 1e308, 2**63, 2**64, 10**30, 10**400),
    *(float("nan"), float("inf"), -float("inf"), "", " ", "nan", "1", "-1e400", "true", "all", "body", "red", "."),
    *("..", "../..", "../../etc/passwd", "/dev/zero", "/dev/null", "/dev/stdin", "~", "cube.stl", "spot.png", "a/b"),
    *(
        "values.npy",
        "values.vtu",
        "head.msh",
        "x" * 300,
        "é",
        "漢字",
        "\u202e",
        "a\nb",
        "a\x00b",
        "\ud83d\ude00".encode("utf-16", "surrogatepass").decode("utf-16"),
    ),
    *([], {}, [[]], [None], [1], [1, 2], [1, 2, 3], [0, 0, 0], [1, 2, 3, 4], ["a"], [[1, 2], [3, 4]], {"a": 1}),
    *({"": ""}, {1: 2}, {None: None}, [{}], {"file": None}, b"\x00\xff", datetime.date(2001, 1, 1), {1, 2}),
    *(datetime.datetime(2001, 1, 1, 1, 1, 1), list(range(100)), [float("nan")] * 3, [1e200] * 3, [10**400] * 3),
]
NUMBERS = [
    *(0, -1, 1, 2, 0.5, 1e-320, 1e-200, 1e-30, 1e-9, 1e-3, 1e3, 1e9, 1e20, 1e30, 1e38, 1e160, 1e300, 1.7e308, 10**400),
    *(float("nan"), float("inf"), -float("inf"), -1e300, 5.0, -5.0, 10.0, 1.0000001, 0.9999999, 180, 2**31, 2**63),
]
KEYS: list[Any] = [
    *(
        "",
        "x",
        "Name",
        "surfaces",
        "sphere",
        "file",
        "scale",
        "radius",
        "power",
        "spot",
        "sweep",
        "material",
        "images",
        "base",
        "zip",
        "sample",
    ),
    *("exitance", "detectors", "tolerance", "model", "holes", "up", "mesh", "labels"),
    *("volume", "array", "phase", "g", "sigma_s", "eta", "region", 1, None, True, 1.5, "?one", "?list", "<<", "=", "é"),
    *("a.b", "__class__", "model_config", "kinds", "a\nb", "x" * 300),
]
SWEPT = [
    *("medium.sigma_a", "lights.0.pencil.power", "lights.²", "lights.-1.name", "lights.99", "lights", "name", "sweep"),
    *("", ".", "..", "surface.slab.width", "surface.file", "outputs.0", "unit", "medium.", "medium.sigma_a.x", "x/y"),
    *("tolerance.exitance", "tolerance.detectors", "tolerance.everywhere", "model", "mesh.labels.1", "up.0"),
    *("zip", "sample", "base", "surface", "medium", "camera.azimuth", "surface.box.center.0", "lights[0].pencil.power"),
    *("lights.0", "lights." + "9" * 30, "regions.0.name", "channels.0", "lights.٣", "medium.material", "name.x"),
]


def words(longest: int) -> st.SearchStrategy[str]:
    """Any text of UTF-8. Asked for by the name of that code, it takes hypothesis two seconds to list the characters."""
    return st.text(st.characters(exclude_categories=["Cs"]), max_size=longest)


scalars = st.one_of(st.none(), st.booleans(), st.integers(), st.floats(), words(8), st.dates(), st.binary(max_size=4))
anything = st.recursive(
    scalars,
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(words(6) | st.integers(), inner, max_size=4),
    max_leaves=8,
)
wrong_values = st.one_of(st.sampled_from(WRONG), st.sampled_from(WRONG), anything)
SCRAPS = [
    *(
        "\t",
        "\x00",
        "\ufeff",
        "&a ",
        "*a",
        "!!python/object/apply:os.system ['true'] ",
        "---\n",
        "...\n",
        "%YAML 9.9\n",
    ),
    *("<<: *x\n", "!!binary x", "!!set ", "!!omap ", "!!timestamp 1 ", "? ", ": ", "- ", "{", "}", "[", "]", "#", "'"),
    *('"', "|", ">", "\r", "\x85", "\u2028", "`", "@", "0x", "1e", "!!int x ", "!!float y ", "!!null 3 ", "!x ", "= "),
]


def _places(data: Any, key: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    items = data.items() if isinstance(data, dict) else enumerate(data) if isinstance(data, list) else ()
    for part, value in items:
        yield (*key, part)
        yield from _places(value, (*key, part))


def _mutate(draw: st.DrawFn, data: dict[Any, Any]) -> None:
    """One change somewhere in the data of a case."""
    places = list(_places(data))
    if not places:
        return
    *path, last = draw(st.sampled_from(places))
    holder: Any = data
    for part in path:
        holder = holder[part]
    kind = draw(st.integers(0, 9))
    number = isinstance(holder[last], int | float)
    if kind <= 3 and number:
        holder[last] = draw(st.sampled_from(NUMBERS) | st.floats() | st.integers())
    elif kind <= 4:
        holder[last] = copy.deepcopy(draw(wrong_values))
    elif kind == 5:
        del holder[last]
    elif kind == 6 and isinstance(holder, dict):
        holder[draw(st.sampled_from(KEYS))] = holder.pop(last)
    elif kind == 7 and isinstance(holder, dict):
        holder[draw(st.sampled_from(KEYS))] = copy.deepcopy(draw(wrong_values))
    elif kind == 8:
        data["sweep"] = _sweep(draw)
    else:
        holder[last] = [holder[last]] * draw(st.integers(1, 4))


def _sweep(draw: st.DrawFn) -> dict[str, Any]:
    """A sweep of a list, a range, zipped lists or a sample, most of them wrong."""
    key, values = draw(st.sampled_from(SWEPT)), copy.deepcopy(draw(st.lists(wrong_values, max_size=3)))
    number = st.sampled_from(NUMBERS)
    ends = {"start": draw(number), "stop": draw(number), "scale": draw(st.sampled_from(["log", "linear"]))}
    kind = draw(st.integers(0, 5))
    if kind == 0:
        return {key: {**ends, "num": draw(st.sampled_from([0, 1, 2, 3, -1, 1e3, 10**6, None]))}}
    if kind == 1:
        return {"zip": {key: values, "medium.eta": [1.3, 1.4]}}
    if kind == 2:
        return {"sample": {"size": draw(st.sampled_from([0, 1, 3, 2.5, -1, None])), "seed": 1, key: ends}}
    return {key: values}


@st.composite
def case_files(draw: st.DrawFn) -> bytes:
    """The bytes of a case file that is wrong, or might be."""
    kind = draw(st.integers(0, 19))
    if kind == 0:
        return draw(st.binary(max_size=200))
    if kind == 1:
        return yaml.dump(draw(anything), Dumper=QUICK, allow_unicode=True).encode("utf-8", "replace")
    data = copy.deepcopy(draw(st.sampled_from(RIGHT)))
    for _ in range(draw(st.integers(1, 3))):
        _mutate(draw, data)
    flow = draw(st.sampled_from([None, False]))
    text = yaml.dump(data, Dumper=QUICK, allow_unicode=True, sort_keys=False, default_flow_style=flow)
    if kind < 8:
        lines = text.splitlines(keepends=True)
        change, at = draw(st.integers(0, 4)), draw(st.integers(0, len(text)))
        line = at % len(lines)
        if change == 0:
            text = text[:at]
        elif change == 1:
            text = text[:at] + draw(st.sampled_from(SCRAPS)) + text[at:]
        elif change == 2:
            text = "".join([*lines[:line], lines[line], *lines[line:]])
        elif change == 3:
            text = "".join([*lines[:line], *lines[line + 1 :]])
        else:
            text = "".join([*lines[:line], " ", *lines[line:]])
    coding = draw(st.sampled_from(["utf-8"] * 9 + ["utf-16", "latin-1", "utf-8-sig", "utf-32"]))
    return text.encode(coding, "replace")


def traps() -> Iterator[tuple[str, bytes]]:
    """Case files made by hand to break a reader, by what they are."""
    right = yaml.safe_dump(RIGHT[0]).encode()
    yield "nothing", b""
    yield "blank", b" \n\n\t\n"
    yield "comment", b"# a case\n"
    yield "scalar", b"42\n"
    yield "list", b"- 1\n- 2\n"
    yield "two documents", right + b"---\n" + right
    yield "a document and an end", right + b"...\n"
    yield "a second document of nothing", right + b"---\n"
    yield "a directive", b"%YAML 3.0\n---\n" + right
    yield "byte order mark", b"\xef\xbb\xbf" + right
    yield "nul bytes", right.replace(b"plate", b"pl\x00ate")
    yield "nul bytes only", b"\x00" * 1000
    yield "carriage returns", right.replace(b"\n", b"\r")
    for coding in ("utf-16", "utf-16-le", "utf-32", "cp037"):
        yield coding, right.decode().encode(coding)
    yield "latin-1", right.replace(b"plate", "plät".encode("latin-1"))
    for opened in (b"[", b"{a: ", b"- ", b"? ", b"!!seq [", b"a: [", b"{"):
        for count in (50, 300, 1000, 10_000, 100_000):
            yield f"{count} times {opened.decode()}", b"surface: " * (opened != b"- ") + opened * count
    yield "10,000 nested and closed", b"surface: " + b"[" * 10_000 + b"]" * 10_000
    yield "90 nested and closed", b"surface: " + b"[" * 90 + b"]" * 90
    yield "200 nested and closed", right + b"camera: " + b"[" * 200 + b"1" + b"]" * 200
    yield "200 nested mappings", right + b"camera: " + b"{position: " * 200 + b"1" + b"}" * 200
    yield "200 levels by indentation", b"".join(b" " * i + b"a:\n" for i in range(200))
    yield "10 MB of text", b"name: " + b"x" * 10_000_000
    yield "10 MB of keys", b"".join(b"k%d: 1\n" % i for i in range(1_000_000))
    yield "900 kB of text", b"name: " + b"x" * 900_000
    yield "900 kB of keys", b"".join(b"k%d: 1\n" % i for i in range(80_000))
    yield "900 kB of brackets", b"[]," * 300_000
    yield "900 kB of flow", b"surface: [" + b"{}," * 290_000 + b"]"
    yield "900 kB of anchors", b"".join(b"k%d: &a%d 1\n" % (i, i) for i in range(50_000))
    yield "900 kB of digits", b"tolerance: " + b"9" * 900_000
    yield "900 kB of spaces", right + b" " * 900_000
    yield "900 kB of quotes", b"name: '" + b"''" * 450_000
    yield "900 kB of key", b"? " + b"x" * 900_000 + b"\n: 1\n"
    laughs = b"a: &a [1,1,1,1,1,1,1,1,1]\n"
    for one, other in zip("abcdefgh", "bcdefghi", strict=True):
        laughs += f"{other}: &{other} [{','.join(['*' + one] * 9)}]\n".encode()
    yield "a billion laughs", laughs
    merges = b"a: &a {x: 1, y: 2}\n"
    for one, other in zip("abcdefghijklmnopqrst", "bcdefghijklmnopqrstu", strict=True):
        merges += f"{other}: &{other} {{<<: [{','.join(['*' + one] * 9)}]}}\n".encode()
    yield "a billion merges", merges
    yield "an anchor that holds itself", b"surface: &a {sphere: *a}\n"
    yield "a list that holds itself", b"lights: &a [*a]\n"
    yield "a merge that holds itself", b"surface: &a {<<: *a}\n"
    yield "an unknown alias", b"surface: *b\n"
    yield "a merge of a number", b"surface: {<<: 3}\n"
    yield "a merge of a list", b"surface: {<<: [3]}\n"
    yield "a merge that is right", right.replace(b"sweep:", b"x: &x {medium.eta: [1.4, 1.5]}\nsweep:\n  <<: *x")
    yield "a sweep by merge", b"camera: &x {medium.eta: [1.4]}\n" + right.replace(b"sweep:", b"sweep:\n  <<: *x")
    for tag in (
        *("!!python/object/apply:os.system ['touch pwned']", "!!python/name:os.system", "!!python/module:os", "!!x 3"),
        *("!!python/object/new:os.system [x]", "!include /etc/passwd", "!!binary '&&&'", "!!timestamp 9", "!!int x"),
        *("!!float x", "!!bool x", "!!null x", "!!set {a, b}", "!!omap [a: 1]", "!!pairs [a: 1]", "!!str 3", "!<x> 3"),
        *("2001-99-99", "2001-01-01", "2001-01-01 99:99:99", "2001-01-01T00:00:00+99:99", "0x10", "0o17", "0b2"),
        *(
            "0x" + "f" * 5000,
            "0x" + "f" * 400,
            "0b" + "1" * 20_000,
            "9" * 4000,
            "9" * 5000,
            "1:30:00",
            "1e400",
            "-1e400",
        ),
        *(
            "1:" * 5000 + "1",
            "yes",
            "off",
            "~",
            "=",
            "<<",
            "1_000",
            "0x_",
            "_1",
            "+.inf",
            ".NaN",
            "1e-400",
            "1.e+999999999999",
        ),
        *("'\\ud800'", '"\\ud800"', '"\\0"', '"\\u202e"', '"\\x07"', '"a\\nb"', '"\\U0010ffff"', '"\\e[31m"', "[a, b"),
    ):
        for key in (b"tolerance", b"name", b"unit", b"surface", b"camera", b"sweep"):
            kept = b"".join(part for part in right.splitlines(keepends=True) if not part.startswith(key))
            yield f"{key.decode()}: {tag[:40]}", kept + b"\n" + key + b": " + tag.encode() + b"\n"
    for named in (
        b"case.yaml",
        b"./case.yaml",
        b"../inputs/case.yaml",
        b"none.yaml",
        b".",
        b"/dev/zero",
        b"cube.stl",
        b"''",
        b"3",
    ):
        yield f"base {named.decode()}", b"base: " + named + b"\n" + right
    for odd in (
        *("{zip: {}}", "{zip: {medium.eta: [1.2, 1.4], medium.g: [1]}}", "{zip: 3}", "{zip: {zip: {medium.eta: [1]}}}"),
        *(
            "{sample: {size: 0}}",
            "{sample: {size: 1e3, medium.eta: {start: 1, stop: 2}}}",
            "{sample: [1]}",
            "{sample: {}}",
        ),
        *(
            "{sample: {size: 20001, medium.eta: {start: 1, stop: 2}}}",
            "{sample: {size: 2, medium.eta: {start: 1, stop: .inf}}}",
        ),
        *(
            "{medium.eta: {start: 1, stop: 2, num: 0}}",
            "{medium.eta: {start: 1, stop: 2, num: 20001}}",
            "{medium.eta: {}}",
        ),
        *(
            "{medium.eta: {start: -1, stop: 2, num: 3, scale: log}}",
            "{medium.eta: {start: -1.e+308, stop: 1.e+308, num: 3}}",
        ),
        *(
            "{medium.eta: {start: 1.e-320, stop: 1.e+308, num: 3, scale: log}}",
            "{medium: [{}]}",
            "{lights: [[]]}",
            "{lights: [1]}",
        ),
        *(
            "{medium.eta: [[1, 2], [1, 2]]}",
            "{surface: [{sphere: {radius: 1}}, {sphere: {radius: 1}}]}",
            "{sweep: [1]}",
        ),
    ):
        alone = yaml.safe_dump({key: value for key, value in RIGHT[0].items() if key not in ("sweep", "compare")})
        yield f"sweep {odd[:40]}", alone.encode() + b"sweep: " + odd.encode() + b"\n"
    for name in (
        *(
            "..",
            ".",
            "../up",
            "/tmp/x",
            "a/b",
            "a\\b",
            "~",
            "~root",
            "-rf",
            " x",
            "x ",
            "x.",
            "CON",
            "é" * 120,
            "漢" * 120,
        ),
        *(
            "a" * 120,
            "a" * 121,
            "$HOME",
            "`id`",
            "a;b",
            "a|b",
            "*",
            "?",
            "a:b",
            "%00",
            "%2e%2e",
            "😀",
            ".partial-x",
            "³",
        ),
    ):
        yield f"name {name[:20]}", yaml.safe_dump({**RIGHT[0], "name": name}, allow_unicode=True).encode()
        yield f"swept name {name[:20]}", yaml.safe_dump({**RIGHT[0], "sweep": {"name": [name, "b"]}}).encode()
        inner = yaml.safe_dump({**RIGHT[1], "sweep": {"surface.file": [name, "cube.stl"]}}).encode()
        yield f"swept file {name[:20]}", inner
        yield f"swept unit {name[:20]}", yaml.safe_dump({**RIGHT[0], "sweep": {"unit": [name, "cm"]}}).encode()
    many = {f"lights.0.pencil.origin.{i}": [0.123456789012345, 3.5] for i in range(2)}
    deep = {"medium.sigma_a": [0.1], "medium.sigma_s_prime": [10.000000000001], "medium.eta": [1.4000000001], **many}
    more = {"surface.slab.width": [6.0000000001], "surface.slab.depth": [1.000000000001], "tolerance": [0.050000001]}
    lengthy = {**RIGHT[0], "sweep": {**deep, **more, "lights.1.point.position.2": [-0.50000000001]}}
    lengthy.pop("compare")
    yield "a label of more than 255 characters", yaml.safe_dump(lengthy).encode()
    for file in (
        *("/dev/zero", "/dev/null", "/dev/random", "/dev/stdin", "/dev/tty", "/proc/self/mem", "/proc/self/environ"),
        *(
            "/",
            ".",
            "..",
            "../../../../etc/passwd",
            "file:///etc/passwd",
            "http://localhost/x.stl",
            "x" * 5000,
            "a\x00b",
        ),
        *("loop.stl", "zero.stl", "zero.png", "zero.npy", "zero.vtu", "pipe.stl", "pipe.png", "pipe.npy", "pipe.vtu"),
        *(
            "folder.stl",
            "folder.png",
            "folder",
            "none.stl",
            "cube.STL",
            "CUBE.stl",
            "cube.stl/",
            "cube.stl/x",
            "~/x.stl",
        ),
    ):
        for place in ("surface", "spot", "environment", "array", "volume", "images", "mesh"):
            data = copy.deepcopy(
                RIGHT[{"surface": 1, "spot": 1, "environment": 1, "images": 4, "mesh": 5}.get(place, 3)]
            )
            if place == "surface":
                data["surface"]["file"] = file
            elif place == "spot":
                data["lights"][2]["collimated"]["spot"]["image"]["file"] = file
            elif place == "environment":
                data["lights"][5]["environment"]["file"] = file
            elif place == "array":
                data["medium"]["sigma_a"]["array"]["file"] = file
            elif place == "mesh":
                data["mesh"]["file"] = file
            elif place == "volume":
                data["medium"]["sigma_s_prime"]["volume"]["file"] = file
            else:
                data["medium"]["sigma_a"]["images"]["files"] = file
            yield f"{place} in {file[:30]!r}", yaml.dump(data, Dumper=QUICK).encode()


def companions(folder: Path) -> None:
    """Write the files that the case files name, right ones and devices under their names."""
    import os  # noqa: PLC0415

    import trimesh  # noqa: PLC0415

    cube = box((10.0, 10.0, 10.0))
    trimesh.Trimesh(cube.points, cube.faces, process=False).export(folder / "cube.stl")
    shades = np.arange(144, dtype=np.uint8).reshape(12, 12)
    Image.fromarray(shades).save(folder / "spot.png")
    np.save(folder / "values.npy", np.full((4, 4, 4), 0.1))
    corners = np.array([[-50.0, -50, -50], [150, -50, -50], [-50, 150, -50], [-50, -50, 150]])
    mesh = TetMesh(corners, np.array([[0, 1, 2, 3]]))
    write_mesh(mesh, folder / "values.vtu", {"coefficient": np.full(4, 1.0)})
    points, tetrahedra, places = cube_of_cubes(3, 4.0)
    labels = np.where(places[:, 2] == 0, 1, 2)
    write_mesh(TetMesh(points, tetrahedra, regions=labels, labels={2: "bone"}), folder / "head.msh")
    (folder / "folder").mkdir()
    for suffix in ("stl", "png", "npy", "vtu", "msh"):
        (folder / f"zero.{suffix}").symlink_to("/dev/zero")
        os.mkfifo(folder / f"pipe.{suffix}")
    (folder / "loop.stl").symlink_to("loop.stl")
    for suffix in ("stl", "png"):
        (folder / f"folder.{suffix}").mkdir()
