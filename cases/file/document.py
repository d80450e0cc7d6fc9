"""A YAML document that knows the line of every key."""

import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml
from yaml.constructor import ConstructorError

from tetlux.meshing.errors import InputError
from tetlux.meshing.host.filesystem import exists, is_file

Key = tuple[str | int, ...]
LARGEST_FILE = 1_000_000
# Keys and items of lists, those of aliases counted as often as they are used; and how deep they may lie.
MOST_KEYS, DEEPEST = 10_000, 50
LARGEST_NUMBER = 10**308


class _Loader(yaml.SafeLoader):
    """Plain data only, of a size to be read at once; and 1e-3 is a number, which YAML 1.1 takes for text."""

    def __init__(self, text: str) -> None:
        super().__init__(text)
        self._nodes = self._depth = 0

    def compose_node(self, parent: yaml.Node | None, index: Any) -> yaml.Node | None:
        event: Any = self.peek_event()  # type: ignore[no-untyped-call]
        if getattr(event, "tag", None) is not None:
            tag = event.tag.replace("tag:yaml.org,2002:", "!!")
            raise ConstructorError(
                None, None, f'tags such as "{tag}" are not read here; write plain values', event.start_mark
            )
        self._nodes += 1
        if self._nodes > 2 * MOST_KEYS:
            raise ConstructorError(None, None, f"more than {MOST_KEYS:,} keys; a case file is a few lines", None)
        if self._depth > DEEPEST:
            raise ConstructorError(
                None, None, f"nested more than {DEEPEST} deep; a case file is flatter", event.start_mark
            )
        self._depth += 1
        node = super().compose_node(parent, index)
        self._depth -= 1
        return node

    def construct_number(self, node: yaml.ScalarNode) -> float:
        """A number that a float can hold, or infinity."""
        make = self.construct_yaml_int if node.tag.endswith(":int") else self.construct_yaml_float
        try:
            value = make(node)
        except ValueError:
            value = LARGEST_NUMBER + 1
        if isinstance(value, int) and abs(value) > LARGEST_NUMBER:
            raise ConstructorError(None, None, "this is no number, or one that is too large", node.start_mark)
        return float(value) if isinstance(value, float) else int(value)


# A date is text, as everything is that is no number, truth value or nothing.
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


@dataclass(frozen=True)
class Document:
    """Plain data read from a YAML file.

    Attributes
    ----------
    path : Path
    data : dict
    lines : dict
        Line number of each key, by its path in the document.
    run : str, optional
        The values of a run of its sweep, of which an error is told.
    """

    path: Path
    data: dict[str, Any]
    lines: dict[Key, int]
    run: str | None = None

    def line(self, key: Key) -> int | None:
        """The line of a key, or of what holds it: a key that is merged into another (`<<`) has none of its own."""
        while key and key not in self.lines:
            key = key[:-1]
        return self.lines[key] if key else None

    def error(self, key: Key, message: str) -> InputError:
        """An error that names this file, the line of a key (or of what holds it), and the key."""
        line = self.line(key)
        where = f"{self.path}, line {line}" if line else f"{self.path}"
        name = dotted(key)
        if self.run is not None:
            message = f"in the run {self.run}: {message}"
        return InputError(f"{where}: {name}: {message}" if name else f"{where}: {message}")

    @contextmanager
    def at(self, key: Key, fields: Mapping[str, Key] | None = None) -> Iterator[None]:
        """Within this, an error is one of the value at a key, or at that of the field that it names.

        Parameters
        ----------
        key : Key
        fields : mapping of str to Key, optional
            Where within `key` the values of fields are.

        Raises
        ------
        InputError
            With this file, the line and the key. What is within must not raise such an error itself.
        """
        try:
            yield
        except InputError as error:
            within = (fields or {}).get(error.field or "", ())
            raise self.error((*key, *within), str(error)) from error


def dotted(key: Key) -> str:
    """A key as people write it: ``lights[0].pencil.origin``."""
    text = ""
    for part in key:
        text += f"[{part}]" if isinstance(part, int) else f".{part}" if text else part
    return text


def read_document(path: Path) -> Document:
    """Read a YAML file that holds one mapping.

    Raises
    ------
    InputError
        If it is missing, unreadable, no YAML, or something else than a mapping.
    """
    try:
        if not is_file(path):
            found = "is not a file; give a YAML case file" if exists(path) else "does not exist; check its path"
            raise InputError(f"{path} {found}.")
        size = path.stat().st_size
        if size > LARGEST_FILE:
            raise InputError(f"{path} is {size / 1e6:.0f} MB; a case file is a few lines of YAML.")
        text = path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(f"{path} is not UTF-8 text; save it as UTF-8.") from error
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror}.") from error
    try:
        loader = _Loader(text)
        node = loader.get_single_node()
        if not isinstance(node, yaml.MappingNode):
            raise InputError(f"{path} is {'empty' if node is None else 'not a mapping'}; give keys and values.")
        lines: dict[Key, int] = {}
        _note_lines(path, node, (), lines)
        data = loader.construct_document(node)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark
        line = f", line {mark.line + 1}" if mark else ""
        raise InputError(f"{path}{line}: not valid YAML: {error.problem}.") from error
    except RecursionError as error:
        raise InputError(f"{path}: not valid YAML: an alias stands within what it stands for.") from error
    except yaml.YAMLError as error:
        first = (str(error).splitlines() or ["no reason given"])[0]
        raise InputError(f"{path}: not valid YAML: {first}.") from error
    return Document(path, data, lines)


def _note_lines(path: Path, node: yaml.Node, key: Key, lines: dict[Key, int]) -> None:
    if len(lines) > MOST_KEYS:
        raise InputError(f"{path} holds more than {MOST_KEYS:,} keys; a case file is a few lines of YAML.")
    if isinstance(node, yaml.MappingNode):
        for name, value in node.value:
            part: Key = (*key, str(name.value))
            if part in lines:
                raise InputError(
                    f"{path}, line {name.start_mark.line + 1}: {dotted(part)}: this key stands here twice."
                )
            lines[part] = name.start_mark.line + 1
            _note_lines(path, value, part, lines)
    elif isinstance(node, yaml.SequenceNode):
        for index, value in enumerate(node.value):
            lines[*key, index] = value.start_mark.line + 1
            _note_lines(path, value, (*key, index), lines)
