"""Names of a case's lights, and the keys of their values in the case file."""

from pydantic import BaseModel

from tetlux.cases.file.documents.document import Key
from tetlux.cases.file.schema.case import CaseSpec

# The name of the part of the body that is outside of all regions.
BODY = "body"


def light_names(spec: CaseSpec) -> tuple[str, ...]:
    """Names of the lights of a case: those given, else kind and number, as in ``pencil_1``."""
    kinds = [light.kind for light in spec.lights]
    return tuple(
        light.name or f"{light.kind}_{kinds[: i + 1].count(light.kind)}" for i, light in enumerate(spec.lights)
    )


def field_keys(spec: BaseModel) -> dict[str, Key]:
    """Map the name of each value in the section of a light to its key within that section."""
    found: dict[str, Key] = {}
    for name, value in spec:
        if isinstance(value, BaseModel):
            found |= {word: (name, *key) for word, key in field_keys(value).items()}
        else:
            found[name] = (name,)
    return found
