"""The types of arrays have the precision that their comments and the compiled kernels count on."""

from typing import get_args

import numpy as np
import pytest

from vobench.rendering import array_types


@pytest.mark.parametrize(
    ("name", "scalar"),
    [("Indices", np.int32), ("Rows", np.int64), ("Pixels", np.intp), ("Mask", np.bool_)],
)
def test_each_type_has_its_scalar(name: str, scalar: type) -> None:
    _, dtype = get_args(getattr(array_types, name))
    assert get_args(dtype) == (scalar,)
