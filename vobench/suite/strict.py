"""What all of a suite's and a scene's models share: strictness, names, and choices from a list."""

from collections.abc import Collection
from typing import Annotated

from pydantic import AfterValidator, BaseModel, ConfigDict, Field

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


def one_of(kind: str, known: Collection[str]) -> AfterValidator:
    """A check that text is among the known names; a near one is suggested."""

    def check(name: str) -> str:
        if name not in known:
            raise ValueError(unknown(kind, name, list(known)))
        return name

    return AfterValidator(check)
