"""Building blocks of the schema: numbers, choices, and values that may differ by channel."""

from collections.abc import Iterator
from typing import Annotated, Any, Literal, get_args

from pydantic import BaseModel, BeforeValidator, ConfigDict, Discriminator, Field, Tag, model_validator
from pydantic_core import PydanticCustomError

from tetlux.cases.hints import did_you_mean, nearest_word

Number = Annotated[float, Field(strict=True, allow_inf_nan=False)]
Length = Annotated[float, Field(strict=True, allow_inf_nan=False, gt=0)]
Vector3 = tuple[Number, Number, Number]


def _no_letter(value: object) -> object:
    if isinstance(value, str) and value.lower() in AXES:
        raise PydanticCustomError("axis", "write the axis as a vector, {vector}", {"vector": AXES[value.lower()]})
    return value


AXES = {"x": "[1, 0, 0]", "y": "[0, 1, 0]", "z": "[0, 0, 1]"}
# A vector that some would write as the name of an axis.
Direction = Annotated[Vector3, BeforeValidator(_no_letter)]
Numbers = Annotated[list[Number], Field(min_length=1)]
# The name of a channel, light, region or detector, which becomes part of the names of arrays in files.
Label = Annotated[str, Field(strict=True, pattern=r"^[A-Za-z0-9][A-Za-z0-9_.+-]*$", max_length=60)]
# The name of a channel, or a number in place of it, as of a wavelength.
ChannelName = Annotated[
    Label,
    BeforeValidator(
        lambda name: f"{name:.10g}" if isinstance(name, (int, float)) and not isinstance(name, bool) else name,
        json_schema_input_type=Label | float,
    ),
]
Encoding = Literal["srgb", "linear"]

# Tags of alternatives begin with this, so that error messages can leave them out of keys.
TAG = "?"


def shape_of(value: Any) -> str:
    """The tag of a value by its form: list, mapping, or a single value."""
    if isinstance(value, list | tuple):
        return TAG + "list"
    return TAG + ("mapping" if isinstance(value, dict | BaseModel) else "one")


def _one_or_list(value: Any) -> str:
    return TAG + ("list" if isinstance(value, list | tuple) else "one")


# One number, or one for each channel.
Each = Annotated[
    Annotated[Number, Tag(TAG + "one")] | Annotated[Numbers, Tag(TAG + "list")], Discriminator(_one_or_list)
]
# One length, or one along each axis.
Spacing = Annotated[
    Annotated[Length, Tag(TAG + "one")] | Annotated[tuple[Length, Length, Length], Tag(TAG + "list")],
    Discriminator(_one_or_list),
]


class Section(BaseModel):
    """A mapping of the case file that allows no other keys than its fields."""

    # Validators of all sections are built together when the first case is read, in half the time.
    model_config = ConfigDict(extra="forbid", frozen=True, defer_build=True)

    @model_validator(mode="before")
    @classmethod
    def _known_keys(cls, data: Any) -> Any:
        if not isinstance(data, dict):
            return data
        for key in data:
            if key not in cls.model_fields:
                hint = cls._hint(str(key), data)
                raise PydanticCustomError(
                    "unknown_key",
                    "unknown key; {hint}the keys here are {known}",
                    {"key": str(key), "hint": hint, "known": ", ".join(cls.model_fields)},
                )
        return data

    @classmethod
    def _hint(cls, key: str, data: dict[Any, Any]) -> str:
        """The clause about an unknown key: which section it belongs in, or which key was probably meant."""
        sections = [name for name, field in cls.model_fields.items() if key in _keys_within(field.annotation)]
        # Of several kinds of light or shape, prefer the one that is given.
        sections = [name for name in sections if name in data] or sections
        if len(sections) == 1:
            return f'it belongs in "{sections[0]}"; '
        found = nearest_word(key, cls.model_fields)
        meaning = cls.model_fields[found].description if found else None
        return did_you_mean(key, cls.model_fields, meaning or "")


def _keys_within(annotation: Any) -> Iterator[str]:
    """The keys of all sections within the type of a value."""
    if isinstance(annotation, type) and issubclass(annotation, Section):
        yield from annotation.model_fields
    for part in get_args(annotation):
        yield from _keys_within(part)


class Choice(Section):
    """A mapping that holds exactly one of the keys whose default is None."""

    @model_validator(mode="after")
    def _exactly_one(self) -> "Choice":
        kinds = self.kinds()
        given = [name for name in kinds if getattr(self, name) is not None]
        if len(given) != 1:
            raise PydanticCustomError(
                "one_of",
                "give exactly one of {known}, not {given}",
                {"known": ", ".join(kinds), "given": " and ".join(given) if given else "none"},
            )
        return self

    @classmethod
    def kinds(cls) -> list[str]:
        """The keys of which exactly one is given."""
        return [name for name, field in cls.model_fields.items() if field.default is None]

    @property
    def kind(self) -> str:
        """The key that is given."""
        return next(name for name in self.kinds() if getattr(self, name) is not None)
