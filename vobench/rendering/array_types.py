"""Types of arrays by what their numbers are."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[Any]  # float32 where there are many, float64 inside formulas
Indices = NDArray[np.int32]  # of faces, things, points: -1 for none
Rows = NDArray[np.int64]  # numbers of rows that are picked from a table
Pixels = NDArray[np.intp]  # numbers of pixels that are picked from a picture
Mask = NDArray[np.bool_]
