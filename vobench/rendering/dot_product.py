"""The dot products of rows of vectors."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from vobench.rendering.array_types import Floats
from vobench.rendering.compiled import compiled


def dot(a: NDArray[Any], b: NDArray[Any]) -> NDArray[Any]:
    """The dot products (R,) of vectors (R, 3) with vectors (R, 3).

    The three products are summed in order, so that the result does not depend on the processor as those of BLAS and
    einsum do.
    """
    products = np.empty(len(a), np.result_type(a, b))
    _dot_rows(a, b, products)
    return products


@compiled
def _dot_rows(a: Floats, b: Floats, products: Floats) -> None:
    for row in range(len(a)):
        products[row] = a[row, 0] * b[row, 0] + a[row, 1] * b[row, 1] + a[row, 2] * b[row, 2]
