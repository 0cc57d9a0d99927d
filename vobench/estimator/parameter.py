"""Reads the parameters of an estimator into a dataclass."""

from collections.abc import Mapping
from dataclasses import fields
from typing import Any, TypeVar

from vobench.errors import VobenchError

Kind = TypeVar("Kind")


def parameters(kind: type[Kind], params: Mapping[str, Any], name: str) -> Kind:
    """The parameters of a manifest as a dataclass whose fields are numbers.

    Raises VobenchError if a parameter is unknown or missing, or if a value is not a number of at least 0.
    """
    known = [field.name for field in fields(kind)]  # type: ignore[arg-type]
    if set(params) != set(known):
        raise VobenchError(f"{name} takes the parameters {', '.join(known)}, got {', '.join(params)}")
    for key, value in params.items():
        is_number = isinstance(value, int | float) and not isinstance(value, bool)
        if not is_number or value < 0:
            raise VobenchError(f"{name}: {key} is {value!r}, expected a number that is not negative")
    return kind(**params)
