"""Second-order tetrahedra in files of Medit and SU2, which meshio does not read, as linear ones by their corners."""

import re
from collections.abc import Callable

# Columns of the rows of Medit's second-order elements: nodes and a label. Corners come first.
MEDIT_SECTIONS = {b"EdgesP2": 4, b"TrianglesP2": 7, b"TetrahedraP2": 11}
# VTK's numbers of second-order and linear elements, as SU2 has them, and their corners.
SU2_KINDS = {b"21": (b"3", 2), b"22": (b"5", 3), b"24": (b"10", 4)}


def straighten(data: bytes, suffix: str) -> tuple[bytes, int]:
    """The text of a file with linear elements in place of second-order ones, and the number of these tetrahedra.

    Raises
    ------
    ValueError
        If a section is cut short.
    """
    readers: dict[str, Callable[[bytes], tuple[bytes, int]]] = {".mesh": _medit, ".su2": _su2}
    return readers[suffix](data) if suffix in readers else (data, 0)


def _medit(data: bytes) -> tuple[bytes, int]:
    count = 0
    for name, columns in MEDIT_SECTIONS.items():
        while found := re.search(rb"(?m)^[ \t]*" + name + rb"\s+(\d+)\s", data):
            rows = int(found[1])
            words = data[found.end() :].split(None, columns * rows)
            if len(words) < columns * rows:
                raise ValueError(f"section {name.decode()} is cut short")
            rest = words[columns * rows] if len(words) > columns * rows else b""
            linear = b""
            if name == b"TetrahedraP2":
                count += rows
                each = [words[i : i + columns] for i in range(0, columns * rows, columns)]
                linear = b"Tetrahedra\n%d\n" % rows + b"".join(b" ".join([*row[:4], row[-1]]) + b"\n" for row in each)
            data = data[: found.start()] + linear + rest
    return data, count


def _su2(data: bytes) -> tuple[bytes, int]:
    lines, count = data.splitlines(), 0
    for i, line in enumerate(lines):
        words = line.split()
        # Elements have integers only, and a coordinate has a point or an exponent.
        if len(words) > 4 and words[0] in SU2_KINDS and all(word.isdigit() for word in words):
            kind, corners = SU2_KINDS[words[0]]
            nodes = {b"3": 3, b"5": 6, b"10": 10}[kind]
            if len(words) > nodes:
                lines[i] = b" ".join([kind, *words[1 : 1 + corners], *words[1 + nodes :]])
                count += kind == b"10"
    return b"\n".join(lines) + b"\n", count
