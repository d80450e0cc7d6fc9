"""Names of a case's lights, and where their values stand in the case file."""

from pydantic import BaseModel

from tetlux.cases.file.document import Key
from tetlux.cases.file.schema.case import CaseSpec

# What is outside all regions, as the region of an emission.
BODY = "body"


def light_names(spec: CaseSpec) -> tuple[str, ...]:
    """Names of the lights of a case, as given or by kind and number."""
    kinds = [light.kind for light in spec.lights]
    return tuple(
        light.name or f"{light.kind}_{kinds[: i + 1].count(light.kind)}" for i, light in enumerate(spec.lights)
    )


def keys_of(spec: BaseModel) -> dict[str, Key]:
    """Where in the section of a light its values stand, by their names."""
    found: dict[str, Key] = {}
    for name, value in spec:
        if isinstance(value, BaseModel):
            found |= {word: (name, *key) for word, key in keys_of(value).items()}
        else:
            found[name] = (name,)
    return found
