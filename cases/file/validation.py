"""Validation of a case file against the schema, with pydantic's errors turned into plain sentences."""

import re
from typing import Any

from pydantic import ValidationError

from tetlux.cases.file.documents.document import Document, Key
from tetlux.cases.file.schema.case import CaseSpec
from tetlux.cases.file.schema.parts import TAG
from tetlux.cases.hints import did_you_mean

# Plain words for pydantic's errors, by the beginning of their type; empty: how many numbers are expected.
PLAIN = {
    "model_": "expected keys and values",
    "dict_": "expected keys and values",
    "list_": "expected a list",
    "tuple_": "",
    "string_pattern": "expected a name of letters, digits, spaces and . + = , - _ that begins with a letter or digit",
    "string_type": "expected text",
    "too_short": "give at least one",
    "too_long": "",
    "float_type": "expected a number",
    "int_": "expected a whole number",
}
# How YAML writes values that Python writes differently.
YAML_WORDS = {None: "nothing", True: "true", False: "false"}
# How to write a section for which a single word was given.
ONE_WORD = {"surface": "surface: {{file: {0}}}", "medium": "medium: {{material: {0}}}"}
# Lists that do not hold three numbers.
COUNTS: dict[str | int, str] = {"values": "two", "range": "two", "pixels": "two", "bounds": "two"}
# Types of errors whose messages say all.
WHOLE_SENTENCES = (
    "unknown_key",
    "one_of",
    "scale",
    "holes",
    "body",
    "no_mesh",
    "tolerance",
    "sweep",
    "picture",
    "pulse",
    "fit",
)


def validate(document: Document, data: dict[str, Any]) -> CaseSpec:
    """Validate the data of a document, or of one run of its sweep.

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
        if first["type"] in ("unknown_key", "no_mesh", "pulse", "fit") and "key" in context:
            key = (*key, context["key"])
        if first["type"] == "body":
            key = () if "name" in context else ("mesh",)
        raise document.error(key, _sentence(first["type"], first["msg"], first.get("input"), key)) from failure


def _sentence(kind: str, message: str, given: object, key: Key) -> str:
    """What is wrong with the value of a key: by the type, message and input of a pydantic error."""
    count = next((COUNTS[part] for part in key[-2:] if part in COUNTS), "three")
    several = f"expected a list of {count} numbers"
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
        text = "expected a name of letters from A to Z, digits and . + - _ that begins with a letter or digit"
    if kind in WHOLE_SENTENCES:
        return f"{text}."
    hint = ""
    if kind == "literal_error" and isinstance(given, str):
        text = did_you_mean(given, re.findall(r"'(.*?)'", message)) + text
    if isinstance(given, str) and kind.startswith(("model_", "dict_")) and key and key[-1] in ONE_WORD:
        hint = "; write " + ONE_WORD[str(key[-1])].format(given)
    shown = YAML_WORDS[given] if given is None or isinstance(given, bool) else repr(given)
    return f"{text}, but found {shown if len(shown) < 60 else shown[:57] + '...'}{hint}."
