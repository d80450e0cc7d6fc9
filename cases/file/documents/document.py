"""A YAML document that knows the line of every key."""

import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import yaml
from yaml.constructor import ConstructorError

from tetlux.meshing.errors import InputError
from tetlux.meshing.host.filesystem import exists, is_file

Key = tuple[str | int, ...]
LARGEST_FILE = 1_000_000
# The most keys and list items, where aliases count as often as they are used; and the deepest nesting.
MOST_KEYS, DEEPEST = 10_000, 50
LARGEST_NUMBER = 10**308


# Written in C where PyYAML was built with libyaml: ten times faster.
_Safe: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)


class _Loader(_Safe):  # type: ignore[misc]
    """Loads plain data, and takes 1e-3 for a number, which in YAML 1.1 is text."""

    def construct_number(self, node: yaml.ScalarNode) -> float:
        """Construct a number in the range of floats, or infinity."""
        construct = self.construct_yaml_int if node.tag.endswith(":int") else self.construct_yaml_float
        try:
            value = construct(node)
        except ValueError:
            value = LARGEST_NUMBER + 1
        if isinstance(value, int) and abs(value) > LARGEST_NUMBER:
            raise ConstructorError(None, None, "this is no number, or too large; give one up to 1e308", node.start_mark)
        return float(value) if isinstance(value, float) else int(value)


def _check_size(text: str) -> None:
    """Refuse tags, too many keys and too deep a nesting, before anything is built of them."""
    nodes = depth = 0
    event: Any
    for event in yaml.parse(text, _Safe):
        if getattr(event, "tag", None) is not None:
            tag = event.tag.replace("tag:yaml.org,2002:", "!!")
            problem = f'tags such as "{tag}" are not allowed; write plain values'
            raise ConstructorError(None, None, problem, event.start_mark)
        nodes += isinstance(event, yaml.NodeEvent)
        if nodes > 2 * MOST_KEYS:
            raise ConstructorError(None, None, f"more than {MOST_KEYS:,} keys; a case file is a few lines", None)
        depth += isinstance(event, yaml.CollectionStartEvent)
        depth -= isinstance(event, yaml.CollectionEndEvent)
        if depth > DEEPEST:
            problem = f"nested more than {DEEPEST} deep; a case file is flatter"
            raise ConstructorError(None, None, problem, event.start_mark)


# Dates are read as text.
_Loader.yaml_implicit_resolvers = {
    first: [(tag, form) for tag, form in forms if not tag.endswith(":timestamp")]
    for first, forms in yaml.SafeLoader.yaml_implicit_resolvers.items()
}
for _kind in ("int", "float"):
    _Loader.add_constructor(f"tag:yaml.org,2002:{_kind}", _Loader.construct_number)
_Loader.add_implicit_resolver(
    "tag:yaml.org,2002:float",
    re.compile(r"^[-+]?(\d+\.?\d*|\.\d+)[eE][-+]?\d+$"),
    list("-+0123456789."),
)


class Place(NamedTuple):
    """Where a key stands: a file, and a line of it."""

    path: Path
    line: int


@dataclass(frozen=True)
class Document:
    """Plain data read from a YAML file.

    Attributes
    ----------
    path : Path
    data : dict
    places : dict
        The file and line of each key, by its path in the document.
    run : str, optional
        Label of a run of the sweep, which error messages then name.
    """

    path: Path
    data: dict[str, Any]
    places: dict[Key, Place]
    run: str | None = None

    def place(self, key: Key) -> Place | None:
        """The place of a key or, where it has none (merged in by `<<`), of the innermost key that contains it."""
        while key and key not in self.places:
            key = key[:-1]
        return self.places[key] if key else None

    def error(self, key: Key, message: str) -> InputError:
        """An error that names the file and line of a key, and the key."""
        place = self.place(key)
        where = f"{place.path}, line {place.line}" if place else f"{self.path}"
        name = format_key(key)
        if self.run is not None:
            message = f"in the run {self.run}: {message}"
        return InputError(f"{where}: {name}: {message}" if name else f"{where}: {message}")

    @contextmanager
    def at(self, key: Key, fields: Mapping[str, Key] | None = None) -> Iterator[None]:
        """Make an `InputError` raised within this context name the file, the line and a key.

        Parameters
        ----------
        key : Key
            The key of the value that is being checked.
        fields : mapping of str to Key, optional
            For an error that names a field: the key of that field within `key`.

        Raises
        ------
        InputError
            With this file, the line and the key. Contexts must not be nested.
        """
        try:
            yield
        except InputError as error:
            within = (fields or {}).get(error.field or "", ())
            raise self.error((*key, *within), str(error)) from error


def format_key(key: Key) -> str:
    """Format a key as in ``lights[0].pencil.origin``."""
    text = ""
    for part in key:
        text += f"[{part}]" if isinstance(part, int) else f".{part}" if text else part
    return text


def read_document(path: Path) -> Document:
    """Read a YAML file that holds one mapping.

    Raises
    ------
    InputError
        If the file is missing, unreadable, no YAML, or holds anything but a mapping.
    """
    try:
        if not is_file(path):
            problem = "is not a file; give a YAML case file" if exists(path) else "does not exist; check its path"
            raise InputError(f"{path} {problem}.")
        size = path.stat().st_size
        if size > LARGEST_FILE:
            raise InputError(f"{path} is {size / 1e6:.0f} MB; a case file is a few lines of YAML.")
        text = path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(f"{path} is not UTF-8 text; save it as UTF-8.") from error
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror}; check its permissions.") from error
    try:
        _check_size(text)
        loader = _Loader(text)
        node = loader.get_single_node()
        if not isinstance(node, yaml.MappingNode):
            raise InputError(f"{path} is {'empty' if node is None else 'not a mapping'}; give keys and values.")
        places: dict[Key, Place] = {}
        _collect_places(path, node, (), places)
        data = loader.construct_document(node)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark
        line = f", line {mark.line + 1}" if mark else ""
        raise InputError(f"{path}{line}: not valid YAML: {error.problem}.") from error
    except RecursionError as error:
        raise InputError(f"{path}: not valid YAML: an alias refers to a value that contains the alias.") from error
    except yaml.YAMLError as error:
        reason = (str(error).splitlines() or ["no reason given"])[0]
        raise InputError(f"{path}: not valid YAML: {reason}.") from error
    return Document(path, data, places)


def _collect_places(path: Path, node: yaml.Node, key: Key, places: dict[Key, Place]) -> None:
    """Add the place of each key within a node to `places`."""
    if len(places) > MOST_KEYS:
        raise InputError(f"{path} holds more than {MOST_KEYS:,} keys; a case file is a few lines of YAML.")
    if isinstance(node, yaml.MappingNode):
        for name, value in node.value:
            part: Key = (*key, str(name.value))
            if part in places:
                where = f"{path}, line {name.start_mark.line + 1}: {format_key(part)}"
                raise InputError(f"{where}: this key is given twice; give it once.")
            places[part] = Place(path, name.start_mark.line + 1)
            _collect_places(path, value, part, places)
    elif isinstance(node, yaml.SequenceNode):
        for index, value in enumerate(node.value):
            places[*key, index] = Place(path, value.start_mark.line + 1)
            _collect_places(path, value, (*key, index), places)
