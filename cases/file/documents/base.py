"""`read_with_base`: a case file with the defaults of the file that its key `base` names."""

import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from tetlux.cases.file.documents.document import Document, Key, Place, read_document

# Keys whose values are paths, relative to the case file.
PATHS = ("file", "files")
# Keys of one section that replace each other: one that is given drops those of the other groups from the base.
ALTERNATIVES: tuple[tuple[frozenset[str], ...], ...] = tuple(
    tuple(frozenset(group.split()) for group in alternatives)
    for alternatives in (
        ("mesh", "surface medium regions compare"),
        ("file scale holes", "sphere", "slab", "box", "cylinder", "torus"),
        ("material", "sigma_a sigma_s_prime sigma_s g phase eta boundary", "chromophores scattering wavelengths"),
        ("sigma_s_prime", "sigma_s g phase"),
        ("g", "phase"),
        ("henyey_greenstein", "two_term", "table"),
        ("volume", "images", "array"),
        ("position", "azimuth elevation"),
    )
)


def read_with_base(path: Path) -> Document:
    """Read a case file and, if it has the key `base`, that file too, whose keys hold where this one has none.

    Mappings are merged key by key, anything else is replaced as a whole. A key that is given without a value drops
    that of the base. The name is not taken over.

    Raises
    ------
    InputError
        If a file cannot be read, or a base includes itself.
    """
    document = _read(path, ())
    document.data.pop("base", None)
    return document


def _read(path: Path, users: tuple[Path, ...]) -> Document:
    document = read_document(path)
    name = document.data.get("base")
    if name is None:
        return document
    if not isinstance(name, str) or not name.isprintable() or not name:
        raise document.error(("base",), "expected the name of another case file.")
    users = (*users, Path(os.path.realpath(path)))
    base_path = path.parent / name
    if Path(os.path.realpath(base_path)) in users:
        through = " by way of other files" if len(users) > 1 or not _same(base_path, path) else ""
        raise document.error(("base",), f"{name} includes itself{through}; name another file.")
    with document.at(("base",)):
        base = _read(base_path, users)
    defaults = {key: value for key, value in base.data.items() if key not in ("name", "base")}
    if not _same(base_path.parent, path.parent):
        defaults = _move_paths(defaults, "", base_path.parent, path.parent)
    places = dict(document.places)
    return Document(path, _merge(document.data, defaults, (), base.places, places), places)


def _same(path: Path, other: Path) -> bool:
    return os.path.realpath(path) == os.path.realpath(other)


def _merge(
    own: dict[str, Any], defaults: dict[str, Any], key: Key, from_places: dict[Key, Place], places: dict[Key, Place]
) -> dict[str, Any]:
    """The values of a section, with those of a base where it has none, whose places are added."""
    dropped = set(_replaced(own))
    merged = dict(own)
    for name, default in defaults.items():
        here: Key = (*key, name)
        if name in dropped:
            continue
        if name not in own:
            merged[name] = default
            places |= {place: from_places[place] for place in from_places if place[: len(here)] == here}
            continue
        value, other = _as_mappings(own[name], default) if here == ("tolerance",) else (own[name], default)
        if isinstance(value, dict) and isinstance(other, dict):
            merged[name] = _merge(value, other, here, from_places, places)
        elif value is None:
            del merged[name]
    return merged


def _as_mappings(own: Any, default: Any) -> tuple[Any, Any]:
    """Two values of `tolerance`; a plain number is that of the exitance, and is written as such beside a mapping."""
    if isinstance(own, dict) != isinstance(default, dict) and own is not None:
        own, default = (each if isinstance(each, dict) else {"exitance": each} for each in (own, default))
    return own, default


def _replaced(own: dict[str, Any]) -> Iterator[str]:
    """The keys of a base that the own keys of a section replace though their names differ."""
    for groups in ALTERNATIVES:
        given = [group for group in groups if group & own.keys()]
        if len(given) == 1:
            for group in groups:
                if group not in given:
                    yield from group


def _move_paths(value: Any, name: str, folder: Path, to: Path) -> Any:
    """Plain data with its paths made relative to another folder."""
    if isinstance(value, dict):
        return {key: _move_paths(each, str(key).rpartition(".")[2], folder, to) for key, each in value.items()}
    if isinstance(value, list):
        return [_move_paths(each, name, folder, to) for each in value]
    if isinstance(value, str) and name in PATHS:
        try:
            return os.path.relpath(folder / value, to)
        except ValueError:  # on another drive of Windows, or no path
            return value
    return value
