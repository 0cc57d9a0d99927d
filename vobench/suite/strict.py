"""What all of a suite's and a scene's models share: strictness, names, and choices from a list."""

from collections.abc import Collection
from typing import Annotated, Any

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError
from pydantic_core import InitErrorDetails, PydanticCustomError

from vobench.catalog.catalog import unknown
from vobench.catalog.yaml_file import matching


class Strict(BaseModel):
    """A frozen model in which an unknown key is an error, as are NaN, infinity and a number in quotes."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)


# Names become folders, and a case's name joins several with a hyphen.
NAME = matching(r"[a-z0-9][a-z0-9_.]*", "lower-case letters, digits, _ and ., a letter or digit first")
Name = Annotated[str, NAME]
Positive = Annotated[float, Field(gt=0)]
NonNegative = Annotated[float, Field(ge=0)]
Share = Annotated[float, Field(ge=0, le=1)]
# Wide enough for a car on a motorway, and narrow enough that no square of one overflows.
Length = Annotated[float, Field(gt=0, le=1e5)]
Speed = Annotated[float, Field(gt=0, le=100)]
Acceleration = Annotated[float, Field(gt=0, le=1000)]
Rate = Annotated[float, Field(gt=0, le=1000)]
Point = tuple[float, float]
Triple = tuple[float, float, float]
Pause = Annotated[float, Field(ge=0, le=3600)]


def tupled(value: Any) -> Any:
    """Lists as tuples, all the way down: what runs before pydantic's own checks has to hand on what YAML gives."""
    if isinstance(value, dict):
        return {key: tupled(part) for key, part in value.items()}
    return tuple(map(tupled, value)) if isinstance(value, list | tuple) else value


def one_of(kind: str, known: Collection[str]) -> AfterValidator:
    """A check that text is among the known names; a near one is suggested."""

    def check(name: str) -> str:
        if name not in known:
            raise ValueError(unknown(kind, name, list(known)))
        return name

    return AfterValidator(check)


def wrong_key(key: str, sentence: str) -> ValidationError:
    """To be raised by a validator of a whole section, where one of its keys is at fault."""
    error = PydanticCustomError("value_error", "{sentence}", {"sentence": sentence})
    return ValidationError.from_exception_data(key, [InitErrorDetails(type=error, loc=(key,), input=None)])
