"""Read gmsh files, versions 2.2 and 4.1, text and binary (Gmsh reference manual, section "Gmsh file formats").

Unlike meshio, this reads files in which only some entities have a physical group.
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from tetlux.meshing.arrays import FloatArray, IntArray
from tetlux.meshing.errors import InputError
from tetlux.meshing.files.gmsh_numbers import BinaryNumbers, TextNumbers
from tetlux.meshing.files.raw import RawMesh
from tetlux.meshing.notes import Note

Numbers = TextNumbers | BinaryNumbers
PHYSICAL, ENTITY = "gmsh:physical", "gmsh:geometrical"
# Element types by number: meshio's name and number of nodes. Corners come first in all of them.
_POINTS = {15: ("vertex", 1)}
_LINES = {kind: ("line", nodes) for kind, nodes in {1: 2, 8: 3, 26: 4, 27: 5, 28: 6}.items()}
_TRIANGLES = {
    kind: ("triangle", nodes) for kind, nodes in {2: 3, 9: 6, 20: 9, 21: 10, 22: 12, 23: 15, 24: 15, 25: 21}.items()
}
_QUADS = {kind: ("quad", nodes) for kind, nodes in {3: 4, 10: 9, 16: 8, 36: 16, 37: 25}.items()}
_TETRAHEDRA = {kind: ("tetra", nodes) for kind, nodes in {4: 4, 11: 10, 29: 20, 30: 35, 31: 56}.items()}
_HEXAHEDRA = {kind: ("hexahedron", nodes) for kind, nodes in {5: 8, 12: 27, 17: 20, 92: 64, 93: 125}.items()}
_WEDGES = {kind: ("wedge", nodes) for kind, nodes in {6: 6, 13: 18, 18: 15, 90: 40, 91: 75}.items()}
_PYRAMIDS = {kind: ("pyramid", nodes) for kind, nodes in {7: 5, 14: 14, 19: 13, 118: 30}.items()}
_KINDS = {**_POINTS, **_LINES, **_TRIANGLES, **_QUADS, **_TETRAHEDRA, **_HEXAHEDRA, **_WEDGES, **_PYRAMIDS}
# Node numbers up to this many times the number of nodes use a lookup table, others bisection.
SPARSE = 20


def is_gmsh(path: Path) -> bool:
    """Whether a file begins like a gmsh file."""
    with path.open("rb") as file:
        return file.read(256).lstrip().startswith((b"$MeshFormat", b"$Comments", b"$NOD"))


def read_gmsh(path: Path) -> RawMesh:
    """Read a gmsh file.

    The array `PHYSICAL` has the physical groups; if there are none, the array `ENTITY` has the numbers of volumes.

    Raises
    ------
    InputError
        If it is of another version, or an element is of an unknown type.
    ValueError, IndexError, KeyError
        If it is damaged.
    """
    sections = _sections(path.read_bytes())
    if "MeshFormat" not in sections:
        raise InputError("it is of gmsh's version 1; save it as version 4.1 or 2.2.")
    head = sections["MeshFormat"].split(maxsplit=3)
    version, binary = head[0].decode(), int(head[1]) == 1
    if version not in ("2", "2.0", "2.1", "2.2", "4.1"):
        raise InputError(f"it is of gmsh's version {version}; save it as version 4.1 or 2.2.")
    big = binary and head[3][:4] == b"\0\0\0\1"
    words = BinaryNumbers(big) if binary else TextNumbers()
    modern = version == "4.1"
    groups = _entity_groups(words, sections.get("Entities")) if modern else {}
    tags, points = (_nodes_4 if modern else _nodes_2)(words, sections["Nodes"])
    found = _elements_4(words, sections["Elements"], groups) if modern else _elements_2(words, sections["Elements"])
    elements = _in_order(found)
    find = _numbering(tags)
    blocks = [(block.kind, find(block.nodes)) for block in elements]
    physical = [block.physical for block in elements]
    names = _names(sections.get("PhysicalNames", b""))
    several = sum(len(found) > 1 for (dimension, _), found in groups.items() if dimension == 3)
    notes: tuple[str, ...] = ()
    if several:
        which = "a volume is" if several == 1 else f"{several} volumes are"
        sentence = f"{which} in several physical groups; the smallest group is the label."
        notes = (Note("labels-overlap", sentence, value=several),)
    solid = [i for i, block in enumerate(elements) if block.kind == "tetra"]
    grouped = any(physical[i].any() for i in solid)
    arrays = {PHYSICAL: physical} if grouped else {ENTITY: [block.entity for block in elements]}
    return RawMesh(points, blocks, arrays, {PHYSICAL: names}, notes)


def _sections(content: bytes) -> dict[str, bytes]:
    """The text between ``$Name`` and ``$EndName``, of the first section of each name."""
    found: dict[str, bytes] = {}
    place = 0
    while (start := content.find(b"$", place)) >= 0:
        line = content.find(b"\n", start)
        if line < 0:
            break
        name = content[start + 1 : line].strip().decode("ascii", "replace")
        end = content.find(b"$End" + name.encode(), line)
        if end < 0:
            raise ValueError(f"section {name} has no end")
        found.setdefault(name, content[line + 1 : end])
        place = end + 4 + len(name)
    return found


def _names(section: bytes) -> dict[int, str]:
    """Names of the physical groups of volumes."""
    found = {}
    for line in section.decode("utf-8", "replace").splitlines()[1:]:
        dimension, number, name = line.split(maxsplit=2)
        if int(dimension) == 3:
            found[int(number)] = name.strip().strip('"')
    return found


@dataclass(frozen=True, eq=False)
class _Elements:
    """Elements of one kind: their number, entity and physical group (m,), and nodes (m, k)."""

    columns: ClassVar = ("number", "entity", "physical", "nodes")

    kind: str
    number: IntArray
    entity: IntArray
    physical: IntArray
    nodes: IntArray


def _count(words: Numbers) -> int:
    """The number of entries at the start of a section of version 2."""
    return words.line() if isinstance(words, BinaryNumbers) else int(words.take(1, "i")[0])


def _entity_groups(words: Numbers, section: bytes | None) -> dict[tuple[int, int], list[int]]:
    """Physical groups of each entity, by its dimension and number."""
    found: dict[tuple[int, int], list[int]] = {}
    if section is None:
        return found
    words.start(section)
    for dimension, count in enumerate(words.take(4, "u").tolist()):
        for _ in range(count):
            number = int(words.take(1, "i")[0])
            words.take(3 if dimension == 0 else 6, "d")
            # A group is negative if it contains the entity with reversed orientation.
            found[dimension, number] = np.abs(words.take(int(words.take(1, "u")[0]), "i")).tolist()
            if dimension > 0:
                words.take(int(words.take(1, "u")[0]), "i")
    return found


def _nodes_4(words: Numbers, section: bytes) -> tuple[IntArray, FloatArray]:
    words.start(section)
    tags: list[IntArray] = []
    points: list[FloatArray] = []
    for _ in range(int(words.take(4, "u")[0])):
        dimension, _, parametric = words.take(3, "i").tolist()
        count = int(words.take(1, "u")[0])
        tags.append(words.take(count, "u"))
        width = 3 + (dimension if parametric else 0)
        points.append(words.take(width * count, "d").reshape(count, width)[:, :3])
    return np.concatenate(tags), np.vstack(points)


def _elements_4(words: Numbers, section: bytes, groups: dict[tuple[int, int], list[int]]) -> list[_Elements]:
    words.start(section)
    blocks = []
    sizes: Counter[tuple[int, int]] = Counter()
    for _ in range(int(words.take(4, "u")[0])):
        dimension, entity, kind = words.take(3, "i").tolist()
        count = int(words.take(1, "u")[0])
        name, nodes = _kind(kind)
        rows = words.take((1 + nodes) * count, "u").reshape(count, 1 + nodes)
        blocks.append((dimension, entity, name, rows))
        sizes.update({(dimension, group): count for group in groups.get((dimension, entity), [])})
    found = []
    for dimension, entity, name, rows in blocks:
        # Of overlapping groups, such as a whole and its part, the part is more specific.
        of_entity = groups.get((dimension, entity), [])
        _, group = min(((sizes[dimension, each], each) for each in of_entity), default=(0, 0))
        count = len(rows)
        found.append(_Elements(name, rows[:, 0], np.full(count, entity), np.full(count, group), rows[:, 1:]))
    return found


def _in_order(blocks: list[_Elements]) -> list[_Elements]:
    """The elements of each kind in one block, in the order of their numbers."""
    kinds: dict[tuple[str, int], list[_Elements]] = {}
    for block in blocks:
        kinds.setdefault((block.kind, block.nodes.shape[1]), []).append(block)
    found = []
    for (kind, _), same in kinds.items():
        columns = [np.concatenate([getattr(each, name) for each in same]) for name in _Elements.columns]
        order = np.argsort(columns[0], kind="stable")
        found.append(_Elements(kind, *(column[order] for column in columns)))
    return found


def _nodes_2(words: Numbers, section: bytes) -> tuple[IntArray, FloatArray]:
    words.start(section)
    count = _count(words)
    if isinstance(words, TextNumbers):
        table = words.take(4 * count, "d").reshape(count, 4)
        return table[:, 0].astype(np.int64), np.ascontiguousarray(table[:, 1:])
    return words.numbered_points(count)


def _elements_2(words: Numbers, section: bytes) -> list[_Elements]:
    """Elements of version 2: each has a header in text, several share one in binary."""
    words.start(section)
    count = _count(words)
    flat = words.rest
    numbers: Sequence[int] = flat.tolist()
    binary = isinstance(words, BinaryNumbers)
    places: dict[tuple[int, int], list[int]] = {}
    place, done = 0, 0
    while done < count:
        if binary:
            kind, follow, tags = numbers[place : place + 3]
            place += 3
        else:
            (kind, tags), follow = numbers[place + 1 : place + 3], 1
            place += 3
        width = tags + _kind(kind)[1] + (1 if binary else 0)
        if follow < 1 or tags < 0 or place + width * follow > len(numbers):
            raise ValueError("a block of no elements, or of more than there are")
        # Position of the first tag.
        first = place + (1 if binary else 0)
        places.setdefault((kind, tags), []).extend(range(first, first + width * follow, width))
        place += width * follow
        done += follow
    found = []
    for (kind, tags), starts in places.items():
        name, nodes = _kind(kind)
        begin = np.array(starts)
        rows = flat[begin[:, None] + np.arange(tags + nodes)]
        none = np.zeros(len(rows), dtype=np.int64)
        physical, entity = (rows[:, i] if tags > i else none for i in (0, 1))
        number = flat[begin - (1 if binary else 3)]
        found.append(_Elements(name, number, entity, np.abs(physical), rows[:, tags:]))
    return found


def _kind(number: int) -> tuple[str, int]:
    if number not in _KINDS:
        raise InputError(
            f"it holds elements of gmsh's type {number}, which is not read; mesh the body with tetrahedra."
        )
    return _KINDS[number]


def _numbering(tags: IntArray) -> Any:
    """A function from node numbers to indices, -1 for numbers that do not exist."""
    if tags.min(initial=0) < 0:
        raise ValueError("a negative number of a node")
    most = int(tags.max(initial=0))
    if most > SPARSE * len(tags) + 1000:
        order = np.argsort(tags)

        def search(nodes: IntArray) -> IntArray:
            places = order[np.searchsorted(tags, nodes, sorter=order).clip(max=len(order) - 1)]
            return np.where(tags[places] == nodes, places, -1)

        return search
    table = np.full(most + 2, -1)
    table[tags] = np.arange(len(tags))
    return lambda nodes: table[np.where((nodes < 0) | (nodes > most), most + 1, nodes)]
