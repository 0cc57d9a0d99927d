"""The types of values in calibration files. They are strict: a text, true or false is not accepted as a number."""

from functools import cache
from typing import Annotated, Any

import numpy as np
from annotated_types import Ge, Gt, Le, Lt, MaxLen, MinLen, MultipleOf
from numpy.typing import NDArray
from pydantic import AllowInfNan, PlainValidator, Strict, TypeAdapter, ValidationError
from pydantic_core import PydanticCustomError

from vobench.geometry import se3
from vobench.geometry.se3 import Array

ROTATION_TOLERANCE = 1e-3  # for the rounding errors of a printed rotation matrix

Text = Annotated[str, Strict()]
Number = Annotated[float, Strict(), AllowInfNan(False), Gt(-1e300), Lt(1e300)]
AboveZero = Annotated[Number, Gt(0)]
ZeroOrMore = Annotated[Number, Ge(0)]
Numbers = tuple[Number, ...]
Pixels = Annotated[Number, MultipleOf(1), Ge(1), Le(100_000)]
Resolution = Annotated[tuple[Pixels, ...], MinLen(2), MaxLen(2)]  # width, height


@cache
def _numbers() -> TypeAdapter[Numbers]:
    return TypeAdapter(Numbers)


def _rigid_transform(value: Any) -> Array:
    """The transform T (4, 4) from four rows, from 16 numbers, or from a mapping with the key `data`, as in EuRoC.

    Its rotation is projected onto SO(3).
    """
    cells = _finite_cells(value.get("data") if isinstance(value, dict) else value)
    if cells is None or len(cells) != 16:
        raise PydanticCustomError("matrix", "should be a 4 x 4 matrix of finite numbers")

    T = np.array(cells, float).reshape(4, 4)
    R = T[:3, :3]
    has_rotation = se3.is_rotation(R, tolerance=ROTATION_TOLERANCE)
    has_last_row = T[3].tolist() == [0, 0, 0, 1]
    if not (has_rotation and has_last_row):
        raise PydanticCustomError("transform", "should be a rigid transform with the last row 0 0 0 1")
    return se3.transform(se3.nearest_rotation(R), T[:3, 3])


def _finite_cells(matrix: Any) -> Numbers | None:
    """The cells of a matrix that is given as a list of rows, of cells, or of both; None if one is no finite number."""
    if not isinstance(matrix, list):
        return None
    cells: list[Any] = []
    for entry in matrix:
        if isinstance(entry, list):
            cells.extend(entry)
        else:
            cells.append(entry)
    try:
        numbers: Numbers = _numbers().validate_python(cells)
    except ValidationError:
        return None
    return numbers


RigidTransform = Annotated[NDArray[np.float64], PlainValidator(_rigid_transform)]  # (4, 4)
