"""`Case`: one run, ready to be solved; and how a case file becomes a list of them."""

import copy
import itertools
import math
import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from tetlux.cases.compare import Comparison, comparison_for
from tetlux.cases.document import Document, Key, read_document
from tetlux.cases.schema import CaseSpec, LightSpec, SurfaceSpec
from tetlux.fem.lights import DiffuseLight, Light, PencilBeam, PointSource
from tetlux.fem.medium import Medium
from tetlux.fem.validity import check_scattering, check_size
from tetlux.meshing import shapes
from tetlux.meshing.errors import InputError
from tetlux.meshing.read import SUFFIXES, read_surface
from tetlux.meshing.surface import Surface


@dataclass(frozen=True, eq=False)
class Case:
    """One scene of a case file, with its surface read and its lights known to meet it.

    Attributes
    ----------
    name : str
        Its folder of results, relative to the output folder; a sweep's runs have a folder of their own
        within the case's.
    source : Path
    surface : Surface
    medium : Medium
    lights : tuple of Light
    tolerance : float
    outputs : tuple of str
    reading_seconds : float
        Spent on reading and checking the surface.
    comparison : Comparison, optional
        Closed forms to hold the run against.
    """

    name: str
    source: Path
    surface: Surface
    medium: Medium
    lights: tuple[Light, ...]
    tolerance: float
    outputs: tuple[str, ...]
    reading_seconds: float = 0.0
    comparison: Comparison | None = None


def library_folder() -> Path:
    """The folder of the case files that ship with the package."""
    return Path(__file__).with_name("library")


def find_case_file(request: str) -> Path:
    """A path as given, or the shipped case file of that name where there is no such path."""
    path = Path(request)
    shipped = library_folder() / f"{request}.yaml"
    if not path.exists() and path.name == request and shipped.is_file():
        return shipped
    if not path.exists() and path.name == request and not path.suffix:
        known = ", ".join(sorted(p.stem for p in library_folder().glob("*.yaml")))
        raise InputError(f"{request} is neither a file nor one of the cases that ship: {known}.")
    if path.suffix.lower() in SUFFIXES:
        raise InputError(f"{path} is a surface file; name it in a case file, as surface: {{file: {path.name}}}.")
    return path


def load_cases(path: Path) -> list[Case]:
    """Read a case file: one case, or as many as its sweep makes.

    Everything that can be known before meshing is checked: keys and values, the surface, that lights meet
    the body, and its size in mean free paths.

    Raises
    ------
    InputError
        With the file, the line and the key.
    """
    document = read_document(path)
    spec = _validated(document, document.data)
    surfaces: dict[str, Surface] = {}
    cases = []
    for label, data, keys in _swept(document, spec):
        single = document if label is None else Document(path, data, {**document.lines, **keys})
        one = spec if label is None else _validated(single, data)
        name = one.name or path.stem
        cases.append(_case(single, one, name if label is None else f"{name}/{label}", surfaces))
    return cases


# What pydantic says in words of Python's, by the beginning of its error's kind.
PLAIN = {
    "model_": "expected keys and values",
    "dict_": "expected keys and values",
    "list_": "expected a list",
    "tuple_": "expected a list of three numbers",
    "string_pattern": "a name is of letters, digits, spaces and any of . + = , - _ and begins with a letter or digit",
    "string_type": "expected text",
    "too_short": "give at least one",
    "too_long": "expected a list of three numbers",
    "float_type": "expected a number",
}
MOST_RUNS = 20_000


def _validated(document: Document, data: dict[str, Any]) -> CaseSpec:
    try:
        return CaseSpec.model_validate(data)
    except ValidationError as failure:
        first = failure.errors()[0]
        key: Key = tuple(first["loc"])
        context = first.get("ctx", {})
        if first["type"] == "unknown_key":
            key = (*key, context["key"])
        raise document.error(
            key, _sentence(first["type"], first["msg"], first.get("input"), key[-1] if key else "")
        ) from failure


def _sentence(kind: str, message: str, given: object, last: str | int) -> str:
    if kind == "missing" and not isinstance(last, int):
        return "this key is missing; the case needs it."
    text = message[0].lower() + message[1:]
    if kind == "missing" and isinstance(last, int):
        return "expected a list of three numbers."
    text = text.replace("input should be greater", "expected a number greater").replace(
        "input should be less", "expected a number less"
    )
    text = text.replace("input should be", "expected").replace("a valid number", "a number")
    for start, plain in PLAIN.items():
        if kind.startswith(start):
            text = plain
    if kind in ("unknown_key", "one_of", "scale"):
        return f"{text}."
    shown = repr(given)
    return f"{text}, but found {shown if len(shown) < 60 else shown[:57] + '...'}."


