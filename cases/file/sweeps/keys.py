"""Dotted keys of a sweep: looked up in the schema, and set in the data of a run."""

from collections.abc import Iterator, Sequence
from types import UnionType
from typing import Annotated, Any, Union, get_args, get_origin

from tetlux.cases.file.documents.document import Document, Key
from tetlux.cases.file.schema.case import CaseSpec
from tetlux.cases.file.schema.parts import Section
from tetlux.cases.hints import nearest_word

# Keys of the case file that no run has.
NOT_SWEPT = ("sweep", "base")


def split_key(key: str) -> Key:
    """The parts of a dotted key; items of lists by number."""
    return tuple(int(part) if part.isascii() and part.isdecimal() else part for part in key.split("."))


def check_key(document: Document, at: Key, key: str) -> None:
    """Refuse a dotted key that no case can have.

    Parameters
    ----------
    document : Document
    at : Key
        Where the key is given.
    key : str

    Raises
    ------
    InputError
        With the nearest key that there is.
    """
    parts = split_key(key)
    for depth, part in enumerate(parts):
        kinds = _kinds_at(parts[:depth])
        if not any(True for kind in kinds for _ in _step(kind, part)) or parts[0] in NOT_SWEPT:
            raise document.error(at, f"unknown key; {_hint(kinds, parts, depth)}.")


def with_value(document: Document, at: Key, data: dict[str, Any], key: str, value: Any) -> dict[str, Any]:
    """The data of a case with the value of a dotted key set; what is left out on the way there gets its default.

    Raises
    ------
    InputError
        If the key names an item of a list, or a part of a single value, that is not there.
    """
    try:
        return dict(_with(data, (), split_key(key), value))
    except LookupError as error:
        raise document.error(at, f"unknown key; {error.args[0]}.") from error


def _with(data: Any, done: Key, parts: Key, value: Any) -> Any:
    """A copy of data in which a value is set; all else is shared with the original."""
    if not parts:
        return value
    part, here = parts[0], _dotted(done)
    if data is None:
        data = {} if isinstance(part, str) else []
    if done == ("tolerance",) and isinstance(data, int | float) and isinstance(part, str):
        data = {"exitance": data}
    if isinstance(data, dict):
        # A number is the label of a mesh, whose key may be text.
        name = str(part) if part not in data else part
        inner = data[name] if name in data else _default((*done, name))
        return {**data, name: _with(inner, (*done, name), parts[1:], value)}
    if not isinstance(data, list):
        raise LookupError(f"{here} is a single value, so it has no {part}")
    if not isinstance(part, int) or part >= len(data):
        items = f"items 0 to {len(data) - 1}" if len(data) > 1 else "one item, 0," if data else "no items"
        raise LookupError(f"{here} has {items} here")
    return [*data[:part], _with(data[part], (*done, part), parts[1:], value), *data[part + 1 :]]


def _dotted(parts: Sequence[object]) -> str:
    return ".".join(map(str, parts))


def _default(key: Key) -> Any:
    """The default of a key, as plain data; None if it has none."""
    for section in _sections(_kinds_at(key[:-1])):
        field = section.model_fields.get(str(key[-1]))
        if field is not None and not field.is_required():
            return list(field.default) if isinstance(field.default, tuple) else field.default
    return None


def _kinds_at(key: Key) -> list[Any]:
    """The types that the value of a key may have in a case."""
    kinds: list[Any] = [CaseSpec]
    for part in key:
        kinds = [inner for kind in kinds for inner in _step(kind, part)]
    return [each for kind in kinds for each in _alternatives(kind)]


def _step(kind: Any, part: str | int) -> Iterator[Any]:
    """The types of a part of a value, from the type of the value."""
    for each in _alternatives(kind):
        origin = get_origin(each)
        if isinstance(each, type) and issubclass(each, Section):
            if part in each.model_fields:
                yield each.model_fields[str(part)].annotation
        elif origin is list and isinstance(part, int):
            yield get_args(each)[0]
        elif origin is tuple and isinstance(part, int) and part < len(get_args(each)):
            yield get_args(each)[part]
        elif origin is dict:
            yield get_args(each)[1]


def _alternatives(kind: Any) -> Iterator[Any]:
    """The types that make up a union, without annotations."""
    origin = get_origin(kind)
    if origin is Annotated:
        yield from _alternatives(get_args(kind)[0])
    elif origin in (Union, UnionType):
        for each in get_args(kind):
            yield from _alternatives(each)
    else:
        yield kind


def _sections(kinds: list[Any]) -> list[type[Section]]:
    return [each for each in kinds if isinstance(each, type) and issubclass(each, Section)]


def _hint(kinds: list[Any], parts: Key, depth: int) -> str:
    """What to write in place of a key whose part at a depth is unknown."""
    before, part, after = parts[:depth], str(parts[depth]), parts[depth + 1 :]
    sections = _sections(kinds)
    names = [name for section in sections for name in section.model_fields if depth or name not in NOT_SWEPT]
    word, _, number = part.partition("[")
    if number and word in names:
        return f'write "{_dotted((*before, word, *number.rstrip("]").split("]["), *after))}"'
    found = nearest_word(part, names)
    if found is None:
        inner = {key: name for section in sections for name in section.model_fields for key in _keys_in(section, name)}
        word = nearest_word(part, inner) or ""
        found = f"{inner[word]}.{word}" if word else None
    if found:
        meant = _dotted((*before, found, *after))
        return f'did you mean "{meant}"? write keys in full, as in lights.0.pencil.power'
    if not names and all(get_origin(kind) in (list, tuple) for kind in kinds):
        return f"{_dotted(before)} is a list, whose items have numbers from 0, as in {_dotted((*before, 0))}"
    if not names:
        return f"{_dotted(before)} is a single value"
    return f"the keys {f'in {_dotted(before)}' if before else 'here'} are {', '.join(names)}"


def _keys_in(section: type[Section], name: str) -> list[str]:
    """The keys of the sections that are the value of a key of a section."""
    inner = _sections(list(_alternatives(section.model_fields[name].annotation)))
    return [key for each in inner for key in each.model_fields]
