"""Whether what a case file says is of the right form, and if not, which key is wrong, in plain words."""

import re
from typing import Any

from pydantic import ValidationError

from tetlux.cases.file.document import Document, Key
from tetlux.cases.file.schema.case import CaseSpec
from tetlux.cases.file.schema.parts import TAG
from tetlux.cases.nearest import did_you_mean

# What pydantic says in words of Python's, by the beginning of its error's kind; of lists, how long they are.
PLAIN = {
    "model_": "expected keys and values",
    "dict_": "expected keys and values",
    "list_": "expected a list",
    "tuple_": "",
    "string_pattern": "a name is of letters, digits, spaces and any of . + = , - _ and begins with a letter or digit",
    "string_type": "expected text",
    "too_short": "give at least one",
    "too_long": "",
    "float_type": "expected a number",
}
# Values that YAML writes in another way than Python.
PYTHONS = {None: "nothing", True: "true", False: "false"}
# Sections in place of which people give one word, and how to write that.
ONE_WORD = {"surface": "surface: {{file: {0}}}", "medium": "medium: {{material: {0}}}"}
# Lists of numbers that are not of three.
COUNTS: dict[str | int, str] = {"values": "two"}


def validated(document: Document, data: dict[str, Any]) -> CaseSpec:
    """The data of a document, or of one run of its sweep, as a case.

    Raises
    ------
    InputError
        With the file, the line and the key.
    """
    try:
        return CaseSpec.model_validate(data)
    except ValidationError as failure:
        first = failure.errors()[0]
        key: Key = tuple(part for part in first["loc"] if not str(part).startswith(TAG))
        context = first.get("ctx", {})
        if first["type"] in ("unknown_key", "no_mesh"):
            key = (*key, context["key"])
        if first["type"] == "body":
            key = () if "name" in context else ("mesh",)
        if first["type"] == "tolerance":
            key = ("tolerance",)
        raise document.error(key, _sentence(first["type"], first["msg"], first.get("input"), key)) from failure


def _sentence(kind: str, message: str, given: object, key: Key) -> str:
    several = f"expected a list of {COUNTS.get(key[-2] if len(key) > 1 else '', 'three')} numbers"
    if kind == "missing":
        return f"{several}." if isinstance(key[-1], int) else "this key is missing; the case needs it."
    text = message[0].lower() + message[1:]
    text = text.replace("input should be greater", "expected a number greater").replace(
        "input should be less", "expected a number less"
    )
    text = text.replace("input should be", "expected").replace("a valid number", "a number")
    for start, plain in PLAIN.items():
        if kind.startswith(start):
            text = plain or several
    if kind.startswith("string_pattern") and key != ("name",):
        text = "a name here is of letters from A to Z, digits and any of . + - _ and begins with a letter or digit"
    if kind in ("unknown_key", "one_of", "scale", "body", "no_mesh", "tolerance"):
        return f"{text}."
    if key[:1] == ("sweep",) and kind == "float_type":
        text = "expected a number or a word"
    hint = ""
    if kind == "literal_error" and isinstance(given, str):
        text = did_you_mean(given, re.findall(r"'(.*?)'", message)) + text
    if isinstance(given, str) and kind.startswith(("model_", "dict_")) and key and key[-1] in ONE_WORD:
        hint = "; write " + ONE_WORD[str(key[-1])].format(given)
    shown = PYTHONS[given] if given is None or isinstance(given, bool) else repr(given)
    return f"{text}, but found {shown if len(shown) < 60 else shown[:57] + '...'}{hint}."