def _swept(document: Document, spec: CaseSpec) -> list[tuple[str | None, dict[str, Any], dict[Key, int]]]:
    """The case's data once for each point of its sweep's grid, with the label of that point."""
    if not spec.sweep:
        return [(None, document.data, {})]
    runs: list[tuple[str | None, dict[str, Any], dict[Key, int]]] = []
    for key, listed in spec.sweep.items():
        if len(set(map(repr, listed))) < len(listed):
            raise document.error(("sweep", key), "a value stands here twice; give each once.")
    count = math.prod(len(listed) for listed in spec.sweep.values())
    if count > MOST_RUNS:
        raise document.error(("sweep",), f"this grid makes {count:,} runs; give at most {MOST_RUNS:,} at once.")
    for values in itertools.product(*spec.sweep.values()):
        data = copy.deepcopy(document.data)
        del data["sweep"]
        keys: dict[Key, int] = {}
        for key, value in zip(spec.sweep, values, strict=True):
            keys[_assign(document, data, key, value)] = document.lines["sweep", key]
        label = ",".join(f"{k}={v}" for k, v in zip(spec.sweep, values, strict=True))
        runs.append((label.replace("/", "_"), data, keys))
    return runs


def _assign(document: Document, data: dict[str, Any], key: str, value: object) -> Key:
    """Set a dotted key (list items by their number); it may be new, what holds it may not."""
    parts: Key = tuple(int(p) if p.isdigit() else p for p in key.split("."))
    holder: Any = data
    try:
        for part in parts[:-1]:
            holder = holder[part]
        holder[parts[-1]] = value
    except (KeyError, IndexError, TypeError) as error:
        raise document.error(
            ("sweep", key),
            f'"{key}" is no key of this case; write it as in medium.sigma_a or lights.0.pencil.power.',
        ) from error
    return parts


def _case(document: Document, spec: CaseSpec, name: str, surfaces: dict[str, Surface]) -> Case:
    def located(key: Key, error: InputError) -> InputError:
        return document.error(key, str(error))

    try:
        medium = Medium(**spec.medium.model_dump())
        check_scattering(medium)
    except InputError as error:
        raise located(("medium", *_named_first(str(error), spec.medium.model_dump())), error) from error
    try:
        label = spec.surface.model_dump_json() + spec.unit
        started = time.perf_counter()
        if label not in surfaces:
            surface = _surface(spec.surface, spec.unit, document.path.parent)
            surfaces[label] = replace(surface, crease_angle=spec.surface.crease_angle)
        reading_seconds = time.perf_counter() - started
        surface = surfaces[label]
        check_size(surface, medium)
    except InputError as error:
        raise located(("surface",), error) from error
    lights, deposits = [], []
    for index, light_spec in enumerate(spec.lights):
        try:
            light = _light(light_spec)
            deposits.append(light.deposit_in(surface, medium))
        except InputError as error:
            raise located(("lights", index), error) from error
        lights.append(light)
    try:
        comparison = comparison_for(spec.surface, medium, deposits, spec.compare) if spec.compare else None
    except InputError as error:
        raise located(("compare",), error) from error
    return Case(
        name=name,
        source=document.path,
        surface=surface,
        medium=medium,
        lights=tuple(lights),
        tolerance=spec.tolerance,
        outputs=tuple(dict.fromkeys(spec.outputs)),
        reading_seconds=reading_seconds,
        comparison=comparison,
    )


def _named_first(message: str, fields: dict[str, Any]) -> Key:
    """The key that a message begins with, if it does."""
    word = message.split(maxsplit=1)[0]
    return (word,) if word in fields else ()


def _surface(spec: SurfaceSpec, unit: str, folder: Path) -> Surface:
    if spec.file is not None:
        return read_surface(folder / spec.file, unit=unit, scale=spec.scale)
    if spec.sphere:
        return shapes.sphere(spec.sphere.radius, center=spec.sphere.center, unit=unit)
    if spec.slab:
        return shapes.slab(spec.slab.width, spec.slab.depth, unit=unit)
    if spec.box:
        return shapes.box(spec.box.size, center=spec.box.center, unit=unit)
    if spec.cylinder:
        c = spec.cylinder
        return shapes.cylinder(c.radius, c.height, center=c.center, unit=unit)
    assert spec.torus is not None
    return shapes.torus(spec.torus.major, spec.torus.minor, center=spec.torus.center, unit=unit)


def _light(spec: LightSpec) -> Light:
    if spec.pencil:
        return PencilBeam(**spec.pencil.model_dump())
    if spec.point:
        return PointSource(**spec.point.model_dump())
    assert spec.diffuse is not None
    return DiffuseLight(**spec.diffuse.model_dump())
