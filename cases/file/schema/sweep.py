"""The section ``sweep`` of the case file: lists, ranges, zipped lists and samples, by dotted keys."""

from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Discriminator, Field, Tag, model_validator
from pydantic_core import PydanticCustomError

from tetlux.cases.file.schema.parts import TAG, Number, Section

MOST_RUNS = 20_000
Scale = Literal["linear", "log"]


class SampledRangeSpec(Section):
    """A range that values are drawn from."""

    start: Number
    stop: Number
    scale: Scale = Field("linear", description="log: steps of equal ratio")

    @model_validator(mode="after")
    def _not_empty(self) -> "SampledRangeSpec":
        if self.start == self.stop:
            raise PydanticCustomError("sweep", "this range is empty, since start and stop are equal; give a list")
        if self.scale == "log" and min(self.start, self.stop) <= 0:
            raise PydanticCustomError(
                "sweep", "a range of scale log has no 0 and no negative numbers; give positive ends"
            )
        return self


class RangeSpec(SampledRangeSpec):
    """Evenly spaced values, both ends included."""

    num: int = Field(strict=True, ge=2, le=MOST_RUNS, description="how many values")


def _shape(value: Any) -> str:
    return TAG + ("mapping" if isinstance(value, dict | BaseModel) else "list")


def _list_or_range(value: Any) -> Any:
    if isinstance(value, list | tuple) and any(each is None for each in value):
        raise PydanticCustomError("sweep", "a value is missing; give a number, a word, a list or a mapping")
    if not isinstance(value, list | tuple | dict | BaseModel):
        raise PydanticCustomError(
            "sweep", "give a list of values, or a range as in {start: 1, stop: 100, num: 5, scale: log}"
        )
    return value


Values = Annotated[list[Any], Field(min_length=1), Tag(TAG + "list")]
# The values of a key: a list, or a range.
Axis = Annotated[
    Values | Annotated[RangeSpec, Tag(TAG + "mapping")], Discriminator(_shape), BeforeValidator(_list_or_range)
]
SampledAxis = Annotated[
    Values | Annotated[SampledRangeSpec, Tag(TAG + "mapping")], Discriminator(_shape), BeforeValidator(_list_or_range)
]


class ByKey(BaseModel):
    """A mapping whose keys are dotted keys of the case, beside those of its own."""

    model_config = ConfigDict(extra="allow", frozen=True)

    @model_validator(mode="before")
    @classmethod
    def _keys_are_words(cls, data: Any) -> Any:
        return {str(key): value for key, value in data.items()} if isinstance(data, dict) else data


class SampleSpec(ByKey):
    """Points drawn from ranges and lists."""

    __pydantic_extra__: dict[str, SampledAxis] = Field(init=False)
    method: Literal["lhs", "random"] = Field("lhs", description="lhs: Latin hypercube; random: independent points")
    size: int = Field(strict=True, ge=1, le=MOST_RUNS, description="how many points")
    seed: int = Field(0, strict=True, ge=0, description="the same seed draws the same points")

    @property
    def axes(self) -> dict[str, list[Any] | SampledRangeSpec]:
        """Ranges and lists by key."""
        return dict(self.__pydantic_extra__)

    @model_validator(mode="after")
    def _some_range(self) -> "SampleSpec":
        if not any(isinstance(axis, SampledRangeSpec) for axis in self.axes.values()):
            raise PydanticCustomError(
                "sweep", "no key has a range to draw from; give one, as in medium.sigma_a: {start: 0.01, stop: 0.1}"
            )
        return self


class SweepSpec(ByKey):
    """Values by dotted key; several keys make a grid."""

    __pydantic_extra__: dict[str, Axis] = Field(init=False)
    zip: dict[str, Axis] = Field(
        {}, min_length=1, description="keys whose values go together: lists and ranges of one length"
    )
    sample: SampleSpec | None = Field(None, description="points drawn from ranges")

    @property
    def axes(self) -> dict[str, list[Any] | RangeSpec]:
        """Lists and ranges of the grid, by key."""
        return dict(self.__pydantic_extra__)
