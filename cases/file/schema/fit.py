"""The section ``fit`` of the case file: what is fitted to what detectors have read."""

import math
from collections.abc import Sequence
from typing import Annotated, Any

from pydantic import BeforeValidator, Field, model_validator
from pydantic_core import PydanticCustomError

from tetlux.cases.file.schema.parts import Length, Number, Section

# How deep lists of readings are: of wavelengths, of lights, of detectors.
DEPTH = 3


def _numbers(value: Any, depth: int = DEPTH) -> Any:
    """Lists of numbers within lists, where nothing (an empty item, or .nan) stands for no reading."""
    if isinstance(value, list | tuple) and depth:
        return [_numbers(each, depth - 1) for each in value]
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return None
    if isinstance(value, bool) or not isinstance(value, int | float) or depth == DEPTH:
        raise PydanticCustomError(
            "fit",
            "give a list of numbers, one for each detector; of several lights or wavelengths a list of such lists",
        )
    return float(value)


Nested = Annotated[list[Any], BeforeValidator(_numbers)]


class FitReadingsSpec(Section):
    """What the detectors have read."""

    file: str | None = Field(
        None,
        description="CSV as detectors.csv of a run: columns name, exitance, and where needed channel, light, phase; "
        "noise if there is a column of it",
    )
    values: Nested | None = Field(
        None, description="in place of a file, exitance of each detector, W/unit²; lists for several lights"
    )
    phases: Nested | None = Field(None, description="beside values, of modulated light: how far they lag, degrees")

    @model_validator(mode="after")
    def _one_source(self) -> "FitReadingsSpec":
        if (self.file is None) == (self.values is None):
            raise PydanticCustomError("fit", "give readings either by file or by values")
        if self.phases is not None and self.values is None:
            raise PydanticCustomError("fit", "phases belong to values; a file has them in a column of its own")
        return self


class FitSpec(Section):
    """Coefficients that are fitted to readings."""

    unknowns: Annotated[list[str], Field(min_length=1)] = Field(
        description="sigma_a, sigma_s_prime, or of media by chromophores hbo2, hhb, water, fat, a, b; of a region with "
        "its name, as bone.sigma_a; gain, a factor of all readings; coordinates of a point or pencil with its name, as "
        "pencil_1.x"
    )
    readings: FitReadingsSpec
    noise: Length | None = Field(
        None, description="relative standard deviation of readings; default: the column noise, or by the residuals"
    )
    bounds: dict[str, tuple[Number, Number]] = Field(
        {},
        description="least and largest value by unknown; default: a thousandth and a thousand times the start, and no "
        "bounds of coordinates",
    )


def refuse_beside_fit(model: str, sections: dict[str, Any], detectors: Sequence[Any]) -> None:
    """Refuse what does not go with a fit: another model, sections that are given, and a case without detectors."""
    if model != "full":
        raise PydanticCustomError("fit", "a fit is made by model full; leave fit or model out", {"key": "fit"})
    for name, given in sections.items():
        if given:
            raise PydanticCustomError(
                "fit", "a fit does not go with {name}; leave one of the two out", {"name": name, "key": "fit"}
            )
    if not detectors:
        raise PydanticCustomError(
            "fit", "a fit is to what detectors have read, and there is none; give some", {"key": "fit"}
        )


def refuse_without_readings(model: str, sections: dict[str, Any], detectors: Sequence[Any]) -> None:
    """Refuse sensitivities of what has none: another model, sections that are given, and a case without detectors."""
    context = {"key": "outputs"}
    if model != "full":
        raise PydanticCustomError(
            "fit", "sensitivities are of model full; leave sensitivity out of outputs, or write model: full", context
        )
    for name, given in sections.items():
        if given:
            raise PydanticCustomError(
                "fit", "there are no sensitivities beside {name}; leave one of the two out", {"name": name, **context}
            )
    if not detectors:
        raise PydanticCustomError(
            "fit", "sensitivities are of what detectors read, and there is none; give some", context
        )
