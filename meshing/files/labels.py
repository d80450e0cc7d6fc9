"""Find the labels of tetrahedra among the cell values of a file."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from tetlux.meshing.arrays import BoolArray, IntArray
from tetlux.meshing.errors import InputError
from tetlux.meshing.files.gmsh import ENTITY, PHYSICAL
from tetlux.meshing.files.raw import RawMesh
from tetlux.meshing.notes import Note
from tetlux.meshing.tets.given import whole_numbers

REGION = "region"
# Names of labels in various programs, the likeliest first.
KNOWN = (
    REGION,
    PHYSICAL,
    "medit:ref",
    "label",
    "labels",
    "regions",
    "tissue",
    "material",
    "cell_tags",
    "tetgen:ref",
    "avsucd:material",
    "nastran:ref",
    "netgen:index",
    "su2:tag",
    "ugrid:ref",
    "flac3d:group",
    "MaterialIds",
    "CellEntityIds",
    "subdomain",
    "domain",
    "attribute",
    "tag",
    "id",
    ENTITY,
)
ORDER = {name.lower(): i for i, name in enumerate(KNOWN)}
# An array of an unknown name with more distinct values is no label array but, for example, numbers the cells.
MOST_LABELS = 256


@dataclass(frozen=True, eq=False)
class Labels:
    """Labels of tetrahedra (m,), if any, their names, and notes on the choice."""

    values: IntArray | None = None
    names: Mapping[int, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()


def labels_of(raw: RawMesh, name: str | None = None) -> Labels:
    """The labels of a file's tetrahedra.

    Parameters
    ----------
    raw : RawMesh
    name : str, optional
        Name of the label array. If not given, the likeliest known array or the only one of integers is used.

    Raises
    ------
    InputError
        If there is no such array, or its values are not integers.
    """
    if name is not None:
        if name not in raw.arrays:
            known = ", ".join(raw.arrays) or "none"
            raise InputError(f'it holds no array "{name}" of cell values; the arrays there are: {known}.')
        values = _integers(raw, name)
        if values is None:
            raise InputError(f'the values of "{name}" are no whole numbers, one for each tetrahedron.')
        return Labels(values, _names(raw, name, values))
    candidates = _candidates(raw)
    odd = " and ".join(f'"{each}"' for each in raw.arrays if each.lower() in ORDER and each not in candidates)
    not_whole = f"its array {odd} holds no whole numbers, one for each tetrahedron, and is not taken for labels."
    notes = (Note("labels-not-whole", not_whole),) if odd else ()
    likely = sorted((each for each in candidates if each.lower() in ORDER), key=lambda each: ORDER[each.lower()])
    if not likely and raw.sets:
        return _labels_of_sets(raw)
    chosen = likely[0] if likely else next(iter(candidates)) if len(candidates) == 1 else None
    if chosen is None:
        several = " and ".join(f'"{each}"' for each in candidates)
        note = f"its arrays {several} may be labels; choose one of them, or all tetrahedra are of label 0."
        return Labels(notes=(*notes, Note("labels-unclear", note)) if several else notes)
    values = candidates[chosen]
    if chosen == ENTITY and len(np.unique(values)) == 1:
        return Labels(
            notes=(Note("labels-none", "it has no physical groups of volumes; all tetrahedra are of label 0."),)
        )
    return Labels(values, _names(raw, chosen, values), (*notes, *_notes(chosen, values, list(candidates))))


def _notes(chosen: str, values: IntArray, candidates: list[str]) -> tuple[str, ...]:
    """Notes on a choice."""
    if chosen == ENTITY:
        return (Note("labels-chosen", "it has no physical groups of volumes; labels are the numbers of its volumes."),)
    if chosen == PHYSICAL:
        none = int((values == 0).sum())
        sentence = f"{none:,} tetrahedra are in no physical group; their label is 0."
        return (Note("labels-missing", sentence, value=none),) if none else ()
    others = " and ".join(f'"{each}"' for each in candidates if each != chosen)
    if others:
        return (Note("labels-chosen", f'labels are the array "{chosen}"; {others} may be labels too.'),)
    return () if chosen.lower() in ORDER else (Note("labels-chosen", f'labels are the array "{chosen}".'),)


def _candidates(raw: RawMesh) -> dict[str, IntArray]:
    """Possible label arrays and their values: arrays of a known name, or with few distinct integers."""
    found = {}
    for name in raw.arrays:
        values = _integers(raw, name)
        if values is not None and (name.lower() in ORDER or len(np.unique(values)) <= MOST_LABELS):
            found[name] = values
    return found


def _integers(raw: RawMesh, name: str) -> IntArray | None:
    """Values of an array if they are integers, one per tetrahedron."""
    values = raw.values(name)
    return whole_numbers(values, len(values))


def _names(raw: RawMesh, name: str, values: IntArray) -> dict[int, str]:
    present = set(np.unique(values).tolist())
    return {label: text for label, text in raw.names.get(name, {}).items() if label in present}


def _labels_of_sets(raw: RawMesh) -> Labels:
    """Labels by named sets of cells, numbered from 1 in their order; a cell in several belongs to the smallest."""
    sizes = [len(raw.blocks[i][1]) for i in raw.tetrahedra]
    members = {name: _members(parts, raw.tetrahedra, sizes) for name, parts in raw.sets.items()}
    solid: dict[str, BoolArray] = {}
    for name, inside in sorted(members.items(), key=lambda item: _is_generated(item[0])):
        # Ignore sets that repeat another under a different name.
        if inside.any() and not any((inside == other).all() for other in solid.values()):
            solid[name] = inside
    if not solid:
        return Labels()
    values = np.zeros(sum(sizes), dtype=np.int64)
    numbers = {name: i for i, name in enumerate(solid, 1)}
    for name in sorted(solid, key=lambda each: -int(solid[each].sum())):
        values[solid[name]] = numbers[name]
    present = set(np.unique(values).tolist())
    names = {number: name for name, number in numbers.items() if number in present}
    notes = []
    if sum(int(inside.sum()) for inside in solid.values()) > int((values > 0).sum()):
        text = "some tetrahedra are in several sets; the smallest of them is their label."
        notes.append(Note("labels-overlap", text))
    if 0 in present:
        none = int((values == 0).sum())
        notes.append(Note("labels-missing", f"{none:,} tetrahedra are in no set; their label is 0.", value=none))
    return Labels(values, names, tuple(notes))


def _is_generated(name: str) -> bool:
    """Whether gmsh generated the name of a set; the user's name of the same set is preferred."""
    return name.startswith("Volume") and name[len("Volume") :].isdecimal()


def _members(parts: object, blocks: list[int], sizes: list[int]) -> BoolArray:
    """Whether each tetrahedron is in a set, given in meshio's form: cell numbers in each block."""
    inside = []
    for block, size in zip(blocks, sizes, strict=True):
        mask = np.zeros(size, dtype=bool)
        part = parts[block] if isinstance(parts, list) and block < len(parts) else None
        if part is not None:
            numbers = np.asarray(part, dtype=np.int64).reshape(-1)
            mask[numbers[(numbers >= 0) & (numbers < size)]] = True
        inside.append(mask)
    return np.concatenate(inside)
