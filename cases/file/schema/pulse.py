"""The section ``pulse`` of the case file: light in time after a short pulse."""

from typing import Annotated, Any

import numpy as np
from pydantic import BaseModel, BeforeValidator, Discriminator, Field, Tag
from pydantic_core import PydanticCustomError

from tetlux.cases.file.schema.parts import TAG, Number, Numbers, Section, shape_of
from tetlux.cases.file.schema.sweep import RangeSpec

# Exitance is computed and kept at all of them.
MOST_TIMES = 1000


def _list_or_range(value: Any) -> Any:
    if not isinstance(value, list | tuple | dict | BaseModel):
        raise PydanticCustomError(
            "times", "give a list of times in s, or a range as in {example}", {"example": EXAMPLE}
        )
    if isinstance(value, list | tuple) and len(value) > MOST_TIMES:
        raise PydanticCustomError("times", "these are too many times; give at most {most}", {"most": MOST_TIMES})
    return value


EXAMPLE = "{start: 5e-11, stop: 2e-9, num: 40}"


class TimesSpec(RangeSpec):
    """Times, both ends included."""

    num: int = Field(strict=True, ge=2, le=MOST_TIMES, description="how many times")


class PulseSpec(Section):
    """A short pulse of all lights."""

    times: Annotated[
        Annotated[Numbers, Tag(TAG + "list")] | Annotated[TimesSpec, Tag(TAG + "mapping")],
        Discriminator(shape_of),
        BeforeValidator(_list_or_range),
    ] = Field(description="s after the pulse, rising: a list, or a range as in " + EXAMPLE)
    outside_index: Number = Field(
        1.0, description="refractive index of what surrounds the body, to which eta is relative"
    )

    @property
    def all_times(self) -> list[float]:
        """The times, s."""
        if not isinstance(self.times, TimesSpec):
            return self.times
        space = np.geomspace if self.times.scale == "log" else np.linspace
        found: list[float] = space(self.times.start, self.times.stop, self.times.num).tolist()
        return found


def refuse_beside_pulse(model: str, sections: dict[str, Any]) -> None:
    """Refuse what does not go with a pulse: another model, and sections that are given."""
    if model != "full":
        raise PydanticCustomError(
            "pulse", "a pulse is solved for by model full; leave pulse or model out", {"key": "pulse"}
        )
    for name, given in sections.items():
        if given:
            raise PydanticCustomError(
                "pulse", "a pulse does not go with {name}; leave one of the two out", {"name": name, "key": "pulse"}
            )
