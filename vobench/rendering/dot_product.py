"""The dot products of rows of vectors."""

from typing import Any

import numpy as np
from numpy.typing import NDArray


def dot(a: NDArray[Any], b: NDArray[Any]) -> NDArray[Any]:
    """The dot products (R,) of vectors (R, 3) with vectors (R, 3)."""
    return np.asarray(np.einsum("ri,ri->r", a, b))
